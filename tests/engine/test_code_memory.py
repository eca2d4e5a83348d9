"""Fingerprints that workspaces share: never a wrong one, whatever becomes of the file."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING

import pytest

from garment_dataset.engine.code import CodeCache
from garment_dataset.engine.codebase import fingerprint
from tests.engine.conftest import ROOTS

if TYPE_CHECKING:
    from pathlib import Path

    from tests.engine.conftest import Toy


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The stages whose fingerprints are computed."""
    names: list[str] = []
    compute = fingerprint.CodeBase.fingerprint

    def noted(self: fingerprint.CodeBase, name: str, **options: tuple[str, ...]) -> fingerprint.Fingerprint:
        names.append(name)
        return compute(self, name, **options)

    monkeypatch.setattr(fingerprint.CodeBase, "fingerprint", noted)
    return names


def digests(toy: Toy, workspace: Path, shared: Path | None) -> dict[str, str]:
    cache = CodeCache(workspace, ROOTS | {"toy": toy.root / "toy"}, shared)
    return {name: code.digest for name, code in cache.codes(toy.stages().values()).items()}


def test_a_second_workspace_follows_no_code(toy: Toy, tmp_path: Path, made: list[str]) -> None:
    first = digests(toy, tmp_path / "a", tmp_path / "shared")
    assert len(made) == len(first)
    assert digests(toy, tmp_path / "b", tmp_path / "shared") == first
    assert len(made) == len(first)


def test_it_keeps_the_parts_of_each_digest_for_itself(toy: Toy, tmp_path: Path) -> None:
    """A change is named by them, and the shared folder may be gone by then."""
    digests(toy, tmp_path / "a", tmp_path / "shared")
    digests(toy, tmp_path / "b", tmp_path / "shared")
    assert {file.name for file in (tmp_path / "a").iterdir()} == {file.name for file in (tmp_path / "b").iterdir()}


def test_an_edit_is_seen_though_others_remember_otherwise(toy: Toy, tmp_path: Path, made: list[str]) -> None:
    before = digests(toy, tmp_path / "a", tmp_path / "shared")
    toy.edit("helpers.py", "return a * b", "return a + b")
    made.clear()
    after = digests(toy, tmp_path / "b", tmp_path / "shared")
    assert after == digests(toy, tmp_path / "c", None)
    changed = {name for name, digest in after.items() if before[name] != digest}
    assert "squares" in changed
    toy.edit("helpers.py", "return a + b", "return a * b")
    assert digests(toy, tmp_path / "d", tmp_path / "shared") == before


@pytest.mark.parametrize("damage", ["cut", "empty", "other", "no_json", "folder"])
def test_a_damaged_file_costs_time_only(toy: Toy, tmp_path: Path, made: list[str], damage: str) -> None:
    first = digests(toy, tmp_path / "a", tmp_path / "shared")
    (file,) = (tmp_path / "shared").iterdir()
    text = file.read_text()
    if damage == "folder":
        file.unlink()
        file.mkdir()
    else:
        some = next(iter(first.values()))
        wrong = {"cut": text[: len(text) // 2], "empty": "", "other": text.replace(some, some[::-1]), "no_json": "[]"}
        file.write_text(wrong[damage])
    made.clear()
    assert digests(toy, tmp_path / "b", tmp_path / "shared") == first
    assert len(made) == len(first)


def test_a_folder_that_cannot_be_written_is_no_obstacle(toy: Toy, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert digests(toy, tmp_path / "a", tmp_path / "file" / "shared") == digests(toy, tmp_path / "b", None)


def test_what_others_wrote_meanwhile_is_kept(toy: Toy, tmp_path: Path) -> None:
    stages = list(toy.stages().values())
    roots = ROOTS | {"toy": toy.root / "toy"}
    one, two = (CodeCache(tmp_path / name, roots, tmp_path / "shared") for name in "ab")
    one.codes(stages[:1])
    two.codes(stages[:1])  # has read the file
    one.codes(stages[:2])
    two.codes(stages[:1] + stages[2:])
    (file,) = (tmp_path / "shared").iterdir()
    assert len(json.loads(file.read_text())["entries"]) == len(stages)


def test_few_files_are_kept_the_youngest(toy: Toy, tmp_path: Path) -> None:
    shared = tmp_path / "shared"
    shared.mkdir()
    for number in range(40):
        (shared / f"{number:02}.json").write_text("{}")
        os.utime(shared / f"{number:02}.json", (number, number))
    digests(toy, tmp_path / "a", shared)
    kept = sorted(file.name for file in shared.iterdir())
    assert len(kept) == 16
    assert "39.json" in kept
    assert "00.json" not in kept
