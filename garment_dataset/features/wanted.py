"""What a filter of results asks for, in the type of its column; and whether there can be such a thing."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from garment_dataset.errors import FilterError, did_you_mean, nearest_word, one_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyarrow as pa
    import pyarrow.dataset as ds

_NAMES = frozenset({"recording", "garment", "holding", "group"})
"""Columns whose words name something: what is asked for by name should be there."""
_FIXED_WORDS = {"axis": ("R", "B"), "stream": ("color", "depth"), "verdict": ("look", "ok", "unusable")}
"""Columns of few words, which are all known whether or not there are rows with them."""


def wanted_values(wanted: Any, field: pa.Field[Any], table: str) -> pa.Array[Any]:  # noqa: ANN401
    """Return the values of a filter in the type of its column."""
    import pyarrow as pa

    where = f"{table}.{field.name}"
    if not (
        pa.types.is_primitive(field.type) or pa.types.is_string(field.type) or pa.types.is_large_string(field.type)
    ):
        raise FilterError("a column that is no filter", where=where, expected="text or a number", found=field.type)
    if as_list := getattr(wanted, "tolist", None) or getattr(wanted, "to_pylist", None):
        wanted = as_list()  # numpy and pandas, Arrow
    is_one = isinstance(wanted, str | bytes) or not isinstance(wanted, Iterable)
    values = [wanted] if is_one else list(wanted)
    try:
        array: pa.Array[Any] = pa.array(values, field.type, from_pandas=True)
    except (pa.ArrowException, OverflowError) as error:
        found = reprlib.repr(wanted if is_one else values)
        raise FilterError("values of another type", where=where, expected=field.type, found=found) from error
    # Arrow makes whole numbers of fractions, and numbers of flags, without a word
    if odd := [value for value in values if _is_changed(value, field.type)]:
        raise FilterError("values of another type", where=where, expected=field.type, found=reprlib.repr(odd))
    return array


def refuse_unknown_words(dataset: ds.Dataset, asked: Mapping[str, pa.Array[Any]], table: str) -> None:
    """Refuse a filter that finds nothing because no row can have its word, or because it names what is not there.

    Of a column that is neither, a word is only refused that looks much like one which is there: there may be no row
    with the verdict "look", but "unsable" is a typing error.
    """
    import pyarrow.compute as pc

    for name, values in asked.items():
        words = [value for value in values.to_pylist() if isinstance(value, str)]
        if not words or len(words) < len(values):  # nothing is asked for, or what is not known as well
            continue
        known: list[Any] = pc.unique(dataset.to_table([name])[name]).drop_null().to_pylist()
        if set(words) & {*_FIXED_WORDS.get(name, ()), *known}:
            continue
        known = sorted({*_FIXED_WORDS.get(name, ()), *known})
        is_name = name in _FIXED_WORDS or name in _NAMES
        if is_name or nearest_word(words[0], known, cutoff=0.8) is not None:
            raise FilterError(
                f"no such {name}",
                where=table,
                expected=one_of(known),
                found=reprlib.repr(words[0] if len(words) == 1 else words),
                hint=did_you_mean(words[0], known) or "`garment list` shows what there is, `garment build` makes more.",
            )


def _is_changed(value: object, wanted: pa.DataType) -> bool:
    import pyarrow as pa

    if isinstance(value, bool | bytes):
        return not pa.types.is_boolean(wanted)
    return isinstance(value, float) and pa.types.is_integer(wanted) and value == value and not value.is_integer()  # noqa: PLR0124 - NaN
