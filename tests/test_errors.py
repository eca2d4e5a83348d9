"""Errors say what, where, expected, found and what next, in one line, and survive a process boundary."""

from __future__ import annotations

import inspect
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset import errors
from garment_dataset.errors import BagError, GarmentError

KINDS = [kind for _, kind in inspect.getmembers(errors, inspect.isclass) if issubclass(kind, GarmentError)]
PART = st.none() | st.text(min_size=1, max_size=20)


@pytest.mark.parametrize("kind", KINDS)
@given(what=st.text(min_size=1), where=PART, expected=PART, found=PART, hint=PART)
def test_every_error_crosses_a_process_boundary_whole(
    kind: type[GarmentError], what: str, where: str | None, expected: str | None, found: str | None, hint: str | None
) -> None:
    error = kind(what, where=where, expected=expected, found=found, hint=hint)
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is kind
    assert (str(copy), copy.parts()) == (str(error), error.parts())


def test_a_message_is_one_line_with_its_parts_in_order() -> None:
    error = BagError("cannot\nbe read", where="a.bag", expected="a bag", found=3, hint="Copy it again.")
    assert str(error) == "a.bag: cannot be read: expected a bag, found 3. Copy it again."
    assert str(BagError("is empty")) == "is empty"


def test_every_kind_is_documented_and_has_an_exit_code() -> None:
    assert len(KINDS) > 10
    for kind in KINDS:
        assert kind.__doc__
        assert kind.exit_code in {1, 2, 4}
