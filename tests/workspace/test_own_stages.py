"""Stages of one's own, in the workspace or in an installed package: run, followed and shown like the shipped ones."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from garment_dataset.errors import GarmentError, StageError
from garment_dataset.features.reading import load_features
from garment_dataset.workspace import Workspace
from garment_dataset.workspace.known_stages import KnownStages
from garment_dataset.workspace.session import Session
from tests.conftest import RECORDINGS
from tests.workspace.conftest import (
    HELPER,
    LENGTHS,
    built,
    edit,
    name_stages,
    put_stages,
    run,
    small_stage,
    stale,
)

CHANGED = {"own_lengths": {"code lengths_helper:in_metres: changed"}}


def check_shown(workspace: Workspace) -> None:
    """Expect the stage ``own_lengths`` everywhere, fresh, with the length that the sheet was drawn with."""
    table = load_features("own_lengths", folder=workspace.features_dir)
    assert set(table["recording"]) == set(RECORDINGS)
    assert table["length_m"].dropna().between(0.4, 0.6).all()
    assert table["length_m"].notna().any()
    assert table.attrs["units"]["length_m"] == "m"
    assert "own_lengths" in json.loads((workspace.features_dir / "schemas.json").read_text())
    assert "points -> [own_lengths] -> own_lengths" in run(workspace, "dag")
    assert "depth_points -- points --> own_lengths" in run(workspace, "dag", "--form", "mermaid")
    assert f"own_lengths:{RECORDINGS[0]}: fresh" in run(workspace, "why", RECORDINGS[0])
    counts = json.loads(run(workspace, "status", "--json"))["counts"]
    assert {state: count for state, count in counts.items() if count} == {"fresh": 4 * len(RECORDINGS)}


@pytest.mark.parametrize("jobs", [0, 2])
def test_a_stage_of_the_workspace_is_run_and_shown_like_any(with_lengths: Workspace, jobs: int) -> None:
    assert "own_lengths" in built(with_lengths.build(jobs=jobs))
    check_shown(with_lengths)


def test_its_code_is_followed_with_its_helpers(with_lengths: Workspace) -> None:
    with_lengths.build(jobs=0)
    stage, helper = (with_lengths.stages_dir / f"{name}.py" for name in ("own_lengths", "lengths_helper"))
    edit(stage, '"""How long', '# a remark\n"""How long')
    edit(helper, "def in_metres", "def other():\n    return 1\n\n\ndef in_metres")
    assert stale(with_lengths) == {}
    edit(helper, "value * factor", "value * factor * 2")
    assert stale(with_lengths) == CHANGED
    assert built(with_lengths.build(jobs=1)) == {"own_lengths"}
    assert load_features("own_lengths", folder=with_lengths.features_dir)["length_m"].dropna().between(0.8, 1.2).all()
    edit(stage, "params.factor)", "3 * params.factor)")
    assert stale(with_lengths) == {"own_lengths": {"code own_lengths:own_lengths: changed"}}


def test_an_edit_counts_in_a_process_that_goes_on(with_lengths: Workspace) -> None:
    """In a notebook what runs must be what the fingerprint was taken of, parameters and tables included."""
    with_lengths.build(jobs=0)
    stage, helper = (with_lengths.stages_dir / f"{name}.py" for name in ("own_lengths", "lengths_helper"))
    for old, new in (("value * factor", "value + factor"), ("value + factor", "value - factor")):
        edit(helper, old, new)
        assert built(with_lengths.build(jobs=0)) == {"own_lengths"}
    lengths_m = load_features("own_lengths", folder=with_lengths.features_dir)["length_m"].dropna()
    assert lengths_m.between(-0.6, -0.4).all()
    edit(stage, "factor: float = 1.0", "factor: float = 2.0")
    assert stale(with_lengths) == {"own_lengths": {"parameter factor: 1.0 -> 2.0"}}
    edit(stage, '"its length"', '"another length"')
    with_lengths.build(jobs=0)
    assert "another length" in (with_lengths.features_dir / "schemas.json").read_text()
    assert not (with_lengths.stages_dir / "__pycache__").exists()


def test_what_an_editor_leaves_is_no_module(with_lengths: Workspace) -> None:
    """Emacs marks a file that is being edited by a link to nowhere."""
    (with_lengths.stages_dir / ".#own_lengths.py").symlink_to("someone@somewhere.1")
    assert "own_lengths" in built(with_lengths.build(jobs=0))


def test_a_helper_of_another_workspace_is_not_taken(with_lengths: Workspace, tmp_path: Path) -> None:
    with_lengths.build(jobs=0)
    other = put_stages(Workspace.create(tmp_path / "other"), "own_lengths", own_lengths=GOOD)
    name_stages(other, "own_lengths")
    with pytest.raises(StageError, match="No module named 'lengths_helper'"):
        Session(other)


def test_its_parameters_are_in_the_pipeline_file(with_lengths: Workspace) -> None:
    with_lengths.build(jobs=0)
    name_stages(with_lengths, "own_lengths", params="[params.own_lengths]\nfactor = 3.0\n")
    assert stale(with_lengths) == {"own_lengths": {"parameter factor: 1.0 -> 3.0"}}
    assert "factor = 3.0" in run(with_lengths, "dag", "--params")


@pytest.fixture
def installed(workspace: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package that brings the stage ``own_lengths`` by an entry point, as pip would lay it out."""
    site = tmp_path / "site"
    package = site / "cloth_lengths"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "own_lengths.py").write_text(LENGTHS.format(helper="cloth_lengths.helper"))
    (package / "helper.py").write_text(HELPER)
    info = site / "cloth_lengths-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: cloth-lengths\nVersion: 1.2\n")
    (info / "entry_points.txt").write_text("[garment_dataset.stages]\nown_lengths = cloth_lengths.own_lengths\n")
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setenv("PYTHONPATH", str(site))
    name_stages(workspace, "own_lengths")
    return package


@pytest.mark.parametrize("jobs", [0, 2])
def test_a_stage_of_an_installed_package_is_run_shown_and_followed(
    workspace: Workspace, installed: Path, jobs: int
) -> None:
    assert "own_lengths" in built(workspace.build(jobs=jobs))
    check_shown(workspace)
    edit(installed / "own_lengths.py", "import pyarrow as pa", "import pyarrow as pa  # a remark")
    assert stale(workspace) == {}
    edit(installed / "helper.py", "value * factor", "value * factor + 1")
    assert stale(workspace) == {"own_lengths": {"code cloth_lengths.helper:in_metres: changed"}}


def test_what_an_installed_package_lends_to_a_stage_of_the_workspace_is_followed(
    workspace: Workspace, installed: Path
) -> None:
    """Whether or not a pipeline names the stage that the package brings."""
    name_stages(workspace, "mine")
    text = small_stage("mine", "points, params: Params", value="in_metres(1, 1)")
    found = put_stages(workspace, "mine", mine=f"from cloth_lengths.helper import in_metres\n{text}")
    found.build(jobs=0)
    edit(installed / "helper.py", "value * factor", "value * factor + 1")
    assert stale(found) == {"mine": {"code cloth_lengths.helper:in_metres: changed"}}


@pytest.mark.parametrize("jobs", [0, 1])
def test_what_no_pipeline_names_is_not_imported(workspace: Workspace, installed: Path, jobs: int) -> None:
    (installed / "own_lengths.py").write_text("raise RuntimeError\n")
    name_stages(workspace)
    found = put_stages(workspace, "broken", broken="raise RuntimeError\n")
    assert built(found.build(jobs=jobs)) == {"decode", "depth_points", "kinematics"}
    assert "cloth_lengths" not in sys.modules


def test_two_of_one_name_are_refused_with_both_places(with_lengths: Workspace, installed: Path) -> None:
    assert installed.is_dir()
    with pytest.raises(
        StageError, match=r"two stages are called 'own_lengths'.*own_lengths\.py and .*cloth-lengths 1\.2"
    ):
        KnownStages.of(with_lengths)


GOOD = LENGTHS.format(helper="lengths_helper")
BAD_MODULES = [
    ("absent", None, r"no module 'absent' .*absent\.py.*found lengths_helper, own_lengths.*garment new stage absent"),
    ("empty", "", r"empty\.py: a module without STAGE"),
    ("broken", "def broken(:\n", r"broken\.py: the module .* cannot be imported: found SyntaxError"),
    ("lacking", "import no_such_module\n", "ModuleNotFoundError: No module named 'no_such_module'"),
    ("slip", "import math\n\nmath.pie\n", r"slip\.py: the module .* AttributeError: module 'math' has no attribute"),
    ("number", "STAGE = 1\n", r"number\.py: STAGE is no Stage: found int"),
    ("another", GOOD, r"another\.py: another stage: expected another, found own_lengths"),
    ("lender", "from own_lengths import STAGE\n", r"lender\.py: another stage: expected lender, found own_lengths"),
    ("numpy", GOOD, r"numpy\.py: a module's name is taken: found .*numpy/__init__\.py"),
    ("json", GOOD, r"json\.py: a module's name is taken: found a module of Python's own"),
    ("garment_dataset", GOOD, r"garment_dataset\.py: a module's name is taken"),
    ("decode", GOOD, r"two stages are called 'decode': found garment_dataset and .*decode\.py"),
    ("aimless", small_stage("aimless", "points"), "aimless: the function takes no `params`"),
    ("typo", small_stage("typo", "points, params", per='"positions"'), "typo: `per` is not understood: .*positions"),
    ("text", small_stage("text", "points, params", per='Group(("garment"))'), r"Write Group\(\('garment',\)\)"),
    ("hollow", small_stage("hollow", "params", per="REPEATS"), "hollow: a stage of a group reads tables: found no"),
    ("reader", small_stage("reader", "bag, points, params", per="REPEATS"), "reader: a stage of a group reads tables"),
    ("lost", small_stage("lost", "pionts, params"), "stage 'lost' reads table 'pionts'.*No stage makes it"),
    ("circle", small_stage("circle", "circle, params"), r"depth\.toml: stages feed each other in a circle: .*circle"),
]


@pytest.mark.parametrize(("name", "text", "message"), BAD_MODULES, ids=[name for name, *_ in BAD_MODULES])
def test_what_is_no_stage_is_refused_in_one_line(
    with_lengths: Workspace, name: str, text: str | None, message: str
) -> None:
    name_stages(with_lengths, name)
    found = put_stages(with_lengths, name, **({} if text is None else {name: text}))
    with pytest.raises(GarmentError, match=message) as caught:
        Session(found)
    assert "\n" not in str(caught.value)


def test_a_function_from_elsewhere_is_refused(workspace: Workspace) -> None:
    """A worker imports the module of the function, and looks for STAGE there."""
    elsewhere = small_stage("mine", "points, params").replace("STAGE", "OTHER")
    mine = "from elsewhere import OTHER as STAGE\n"
    name_stages(workspace, "mine")
    with pytest.raises(StageError, match=r"mine\.py: STAGE stands in another module .*mine\(\) in module elsewhere"):
        Session(put_stages(workspace, "mine", mine=mine, elsewhere=elsewhere))


@pytest.mark.parametrize(("helper", "found"), [("json", "Python's own"), ("pyarrow", r"pyarrow/__init__\.py")])
def test_a_helper_that_hides_a_library_is_refused(with_lengths: Workspace, helper: str, found: str) -> None:
    (with_lengths.stages_dir / f"{helper}.py").touch()
    with pytest.raises(StageError, match=rf"stages/{helper}\.py: a module's name is taken: found .*{found}"):
        Session(with_lengths)


def test_a_folder_without_init_cannot_be_followed(with_lengths: Workspace) -> None:
    """Python imports from it all the same; so it must be refused, not left out of the fingerprint."""
    (with_lengths.stages_dir / "lengths_helper.py").unlink()
    (with_lengths.stages_dir / "lengths_helper").mkdir()
    (with_lengths.stages_dir / "lengths_helper" / "deep.py").write_text(HELPER)
    (with_lengths.stages_dir / "own_lengths.py").write_text(LENGTHS.format(helper="lengths_helper.deep"))
    with pytest.raises(GarmentError, match="lengths_helper: belongs to no installed distribution"):
        with_lengths.build(jobs=0)
    (with_lengths.stages_dir / "lengths_helper" / "__init__.py").touch()
    assert "own_lengths" in built(with_lengths.build(jobs=0))


def test_a_package_of_helpers_is_followed(with_lengths: Workspace) -> None:
    package = with_lengths.stages_dir / "helpers"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "deep.py").write_text(HELPER)
    (with_lengths.stages_dir / "own_lengths.py").write_text(LENGTHS.format(helper="helpers.deep"))
    with_lengths.build(jobs=0)
    edit(package / "deep.py", "value * factor", "value + factor")
    assert stale(with_lengths) == {"own_lengths": {"code helpers.deep:in_metres: changed"}}


def test_stages_that_feed_each_other_are_refused(workspace: Workspace) -> None:
    name_stages(workspace, "one", "two")
    one, two = small_stage("one", "two, params"), small_stage("two", "one, params")
    with pytest.raises(GarmentError, match=r"in a circle: found (one -> two -> one|two -> one -> two)"):
        Session(put_stages(workspace, "one", "two", one=one, two=two))


def test_who_makes_a_table_is_said_though_another_module_is_broken(workspace: Workspace) -> None:
    (workspace.pipelines_dir / "depth.toml").write_text('stages = ["decode", "kinematics"]\n')
    found = put_stages(workspace, "broken", "mine", broken="1 / 0\n", mine=MINE)
    with pytest.raises(GarmentError, match=r"reads table 'points'.*Add 'depth_points' or 'mine' to its stages"):
        Session(found)


def test_a_module_named_twice_is_one(with_lengths: Workspace) -> None:
    assert KnownStages.of(put_stages(with_lengths, "own_lengths", "own_lengths")).names.count("own_lengths") == 1


def test_columns_that_the_product_adds_are_refused(with_lengths: Workspace) -> None:
    edit(with_lengths.stages_dir / "own_lengths.py", '"length_m", "float64"', '"garment", "float64"')
    with pytest.raises(StageError, match="has columns that the product adds: found garment"):
        Session(with_lengths)


MINE = """
from garment_dataset.stages import Stage, StageParams
from garment_dataset.stages.depth_tables import POINTS


class MineParams(StageParams):
    pass


def mine(frames, gripper, params: MineParams):
    rows = [row for row in gripper.to_pylist() if row["stream"] == "depth"]
    columns = {column.name: [None] * len(rows) for column in POINTS.columns}
    columns |= {name: [row[name] for row in rows] for name in ("frame", "stamp_ns", "x_m", "z_m")}
    columns |= {"point": [1] * len(rows), "pixels": [9] * len(rows), "y_m": [row["y_m"] + 0.1 for row in rows]}
    return {"points": POINTS.table(columns)}


STAGE = Stage(mine, params=MineParams, outputs=(POINTS,))
"""


@pytest.fixture
def with_mine(workspace: Workspace) -> Workspace:
    """A workspace whose depth pipeline has a maker of points of its own."""
    text = 'recordings = ["axis=R"]\nstages = ["decode", "mine", "kinematics"]\n'
    (workspace.pipelines_dir / "depth.toml").write_text(text)
    return put_stages(workspace, "mine", mine=MINE)


def test_a_stage_may_stand_in_for_one_of_ours(with_mine: Workspace) -> None:
    """Whoever has a better extraction makes the table ``points``; ``kinematics`` reads it."""
    assert built(with_mine.build(jobs=0)) == {"decode", "mine", "kinematics"}
    table = load_features("kinematics", folder=with_mine.features_dir)
    gripper, point = table[table["point"] == 0], table[table["point"] == 1]
    assert (point["y_m"].to_numpy() - gripper["y_m"].to_numpy()).round(9).tolist() == [0.1] * len(point)


def test_who_stands_in_is_a_matter_of_the_pipeline_file(with_mine: Workspace) -> None:
    """Ours again, and back: users see the points of the stage that is named, and nothing is made twice."""
    points = with_mine.features_dir / "points"
    with_mine.build(jobs=0)
    theirs = load_features("points", folder=with_mine.features_dir)
    edit(with_mine.pipelines_dir / "depth.toml", '"mine"', '"depth_points"')
    assert built(with_mine.build(jobs=0)) == {"depth_points", "kinematics"}
    assert len(load_features("points", folder=with_mine.features_dir)) == 5 * len(theirs)
    edit(with_mine.pipelines_dir / "depth.toml", '"depth_points"', '"mine"')
    assert "mine" in stale(with_mine)
    assert built(with_mine.build(jobs=0)) == set()
    assert load_features("points", folder=with_mine.features_dir).equals(theirs)
    assert len(list(points.glob("**/*.parquet"))) == len(RECORDINGS)


def test_two_makers_of_one_table_stand_beside_each_other_in_variants(with_mine: Workspace) -> None:
    with_mine.build(jobs=0)
    other = 'recordings = ["axis=R"]\nstages = ["decode", "depth_points"]\n'
    (with_mine.pipelines_dir / "other.toml").write_text(other)
    with pytest.raises(GarmentError, match="by different stages: found mine and depth_points"):
        Session(with_mine)
    (with_mine.pipelines_dir / "other.toml").write_text(f'variant = "ours"\n{other}')
    assert built(with_mine.build(jobs=0)) == {"depth_points"}
    (with_mine.pipelines_dir / "other.toml").unlink()
    edit(with_mine.pipelines_dir / "depth.toml", '"mine"', '"mine", "depth_points"')
    with pytest.raises(StageError, match="table 'points' is made by two stages"):
        Session(with_mine)


def test_two_workspaces_in_one_process_keep_their_own(with_lengths: Workspace, tmp_path: Path) -> None:
    other = Workspace.create(tmp_path / "other")
    for path in with_lengths.recordings_dir.iterdir():
        (other.recordings_dir / path.name).symlink_to(path.resolve())
    helper = HELPER.replace("value * factor", "-1.0")
    name_stages(other, "own_lengths")
    other = put_stages(other, "own_lengths", own_lengths=GOOD, lengths_helper=helper)
    for _ in range(2):
        for workspace, least, most in ((with_lengths, 0.4, 0.6), (other, -1.0, -1.0)):
            workspace.build(RECORDINGS[0], jobs=0, forced=True)
            length_m = load_features("own_lengths", folder=workspace.features_dir)["length_m"].dropna()
            assert len(length_m)
            assert length_m.between(least, most).all()
            assert stale(workspace).keys() <= {"decode", "depth_points", "kinematics", "own_lengths"}


def test_the_shipped_stages_import_nothing_of_ones_own(workspace: Workspace) -> None:
    Session(workspace).store.close()
    assert "own_lengths" not in sys.modules
