"""The filter language: what each kind of term wants, how terms combine, and what is refused with which hint."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.catalog.filters import compile_filter, terms_of
from garment_dataset.errors import FilterError

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


@pytest.mark.parametrize("term", ["recording<1", "speed<a", "speed<1,2", "speed<"])
def test_comparisons_that_make_no_sense_are_refused(term: str) -> None:
    with pytest.raises(FilterError):
        compile_filter([term], {"recording": str, "speed": float})
