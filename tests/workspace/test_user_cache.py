"""A person's cache lies where it is told to, or where the system keeps such things."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from garment_dataset.engine.events import Ending
from garment_dataset.workspace.user_cache import user_cache_dir

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace

linux = pytest.mark.skipif(sys.platform != "linux", reason="each system has its own place")


def test_it_is_where_it_is_told_to_be(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("GARMENT_CACHE_DIR", str(tmp_path))
    assert user_cache_dir() == tmp_path
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GARMENT_CACHE_DIR", "here")
    assert user_cache_dir() == tmp_path / "here"


@linux
def test_by_default_it_is_where_the_system_keeps_such_things(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GARMENT_CACHE_DIR")
    monkeypatch.setenv("HOME", "/home/somebody")
    monkeypatch.setenv("XDG_CACHE_HOME", "/scratch/somebody")
    assert user_cache_dir() == Path("/scratch/somebody/garment-dataset")
    for nothing in ("", "relative"):
        monkeypatch.setenv("XDG_CACHE_HOME", nothing)
        assert user_cache_dir() == Path("/home/somebody/.cache/garment-dataset")


@linux
def test_where_nobody_knows_a_home_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("GARMENT_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", "~")
    assert user_cache_dir() is None


def test_a_build_leaves_there_what_other_workspaces_can_use(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("GARMENT_CACHE_DIR", str(tmp_path / "cache"))
    assert workspace.build().of(Ending.BUILT)
    assert list((tmp_path / "cache" / "code").glob("*.json"))
