"""Stages that take several recordings together: who is in a group, in which order, and what makes it anew."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import TYPE_CHECKING

import pytest

from garment_dataset.catalog import Catalog
from garment_dataset.engine.events import Ending
from garment_dataset.engine.graph import NodeId
from garment_dataset.engine.plan import State
from garment_dataset.errors import GarmentError
from garment_dataset.features.reading import load_features
from garment_dataset.stages import REPEATS, Group
from garment_dataset.workspace.building import build
from garment_dataset.workspace.groups import groups_of
from garment_dataset.workspace.session import Session
from tests.workspace.conftest import name_stages, put_stages, run, small_stage

if TYPE_CHECKING:
    from garment_dataset.engine.plan import Decision
    from garment_dataset.workspace import Workspace
    from tests.conftest import MakeRecording

COUNTS = """
from garment_dataset.stages import REPEATS, Column, Group, Stage, StageParams, TableSpec

COUNTS = TableSpec("counts", 1, "one recording", (
    Column("recording", "string", "", "which"), Column("rows", "int64", "1", "rows of its points")), ("recording",))


class CountsParams(StageParams):
    pass


def counts(points, params: CountsParams):
    return {"counts": COUNTS.table({"recording": list(points), "rows": [one.num_rows for one in points.values()]})}


STAGE = Stage(counts, params=CountsParams, outputs=(COUNTS,), per=PER)
"""
TOWELS, SCARF = "GreenTowel_Ruler_pi16_0.5_R_topics_file1", "MyScarf_Corner_pi16_0.5_R_topics_file1"
FIRST, SECOND, THIRD = (f"GreenTowel_Ruler_0{number}_pi16_0.5_R1" for number in (1, 2, 3))
BY_GARMENT = 'Group(("garment", "axis"))'


def with_counts(workspace: Workspace, per: str = "REPEATS") -> Workspace:
    name_stages(workspace, "counts")
    return put_stages(workspace, "counts", counts=COUNTS.replace("PER)", f"{per})"))


def decision_of(workspace: Workspace, subject: str) -> Decision:
    with Session(workspace) as session:
        return session.plan()[NodeId("counts", subject)]


def reasons_of(workspace: Workspace, subject: str) -> list[str]:
    return [str(reason) for reason in decision_of(workspace, subject).reasons]


def members(workspace: Workspace) -> dict[str, list[str]]:
    """Return the recordings that every group's table names, in its order."""
    table = load_features("counts", folder=workspace.features_dir)
    return {str(group): list(rows["recording"]) for group, rows in table.groupby("group")}


@pytest.mark.parametrize("jobs", [0, 2])
def test_repeats_are_taken_together(workspace: Workspace, jobs: int) -> None:
    found = with_counts(workspace)
    found.build(jobs=jobs)
    assert members(found) == {SCARF: ["MyScarf_Corner_pi16_0.5_R1"], TOWELS: [FIRST, SECOND]}
    towels = load_features("counts", folder=found.features_dir, group=TOWELS).iloc[0]
    assert (towels["axis"], towels["speed"], towels["swing_rad"]) == ("R", 0.5, math.pi / 16)
    assert (towels["garment"], towels["holding"]) == ("GreenTowel", "Ruler")
    path = found.features_dir / "counts" / "garment=GreenTowel" / "holding=Ruler" / f"{TOWELS}.parquet"
    assert path.is_file()
    described = json.loads((found.features_dir / "schemas.json").read_text())["counts"]
    assert [column["name"] for column in described["columns"]][:4] == ["group", "axis", "speed", "swing_rad"]


def test_all_recordings_of_a_garment_are_taken_together(workspace: Workspace, make_recording: MakeRecording) -> None:
    """What they do not share is null in the rows, and unspecified in the path."""
    found = with_counts(workspace, BY_GARMENT)
    other, across = "GreenTowel_Corner_01_pi8_0.3_R2", "GreenTowel_Corner_01_pi8_0.3_B2"
    for name in (other, across):
        make_recording(found.recordings_dir / f"{name}.bag", shift_m=0.02)
    found.build(jobs=0)
    assert members(found) == {"MyScarf_R": ["MyScarf_Corner_pi16_0.5_R1"], "GreenTowel_R": [other, FIRST, SECOND]}
    path = found.features_dir / "counts" / "garment=GreenTowel" / "holding=unspecified" / "GreenTowel_R.parquet"
    assert path.is_file()
    towel = load_features("counts", folder=found.features_dir, garment="GreenTowel")
    assert set(towel["axis"]) == {"R"}
    assert towel[["speed", "swing_rad"]].isna().all(axis=None)
    scarf = load_features("counts", folder=found.features_dir, garment="MyScarf")
    assert (scarf["speed"].tolist(), scarf["holding"].tolist()) == ([0.5], ["Corner"])


def test_a_group_is_shown_like_any_subject(workspace: Workspace) -> None:
    found = with_counts(workspace)
    shown = run(found, "dag")
    assert "points -> [counts] -> counts  (per group of equal garment, holding, swing_rad, speed, axis" in shown
    found.build(jobs=0)
    assert f"counts:{TOWELS}: fresh" in run(found, "why", TOWELS)
    assert json.loads(run(found, "status", "--json"))["counts"]["fresh"] == 3 * 3 + 2


def test_a_recording_added_or_gone_is_a_reason(workspace: Workspace, make_recording: MakeRecording) -> None:
    found = with_counts(workspace)
    found.build(jobs=0)
    bag = make_recording(found.recordings_dir / f"{THIRD}.bag", shift_m=0.02)
    assert decision_of(found, TOWELS).state is State.STALE
    assert decision_of(found, SCARF).state is State.FRESH
    events = found.build(jobs=0).events
    assert (events[NodeId("counts", TOWELS)].ending, events[NodeId("counts", SCARF)].ending) == ("built", "fresh")
    assert members(found)[TOWELS] == [FIRST, SECOND, THIRD]
    bag.unlink()
    assert reasons_of(found, TOWELS) == [f"member points of {THIRD}: gone"]
    assert found.build(jobs=0).events[NodeId("counts", TOWELS)].ending is Ending.LINKED
    assert members(found)[TOWELS] == [FIRST, SECOND]


def test_a_recording_changed_is_a_reason(workspace: Workspace, make_recording: MakeRecording) -> None:
    found = with_counts(workspace)
    found.build(jobs=0)
    bag = found.recordings_dir / f"{SECOND}.bag"
    bag.unlink()
    make_recording(bag, shift_m=0.03, frames=20)
    assert reasons_of(found, TOWELS) == [f"upstream depth_points:{SECOND}: stale"]
    with Session(found, stages=["depth_points"]) as session:
        build(session, jobs=0)
    (reason,) = reasons_of(found, TOWELS)
    assert reason.startswith(f"member points of {SECOND}: ")
    before = load_features("counts", folder=found.features_dir, group=TOWELS)["rows"].tolist()
    found.build(jobs=0)
    after = load_features("counts", folder=found.features_dir, group=TOWELS)["rows"].tolist()
    assert after == [before[0], before[1] * 20 // 24]


def test_a_recording_that_fails_is_left_out_and_said(workspace: Workspace, make_recording: MakeRecording) -> None:
    found = with_counts(workspace)
    found.build(jobs=0)
    bag = found.recordings_dir / f"{SECOND}.bag"
    whole = bag.resolve()
    bag.unlink()
    make_recording(bag, fault="zero_k")
    with Session(found, stages=["depth_points"]) as session:
        build(session, jobs=0)
    (reason,) = reasons_of(found, TOWELS)
    assert reason.startswith(f"member points of {SECOND}: ")
    assert reason.endswith(" -> left out")
    note = f"{SECOND} is left out: its points cannot be had"
    event = found.build(jobs=0).events[NodeId("counts", TOWELS)]
    assert (event.ending, event.notes) == (Ending.BUILT, (note,))
    assert members(found)[TOWELS] == [FIRST]
    assert decision_of(found, TOWELS).state is State.FRESH
    assert note in run(found, "why", TOWELS)
    bag.unlink()
    bag.symlink_to(whole)
    assert found.build(jobs=0).events[NodeId("counts", TOWELS)].ending is Ending.LINKED
    assert members(found)[TOWELS] == [FIRST, SECOND]


def test_a_group_of_which_nothing_can_be_had_is_blocked(workspace: Workspace, make_recording: MakeRecording) -> None:
    found = with_counts(workspace)
    bag = found.recordings_dir / "MyScarf_Corner_pi16_0.5_R1.bag"
    bag.unlink()
    make_recording(bag, fault="zero_k")
    events = found.build(jobs=0).events
    assert (events[NodeId("counts", SCARF)].ending, events[NodeId("counts", TOWELS)].ending) == ("blocked", "built")


def test_a_group_is_selected_as_a_whole(workspace: Workspace) -> None:
    found = with_counts(workspace)
    said = f"left out, since not all of their recordings are selected: {TOWELS}"
    with Session(found, [FIRST]) as session:
        assert [node.subject for node in session.partial_groups] == [TOWELS]
        assert NodeId("counts", TOWELS) not in session.graph
    assert said in run(found, "build", FIRST, "-j", "0")
    assert said in run(found, "status", FIRST)
    assert not (found.features_dir / "counts").exists()
    with Session(found, ["garment=GreenTowel"]) as session:
        assert NodeId("counts", TOWELS) in session.graph
        assert not session.partial_groups
    with Session.about(found, TOWELS) as session:
        assert {node.subject for node in session.graph} == {FIRST, SECOND, TOWELS}


def test_a_group_may_read_what_was_made_of_the_same_group(workspace: Workspace) -> None:
    """That comes as it is; tables of recordings come as a dict."""
    text = small_stage("total", "counts, points, params", value="counts.num_rows * 10 + len(points)", per="REPEATS")
    name_stages(workspace, "counts", "total")
    found = put_stages(workspace, "counts", "total", counts=COUNTS.replace("PER)", "REPEATS)"), total=text)
    found.build(jobs=0)
    total = load_features("total", folder=found.features_dir).set_index("group")["value"]
    assert total.to_dict() == {TOWELS: 22, SCARF: 11}


@pytest.mark.parametrize(
    ("arguments", "per", "message"),
    [
        ("counts, params", '"recording"', "'counts' is of groups by garment.*expected a stage of the same groups"),
        ("counts, params", '"position"', "'counts' is of groups by garment.*expected a stage of the same groups"),
        ("counts, params", BY_GARMENT, "'counts' is of groups by garment, holding.*expected a stage of the same"),
        ("background, params", "REPEATS", "'background' is of camera positions: found a stage of groups"),
    ],
)
def test_what_does_not_go_together_is_refused(workspace: Workspace, arguments: str, per: str, message: str) -> None:
    name_stages(workspace, "background", "counts", "other")
    counts, other = COUNTS.replace("PER)", "REPEATS)"), small_stage("other", arguments, per=per)
    with pytest.raises(GarmentError, match=f"other: table {message}"):
        Session(put_stages(workspace, "counts", "other", counts=counts, other=other))


def test_two_pipelines_may_not_mean_different_recordings_by_one_group(workspace: Workspace) -> None:
    found = with_counts(workspace, BY_GARMENT)
    text = 'recordings = ["repeat=1"]\nstages = ["decode", "depth_points", "kinematics", "counts"]\n'
    (found.pipelines_dir / "first.toml").write_text(text)
    with pytest.raises(GarmentError, match=r"stage 'counts' of GreenTowel_R with different recordings.*`variant`"):
        Session(found)
    (found.pipelines_dir / "first.toml").write_text(f'variant = "first"\n{text}')
    found.build(jobs=0)
    assert members(found)["GreenTowel_R"] == [FIRST, SECOND]
    first = load_features("counts", folder=found.features_dir, variant="first")
    assert first["recording"].tolist() == [FIRST]


def test_columns_that_the_catalog_does_not_have_are_refused(workspace: Workspace) -> None:
    with pytest.raises(GarmentError, match=r"counts: groups by 'garmet': expected columns of the catalog"):
        Session(with_counts(workspace, 'Group(("garmet",))'))


@pytest.fixture(scope="module")
def thesis() -> Catalog:
    return Catalog.load()


@pytest.mark.parametrize(
    "by", [(), ("garment",), ("garment", "axis"), ("color", "width_m", "dvd"), ("partner",), REPEATS.by]
)
def test_groups_part_the_recordings(thesis: Catalog, by: tuple[str, ...]) -> None:
    """Every recording is in one group; a group agrees in its columns, two groups do not, nor in their names."""
    groups = groups_of(thesis.rows, Group(by), "x")
    assert sorted(name for group in groups for name in group.recordings) == sorted(row.recording for row in thesis.rows)
    values = [{tuple(getattr(row, column) for column in by) for row in group.rows} for group in groups]
    assert all(len(found) == 1 for found in values)
    assert len(set.union(*values)) == len({group.name for group in groups}) == len(groups)
    assert all(list(group.recordings) == sorted(group.recordings) for group in groups)


def test_groups_are_named_by_what_they_share(thesis: Catalog) -> None:
    rows = thesis.select(["axis=R"])
    repeats = {group.name: group for group in groups_of(rows, REPEATS, "x")}
    assert len(repeats) == 26 - 4 - 4
    assert repeats[TOWELS].recordings[0] == FIRST
    garments = groups_of(rows, Group(("garment", "axis")), "x")
    assert {group.name for group in garments} == {f"{row.garment}_R" for row in rows}
    towel = next(group for group in garments if group.name == "GreenTowel_R")
    assert len(towel.rows) == 11
    assert towel.labels == {"group": "GreenTowel_R", "axis": "R", "speed": 0.5, "swing_rad": math.pi / 16}
    assert towel.partition == {"garment": "GreenTowel", "holding": "unspecified"}
    assert [group.name for group in groups_of(rows, Group(()), "x")] == ["all"]


def test_two_groups_of_one_name_are_refused(thesis: Catalog) -> None:
    """Otherwise one of them would be lost in the other."""
    colors = ["dark_green", "dark", "dark/green", "dark-green"]
    kinds = ["towel", "green_towel", "towel", "towel"]
    rows = [
        dataclasses.replace(row, color=color, garment_kind=kind)
        for row, color, kind in zip(thesis.rows, colors, kinds, strict=False)
    ]
    for pair in (rows[:2], rows[2:4]):
        with pytest.raises(GarmentError, match="counts: two groups of recordings have one name: found dark"):
            groups_of(pair, Group(("color", "garment_kind")), "counts")
