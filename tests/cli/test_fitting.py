"""Tables and names in the width of a terminal: no line too long, nothing lost, and different names stay different."""

from __future__ import annotations

import re

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from garment_dataset.cli.fitting import cell_width, fit_table, fits, name_lines, shorten, wrap

LETTERS = st.sampled_from("abcXYZ019_.-é×語👕")
WORDS = st.text(LETTERS, min_size=1, max_size=12)
WIDTHS = st.integers(40, 200)


@st.composite
def alike_names(draw: st.DrawFn) -> list[str]:
    """Names, or paths, that begin and end alike."""
    prefix, suffix = (draw(st.text(LETTERS, max_size=60)) for _ in range(2))
    folder = draw(st.sampled_from(["", "some/folder/of/mine/", "/data/towels/recordings/"]))
    middles = draw(st.lists(st.text(LETTERS, max_size=20), min_size=1, max_size=8, unique=True))
    return [f"{folder}{prefix}{middle}{suffix}" or "-" for middle in middles]


@st.composite
def tables(draw: st.DrawFn) -> tuple[list[str], list[list[str]]]:
    names = draw(alike_names())
    columns = ["recording", *draw(st.lists(WORDS, max_size=8))]
    texts = st.lists(WORDS, min_size=1, max_size=6).map(" ".join)
    return columns, [[name, *(draw(texts) for _ in columns[1:])] for name in names]


def squeezed(lines: list[str]) -> str:
    return re.sub(r"\s", "", "".join(lines))


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # of time on a busy machine nothing is meant
@given(tables(), WIDTHS, st.booleans())
def test_no_line_is_too_long_and_every_name_is_whole(
    table: tuple[list[str], list[list[str]]], width: int, with_heads: bool
) -> None:
    columns, rows = table
    lines = fit_table(columns, rows, width, heads=columns[1:3] if with_heads else ())
    assert all(cell_width(line) <= width for line in lines)
    text = squeezed(lines)
    for row in rows:
        assert row[0] in text  # so different ones are different


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(tables(), WIDTHS)
def test_no_letter_is_lost(table: tuple[list[str], list[list[str]]], width: int) -> None:
    columns, rows = table
    shown = squeezed(fit_table(columns, rows, width))
    for letter in set("".join(cell for row in rows for cell in row)) - {" "}:
        assert shown.count(letter) >= sum(cell.count(letter) for row in rows for cell in row[1:])


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(tables())
def test_without_a_terminal_each_row_is_a_line(table: tuple[list[str], list[list[str]]]) -> None:
    columns, rows = table
    head, *lines = fit_table(columns, rows, None)
    assert head.split() == [word for column in columns for word in column.split()]
    assert [line.split() for line in lines] == [" ".join(row).split() for row in rows]


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(alike_names(), st.integers(1, 200))
def test_shortened_names_stay_different(names: list[str], width: int) -> None:
    found = shorten(names, width)
    assert len(set(found)) == len(set(names))
    for name, short in zip(names, found, strict=True):
        assert short == name or ("…" in short and cell_width(short) <= width)
        if short != name:
            head, _, tail = short.partition("…")
            assert name.startswith(head)
            assert name.endswith(tail)


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(alike_names(), WIDTHS)
def test_names_side_by_side_are_whole(names: list[str], width: int) -> None:
    lines = name_lines(names, width)
    assert all(cell_width(line) <= width for line in lines)
    assert squeezed(lines) == "".join(names)


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(WORDS, min_size=1).map(" ".join), st.integers(2, 60))
def test_wrapping_keeps_all_but_spaces(text: str, width: int) -> None:
    lines = wrap(text, width)
    assert all(cell_width(line) <= width for line in lines)
    assert squeezed(lines) == text.replace(" ", "")


def test_spaces_within_a_line_are_kept() -> None:
    assert wrap("a  b c", 4) == ["a  b", "c"]


def test_what_is_wide_takes_two_columns_and_a_mark_none() -> None:
    assert [cell_width(text) for text in ("ab", "語", "👕", "e\u0301", "×")] == [2, 2, 2, 1, 1]


ROWS = [
    ["GreenTowel_Ruler_01_pi16_0.5_R1", "green towel", "present"],
    ["GreenTowel_Free_pi16_0.5_R1", "green towel", "-"],
]


@pytest.mark.parametrize(
    ("width", "expected"),
    [
        (
            54,
            [
                "recording                        garment      state",
                "                                 [kind]",
                "GreenTowel_Ruler_01_pi16_0.5_R1  green towel  present",
                "GreenTowel_Free_pi16_0.5_R1      green towel  -",
            ],
        ),
        (
            44,
            [
                "garment [kind]",
                "  recording                        state",
                "green towel",
                "  GreenTowel_Ruler_01_pi16_0.5_R1  present",
                "  GreenTowel_Free_pi16_0.5_R1      -",
            ],
        ),
        (
            32,
            [
                "recording",
                "  garment      state",
                "  [kind]",
                "GreenTowel_Ruler_01_pi16_0.5_R1",
                "  green towel  present",
                "GreenTowel_Free_pi16_0.5_R1",
                "  green towel  -",
            ],
        ),
        (
            22,
            [
                "recording",
                "  GreenTowel_Ruler_01_",
                "  pi16_0.5_R1",
                "garment [kind]",
                "  green towel",
                "state",
                "  present",
                "",
                "recording",
                "  GreenTowel_Free_pi16",
                "  _0.5_R1",
                "garment [kind]",
                "  green towel",
                "state",
                "  -",
            ],
        ),
    ],
)
def test_the_forms_of_a_table(width: int, expected: list[str]) -> None:
    columns = ["recording", "garment [kind]", "state"]
    assert not fits(columns, ROWS, width)
    assert fit_table(columns, ROWS, width, heads=["garment [kind]"]) == expected
