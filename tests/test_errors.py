"""Errors say what, where, expected, found and what next, in one line, and survive a process boundary."""

from __future__ import annotations

import inspect
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset import errors
from garment_dataset.errors import BagError, GarmentError, did_you_mean, nearest_word, one_of

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


@pytest.mark.parametrize(
    "part",
    ["two\nlines", "\x1b[31mred", "a\x00b", "\udcff", "\u2028", "\u202eleft", "x" * 10_000, "a," * 10_000, "é 雨 ×"],
)
def test_a_message_is_one_line_that_can_be_printed(part: str) -> None:
    error = GarmentError(f"what {part}", where=part, expected=part, found=part, hint=part)
    text = str(error)
    assert text.isprintable()
    assert len(text.splitlines()) == 1
    assert len(text) < 5 * 600
    assert text.encode().decode() == text
    assert str(GarmentError("é 雨 ×")) == "é 雨 ×", "letters stay letters"


@pytest.mark.parametrize(
    ("word", "nearest"), [("greentowel", "GreenTowel"), ("RedSkrt", "RedSkirt"), ("Q", None), ("", None)]
)
def test_the_nearest_word_is_found_whatever_its_case(word: str, nearest: str | None) -> None:
    known = ["GreenTowel", "RedSkirt"]
    assert nearest_word(word, known) == nearest
    assert did_you_mean(word, known, "garment=") == (nearest and f"Did you mean garment={nearest}?")


def test_what_is_allowed_is_named_or_counted() -> None:
    assert one_of([]) == "nothing: there is none"
    assert one_of(["a", "b"]) == "one of a, b"
    assert one_of(str(number) for number in range(1000)) == "one of the 1000 that there are"
