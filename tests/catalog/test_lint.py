"""Lint: every disagreement under its own code, with the exact name, in both directions; and the three verbs."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import typer
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from garment_dataset.bags.rosbag1_writer import BagWriter
from garment_dataset.catalog import ROW_KEYS, Catalog
from garment_dataset.catalog.lint import SEVERITIES, lint
from garment_dataset.errors import CatalogError, FilterError
from garment_dataset.layout import packaged_workspace

if TYPE_CHECKING:
    from garment_dataset.catalog.lint import Finding

Run = Callable[..., Any]
"""Runs a verb; click's result, which typer does not export."""

THESIS = packaged_workspace() / "catalog"
ALL = [row.recording for row in Catalog.load(THESIS).rows]
UNPAIRED = ["FelShirt_Ruler_pi16_0.5_R1", *(f"GreenTowel_Ruler_0{number}_pi16_0.5_R1" for number in range(1, 6))]


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """A workspace with the thesis' tables and no bag."""
    shutil.copytree(THESIS, tmp_path / "catalog")
    (tmp_path / "pipelines").mkdir()
    (tmp_path / "recordings").mkdir()
    return tmp_path


@pytest.fixture
def put(workspace: Path) -> Callable[..., None]:
    """Make bags without messages in the workspace."""
    content = io.BytesIO()
    BagWriter(content, {}, "none").finish()

    def make(*names: str) -> None:
        for name in names:
            path = workspace / "recordings" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content.getvalue())

    return make


def findings_of(workspace: Path) -> list[Finding]:
    return list(lint(Catalog.load(workspace / "catalog", strict=False), workspace / "recordings"))


def subjects(findings: list[Finding], code: str) -> list[str]:
    return [finding.subject for finding in findings if finding.code == code]


def only(findings: list[Finding], code: str) -> Finding:
    (finding,) = (finding for finding in findings if finding.code == code)
    return finding


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), "utf-8")


# Each code


def test_without_a_folder_only_the_six_recordings_without_a_partner_are_found() -> None:
    findings = list(lint(Catalog.load(THESIS)))
    assert subjects(findings, "unpaired") == UNPAIRED
    assert len(findings) == 6
    assert {finding.severity for finding in findings} == {"note"}


def test_an_empty_folder_lacks_all_46_by_name(workspace: Path) -> None:
    findings = findings_of(workspace)
    assert subjects(findings, "missing") == ALL
    assert len(findings) == 46 + 6


def test_a_whole_data_set_has_only_the_six(workspace: Path, put: Callable[..., None]) -> None:
    put(*(f"{name}.bag" for name in ALL), "camera_default_0.bag", "README.txt")
    findings = findings_of(workspace)
    assert subjects(findings, "unpaired") == UNPAIRED
    assert len(findings) == 6


@settings(max_examples=25, deadline=None)
@given(
    st.sets(st.sampled_from(ALL)), st.sets(st.sampled_from(["MyTowel_Free_0.5_R1", "BlueShirt_Belt_0.5_B1", "t_1_R1"]))
)
def test_both_differences_between_tables_and_folder_are_exact(
    tmp_path_factory: pytest.TempPathFactory, listed: set[str], others: set[str]
) -> None:
    folder = tmp_path_factory.mktemp("bags")
    for name in listed | others | {"camera_default_0"}:
        (folder / f"{name}.bag").touch()
    findings = list(lint(Catalog.load(THESIS), folder))
    assert subjects(findings, "missing") == [name for name in ALL if name not in listed]
    assert subjects(findings, "unexpected") == sorted(others)
    assert sorted(subjects(findings, "unpaired")) == sorted([*UNPAIRED, *others])
    assert len(findings) == len(ALL) - len(listed) + 2 * len(others) + 6


@pytest.mark.parametrize(
    ("file", "meant"),
    [
        ("FelShirt_Free_pi16.0.5_B1.bag", "FelShirt_Free_pi16_0.5_B1.bag"),
        ("deep/FelShirt_Free_pi16.0.5_B1.bag", "FelShirt_Free_pi16_0.5_B1.bag"),
        ("FelShirt_Free_pi16.0.5_B1/metadata.yaml", "FelShirt_Free_pi16_0.5_B1"),
        ("FelShirt Free pi16 0,5 b.BAG", "FelShirt_Free_pi16_0.5_B1.bag"),
        ("FelShirt_Free_pi16_0.5_B1.BAG", "FelShirt_Free_pi16_0.5_B1.bag"),
        ("felshirt_free_pi16_0.5_B1.bag", "FelShirt_Free_pi16_0.5_B1.bag"),
        ("Fel-Shirt_Free_pi16_0.50_B1.bag", "FelShirt_Free_pi16_0.5_B1.bag"),
        ("FelShrt_Free_pi16_0.5_B1.bag", "FelShirt_Free_pi16_0.5_B1.bag"),
        ("FelShrt-Free-pi16-0.5-B1.bag", "FelShirt_Free_pi16_0.5_B1.bag"),
        ("GreenTowl_Crner_01_pi16_0.5_B1.bag", "GreenTowel_Corner_01_pi16_0.5_B1.bag"),
        ("GreenTowel_Corner_1_pi16_0.5_B1.bag", "GreenTowel_Corner_01_pi16_0.5_B1.bag"),
        ("Camera_default_0.bag", "camera_default_0.bag"),
        ("MyTowel Free 0.5 R1.bag", "MyTowel_Free_0.5_R1.bag"),
    ],
)
def test_a_misnamed_bag_is_told_its_name(workspace: Path, put: Callable[..., None], file: str, meant: str) -> None:
    put(file)
    findings = findings_of(workspace)
    finding = only(findings, "misnamed")
    path = workspace / "recordings" / file.removesuffix("/metadata.yaml")
    assert (finding.subject, finding.where) == (path.name, str(path))
    assert finding.message.endswith(f": should be {meant}")
    assert finding.hint == f"Rename it to {meant}."
    assert subjects(findings, "unexpected") == []
    path.rename(path.with_name(meant))
    assert subjects(findings_of(workspace), "misnamed") == []


def test_a_name_that_is_taken_is_not_given_again(workspace: Path, put: Callable[..., None]) -> None:
    put("FelShirt_Free_pi16_0.5_B1.bag", "FelShirt_Free_pi16_0.5_B1 (1).bag")
    finding = only(findings_of(workspace), "misnamed")
    taken = workspace / "recordings" / "FelShirt_Free_pi16_0.5_B1.bag"
    assert finding.hint == f"{taken} has that name already: keep one of the two."


def test_a_name_beyond_repair_is_told_the_nearest_of_the_tables_or_the_grammar(
    workspace: Path, put: Callable[..., None]
) -> None:
    put("FelShirt_Free_pi16_B1.bag", "holiday.bag")
    near, far = (finding for finding in findings_of(workspace) if finding.code == "misnamed")
    assert near.hint == "Did you mean FelShirt_Free_pi16_0.5_B1?"
    assert far.hint is not None
    assert far.hint.startswith("Expected <name>_<speed>")


@pytest.mark.parametrize(
    "name",
    [
        "GreenTowel_Corner_06_pi16_0.5_R1",  # another repeat
        "GreenTowel_Ruler_01_pi16_0.5_B1",  # the partner of one that has none
        "GreenTowel_Free_pi16_1_R1",  # another speed
        "GreenTowel_Free_pi8_0.5_R1",  # another swing
        "GreenTowel_Free_pi16_0.5_R2",  # another topics file
        "GreenThing_Free_pi16_0.5_R1",  # a garment of one's own
        "RedShirt_Free_pi16_0.5_R1",  # a garment of one's own, whose name is like one that has its bag
    ],
)
def test_a_new_recording_is_unexpected_and_not_misnamed(workspace: Path, put: Callable[..., None], name: str) -> None:
    put(f"{name}.bag", "RedSkirt_Free_pi16_0.5_R1.bag")
    findings = findings_of(workspace)
    assert subjects(findings, "unexpected") == [name]
    assert subjects(findings, "misnamed") == []
    assert "recordings.csv" in str(only(findings, "unexpected").hint)


def test_two_bags_of_one_recording_are_told_apart(workspace: Path, put: Callable[..., None]) -> None:
    put("a/GreenTowel_Free_pi16.0.5_R1.bag", "b/GreenTowel_Free_pi16_0.5_R1.bag", "c/GreenTowel_Free_pi16_0.5_R1.bag")
    findings = findings_of(workspace)
    bags = workspace / "recordings"
    duplicates = [finding for finding in findings if finding.code == "duplicate"]
    assert sorted(str(finding.where) for finding in duplicates) == [
        str(bags / "a/GreenTowel_Free_pi16.0.5_R1.bag"),
        str(bags / "c/GreenTowel_Free_pi16_0.5_R1.bag"),
    ]
    assert {finding.subject for finding in duplicates} == {"GreenTowel_Free_pi16_0.5_R1"}
    assert all(str(bags / "b/GreenTowel_Free_pi16_0.5_R1.bag") in finding.message for finding in duplicates)
    assert subjects(findings, "misnamed") == []


def test_an_unfinished_bag_is_unfinished_and_its_recording_missing(workspace: Path, put: Callable[..., None]) -> None:
    put("GreenTowel_Free_pi16_0.5_R1.bag.active", "x.bag.active", "crashed/crashed_0.mcap")
    findings = findings_of(workspace)
    assert subjects(findings, "unfinished") == ["GreenTowel_Free_pi16_0.5_R1", "crashed_0.mcap", "x.bag.active"]
    assert "GreenTowel_Free_pi16_0.5_R1" in subjects(findings, "missing")
    assert subjects(findings, "unexpected") == subjects(findings, "misnamed") == []


def test_table_errors_are_all_listed_and_make_no_other_findings(workspace: Path, put: Callable[..., None]) -> None:
    put(*(f"{name}.bag" for name in ALL), "camera_default_0.bag")
    table = workspace / "catalog" / "recordings.csv"
    edit(table, "1,e,d,no", "1,z,d,nope")
    edit(table, "2,e,a,no", "2,d,a,no")
    table.write_text(table.read_text("utf-8") + "RedSkirt_Free_pi16.0.5_R1,,,c,a,\n", "utf-8")
    findings = findings_of(workspace)
    errors = [finding for finding in findings if finding.code == "table-error"]
    assert [(finding.subject, finding.where) for finding in errors] == [
        ("BlackShorts_Belt_pi16_0.5_R1", f"{table}, line 2, column dvd"),
        ("RedSkirt_Free_pi16_0.5_R1", f"{table}, line 48, column recording"),
        ("BlackShorts_Belt_pi16_0.5_R1", f"{table}, line 2, column garment"),
        ("BlackShorts_Free_pi16_0.5_R1", f"{table}, line 3, column garment"),
    ]
    assert len(findings) == 4 + 6
    table.unlink()
    findings = findings_of(workspace)
    assert subjects(findings, "table-error") == ["recordings.csv"]
    assert subjects(findings, "unexpected") == [], "without a table nobody knows what to expect"


def test_recordings_across_the_view_need_the_empty_scene(workspace: Path, put: Callable[..., None]) -> None:
    put("GreenTowel_Free_pi16_0.5_B1.bag", "GreenTowel_Free_pi16_0.5_R1.bag", "My_Scarf_1_B3.bag", "My_Scarf_1_R4.bag")
    findings = findings_of(workspace)
    assert subjects(findings, "no-background") == ["GreenTowel_Free_pi16_0.5_B1", "My_Scarf_1_B3"]
    hints = [finding.hint for finding in findings if finding.code == "no-background"]
    assert hints == [
        f"Provide recordings/camera_default_{number - 1}.bag, or a row for topics file {number} in "
        "catalog/backgrounds.csv."
        for number in (1, 3)
    ]
    put("camera_default_0.bag")
    table = workspace / "catalog" / "backgrounds.csv"
    table.write_text(table.read_text("utf-8") + "3,My_Scarf_1_R4,0,1.5\n", "utf-8")
    assert subjects(findings_of(workspace), "no-background") == []
    table.write_text("topics_file,source\n1,camera_default_5\n", "utf-8")
    finding = next(finding for finding in findings_of(workspace) if finding.code == "no-background")
    assert finding.hint == (
        "Provide recordings/camera_default_5.bag, which catalog/backgrounds.csv names for topics file 1."
    )


def test_findings_come_in_the_order_of_their_codes(workspace: Path, put: Callable[..., None]) -> None:
    edit(workspace / "catalog" / "recordings.csv", "1,e,d,no", "1,z,d,no")
    put("a/My_Bag_1_R1.bag", "b/My_Bag_1_R1.bag", "My_Bag_1_B7.bag", "x.bag", "y.bag.active", "z.salvaged.bag")
    codes = list(dict.fromkeys(finding.code for finding in findings_of(workspace)))
    # the others only the verb knows: it sees the results, and opens and reads bags
    of_bags = ("orphaned", "damaged", "unindexed", "copied", "repeats-reversed", "differs-from-repeats", "unmeasured")
    assert codes == [code for code in SEVERITIES if code not in of_bags and not code.endswith("-contradicted")]


# The verbs


@pytest.fixture
def garment(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run a verb in the workspace; what a user caused is raised."""
    from garment_dataset.cli import catalog, show
    from garment_dataset.cli.lint import lint_

    app = typer.Typer()
    app.command("list")(catalog.list_)
    app.command("show")(show.show)
    app.command("lint")(lint_)
    monkeypatch.chdir(workspace / "recordings")

    def run(*arguments: str) -> Any:
        result = CliRunner().invoke(app, arguments)
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result

    return run


def test_list_has_46_rows_without_any_bag(garment: Run) -> None:
    result = garment("list")
    assert result.exit_code == 0
    header, *lines = result.stdout.splitlines()
    assert header.split()[0] == "recording"
    assert [line.split()[0] for line in lines] == ALL
    assert all(line.endswith("  missing") for line in lines)
    assert result.stderr == "46 recordings: 46 missing\n"
    towel = next(line for line in lines if line.startswith("GreenTowel_Corner_01_pi16_0.5_B1"))
    assert towel.split()[1:] == ["green", "towel", "60×36", "45", "yes", "yes", "missing"]


def test_list_says_what_is_there_and_hides_nothing(garment: Run, put: Callable[..., None]) -> None:
    put("GreenTowel_Free_pi16_0.5_R1.bag", "MyTowel_Free_0.5_R1.bag", "x.bag", "y.bag.active")
    result = garment("list", "--json")
    rows = {row["recording"]: row for row in json.loads(result.stdout)}
    assert len(rows) == 47
    assert rows["GreenTowel_Free_pi16_0.5_R1"]["state"] == "present"
    assert rows["GreenTowel_Free_pi16_0.5_R1"]["path"].endswith("recordings/GreenTowel_Free_pi16_0.5_R1.bag")
    assert rows["MyTowel_Free_0.5_R1"]["state"] == "unexpected"
    assert "2 more in" in result.stderr


def test_list_is_filtered_and_written_as_csv(garment: Run) -> None:
    result = garment("list", "--csv", "garment=GreenTowel", "axis=R", "*_Ruler_*")
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert [row["repeat"] for row in rows] == ["1", "2", "3", "4", "5"]
    assert [{name: row[name] for name in (*ROW_KEYS, "path")} for row in rows] == [
        {name: "" if value is None else str(value) for name, value in row.record().items()}
        for row in Catalog.load(THESIS).with_folder(Path("none")).select(["GreenTowel_Ruler_*"])
    ]
    with pytest.raises(FilterError, match="Did you mean garment=x"):
        garment("list", "garmet=x")


def test_show_tells_all_of_one_recording(garment: Run, put: Callable[..., None]) -> None:
    put("GreenTowel_Free_pi16_0.5_R1.bag", "camera_default_0.bag")
    result = garment("show", "GreenTowel_Free_pi16.0.5_R1.bag")
    facts = [line.split(maxsplit=1) for line in result.stdout.splitlines()]
    assert ["state", "present"] in facts
    assert ["garment", "GreenTowel (green towel, 0.6 × 0.36 m, 0.045 kg)"] in facts
    assert ["holding", "Free (at a random point)"] in facts
    assert ["partner", "GreenTowel_Free_pi16_0.5_B1 (missing)"] in facts
    assert result.stdout.splitlines()[-1].endswith("/r2_ee_to_rgb  not in the bag")
    expected = garment("show", "GreenTowel_Free_pi16_0.5_B1").stdout
    assert expected.splitlines()[-1].split() == ["/r2_ee_to_rgb", "(expected)"]
    shown = json.loads(garment("show", "GreenTowel_Free_pi16_0.5_R1", "--json").stdout)
    assert shown["background"]["path"].endswith("recordings/camera_default_0.bag")
    assert (shown["background"]["source"], shown["background"]["from_s"]) == ("camera_default_0", None)
    assert len(shown["topics"]) == 10
    assert shown["weight_kg"] == 0.045
    with pytest.raises(CatalogError, match="Did you mean GreenTowel_Free_pi16_0"):
        garment("show", "GreenTowl_Free_pi16_0.5_R1")


def test_show_tells_two_ways_of_holding_on_the_ruler_apart(garment: Run, put: Callable[..., None]) -> None:
    put("FelShirt_Ruler_pi16_1_R1.bag")
    descriptions = [
        json.loads(garment("show", f"{name}_R1", "--json").stdout)["holding_description"]
        for name in ("FelShirt_Ruler_pi16_0.5", "GreenTowel_Ruler_01_pi16_0.5", "FelShirt_Ruler_pi16_1")
    ]
    assert "FelShirt" in descriptions[0]
    assert "GreenTowel" in descriptions[1]
    assert descriptions[2] is None, "its letter stands in no table"


def test_lint_ends_with_1_and_lists_every_name_as_json(garment: Run) -> None:
    result = garment("lint", "--json")
    assert result.exit_code == 1
    report = json.loads(result.stdout)
    assert report["counts"] == {"missing": 46, "unpaired": 6}
    assert [found["subject"] for found in report["findings"] if found["code"] == "missing"] == ALL
    assert set(report["findings"][0]) == {"code", "severity", "subject", "where", "message", "hint", "target"}


def test_lint_groups_an_empty_folder_in_text(garment: Run) -> None:
    result = garment("lint")
    assert result.exit_code == 1
    assert "46 recordings: recordings holds no bag at all" in result.stdout
    assert "BlackShorts_Belt" not in result.stdout
    assert [line.strip() for line in result.stdout.splitlines() if line.startswith("    Fel")] == UNPAIRED[:1]
    assert result.stdout.splitlines()[-1] == "46 missing, 6 unpaired"


def test_lint_names_what_is_missing_once_there_is_a_bag(garment: Run, put: Callable[..., None]) -> None:
    put("FelShirt_Free_pi16.0.5_B1.bag", "camera_default_0.bag")
    lines = garment("lint").stdout.splitlines()
    assert "    recordings/FelShirt_Free_pi16.0.5_B1.bag" in lines
    assert "    BlackShorts_Belt_pi16_0.5_R1" in lines
    assert lines[-1] == "1 misnamed, 45 missing, 6 unpaired"


NAME = "GreenTowel_Free_pi16_0.5_R1"
SOUND = io.BytesIO()
BagWriter(SOUND, {}, "none").finish()
INDEX_AT = struct.pack("<Q", 13 + 4096)


@pytest.mark.parametrize(
    ("content", "code", "state", "message"),
    [
        (b"", "damaged", "empty", "the file is empty"),
        (b"PK\3\4 some archive of another kind", "damaged", "foreign", "not a ROS 1 bag"),
        (SOUND.getvalue()[:4000], "damaged", "damaged", "its index cannot be followed"),
        (SOUND.getvalue()[:13] + b"\xff" * 40, "damaged", "damaged", "its index cannot be followed"),
        (SOUND.getvalue().replace(INDEX_AT, bytes(8)), "unindexed", "unindexed", "never written"),
        (
            SOUND.getvalue().replace(INDEX_AT, b"\xff" * 8),
            "damaged",
            "cut",
            "its index would begin",
        ),
        (SOUND.getvalue() + b"???", "damaged", "cut", "cut in its index"),
    ],
)
def test_a_bag_that_is_damaged_is_marked_by_every_verb(
    garment: Run, put: Callable[..., None], workspace: Path, content: bytes, code: str, state: str, message: str
) -> None:
    put(f"{NAME}.bag", "BlueShirt_Free_pi16_0.5_R1.bag")
    assert garment("lint", "code=damaged,unindexed").exit_code == 0
    (workspace / "recordings" / f"{NAME}.bag").write_bytes(content)
    linted = garment("lint", "code=damaged,unindexed")
    assert linted.stdout.startswith(f"{code}: ")
    assert linted.stdout.splitlines()[-1] == f"1 {code}"
    assert message in linted.stdout
    listed = garment("list", "state=present")
    assert f"present, {state}" in listed.stdout
    assert f"of these bags, 1 {state}" in listed.stderr
    assert [each["damage"] for each in json.loads(garment("list", "state=present", "--json").stdout)] == [None, state]
    assert message in garment("show", NAME).stdout


def test_lint_ends_with_0_when_nothing_that_was_asked_for_is_found(garment: Run, put: Callable[..., None]) -> None:
    put("FelShirt_Free_pi16.0.5_B1.bag")
    assert garment("lint", "severity=error").exit_code == 1
    assert garment("lint", "code=misnamed", "FelShirt_*").exit_code == 1
    fine = garment("lint", "code=table-error,duplicate")
    assert fine.exit_code == 0
    assert re.fullmatch(r"no such finding among [0-9]+\n", fine.stdout), "nothing is said of what was not asked for"


def test_lint_works_where_other_verbs_stop_at_the_first_table_error(garment: Run, workspace: Path) -> None:
    edit(workspace / "catalog" / "recordings.csv", "1,e,d,no", "1,z,d,nope")
    with pytest.raises(CatalogError, match="line 2, column dvd"):
        garment("list")
    result = garment("lint", "code=table-error")
    assert "catalog/recordings.csv, line 2, column dvd" in result.stdout
    assert result.stdout.splitlines()[-1] == "2 table-error"


@pytest.mark.parametrize(
    ("term", "message"),
    [
        ("code=mising", r"expected one of table-error, misnamed, .*Did you mean code=missing\?"),
        ("severity!=eror", r"expected one of error, warning, note.*Did you mean severity!=error\?"),
        ("GreenTowl_Free_pi16_0.5_R1", r"no such recording.*Did you mean GreenTowel_Free_pi16_0\.5_R1\?"),
        ("code>1", "code is none"),
    ],
)
def test_lint_refuses_words_that_no_finding_can_have(garment: Run, term: str, message: str) -> None:
    with pytest.raises(FilterError, match=message) as caught:
        garment("lint", term)
    assert "\n" not in str(caught.value)


def test_lint_says_that_a_glob_looks_like_nothing(garment: Run, put: Callable[..., None]) -> None:
    put("camera_default_0.bag", "x.bag")
    assert garment("lint", "camera_default_0").exit_code == 0, "there is no finding of it, but there it is"
    assert garment("lint", "x").exit_code == 1, "a file that is no recording's has a finding"
    result = garment("lint", "GreenTowl*")
    assert (result.exit_code, result.stdout) == (0, "no such finding among 53\n")
    assert "no recording looks like 'GreenTowl*'; the nearest is GreenTowel_" in result.stderr
