"""The filter language that every verb understands.

A filter is a list of terms:

- ``key=value[,value]`` keeps what has one of the values, ``key!=value[,value]`` what has none of them;
- ``key<number``, ``<=``, ``>`` and ``>=`` keep what is known to be so;
- anything else is a glob on the recording's name: ``'GreenTowel_Ruler_*'``.

Terms of different keys must all hold; of several terms on one key, or several globs, one suffices. A text value may be
a glob (``garment=*Shirt``); numbers compare as numbers (``speed=0.5`` finds 0.50, and ``pi16`` or ``pi/16`` is one);
``yes``, ``no``, ``true`` and ``false`` are the flags; an empty value stands for a missing one (``repeat=``).
"""

from __future__ import annotations

import difflib
import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from fnmatch import translate

from garment_dataset.catalog.names import parse_bag_name
from garment_dataset.errors import FilterError, RecordingNameError

Kind = type[str | float | bool]
Keys = Mapping[str, Kind]
"""What may be asked for: the name of each value, and whether it is text, a number or a flag."""

Predicate = Callable[[object], bool]
"""Whether a record (a mapping, or an object with attributes) is wanted."""

NAME_KEY = "recording"
"""What a bare glob is matched with."""

_TERM = re.compile(r"(?P<key>[^=!<>]*)(?P<operator>[<>]=?|!?=)(?P<values>.*)", re.DOTALL)
_COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
_PI = re.compile(r"pi/?(?P<divisor>[1-9][0-9]{0,2})")
_FLAGS = {"yes": True, "true": True, "no": False, "false": False}


def compile_filter(terms: Iterable[str], keys: Keys) -> Predicate:
    """Make one predicate of all terms; no term at all wants everything.

    Parameters
    ----------
    terms : iterable of str
        As typed after a verb.
    keys : mapping of str to {str, float, bool}
        The values that a record has, and of which type.

    Raises
    ------
    FilterError
        If a term names no key, or its value is no number or flag where one is needed.
    """
    wanted: dict[str, list[Predicate]] = {}
    refused: list[tuple[str, Predicate]] = []
    compared: list[tuple[str, Predicate]] = []
    for term in terms:
        key, sign, values = _split(term, keys)
        if sign in _COMPARISONS:
            compared.append((key, _comparison(term, key, sign, values, keys[key])))
            continue
        tests = [_test(key, value, keys[key]) for value in values]
        if sign == "=":
            wanted.setdefault(key, []).extend(tests)
        else:
            refused.extend((key, test) for test in tests)

    def predicate(record: object) -> bool:
        return (
            all(any(test(_value(record, key)) for test in tests) for key, tests in wanted.items())
            and not any(test(_value(record, key)) for key, test in refused)
            and all(test(_value(record, key)) for key, test in compared)
        )

    return predicate


def terms_of(filters: Mapping[str, object]) -> tuple[str, ...]:
    """Write keyword filters as terms: ``garment="GreenTowel", repeat=[1, 2]`` is ``garment=GreenTowel repeat=1,2``.

    None asks for a missing value, and an empty list for nothing at all.
    """
    terms: list[str] = []
    for key, value in filters.items():
        values = _written(value)
        # there is no term for nothing, but nothing is both missing and not missing; a name is never missing
        some = "*" if key == NAME_KEY else ""
        terms += [f"{key}={','.join(values)}"] if values else [f"{key}={some}", f"{key}!={some}"]
    return tuple(terms)


def _written(value: object) -> list[str]:
    """Return the values of a keyword filter as they stand in a term."""
    if (as_list := getattr(value, "tolist", None)) is not None:
        value = as_list()  # numpy and pandas
    if isinstance(value, Iterable) and not isinstance(value, str | bytes):
        return sorted(text for item in value for text in _written(item))
    if isinstance(value, bool):
        return ["yes" if value else "no"]
    if isinstance(value, str):
        return [value]
    return ["" if value is None or str(value) in {"nan", "<NA>"} else str(value)]  # as numpy and pandas say missing


def _split(term: str, keys: Keys) -> tuple[str, str, list[str]]:
    if (found := _TERM.fullmatch(term)) is None:
        return NAME_KEY, "=", [_name_pattern(term)]
    key, values = found["key"].strip(), [value.strip() for value in found["values"].split(",")]
    if key not in keys:
        nearest = difflib.get_close_matches(key, list(keys), n=1)
        hint = f"Did you mean {nearest[0]}{found['operator']}{found['values']}?" if nearest else None
        raise FilterError("no such key", where=term, expected=", ".join(keys), found=repr(key), hint=hint)
    if key == NAME_KEY:
        values = [_name_pattern(value) for value in values]
    return key, found["operator"], values


def _name_pattern(text: str) -> str:
    """Let a file name as the shell completes it, or as table B.3 prints it, name its recording."""
    if not text:
        raise FilterError("empty filter", expected="key=value[,value] or a glob on the recording's name")
    try:
        return str(parse_bag_name(text))
    except RecordingNameError:
        return text.removesuffix(".bag")


def _test(key: str, value: str, kind: type[str | float | bool]) -> Predicate:
    if value == "":
        return lambda found: found is None
    if kind is float:
        number = _number(key, value)
        return lambda found: isinstance(found, int | float) and math.isclose(found, number, rel_tol=1e-9)
    if kind is bool:
        if value.lower() not in _FLAGS:
            raise FilterError("not a flag", where=f"{key}={value}", expected="yes or no", found=repr(value))
        flag = _FLAGS[value.lower()]
        return lambda found: found is flag
    pattern = re.compile(translate(value))
    return lambda found: isinstance(found, str) and pattern.match(found) is not None


def _comparison(term: str, key: str, sign: str, values: Sequence[str], kind: Kind) -> Predicate:
    """Return the test of ``key<number`` and the like: what is not known is neither less nor more."""
    if kind is not float or len(values) != 1:
        raise FilterError(
            f"{sign} compares numbers", where=term, expected=f"key{sign}number, of a key that is a number"
        )
    compare, bound = _COMPARISONS[sign], _number(key, values[0])
    return lambda found: isinstance(found, int | float) and not isinstance(found, bool) and compare(found, bound)


def _number(key: str, text: str) -> float:
    if (found := _PI.fullmatch(text)) is not None:
        return math.pi / int(found["divisor"])
    if _NUMBER.fullmatch(text) is None:
        raise FilterError("not a number", where=f"{key}={text}", expected="a number", found=repr(text))
    return float(text)


def _value(record: object, key: str) -> object:
    return record[key] if isinstance(record, Mapping) else getattr(record, key)
