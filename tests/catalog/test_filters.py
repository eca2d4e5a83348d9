"""The filter language: what each kind of term wants, how terms combine, and what is refused with which hint."""

from __future__ import annotations

import math
import operator
from types import SimpleNamespace
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.catalog.filters import compile_filter, terms_of
from garment_dataset.catalog.hints import why_nothing
from garment_dataset.catalog.rows import ROW_KEYS
from garment_dataset.errors import FilterError
from garment_dataset.features.quality import QUALITY_KEYS

if TYPE_CHECKING:
    from garment_dataset.catalog.filters import Kind

KEYS: dict[str, Kind] = {
    "recording": str,
    "garment": str,
    "repeat": float,
    "speed": float,
    "swing_rad": float,
    "dvd": bool,
}


def record(name: str, garment: str | None, repeat: int | None, speed: float, dvd: bool | None) -> dict[str, object]:
    return dict(zip(KEYS, (name, garment, repeat, speed, math.pi / 16, dvd), strict=True))


RECORDS = [
    record("GreenTowel_Corner_01_pi16_0.5_R1", "GreenTowel", 1, 0.5, True),
    record("GreenTowel_Corner_02_pi16_0.50_R1", "GreenTowel", 2, 0.5, False),
    record("RedSkirt_Belt_pi16_1_B1", "RedSkirt", None, 1.0, True),
    record("towel16_pi16_0.1_0006_R2", None, 6, 0.1, None),
]


def chosen(*terms: str) -> list[int]:
    wanted = compile_filter(terms, KEYS)
    return [number for number, found in enumerate(RECORDS) if wanted(found)]


@pytest.mark.parametrize(
    ("terms", "expected"),
    [
        ([], [0, 1, 2, 3]),
        (["garment=GreenTowel"], [0, 1]),
        (["garment=GreenTowel,RedSkirt"], [0, 1, 2]),
        (["garment=GreenTowel", "garment=RedSkirt"], [0, 1, 2]),
        (["garment=*S*"], [2]),
        (["garment=greentowel"], []),
        (["garment=Green"], []),
        (["garment!=GreenTowel"], [2, 3]),
        (["garment!=GreenTowel,RedSkirt"], [3]),
        (["garment!=GreenTowel", "garment!=RedSkirt"], [3]),
        (["garment="], [3]),
        (["garment!="], [0, 1, 2]),
        (["garment=,RedSkirt"], [2, 3]),
        (["repeat=1,2"], [0, 1]),
        (["repeat!=1"], [1, 2, 3]),
        (["repeat=01"], [0]),
        (["speed=0.50"], [0, 1]),
        (["speed=.5"], [0, 1]),
        (["speed=0.50001"], []),
        (["speed=5e-1"], [0, 1]),
        (["speed=1"], [2]),
        (["swing_rad=pi16", "speed=1"], [2]),
        (["swing_rad=pi/16", "speed=1"], [2]),
        (["swing_rad=pi/8"], []),
        (["dvd=yes"], [0, 2]),
        (["dvd=True"], [0, 2]),
        (["dvd=no"], [1]),
        (["dvd!=yes"], [1, 3]),
        (["dvd="], [3]),
        (["garment=GreenTowel", "dvd=yes"], [0]),
        (["GreenTowel_*"], [0, 1]),
        (["GreenTowel_*", "RedSkirt_*"], [0, 1, 2]),
        (["GreenTowel_*", "recording=RedSkirt_*"], [0, 1, 2]),
        (["GreenTowel_*", "speed=1"], []),
        (["*_R?"], [0, 1, 3]),
        (["*_[B]1"], [2]),
        (["GreenTowel"], []),
        (["GreenTowel_Corner_01_pi16_0.5_R1.bag"], [0]),
        (["GreenTowel_Corner_01_pi16.0.5_R1"], [0]),
        (["recording!=GreenTowel_Corner_01_pi16.0.5_R1.bag"], [1, 2, 3]),
        (["Green*_R1.bag"], [0, 1]),
    ],
)
def test_what_terms_want(terms: list[str], expected: list[int]) -> None:
    assert chosen(*terms) == expected


def test_objects_are_read_like_mappings() -> None:
    wanted = compile_filter(["garment=GreenTowel", "repeat=2"], KEYS)
    assert [wanted(SimpleNamespace(**found)) for found in RECORDS] == [False, True, False, False]


@pytest.mark.parametrize(
    ("term", "message"),
    [
        ("garmet=GreenTowel", r"no such key.*recording, garment, repeat.*Did you mean garment=GreenTowel\?"),
        ("garmet!=GreenTowel", r"Did you mean garment!=GreenTowel\?"),
        ("wholly_else=1", "no such key.*expected recording, garment"),
        ("=GreenTowel", "no such key"),
        ("speed=fast", "speed=fast: not a number: expected a number, found 'fast'"),
        ("speed=nan", "not a number"),
        ("speed=0.5,1_0", "not a number"),
        ("repeat=*", "not a number"),
        ("dvd=1", "expected yes or no, found '1'"),
        ("", "empty filter"),
        ("recording=", "empty filter"),
    ],
)
def test_what_cannot_be_understood_is_refused_before_anything_is_read(term: str, message: str) -> None:
    with pytest.raises(FilterError, match=message):
        compile_filter([term], KEYS)


def test_keywords_say_the_same_as_terms() -> None:
    filters = {"garment": "GreenTowel", "repeat": [2, 1], "speed": 0.5, "dvd": True}
    assert terms_of(filters) == ("garment=GreenTowel", "repeat=1,2", "speed=0.5", "dvd=yes")
    assert terms_of({"repeat": None, "dvd": (False, None)}) == ("repeat=", "dvd=,no")
    assert chosen(*terms_of({"repeat": {1, 2}})) == [0, 1]


terms_by_key = {
    "garment": st.sampled_from(["garment=GreenTowel", "garment!=RedSkirt", "garment="]),
    "repeat": st.sampled_from(["repeat=1", "repeat!=1,2"]),
    "speed": st.sampled_from(["speed=0.5", "speed!=0.5"]),
    "dvd": st.sampled_from(["dvd=yes", "dvd=", "dvd!=no"]),
    "recording": st.sampled_from(["*_R1", "recording!=Red*"]),
}
keys = st.permutations(sorted(terms_by_key))
values = st.one_of(*terms_by_key.values())


@given(keys.flatmap(lambda order: st.tuples(*(terms_by_key[key] for key in order))))
def test_terms_of_different_keys_must_all_hold(terms: tuple[str, ...]) -> None:
    assert set(chosen(*terms)) == set.intersection(*(set(chosen(term)) for term in terms))


@given(st.lists(values, max_size=5).flatmap(lambda terms: st.tuples(st.just(terms), st.permutations(terms))))
def test_order_does_not_matter(orders: tuple[list[str], list[str]]) -> None:
    assert chosen(*orders[0]) == chosen(*orders[1])


@given(st.sampled_from(sorted(KEYS)), st.sampled_from(["GreenTowel", "RedSkirt", "*"]))
def test_not_equal_is_the_complement(key: str, value: str) -> None:
    value = {"garment": value, "recording": f"{value}_*", "dvd": "yes"}.get(key, "0.5")
    assert set(chosen(f"{key}={value}")) ^ set(chosen(f"{key}!={value}")) == set(range(len(RECORDS)))


@pytest.mark.parametrize(
    ("term", "wanted"),
    [
        ("speed<0.5", {0.1}),
        ("speed<=0.5", {0.1, 0.5}),
        ("speed>0.1", {0.5, 2.0}),
        ("speed>=.5", {0.5, 2.0}),
    ],
)
def test_numbers_compare_and_what_is_not_known_does_not(term: str, wanted: set[float]) -> None:
    keep = compile_filter([term], {"recording": str, "speed": float})
    assert {speed for speed in (0.1, 0.5, 2.0, None) if keep({"recording": "a", "speed": speed})} == wanted


def test_comparisons_of_one_key_must_all_hold() -> None:
    keep = compile_filter(["speed>0.1", "speed<2"], {"recording": str, "speed": float})
    assert [speed for speed in (0.1, 0.5, 2.0) if keep({"recording": "a", "speed": speed})] == [0.5]


@pytest.mark.parametrize(
    ("term", "message"),
    [
        ("recording<1", "recording<1: < compares numbers, and recording is none: expected one of speed$"),
        ("dvd>=1", ">= compares numbers, and dvd is none: expected one of speed$"),
        ("speed<a", "not a number"),
        ("speed<1,2", "< compares with one number"),
        ("speed<", "not a number"),
        ("sped>1", r"Did you mean speed\?"),
    ],
)
def test_comparisons_that_make_no_sense_are_refused(term: str, message: str) -> None:
    with pytest.raises(FilterError, match=message):
        compile_filter([term], {"recording": str, "speed": float, "dvd": bool})


@pytest.mark.parametrize("key", [key for key, kind in {**ROW_KEYS, **QUALITY_KEYS}.items() if kind is float])
@given(values=st.lists(st.none() | st.integers(-3, 3).map(lambda number: number / 2)), bound=st.integers(-3, 3))
def test_every_number_compares_as_numbers_do(key: str, values: list[float | None], bound: int) -> None:
    signs = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
    for sign, compare in signs.items():
        keep = compile_filter([f"{key}{sign}{bound / 2}"], {**ROW_KEYS, **QUALITY_KEYS})
        kept = [value for value in values if keep({key: value})]
        assert kept == [value for value in values if value is not None and compare(value, bound / 2)]


@pytest.mark.parametrize("key", [key for key, kind in {**ROW_KEYS, **QUALITY_KEYS}.items() if kind is not float])
@pytest.mark.parametrize("sign", ["<", "<=", ">", ">="])
def test_text_and_flags_do_not_compare(key: str, sign: str) -> None:
    with pytest.raises(
        FilterError, match=f"{sign} compares numbers, and {key} is none: expected one of repeat, "
    ) as caught:
        compile_filter([f"{key}{sign}1"], {**ROW_KEYS, **QUALITY_KEYS})
    assert "\n" not in str(caught.value)


WORDS = {
    "recording": [str(found["recording"]) for found in RECORDS],
    "garment": ["GreenTowel", "RedSkirt"],
    "holding": ["Belt"],
}


@pytest.mark.parametrize(
    ("term", "message"),
    [
        ("garment=GreenTowl", r"^garment=GreenTowl: no such garment: expected one of GreenTowel, RedSkirt, found "),
        ("garment=GreenTowl", r"found 'GreenTowl'\. Did you mean garment=GreenTowel\?$"),
        ("garment!=redskirt", r"Did you mean garment!=RedSkirt\?$"),
        ("garment=GreenTowel,RedSkrt", r"found 'RedSkrt'\. Did you mean garment=RedSkirt\?$"),
        ("garment=Entirely", "found 'Entirely'$"),
        ("RedSkrt_Belt_pi16_1_B1", r"Did you mean RedSkirt_Belt_pi16_1_B1\?$"),
        ("recording=RedSkrt_Belt_pi16_1_B1.bag", r"Did you mean recording=RedSkirt_Belt_pi16_1_B1\?$"),
        ("GreenTowel", r"no such recording: .*Did you mean garment=GreenTowel\?$"),
        ("speed", r"speed is a key: write 'speed>0\.1' in quotes"),
        ("dvd", "dvd is a key: write dvd=VALUE"),
    ],
)
def test_a_word_that_is_not_known_is_no_empty_answer(term: str, message: str) -> None:
    with pytest.raises(FilterError, match=message):
        compile_filter([term], KEYS, WORDS)


@given(st.sampled_from(["garment", "recording"]), st.text(max_size=12))
def test_of_known_words_a_value_is_a_glob_or_one_of_them(key: str, value: str) -> None:
    value = value.replace(",", "").strip()
    if value in {"" if key == "garment" else WORDS[key][0], *WORDS[key]} or any(letter in value for letter in "*?["):
        compile_filter([f"{key}={value}"], KEYS, WORDS)
        return
    with pytest.raises(FilterError) as caught:
        compile_filter([f"{key}={value}"], KEYS, WORDS)
    assert "\n" not in str(caught.value)


def records() -> list[dict[str, object]]:
    return [dict(found) for found in RECORDS]


@pytest.mark.parametrize(
    ("terms", "expected"),
    [
        (["GreenTowl_*"], ["no recording looks like 'GreenTowl_*'; the nearest is GreenTowel_Corner_01_pi16_0.5_R1"]),
        (["*_Blet_*"], ["no recording looks like '*_Blet_*'; the nearest is RedSkirt_Belt_pi16_1_B1"]),
        (["garment=*ski?t"], ["no garment looks like '*ski?t'; the nearest is RedSkirt"]),
        (["QQQ*"], ["no recording looks like 'QQQ*'"]),
        (["speed>100"], ["'speed>100' holds of none: speed is 0.1 m/s to 1 m/s"]),
        (["repeat=3", "repeat=3"], ["'repeat=3' holds of none: repeat is 1 to 6"]),
        (["GreenTowel_*", "speed=1"], []),
    ],
)
def test_why_nothing_is_found_is_said(terms: list[str], expected: list[str]) -> None:
    assert chosen(*terms) == []
    assert why_nothing(terms, records(), KEYS, WORDS, {"speed": "m/s"}) == expected


def test_what_nothing_is_known_of_is_said() -> None:
    unknown = [{**found, "garment": None, "dvd": None} for found in records()]
    assert why_nothing(["dvd=yes"], unknown, KEYS, {}, {}) == ["'dvd=yes' holds of none: no dvd is known"]
    assert why_nothing(["garment=GreenTowel"], unknown, KEYS, WORDS, {}) == ["no garment is known"]
    yes = [{**found, "dvd": True} for found in records()]
    assert why_nothing(["dvd=no"], yes, KEYS, {}, {}) == ["'dvd=no' holds of none: dvd is yes"]
