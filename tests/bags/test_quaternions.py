"""Unit quaternions: their algebra, and one sign along a recording."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.bags.quaternions import Quaternion, conjugate, multiply, normalised, rotate, without_flips

components = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: math.hypot(*q) > 0.1)


def unit(q: tuple[float, ...]) -> Quaternion:
    x, y, z, w = (component / math.hypot(*q) for component in q)
    return x, y, z, w


rotations = components.map(unit)


@given(rotations, rotations)
def test_a_product_turns_by_the_inner_one_first(outer: Quaternion, inner: Quaternion) -> None:
    v = (0.3, -0.2, 1.0)
    assert rotate(multiply(outer, inner), v) == pytest.approx(rotate(outer, rotate(inner, v)), abs=1e-12)
    assert rotate(conjugate(outer), rotate(outer, v)) == pytest.approx(v, abs=1e-12)


@given(st.lists(st.one_of(st.none(), rotations)))
def test_signs_change_nothing_but_flips(turns: list[Quaternion | None]) -> None:
    chosen = without_flips(turns)
    assert [q is None for q in chosen] == [q is None for q in turns]
    known = [q for q in chosen if q is not None]
    pairs = zip([(0.0, 0.0, 0.0, 1.0), *known], known, strict=False)
    assert all(sum(a * b for a, b in zip(before, after, strict=True)) >= 0 for before, after in pairs)
    for given_turn, turn in zip(turns, chosen, strict=True):
        assert given_turn is None or turn in {given_turn, tuple(-component for component in given_turn)}


@pytest.mark.parametrize("bad", [(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, math.nan), (0.0, 0.0, 0.0, 2.0)])
def test_what_is_no_rotation_is_none(bad: Quaternion) -> None:
    assert normalised(bad, 0.01) is None
    assert normalised((0.0, 0.0, 0.0, 1.004), 0.01) == (0.0, 0.0, 0.0, 1.0)
