"""Names by a pattern of one's own: writing inverts reading, or pattern and name are refused with the reason."""

from __future__ import annotations

import json
import re
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from typer.testing import CliRunner

from garment_dataset.catalog import Catalog
from garment_dataset.catalog.names import BackgroundName, RecordingName
from garment_dataset.catalog.patterns import template_of
from garment_dataset.catalog.record_plan import plan_recording
from garment_dataset.catalog.schemes import THESIS, PatternScheme, compile_scheme
from garment_dataset.cli import application
from garment_dataset.engine.events import Ending
from garment_dataset.errors import CatalogError, RecordingNameError, WorkspaceError
from garment_dataset.layout import NamesSettings
from garment_dataset.workspace import Workspace

DASHES = (
    "(?P<garment>[a-z]+)-(?P<holding>[a-z]+)-v(?P<speed>[0-9]+p[0-9]+)-(?P<axis>along|across)(?:-(?P<repeat>[0-9]{3}))?"
)
AXIS = {"along": "R", "across": "B"}
SETTINGS = f'[names]\npattern = \'{DASHES}\'\naxis = {{ along = "R", across = "B" }}\n'


def scheme_by(pattern: str, **more: Any) -> PatternScheme:
    return compile_scheme(NamesSettings(pattern=pattern, **more))


def dashes() -> PatternScheme:
    return scheme_by(DASHES, axis=AXIS)


# Reading and writing


@pytest.mark.parametrize(
    ("pattern", "settings", "text", "says"),
    [
        (DASHES, {"axis": AXIS}, "scarf-corner-v0p5-along-007", ("scarf_corner", "scarf", "corner", 7, "0.5", "R", 1)),
        (DASHES, {"axis": AXIS}, "scarf-corner-v0p5-across", ("scarf_corner", "scarf", "corner", None, "0.5", "B", 1)),
        (
            r"(?P<name>.+)_take(?P<repeat>\d+)",
            {"axis": "R", "speed": 1},
            "my scarf_take02",
            ("my scarf", None, None, 2, "1", "R", 1),
        ),
        (
            r"(?P<name>(?P<garment>\w+?)\.(?P<holding>\w+)) (?P<axis>[RB])(?P<topics_file>0\d)\+(?P<speed>\d\.\d)",
            {},
            "tuch.ecke R03+0.5",
            ("tuch.ecke", "tuch", "ecke", None, "0.5", "R", 3),
        ),
        (r"(?P<speed>\d)_(?P<name>\w)(?P<counter>\d\d)?", {"axis": "B"}, "3_a17", ("a", None, None, 17, "3", "B", 1)),
    ],
)
def test_a_pattern_says_what_its_groups_say(pattern: str, settings: dict[str, Any], text: str, says: Any) -> None:
    name = scheme_by(pattern, **settings).parse(f"{text}.bag")
    assert isinstance(name, RecordingName)
    found = (name.name, name.garment, name.holding, name.repeat, name.speed, name.axis, name.topics_file)
    assert found == says
    assert str(name) == text


def test_an_empty_scene_is_called_as_ever() -> None:
    assert dashes().parse("camera_default_2.bag") == BackgroundName(2)
    loose = scheme_by("(?P<name>.+)", axis="R", speed=1)
    assert loose.parse("camera_default_2.bag") == BackgroundName(2)
    assert str(loose.parse("camera_default_x")) == "camera_default_x"


words = st.from_regex(r"[a-z]{1,8}", fullmatch=True)
dashed = st.builds(
    lambda garment, holding, speed, axis, repeat: f"{garment}-{holding}-v{speed}-{axis}{repeat}",
    words,
    words,
    st.from_regex(r"[0-9]{1,2}p[0-9]{1,3}", fullmatch=True),
    st.sampled_from(sorted(AXIS)),
    st.just("") | st.from_regex(r"-[0-9]{3}", fullmatch=True),
)


@given(dashed)
def test_writing_inverts_reading(text: str) -> None:
    scheme = dashes()
    name = scheme.parse(text)
    assert str(name) == text
    assert scheme.parse(str(name)) == name
    assert scheme.parse(f"{text}.bag") == name


pieces = st.sampled_from(
    [
        *("x", "-", r"\.", "_", "(?P<name>[a-z]+)", "(?P<holding>[a-z]*)", "(?P<repeat>[0-9]+)?"),
        *("(?:-(?P<counter>[0-9]+))?", "(?P<topics_file>[0-9])", "(?P<garment>[a-c]+|[(])"),
    ]
)


@given(st.lists(pieces, min_size=1, max_size=6), st.text("abx-._0123(", max_size=10))
@example(["(?P<name>[a-z]+)", "(?:-(?P<counter>[0-9]+))?", "-", "(?P<repeat>[0-9]+)?"], "a-1-2")
def test_the_law_holds_for_any_pattern_that_is_taken(parts: list[str], text: str) -> None:
    try:
        scheme = scheme_by("".join(parts), axis="R", speed=1)
        name = scheme.parse(text)
    except (ValueError, RecordingNameError):
        return
    assert str(name) == text
    assert scheme.parse(str(name)) == name


@given(st.text("(?P<name>x)[]\\|*+-^.:a", max_size=14))
def test_any_pattern_of_python_is_taken_apart_or_refused(pattern: str) -> None:
    try:
        compiled = re.compile(pattern)
        template = template_of(pattern)
    except (re.error, FutureWarning, ValueError):
        return
    if (found := compiled.fullmatch(template.write(dict.fromkeys(compiled.groupindex, "x")))) is not None:
        assert template.write(found.groupdict()) == found[0]


@given(st.text(max_size=30) | dashed.map(str.upper) | dashed.map(lambda text: f"a/{text} (1).BAG"))
@example("\udcff")
def test_any_text_is_read_whole_or_refused_with_a_name_that_can_be_read(text: str) -> None:
    scheme = dashes()
    try:
        name = scheme.parse(text)
    except RecordingNameError as error:
        nearest = scheme.repair(text)
        assert (nearest is None) == (error.hint is None)  # noqa: PT017 - some texts raise none
        if nearest is not None:
            assert str(scheme.parse(nearest)) == nearest
    else:
        assert str(name) == text.removesuffix(".bag")


def test_letters_composed_in_another_way_make_the_same_name() -> None:
    scheme = scheme_by("(?P<name>.+)", axis="R", speed=1)
    composed = scheme.parse("t\u00fccher.bag")
    assert scheme.parse("tu\u0308cher.bag") == composed
    assert unicodedata.is_normalized("NFC", str(composed))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"axis": "B"}, "scarf-corner-v0p5-across-007"),
        ({"axis": "R"}, "scarf-corner-v0p5-along-007"),
        ({"speed": "1.25"}, "scarf-corner-v1p25-along-007"),
        ({"repeat": 12}, "scarf-corner-v0p5-along-012"),
        ({"garment": "towel", "axis": "B"}, "towel-corner-v0p5-across-007"),
        ({"swing_divisor": 8}, "scarf-corner-v0p5-along-007"),
    ],
)
def test_a_name_with_other_parts_is_written_as_the_pattern_has_it(changes: dict[str, Any], text: str) -> None:
    name = dashes().parse("scarf-corner-v0p5-along-007")
    assert isinstance(name, RecordingName)
    assert str(name.changed(**changes)) == text
    with pytest.raises(RecordingNameError):
        name.changed(garment="two words")


# What is refused


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"pattern": "(?P<name>"}, "'names.pattern': found no regular expression"),
        ({"pattern": "(?P<name>[[x])"}, "no regular expression: Possible nested set"),
        ({"pattern": "(?P<nam>x)"}, "a group 'nam'. Did you mean name"),
        ({"pattern": "(?P<material>x)"}, "a group 'material'. Groups: one of name, garment"),
        ({"pattern": "(?P<speed>1)"}, "no group that says what is recorded"),
        (
            {"pattern": ".*(?P<name>x)"},
            r"'\.' outside the groups, at letter 1. Put it into a named group, or write \\\.",
        ),
        ({"pattern": r"\d(?P<name>x)"}, r"\\d outside the groups, at letter 1"),
        ({"pattern": "a+(?P<name>x)"}, r"'\+' outside the groups, at letter 2"),
        ({"pattern": "(a|b)(?P<name>x)"}, r"'\(' outside the groups"),
        ({"pattern": "(?P<name>x)|(?P<garment>y)"}, r"'\|' outside the groups"),
        ({"pattern": "(?i)(?P<name>x)"}, r"'\(' outside the groups"),
        ({"pattern": "(?:ab)?(?P<name>x)"}, "brackets that are no part with a group, at letter 1"),
        ({"pattern": "(?:(?P<name>x))+"}, "brackets that are no part with a group"),
        ({"pattern": "(?P<name>x)+"}, "a group that is repeated"),
        ({"pattern": "(?P<name>x)"}, "'names.axis': found names that say no axis"),
        ({"pattern": "(?P<name>x)", "axis": "R"}, "'names.speed': found names that say no speed"),
        ({"pattern": "(?P<name>x)(?P<axis>R)", "axis": "R", "speed": 1}, "'R', and the pattern has a group for it"),
        ({"pattern": "(?P<name>x)(?P<speed>1)", "axis": "R", "speed": 1}, "1, and the pattern has a group for it"),
        ({"pattern": "(?P<name>x)(?P<axis>.)", "axis": {"x": "R", "z": "R"}, "speed": 1}, "two words for one axis"),
    ],
)
def test_a_pattern_that_cannot_promise_it_is_refused(tmp_path: Path, settings: dict[str, Any], message: str) -> None:
    place = Workspace.create(tmp_path / "ws")
    lines = (
        f"{key} = {json.dumps(value) if not isinstance(value, dict) else table(value)}"
        for key, value in settings.items()
    )
    (place.root / "garment.toml").write_text("[names]\n" + "\n".join(lines))
    with pytest.raises(WorkspaceError, match=message) as caught:
        Workspace.find(place.root).catalog()
    assert str(caught.value.where) == str(place.root / "garment.toml")


def table(value: dict[str, str]) -> str:
    return "{ " + ", ".join(f'{key} = "{word}"' for key, word in value.items()) + " }"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("scarf-corner-v0.5-along", "not a recording name by the pattern"),
        ("scarf-corner-v0p5-along-001.BAG", "Did you mean scarf-corner-v0p5-along-001.bag"),
        ("SCARF-Corner-V0P5-ALONG-001", "Did you mean scarf-corner-v0p5-along-001.bag"),
        ("scarf-corner-v0p5-along-001 (2).bag", "Did you mean scarf-corner-v0p5-along-001.bag"),
        (
            "scarf-corner-v0p5-along-001_2026-11-25-10-30-00",
            "the date that .* appends.*Did you mean scarf-corner-v0p5-along-001",
        ),
    ],
)
def test_a_name_that_is_none_is_told_the_nearest(text: str, message: str) -> None:
    with pytest.raises(RecordingNameError, match=message):
        dashes().parse(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a=b_1R", "that results cannot have"),
        ("_a_1R", "that results cannot have"),
        (".a_1R", "that results cannot have"),
        ("a*_1R", "that results cannot have"),
        ("a" * 250 + "_1R", "more than 247 bytes"),
        ("é" * 130 + "_1R", "more than 247 bytes"),
        ("a,b_1R", "that results cannot have"),
        ("a_fastR", "whose speed is no number, but 'fast'"),
        ("a_1Q", "whose axis is 'Q', not one of R, B"),
        ("a_1R-0", "whose topics_file is no count, but '0'"),
        ("a_1R-x", "whose topics_file is no count, but 'x'"),
        ("_1R", "that results cannot have|does not say what"),
    ],
)
def test_a_name_whose_parts_say_nothing_is_refused(text: str, message: str) -> None:
    scheme = scheme_by(r"(?P<name>.*)_(?P<speed>[a-z0-9]+?)(?P<axis>[A-Z])(?:-(?P<topics_file>.))?")
    with pytest.raises(RecordingNameError, match=message):
        scheme.parse(text)


# In a workspace


@pytest.fixture
def place(tmp_path: Path) -> Workspace:
    """A workspace with a pattern, and rows for two of its recordings."""
    made = Workspace.create(tmp_path / "ws", empty=True)
    (made.root / "garment.toml").write_text(SETTINGS)
    (made.catalog_dir / "garments.csv").write_text("letter,garment,weight_g\na,scarf,80\n")
    (made.catalog_dir / "holdings.csv").write_text("letter,holding\na,corner\n")
    rows = "scarf-corner-v0p5-along-001,a,a\nscarf-corner-v0p5-across-001,a,a\n"
    (made.catalog_dir / "recordings.csv").write_text(f"recording,garment,holding\n{rows}")
    (made.pipelines_dir / "colour.toml").unlink()
    return Workspace.find(made.root)


def run(place: Workspace, *arguments: str) -> Any:
    return CliRunner(env={"NO_COLOR": "1"}).invoke(application(), [*arguments, "-w", str(place.root)])


def test_tables_folder_and_filters_use_it(place: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("scarf-corner-v0p5-along-001", "scarf-corner-v0p5-along-002", "GreenTowel_Free_0.5_R1"):
        (place.recordings_dir / f"{name}.bag").touch()
    first, partner, other = place.catalog().rows
    assert (first.state, partner.state, other.state) == ("present", "missing", "unexpected")
    assert (first.partner, other.partner, first.weight_kg) == (partner.recording, None, 0.08)
    assert place.catalog().row("scarf-corner-v0p5-along-001.bag") == first
    for terms in (["repeat=1", "axis=R"], ["scarf-corner-v0p5-along-001.bag"], ["*-along-001"]):
        assert place.catalog().select(terms) == (first,)
    monkeypatch.chdir(place.recordings_dir)
    assert [row.recording for row in Catalog.load().rows] == [first.recording, partner.recording]


def test_a_row_of_the_thesis_scheme_is_no_name_here(place: Workspace) -> None:
    (place.catalog_dir / "recordings.csv").write_text("recording\nGreenTowel_Free_0.5_R1\n")
    with pytest.raises(CatalogError, match="line 2, column recording"):
        place.catalog()


def test_a_name_of_the_pattern_that_the_thesis_would_write_otherwise_is_found(place: Workspace) -> None:
    (place.root / "garment.toml").write_text("[names]\npattern = '(?P<name>.+)'\naxis = 'R'\nspeed = 1\n")
    (place.catalog_dir / "recordings.csv").write_text("recording\nA_pi16.0.5_R1\n")
    catalog = Workspace.find(place.root).catalog()
    assert [row.recording for row in catalog.select(["A_pi16.0.5_R1.bag"])] == ["A_pi16.0.5_R1"]


def test_lint_proposes_names_of_the_pattern_and_gives_them(place: Workspace) -> None:
    for name in (
        "Scarf-corner-v0p5-Along-001.BAG",
        "scarf-corner-v0p5-across-001_2026-11-25-10-30-00.bag",
        "scarf.bag",
    ):
        (place.recordings_dir / name).touch()
    assert run(place, "lint", "--rename", "--apply").exit_code == 0
    assert sorted(path.name for path in place.recordings_dir.iterdir()) == [
        "scarf-corner-v0p5-across-001.bag",
        "scarf-corner-v0p5-along-001.bag",
        "scarf.bag",
    ]


def test_two_files_of_one_name_are_a_duplicate_however_their_letters_are_composed(place: Workspace) -> None:
    (place.root / "garment.toml").write_text("[names]\npattern = '(?P<name>.+)'\naxis = 'R'\nspeed = 1\n")
    for name in ("tu\u0308cher.bag", "t\u00fccher.bag"):
        (place.recordings_dir / name).touch()
    assert run(place, "lint", "code=duplicate").stdout.count("t\u00fccher") >= 1
    assert run(place, "lint", "code=misnamed").exit_code == 0


def test_a_build_names_its_results_by_it(place: Workspace, make_recording: Callable[..., Path]) -> None:
    make_recording(place.recordings_dir / "scarf-corner-v0p5-along-001.bag")
    assert {event.ending for event in place.build(jobs=0).events.values()} == {Ending.BUILT}
    folder = place.features_dir / "points" / "garment=scarf" / "holding=corner"
    assert [path.name for path in folder.iterdir()] == ["scarf-corner-v0p5-along-001.parquet"]


def test_a_recording_is_planned_by_its_name_in_the_pattern(place: Workspace) -> None:
    (place.catalog_dir / "topics").mkdir()
    (place.catalog_dir / "topics" / "1.txt").write_text("/tf\n")
    planned = run(place, "record-plan", "scarf-corner-v0p5-along-001.bag").stdout
    assert "recordings/scarf-corner-v0p5-along-001.bag" in planned
    assert "garment record-plan scarf-corner-v0p5-across-001" in planned
    with pytest.raises(CatalogError, match="Did you mean scarf-corner-v0p5-along-001"):
        plan_recording(place.catalog(), "Scarf-corner-v0p5-along-001")


def test_a_watch_builds_names_of_the_pattern(place: Workspace, make_recording: Callable[..., Path]) -> None:
    make_recording(place.recordings_dir / "scarf-corner-v0p5-along-001.bag")
    watched = run(place, "watch", "--once", "-j", "0", "--settle-s", "0.1")
    assert "scarf-corner-v0p5-along-001" in watched.stdout
    assert (place.features_dir / "points" / "garment=scarf").is_dir()


def test_the_thesis_scheme_is_the_one_without_a_setting(tmp_path: Path) -> None:
    assert Workspace.create(tmp_path / "ws").catalog().scheme is THESIS
