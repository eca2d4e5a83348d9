"""File names: what each form says, that writing inverts reading, and that nothing is half read."""

from __future__ import annotations

import math
import pickle
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from garment_dataset.catalog.names import BackgroundName, RecordingName, parse_bag_name, repair_name
from garment_dataset.errors import RecordingNameError

PRINTED = [
    [cell.strip() for cell in line.strip().strip("|").split("|")]
    for line in (Path(__file__).parent / "data" / "tables_b2_b3.txt").read_text("utf-8").splitlines()[1:]
]
GARMENTS = {
    "a": "BlueShirt",
    "b": "FelShirt",
    "c": "RedSkirt",
    "d": "GreenTowel",
    "e": "BlackShorts",
    "f": "WhiteBlackShirt",
    "g": "RedPullover",
    "h": "WhitePullover",
}
HOLDINGS = {"a": "Free", "b": "Corner", "c": "Collar", "d": "Belt", "e": "Ruler", "f": "Ruler"}

tokens = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9-]{0,9}", fullmatch=True)
words = st.from_regex(r"[A-Za-z][A-Za-z0-9-]{0,9}", fullmatch=True)
speeds = st.from_regex(r"(0|[1-9][0-9]?)(\.[0-9]{1,4})?", fullmatch=True)
counters = st.none() | st.from_regex(r"[0-9]{4}", fullmatch=True)
free_names = st.builds(lambda first, rest: "_".join([first, *rest]), words, st.lists(tokens, max_size=5))


def conventional(garment: str, holding: str, repeat: str | None, divisor: int | None) -> str:
    swing = None if divisor is None else f"pi{divisor}"
    return "_".join(filter(None, (garment, holding, repeat, swing)))


conventional_names = st.builds(
    conventional,
    words,
    words.filter(lambda word: not re.fullmatch(r"pi[0-9]+", word)),
    st.none() | st.from_regex(r"[0-9]{2}", fullmatch=True),
    st.none() | st.integers(1, 999),
)
recordings = st.builds(
    RecordingName,
    name=free_names | conventional_names,
    speed=speeds,
    axis=st.sampled_from(["R", "B"]),
    topics_file=st.integers(1, 99),
    counter=counters,
)
backgrounds = st.builds(BackgroundName, st.integers(0, 10**9))
names = recordings | backgrounds


def read(text: str) -> RecordingName | BackgroundName | RecordingNameError:
    try:
        return parse_bag_name(text)
    except RecordingNameError as error:
        return error


def suggestion(error: RecordingNameError) -> str | None:
    found = re.search(r"Did you mean (\S+)\?$", error.hint or "")
    return None if found is None else found[1]


@pytest.mark.parametrize("row", PRINTED, ids=lambda row: row[1])
def test_every_name_of_the_thesis_says_what_its_row_says(row: list[str]) -> None:
    _, printed, garment, holding, _ = row
    name = parse_bag_name(printed)
    assert isinstance(name, RecordingName)
    assert (name.garment, name.holding) == (GARMENTS[garment], HOLDINGS[holding])
    repeat = re.search(r"_(\d\d)_", printed)
    assert name.repeat == (None if repeat is None else int(repeat[1]))
    assert (name.swing_divisor, name.speed, name.topics_file, name.counter) == (16, "0.5", 1, None)
    assert name.swing_rad == math.pi / 16
    assert name.axis == printed[-2]
    assert str(name) == printed.replace("pi16.", "pi16_")


def test_the_thesis_has_46_recordings_and_prints_20_with_a_point() -> None:
    assert len(PRINTED) == 46
    assert sum("pi16.0.5" in row[1] for row in PRINTED) == 20
    assert len({str(parse_bag_name(row[1])) for row in PRINTED}) == 46


@pytest.mark.parametrize(
    ("text", "garment", "holding", "repeat", "divisor", "speed", "counter"),
    [
        ("towel16_0.1_0006_R2.bag", None, None, 6, None, "0.1", "0006"),
        ("GreenTowel_Corner_03_0.50_0007_B12", "GreenTowel", "Corner", 3, None, "0.50", "0007"),
        ("GreenTowel_Corner_0.5_0007_R1", "GreenTowel", "Corner", 7, None, "0.5", "0007"),
        ("RealGarments_Floor_01_pi16_0.1_R1.bag", "RealGarments", "Floor", 1, 16, "0.1", None),
        ("GreenTowel_pi16_0.5_R1", None, None, None, 16, "0.5", None),
        ("pi8_1_R1", None, None, None, 8, "1", None),
        ("A_B_C_pi16_0.5_R1", None, None, None, 16, "0.5", None),
        ("T-shirt_On-table_00_pi100_99_R99", "T-shirt", "On-table", 0, 100, "99", None),
        ("Towel_Free_pi16_5_R1", "Towel", "Free", None, 16, "5", None),
        ("Towel_Free_16_5_R1", "Towel", "Free", 16, None, "5", None),
        ("Towel_Free_pi0_5_R1", None, None, None, None, "5", None),
        ("Towel_1Free_5_R1", None, None, None, None, "5", None),
        ("towel_5_0006_1_R1", None, None, None, None, "1", None),
        ("camera_default_0.5_R1", "camera", "default", None, None, "0.5", None),
    ],
)
def test_what_a_name_says(
    text: str, garment: Any, holding: Any, repeat: Any, divisor: Any, speed: str, counter: Any
) -> None:
    name = parse_bag_name(text)
    assert isinstance(name, RecordingName)
    assert (name.garment, name.holding, name.repeat, name.swing_divisor) == (garment, holding, repeat, divisor)
    assert (name.speed, name.counter) == (speed, counter)
    assert str(name) == text.removesuffix(".bag")


def test_an_empty_scene_is_the_background_of_the_next_number() -> None:
    name = parse_bag_name("camera_default_0.bag")
    assert name == BackgroundName(0)
    assert name.topics_file == 1


@given(names)
def test_writing_inverts_reading(name: RecordingName | BackgroundName) -> None:
    assert parse_bag_name(str(name)) == name
    assert parse_bag_name(f"{name}.bag") == name


@given(conventional_names, speeds)
def test_a_conventional_name_is_taken_apart(name: str, speed: str) -> None:
    parsed = RecordingName(name, speed, "R", 1)
    assert parsed.garment is not None
    assert parsed.holding is not None
    number = "" if parsed.repeat is None else f"{parsed.repeat:02}"
    swing = "" if parsed.swing_divisor is None else f"pi{parsed.swing_divisor}"
    assert "_".join(filter(None, (parsed.garment, parsed.holding, number, swing))) == name


@given(free_names, st.integers(1, 999), st.from_regex(r"(0|[1-9][0-9]?)\.[0-9]{1,4}", fullmatch=True), counters)
def test_the_point_of_table_b3_is_read_as_an_underscore(
    name: str, divisor: int, speed: str, counter: str | None
) -> None:
    meant = RecordingName(f"{name}_pi{divisor}", speed, "B", 1, counter)
    printed = str(meant).replace(f"_pi{divisor}_{speed}", f"_pi{divisor}.{speed}")
    assert printed != str(meant)
    assert parse_bag_name(printed) == meant


near_names = st.builds(
    lambda name, change, place: change(str(name), place % (len(str(name)) + 1)),
    names,
    st.sampled_from(
        [
            lambda text, place: text[:place] + text[place + 1 :],
            lambda text, place: f"{text[:place]}_{text[place:]}",
            lambda text, place: f"{text[:place]}.{text[place:]}",
            lambda text, place: text[:place] + text[place:].swapcase(),
            lambda text, place: text[:place] + text[place:].replace("_", " "),
            lambda text, _: text.replace("_", "-"),
            lambda text, _: text.replace(".", ","),
            lambda text, _: text.rstrip("0123456789"),
            lambda text, _: f"some/folder/{text}.BAG",
        ]
    ),
    st.integers(0, 300),
)


@given(st.text(max_size=40) | st.text("aR_.-10pi ,b/", max_size=30) | near_names)
@example("GreenTowel_Free_pi16_0.5_R1\n")
@example("GreenTowel_Free_pi16_0.5_R１")
@example("Towel_pi16.0.5_R1.bag.bag")
@example("\ud800_0.5_R1")
def test_any_text_is_read_whole_or_refused_with_a_name_that_can_be_read(text: str) -> None:
    name = read(text)
    if isinstance(name, RecordingNameError):
        assert name.found == repr(text)
        assert pickle.loads(pickle.dumps(name)).parts() == name.parts()
        assert (suggestion(name) is None) == (repair_name(text) is None)
        if (better := suggestion(name)) is not None:
            assert str(parse_bag_name(better)) == better.removesuffix(".bag")
    else:
        canonical = str(name)
        assert parse_bag_name(canonical) == name
        printed = re.sub(r"(?<=_pi)([0-9]+)_(?=[0-9]+\.[0-9]+_)", r"\1.", canonical)
        assert text.removesuffix(".bag") in (canonical, printed)


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("GreenTowel-Corner-01-pi16-0.5-R1.bag", "GreenTowel_Corner_01_pi16_0.5_R1"),
        ("T-shirt_Free_0.5-R1", "T-shirt_Free_0.5_R1"),
        ("GreenTowel Corner 01 pi16 0.5 R1.bag", "GreenTowel_Corner_01_pi16_0.5_R1"),
        ("GreenTowel.Free.pi16.0.5.B1", "GreenTowel_Free_pi16_0.5_B1"),
        ("GreenTowel__Free_pi16_0.5_B1", "GreenTowel_Free_pi16_0.5_B1"),
        ("GreenTowel–Free_pi16_0.5_B1", "GreenTowel_Free_pi16_0.5_B1"),
        ("GrünTowel_Free_pi16_0.5_B1", "GrunTowel_Free_pi16_0.5_B1"),
        ("GreenTowel_Free_pi16_0.5_r1", "GreenTowel_Free_pi16_0.5_R1"),
        ("GreenTowel_Free_pi16_0,5_R1", "GreenTowel_Free_pi16_0.5_R1"),
        ("GreenTowel_Free_pi16_.5_R1", "GreenTowel_Free_pi16_0.5_R1"),
        ("GreenTowel_Free_pi16_0.5_R", "GreenTowel_Free_pi16_0.5_R1"),
        ("GreenTowel_Free_pi16_0.5_R01", "GreenTowel_Free_pi16_0.5_R1"),
        ("GreenTowel_Free_pi16_00.5_R1", "GreenTowel_Free_pi16_0.5_R1"),
        ("GreenTowel_Free_pi16_0.5_R_1", "GreenTowel_Free_pi16_0.5_R1"),
        ("GreenTowel_Free_pi16.0_5_R1", "GreenTowel_Free_pi16_0.5_R1"),
        ("GreenTowel_Free_pi16.5_R1", "GreenTowel_Free_pi16_5_R1"),
        ("GreenTowel_Free_pi16_0.5_R1.BAG", "GreenTowel_Free_pi16_0.5_R1"),
        ("GreenTowel_Free_pi16_0.5_R1.bag.bag", "GreenTowel_Free_pi16_0.5_R1"),
        ("GreenTowel_Free_pi16_0.5_R1.bag.active", "GreenTowel_Free_pi16_0.5_R1"),
        ("GreenTowel_Free_pi16_0.5_R1 (1).bag", "GreenTowel_Free_pi16_0.5_R1"),
        (" recordings/GreenTowel_Free_pi16_0.5_R1.bag\n", "GreenTowel_Free_pi16_0.5_R1"),
        ("towel16 0.1 0006 R2", "towel16_0.1_0006_R2"),
        ("Camera-Default 03.bag", "camera_default_3"),
    ],
)
def test_the_hint_gives_the_nearest_valid_form(text: str, meant: str) -> None:
    with pytest.raises(RecordingNameError) as caught:
        parse_bag_name(text)
    assert suggestion(caught.value) == f"{meant}.bag"


@pytest.mark.parametrize(
    "text",
    ["", ".bag", "GreenTowel_Free_R1", "16towel_0.5_R1", "towel_100_R1", "towel_0.5_R100", "towel_0.5_G1", "0.5_R1"],
)
def test_no_name_is_made_up_where_something_is_missing(text: str) -> None:
    with pytest.raises(RecordingNameError) as caught:
        parse_bag_name(text)
    assert suggestion(caught.value) is None
    assert "For example" in str(caught.value)


def test_a_name_longer_than_results_can_have_is_refused_at_once() -> None:
    assert str(parse_bag_name("x" * 240 + "_0.5_R1.bag")) == "x" * 240 + "_0.5_R1"
    for text in (
        "x" * 241 + "_0.5_R1",
        "_ " * 500_000,
        "camera_default_" + "9" * 10_000,
        "camera default " + "9" * 240,
    ):
        with pytest.raises(RecordingNameError) as caught:
            parse_bag_name(text)
        assert suggestion(caught.value) is None
        assert len(str(caught.value)) < 300


@pytest.mark.parametrize(
    "parts",
    [
        ("towel_0.5", "1", "R", 1, None),
        ("", "1", "R", 1, None),
        ("1towel", "1", "R", 1, None),
        ("towel", "01", "R", 1, None),
        ("towel", 0.5, "R", 1, None),
        ("towel", "1e1", "R", 1, None),
        ("towel", "1", "r", 1, None),
        ("towel", "1", "R", 0, None),
        ("towel", "1", "R", 100, None),
        ("towel", "1", "R", "1", None),
        ("towel", "1", "R", True, None),
        ("towel", "1", "R", 1, "12"),
        ("towel", "1", "R", 1, ""),
        ("towel", "1_0006", "R", 1, None),
        ("towel_1", "1_0006", "R", 1, None),
    ],
)
def test_parts_that_make_no_name_are_refused(parts: tuple[Any, ...]) -> None:
    with pytest.raises(RecordingNameError):
        RecordingName(*parts)


@pytest.mark.parametrize("position", [-1, True, "1", 1.0])
def test_positions_that_are_no_count_are_refused(position: Any) -> None:
    with pytest.raises(RecordingNameError):
        BackgroundName(position)
