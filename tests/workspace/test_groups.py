"""Stages that take several recordings together: who is in a group, in which order, and what makes it anew."""

from __future__ import annotations

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
from garment_dataset.workspace import Workspace
from garment_dataset.workspace.groups import groups_of
from garment_dataset.workspace.session import Session
from tests.workspace.conftest import name_stages

if TYPE_CHECKING:
    from garment_dataset.engine.plan import Decision
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
TOWELS = "GreenTowel_Ruler_pi16_0.5_R_topics_file1"
FIRST, SECOND, THIRD = (f"GreenTowel_Ruler_0{number}_pi16_0.5_R1" for number in (1, 2, 3))


def with_counts(workspace: Workspace, per: str = "REPEATS") -> Workspace:
    (workspace.root / "stages").mkdir(exist_ok=True)
    (workspace.root / "stages" / "counts.py").write_text(COUNTS.replace("PER)", f"{per})"))
    (workspace.root / "garment.toml").write_text('[stages]\nmodules = ["counts"]\n')
    name_stages(workspace, "counts")
    return Workspace.find(workspace.root)


def decision_of(workspace: Workspace, subject: str) -> Decision:
    with Session(workspace) as session:
        return session.plan()[NodeId("counts", subject)]


def test_repeats_are_taken_together(workspace: Workspace) -> None:
    found = with_counts(workspace)
    found.build(jobs=2)
    table = load_features("counts", folder=found.features_dir)
    assert table.groupby("group")["recording"].apply(list).to_dict() == {
        "MyScarf_Corner_pi16_0.5_R_topics_file1": ["MyScarf_Corner_pi16_0.5_R1"],
        TOWELS: [FIRST, SECOND],
    }
    towels = table[table["group"] == TOWELS].iloc[0]
    assert (towels["axis"], towels["speed"], towels["garment"], towels["holding"]) == ("R", 0.5, "GreenTowel", "Ruler")
    path = found.features_dir / "counts" / "garment=GreenTowel" / "holding=Ruler" / f"{TOWELS}.parquet"
    assert path.is_file()


def test_a_recording_added_changed_or_gone_is_a_reason(workspace: Workspace, make_recording: MakeRecording) -> None:
    found = with_counts(workspace)
    found.build(jobs=0)
    bag = make_recording(found.recordings_dir / f"{THIRD}.bag", shift_m=0.02)
    assert decision_of(found, TOWELS).state is State.STALE
    assert found.build(jobs=0).events[NodeId("counts", TOWELS)].ending is Ending.BUILT
    rows = load_features("counts", folder=found.features_dir, group=TOWELS)
    assert list(rows["recording"]) == [FIRST, SECOND, THIRD]
    bag.unlink()
    assert [str(reason) for reason in decision_of(found, TOWELS).reasons] == [f"member points of {THIRD}: gone"]
    assert found.build(jobs=0).events[NodeId("counts", TOWELS)].ending is Ending.LINKED


def test_a_recording_that_fails_is_left_out_and_said(workspace: Workspace, make_recording: MakeRecording) -> None:
    found = with_counts(workspace)
    make_recording(found.recordings_dir / f"{THIRD}.bag", fault="zero_k")
    event = found.build(jobs=0).events[NodeId("counts", TOWELS)]
    assert (event.ending, event.notes) == (
        Ending.BUILT,
        (f"{THIRD} is left out: its points cannot be had",),
    )


def test_a_group_is_selected_as_a_whole(workspace: Workspace) -> None:
    found = with_counts(workspace)
    with Session(found, [FIRST]) as session:
        assert [node.subject for node in session.partial_groups] == [TOWELS]
        assert NodeId("counts", TOWELS) not in session.graph
    with Session(found, ["garment=GreenTowel"]) as session:
        assert NodeId("counts", TOWELS) in session.graph
        assert not session.partial_groups
    with Session.about(found, TOWELS) as session:
        assert NodeId("counts", TOWELS) in session.graph


def test_groups_are_named_by_what_they_share(thesis: Catalog) -> None:
    rows = thesis.select(["axis=R"])
    repeats = {group.name: group for group in groups_of(rows, REPEATS, "x")}
    assert len(repeats) == 26 - 4 - 4
    assert repeats["GreenTowel_Ruler_pi16_0.5_R_topics_file1"].recordings[0] == FIRST
    garments = groups_of(rows, Group(("garment", "axis")), "x")
    assert [group.name for group in garments] == sorted({f"{row.garment}_R" for row in rows})
    towel = next(group for group in garments if group.name == "GreenTowel_R")
    assert len(towel.rows) == 11
    assert towel.labels == {"group": "GreenTowel_R", "axis": "R", "speed": 0.5, "swing_rad": math.pi / 16}
    assert towel.partition == {"garment": "GreenTowel", "holding": "unspecified"}
    assert list(towel.recordings) == sorted(towel.recordings)


@pytest.fixture
def thesis() -> Catalog:
    return Catalog.load()


def test_columns_that_the_catalog_does_not_have_are_refused(workspace: Workspace) -> None:
    with pytest.raises(GarmentError, match=r"groups by 'garmet'.*expected columns of the catalog"):
        Session(with_counts(workspace, 'Group(("garmet",))'))


def test_a_group_reads_no_bag(workspace: Workspace) -> None:
    with_counts(workspace)
    path = workspace.root / "stages" / "counts.py"
    path.write_text(path.read_text().replace("def counts(points", "def counts(bag, points"))
    with pytest.raises(GarmentError, match="a stage of a group reads tables: found argument 'bag'"):
        Session(Workspace.find(workspace.root))
