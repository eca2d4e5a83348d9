"""Sources read ahead of the workers: each once, in order, never far, and nothing depends on it."""

from __future__ import annotations

import os
import shutil
import subprocess
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.engine.ahead import ReadAhead, ask_for
from garment_dataset.engine.options import Options

if TYPE_CHECKING:
    from tests.engine.conftest import Toy

MIB = 1 << 20


@given(sources=st.lists(st.integers(0, 9)), count=st.integers(0, 4), works=st.lists(st.integers(0, 11), max_size=20))
def test_each_is_asked_for_once_in_order_and_none_further_ahead_than_wanted(
    sources: list[int], count: int, works: list[int]
) -> None:
    order = list(dict.fromkeys(sources))
    asked: list[int] = []
    ahead = ReadAhead((Path(str(each)) for each in sources), count, lambda path, _: asked.append(int(path.name)))
    furthest = -1
    for work in works:
        ahead.came_to(Path(str(work)))
        furthest = max(furthest, order.index(work) if work in order else -1)
    if ahead._thread is not None:  # close() drops what waits
        ahead._thread.shutdown()
    ahead.close()
    places = [order.index(each) for each in asked]
    assert places == sorted(set(places))
    assert set(places) <= set(range(1, furthest + count + 1))
    if count and works and furthest >= 0:
        assert set(range(furthest + 1, min(furthest + 1 + count, len(order)))) <= set(places)


def test_what_waits_is_dropped_when_the_build_ends() -> None:
    begun, asked = threading.Event(), list[str]()

    def ask(path: Path, ended: threading.Event) -> None:
        asked.append(path.name)
        begun.set()
        assert ended.wait(30)

    ahead = ReadAhead([Path(name) for name in "abcd"], 3, ask)
    ahead.came_to(Path("a"))
    assert begun.wait(30)
    ahead.close()
    assert asked == ["b"]


def test_what_cannot_be_read_is_no_matter(tmp_path: Path) -> None:
    ask_for(tmp_path / "gone", threading.Event())
    ask_for(tmp_path, threading.Event())


def test_a_build_asks_for_what_comes_next_and_makes_the_same_bytes(toy: Toy, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    monkeypatch.setattr("garment_dataset.engine.ahead.ask_for", lambda path, _: asked.append(path.name))
    toy.source("c", "6")
    toy.build()
    assert not asked  # nobody wanted it
    plain = toy.files()
    shutil.rmtree(toy.private_dir)
    shutil.rmtree(toy.features_dir)
    toy.build_with(Options(ahead=1))
    assert asked == ["b.txt", "c.txt"]
    assert toy.files() == plain
    toy.build_with(Options(ahead=1))
    assert asked == ["b.txt", "c.txt"]  # what is fresh is not read


@pytest.mark.skipif(not hasattr(os, "posix_fadvise"), reason="the system cannot be told what comes next")
@pytest.mark.skipif(shutil.which("fincore") is None, reason="no fincore here, which says what is in the page cache")
def test_a_cold_file_is_in_memory_after_it_was_asked_for(tmp_path: Path) -> None:
    file = tmp_path / "source"
    file.write_bytes(os.urandom(16 * MIB))
    with file.open("rb") as opened:
        os.fsync(opened.fileno())
        os.posix_fadvise(opened.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    if resident_bytes(file):
        pytest.skip("this file system does not give up its pages")
    ask_for(file, threading.Event())
    deadline = time.monotonic() + 30
    while resident_bytes(file) < 16 * MIB:
        assert time.monotonic() < deadline, f"{resident_bytes(file)} bytes are in memory"
        time.sleep(0.02)


def resident_bytes(file: Path) -> int:
    return int(subprocess.check_output(["fincore", "-b", "-n", "-o", "RES", file]))
