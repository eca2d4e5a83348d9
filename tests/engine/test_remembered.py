"""What the engine remembers to save time: contents of files, an index read from footers, what results rest on."""

from __future__ import annotations

import sqlite3
import time
from typing import TYPE_CHECKING

import pytest

from garment_dataset.engine import loaded
from garment_dataset.engine.graph import NodeId
from garment_dataset.engine.loaded import ContentStates
from garment_dataset.engine.plan import State
from garment_dataset.engine.results import FORMAT, Result, StoredFile
from garment_dataset.engine.store import Store

if TYPE_CHECKING:
    from pathlib import Path

    from tests.engine.conftest import Toy


@pytest.mark.parametrize(("age_s", "reads"), [(0, 2), (3600, 1)])
def test_a_file_is_read_again_until_it_has_rested(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, age_s: int, reads: int
) -> None:
    path = tmp_path / "module.py"
    path.write_text("x = 1\n")
    asked: list[str] = []
    read, now_ns = loaded.content_state, time.time_ns

    def noting(path: str) -> str | None:
        asked.append(path)
        return read(path)

    monkeypatch.setattr(loaded, "content_state", noting)
    monkeypatch.setattr(time, "time_ns", lambda: now_ns() + age_s * 10**9)
    states = ContentStates()
    assert states(str(path)) == states(str(path)) == loaded.state_of(b"x = 1\n")
    assert len(asked) == reads
    path.write_text("x = 22\n")
    assert states(str(path)) == loaded.state_of(b"x = 22\n")
    path.unlink()
    assert states(str(path)) is None


def test_what_a_result_was_made_from_is_read_from_its_file_where_the_index_has_lost_it(toy: Toy) -> None:
    toy.build()
    toy.params["squares"] = {"factor": 2.0}
    reasons = toy.plan()[NodeId("squares", "a")].reasons
    with sqlite3.connect(toy.private_dir / "index.sqlite") as connection:
        connection.execute("UPDATE facts SET facts = '{}'")
    connection.close()
    assert toy.plan()[NodeId("squares", "a")].reasons == reasons
    assert any(reason.kind == "parameter" for reason in reasons)


def test_a_lost_index_is_read_once_and_written(toy: Toy, monkeypatch: pytest.MonkeyPatch) -> None:
    toy.build()
    (toy.private_dir / "index.sqlite").unlink()
    times: list[Store] = []
    read = Store._read_footers

    def noting(store: Store) -> None:
        times.append(store)
        read(store)

    monkeypatch.setattr(Store, "_read_footers", noting)
    store = Store(toy.private_dir, toy.features_dir)
    known = dict(store.results)
    store.prepare()
    store.close()
    assert len(times) == 1
    assert {decision.state for decision in toy.plan() if decision.node.stage != "numbers"} == {State.STALE}
    again = Store(toy.private_dir, toy.features_dir)
    assert again.results == known
    assert again.is_current
    again.close()
    assert len(times) == 1


def test_a_result_is_whole_with_the_last_of_its_tables() -> None:
    def footer(table: str, tables: tuple[str, ...] = ("a", "b")) -> dict[str, object]:
        facts = {"format": FORMAT, "stage": "s"}
        about = {"key": "k", "table": table, "tables": tables, "subject": "x", "partition": "", "facts": facts}
        return {**about, "body": "", "content": table, "labelled": table, "rows": 1, "notes": []}

    files = [StoredFile(name, 1, 2) for name in "123"]
    assert list(Result.from_footers([(files[0], footer("a"))])) == []
    found = list(Result.from_footers(zip(files, map(footer, "aba"), strict=True)))
    assert [result.outputs["a"].file for result in found] == [files[0], files[2]]
    assert all(set(result.outputs) == {"a", "b"} for result in found)
