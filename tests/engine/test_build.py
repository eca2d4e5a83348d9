"""What a build does and does not: the laws of the cached graph, on a toy project."""

from __future__ import annotations

import json
import os
import shutil
from typing import TYPE_CHECKING

import pyarrow.parquet as pq
import pytest

from garment_dataset.engine.artifacts import read_provenance
from garment_dataset.engine.graph import NodeId
from garment_dataset.engine.plan import State

if TYPE_CHECKING:
    from tests.engine.conftest import Toy

ALL_FRESH = {"numbers fresh": ["a", "b"], "squares fresh": ["a", "b"], "total fresh": ["a", "b"]}


def total(toy: Toy, subject: str) -> float:
    table = pq.ParquetFile(toy.features_dir / "total" / "kind=toy" / f"{subject}.parquet").read()
    (value,) = table["value"].to_pylist()
    return float(value or 0)


def reasons(toy: Toy, stage: str, subject: str) -> list[str]:
    return [str(reason) for reason in toy.plan()[NodeId(stage, subject)].reasons]


def test_a_first_build_makes_everything_and_a_second_nothing(toy: Toy) -> None:
    assert {decision.state for decision in toy.plan()} == {State.MISSING}
    report = toy.build()
    assert toy.endings(report) == {"numbers built": ["a", "b"], "squares built": ["a", "b"], "total built": ["a", "b"]}
    assert (total(toy, "a"), total(toy, "b")) == (14.0, 41.0)
    assert toy.plan().is_fresh
    assert toy.endings(toy.build()) == ALL_FRESH


def test_the_bytes_do_not_depend_on_the_workers(toy: Toy) -> None:
    toy.build(jobs=0)
    alone = toy.files()
    shutil.rmtree(toy.private_dir)
    shutil.rmtree(toy.features_dir)
    toy.build(jobs=2)
    assert toy.files() == alone
    assert len(alone) == 6


def test_nothing_of_the_machine_is_in_a_result(toy: Toy) -> None:
    toy.build()
    for content in toy.files().values():
        assert str(toy.root).encode() not in content
        assert os.uname().nodename.encode() not in content


def test_a_changed_parameter_rebuilds_what_depends_on_it(toy: Toy) -> None:
    toy.build()
    toy.params["squares"] = {"factor": 2.0}
    assert reasons(toy, "squares", "a") == ["parameter factor: 1.0 -> 2.0"]
    assert reasons(toy, "total", "a") == ["upstream squares:a: stale"]
    assert not toy.plan()[NodeId("total", "a")].certain
    report = toy.endings(toy.build())
    assert report == {"numbers fresh": ["a", "b"], "squares built": ["a", "b"], "total built": ["a", "b"]}
    assert total(toy, "a") == 28.0


def test_a_parameter_set_back_costs_nothing(toy: Toy) -> None:
    toy.build()
    before = toy.files()
    toy.params["squares"] = {"factor": 2.0}
    toy.build()
    toy.params["squares"] = {"factor": 1.0}
    assert toy.plan()[NodeId("squares", "a")].stored
    report = toy.endings(toy.build())
    assert report == {"numbers fresh": ["a", "b"], "squares linked": ["a", "b"], "total linked": ["a", "b"]}
    assert toy.files() == before


def test_an_unchanged_result_stops_the_wave(toy: Toy) -> None:
    toy.build()
    toy.edit("helpers.py", "return multiply(value, value)", "return multiply(value, value) + 0")
    assert reasons(toy, "squares", "b") == ["code toy.helpers:square: changed"]
    report = toy.endings(toy.build())
    assert report == {"numbers fresh": ["a", "b"], "squares built": ["a", "b"], "total fresh": ["a", "b"]}


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("def multiply(a, b):", "# a remark\n\n\ndef multiply(a, b):"),
        ("    return a * b", '    """Return the product."""\n    return (a * b)'),
        ('return "nobody calls this"', "return 1 / 0"),
    ],
)
def test_edits_without_effect_rebuild_nothing(toy: Toy, old: str, new: str) -> None:
    toy.build()
    toy.edit("helpers.py", old, new)
    assert toy.endings(toy.build()) == ALL_FRESH


def test_a_helper_two_calls_away_and_a_constant_rebuild_their_stages_only(toy: Toy) -> None:
    toy.build()
    toy.edit("helpers.py", "return a * b", "return 10 * a * b")
    assert toy.endings(toy.build())["squares built"] == ["a", "b"]
    assert total(toy, "a") == 140.0
    toy.edit("helpers.py", "UNIT = 1", "UNIT = 2")
    assert reasons(toy, "numbers", "a") == ["code toy.helpers:UNIT: changed"]
    assert toy.endings(toy.build())["numbers built"] == ["a", "b"]
    assert total(toy, "a") == 560.0


def test_a_changed_source_rebuilds_its_own_subject(toy: Toy) -> None:
    toy.build()
    toy.source("b", "6")
    assert toy.plan()[NodeId("numbers", "a")].state is State.FRESH
    assert reasons(toy, "numbers", "b") == ["source bag: touched since it was read"]
    report = toy.endings(toy.build())
    assert (report["numbers fresh"], report["numbers built"]) == (["a"], ["b"])
    assert total(toy, "b") == 36.0


def test_a_touched_source_with_the_same_bytes_rebuilds_nothing(toy: Toy) -> None:
    toy.build()
    os.utime(toy.root / "sources" / "a.txt", ns=(1, 1))
    assert toy.plan()[NodeId("numbers", "a")].state is State.STALE
    assert toy.endings(toy.build()) == ALL_FRESH
    assert toy.plan().is_fresh


def test_a_new_library_version_is_its_own_reason(toy: Toy, monkeypatch: pytest.MonkeyPatch) -> None:
    toy.build()
    monkeypatch.setattr("garment_dataset.engine.code.library_versions", lambda names: dict.fromkeys(names, "99.0"))
    (reason,) = toy.plan()[NodeId("numbers", "a")].reasons
    assert (reason.kind, reason.name, reason.new) == ("library", "pyarrow", "99.0")


def test_one_bad_subject_does_not_stop_the_others(toy: Toy) -> None:
    toy.source("b", "4 bad")
    report = toy.build()
    assert toy.endings(report) == {
        "numbers built": ["a"],
        "squares built": ["a"],
        "total built": ["a"],
        "numbers failed": ["b"],
        "squares blocked": ["b"],
        "total blocked": ["b"],
    }
    assert report.events[NodeId("numbers", "b")].message == "b.txt: holds the word bad"
    plan = toy.plan()
    assert plan[NodeId("numbers", "b")].state is State.FAILED
    assert plan[NodeId("total", "b")].state is State.BLOCKED


def test_a_known_failure_is_tried_again_only_when_asked(toy: Toy) -> None:
    toy.source("b", "4 bug")
    toy.build()
    again = toy.build().events[NodeId("numbers", "b")]
    assert again.seconds == 0.0
    assert again.is_repeated
    assert again.message == "ZeroDivisionError: a bug"
    retried = toy.build(retry_failed=True).events[NodeId("numbers", "b")]
    assert retried.message == "ZeroDivisionError: a bug"
    toy.source("b", "4")
    assert toy.endings(toy.build())["total built"] == ["b"]
    assert toy.plan().is_fresh


def test_a_failure_keeps_the_old_result(toy: Toy) -> None:
    toy.build()
    before = toy.files()
    toy.source("b", "bad")
    toy.build()
    assert toy.files() == before


def test_a_name_too_long_for_a_result_costs_its_own_subject_only(toy: Toy) -> None:
    """A bag may be called what its results cannot: they end in .parquet, which has four letters more."""
    longest, too_long = "n" * 247, "n" * 248
    toy.source(longest, "6")
    toy.source(too_long, "7")
    report = toy.build(jobs=1)
    assert toy.endings(report)["numbers built"] == ["a", "b", longest]
    assert "File name too long" in report.events[NodeId("numbers", too_long)].message
    assert toy.plan()[NodeId("numbers", longest)].state is State.FRESH


def test_a_worker_that_dies_costs_its_own_subject_only(toy: Toy) -> None:
    toy.source("b", "4 die")
    toy.source("c", "6")
    report = toy.build(jobs=2)
    endings = toy.endings(report)
    assert endings["numbers failed"] == ["b"]
    assert endings["total built"] == ["a", "c"]
    assert "died twice" in report.events[NodeId("numbers", "b")].message


def test_a_source_that_changes_meanwhile_is_not_published(toy: Toy) -> None:
    toy.source("b", "4 grow")
    report = toy.build()
    assert "changed while it was read" in report.events[NodeId("numbers", "b")].message
    assert not (toy.features_dir / "numbers" / "kind=toy" / "b.parquet").exists()


def test_a_source_that_was_only_touched_meanwhile_is_tried_again(toy: Toy) -> None:
    toy.source("b", "4 touch")
    report = toy.build()
    assert "changed while it was read" in report.events[NodeId("numbers", "b")].message
    assert toy.plan()[NodeId("numbers", "b")].state is State.MISSING
    assert toy.endings(toy.build())["total built"] == ["b"]


def test_what_a_stage_left_out_is_kept_with_the_result(toy: Toy) -> None:
    toy.source("b", "4 skip")
    assert toy.build().events[NodeId("numbers", "b")].notes == ("one word skipped",)
    assert toy.build().events[NodeId("numbers", "b")].notes == ("one word skipped",)


def test_a_deleted_or_damaged_feature_file_is_linked_again(toy: Toy) -> None:
    toy.build()
    before = toy.files()
    path = toy.features_dir / "squares" / "kind=toy" / "a.parquet"
    path.unlink()
    assert reasons(toy, "squares", "a") == ["output not where users look"]
    other = toy.features_dir / "squares" / "kind=toy" / "b.parquet"
    other.unlink()
    other.write_bytes(b"overwritten")
    assert toy.endings(toy.build())["squares linked"] == ["a", "b"]
    assert toy.files() == before


def test_the_index_is_rebuilt_from_the_footers(toy: Toy) -> None:
    toy.params["squares"] = {"factor": 2.0}
    toy.build()
    toy.params["squares"] = {}
    toy.build()
    (toy.private_dir / "index.sqlite").unlink()
    decision = toy.plan()[NodeId("numbers", "a")]  # what the sources were is in no footer: they are read once more
    assert (decision.state, decision.certain) == (State.STALE, False)
    report = toy.endings(toy.build())
    assert report == ALL_FRESH
    toy.params["squares"] = {"factor": 2.0}
    assert toy.endings(toy.build())["squares linked"] == ["a", "b"]


def test_a_lost_store_is_built_anew(toy: Toy) -> None:
    toy.build()
    before = toy.files()
    shutil.rmtree(toy.private_dir)
    assert toy.endings(toy.build())["total built"] == ["a", "b"]
    assert toy.files() == before


def test_an_object_that_is_lost_is_made_again_when_it_is_needed(toy: Toy) -> None:
    toy.build()
    before = toy.files()
    shutil.rmtree(toy.private_dir / "objects")
    shutil.rmtree(toy.features_dir)
    toy.build()
    assert toy.files() == before


def test_an_object_that_is_lost_is_read_where_it_is_published(toy: Toy) -> None:
    toy.build()
    shutil.rmtree(toy.private_dir / "objects")
    toy.params["squares"] = {"factor": 2.0}
    assert toy.endings(toy.build())["total built"] == ["a", "b"]
    assert total(toy, "a") == 28.0


def test_force_runs_everything_and_changes_no_byte(toy: Toy) -> None:
    toy.build()
    before = toy.files()
    assert toy.endings(toy.build(forced=True))["numbers built"] == ["a", "b"]
    assert toy.files() == before


def test_a_moved_project_is_still_fresh(toy: Toy) -> None:
    toy.build()
    shutil.move(toy.root / "sources", toy.root / "elsewhere")
    (toy.root / "sources").symlink_to(toy.root / "elsewhere")
    assert toy.endings(toy.build()) == ALL_FRESH


def test_no_rubbish_is_left(toy: Toy) -> None:
    toy.source("b", "4 bad")
    toy.build(jobs=2)
    assert list(toy.private_dir.glob("scratch/*")) == []
    assert list(toy.features_dir.rglob(".*")) == []


def test_a_footer_says_all_a_result_was_made_from(toy: Toy) -> None:
    toy.params["squares"] = {"factor": 2.0}
    toy.build()
    footer = read_provenance(toy.features_dir / "squares" / "kind=toy" / "a.parquet")
    assert (footer["table"], footer["subject"], footer["rows"]) == ("squares", "a", 3)
    assert footer["facts"]["params"] == {"factor": 2.0}
    assert set(footer["facts"]["libraries"]) == {"pyarrow", "pydantic"} & set(footer["facts"]["libraries"]) | {
        "pyarrow"
    }
    numbers = read_provenance(toy.features_dir / "numbers" / "kind=toy" / "a.parquet")
    assert footer["facts"]["inputs"] == {"numbers": numbers["content"]}
    assert json.loads(json.dumps(footer)) == footer


def test_code_edited_while_a_stage_runs_is_not_credited(toy: Toy, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setattr("garment_dataset.engine.code.CodeCache.is_as_read", lambda *_: False)
        report = toy.build()
    assert "edited during the build" in report.events[NodeId("numbers", "a")].message
    assert toy.files() == {}
    assert list(toy.private_dir.glob("scratch/*")) == []
    # whether it was a remark that was edited, or the edit was taken back: nothing is wrong with the stage
    assert toy.endings(toy.build())["total built"] == ["a", "b"]
