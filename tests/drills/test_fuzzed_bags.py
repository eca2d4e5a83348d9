"""Damaged recordings: bytes that lie are faults, never pixels.

The law is in :mod:`tests.drills.fuzz_law`. What no reader can notice is kept apart and counted: bytes of messages that
neither a checksum nor a second copy covers, such as raw pixels of an uncompressed bag.
"""

from __future__ import annotations

import resource
import tempfile
from collections import Counter
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING

import pytest

from tests.drills.fuzz_bags import ROS1, ROS2, Sample, make_sample
from tests.drills.fuzz_damage import Damage, damage_bytes, damage_database, damage_index
from tests.drills.fuzz_law import Outcome, judge, read
from tests.drills.fuzz_ros1 import Ros1

if TYPE_CHECKING:
    from collections.abc import Iterator

KINDS = (*ROS1, *ROS2)
MOST_GROWTH_KIB = 300 * 1024


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Sample, Outcome]]:
    """Every kind of recording, and what a whole one gives."""
    found = {}
    for kind in KINDS:
        folder = tmp_path_factory.mktemp("whole")
        sample = make_sample(kind, folder)
        found[kind] = sample, read(folder / sample.opened)
    return found


def cases(sample: Sample, numbers: range, folder: Path) -> Iterator[tuple[int, Damage]]:
    for number in numbers:
        random = Random(f"{sample.kind} {number}")
        if number % 3 == 0 and sample.kind in ROS1:
            yield number, damage_index(sample, random)
        elif number % 3 == 0 and sample.kind == "sqlite3":
            yield number, damage_database(sample, random, folder)
        else:
            yield number, damage_bytes(sample, random)


def fuzz(sample: Sample, whole: Outcome, numbers: range) -> tuple[Counter[str], list[str]]:
    """Return how many cases came out how, and those against the law."""
    counts: Counter[str] = Counter()
    wrong = []
    with tempfile.TemporaryDirectory() as root:
        for number, damage in cases(sample, numbers, Path(root)):
            folder = Path(root) / str(number)
            try:
                verdict = judge(read(sample.write(folder, damage.files)), whole)
            except Exception as error:  # noqa: BLE001 - any but a GarmentError is against the law
                verdict = f"silent: {type(error).__name__} {error}"
            if verdict == "silent" and damage.uncovered:
                verdict = "uncovered"
            elif verdict.startswith("silent"):
                wrong.append(f"{sample.kind} {number}: {verdict}: {damage.text}")
            counts[verdict] += 1
    return counts, wrong


@pytest.mark.parametrize("kind", KINDS)
def test_a_whole_recording_is_read_in_silence(recordings: dict[str, tuple[Sample, Outcome]], kind: str) -> None:
    _, whole = recordings[kind]
    assert whole.refused is None
    assert all("no gripper position" in note for note in whole.notes)
    assert "'frame': 4" in whole.rows["frames"]
    assert "'z_m': 1." in whole.rows["points"]


def test_kinds_differ_in_storage_only(recordings: dict[str, tuple[Sample, Outcome]]) -> None:
    pixels = {
        (whole.rows["depth pixels"], whole.rows["color pixels"])
        for kind, (_, whole) in recordings.items()
        if kind != "jpeg"
    }
    assert len(pixels) == 1


@pytest.mark.parametrize("kind", ROS1)
def test_taken_apart_and_put_together_a_bag_reads_the_same(
    recordings: dict[str, tuple[Sample, Outcome]], kind: str, tmp_path: Path
) -> None:
    sample, whole = recordings[kind]
    path = sample.write(tmp_path, {sample.opened: Ros1.parse(sample.files[sample.opened]).build()})
    again = read(path)
    assert (again.rows, again.notes) == (whole.rows, whole.notes)


@pytest.mark.parametrize("kind", KINDS)
def test_no_damage_passes_for_data(recordings: dict[str, tuple[Sample, Outcome]], kind: str) -> None:
    before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    counts, wrong = fuzz(*recordings[kind], range(60))
    assert not wrong, "\n".join(wrong)
    assert counts["refused"]
    assert counts["said"] or kind.startswith("mcap")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kib < MOST_GROWTH_KIB


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_no_damage_passes_for_data_in_many_cases(recordings: dict[str, tuple[Sample, Outcome]], kind: str) -> None:
    counts, wrong = fuzz(*recordings[kind], range(60, 660))
    assert not wrong, f"{counts}\n" + "\n".join(wrong)
