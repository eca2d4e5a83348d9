"""Files that are cut, flipped, exchanged, moved or gone: each heals by ``garment build``, or is named by ``verify``.

The law, of :meth:`Sandbox.is_sound`: the next build completes, its bytes are those of an undisturbed build, nothing is
left over, and ``verify`` agrees.
"""

from __future__ import annotations

import os
import random
import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest

from garment_dataset.engine.artifacts import read_provenance
from tests.drills.conftest import NAMES, Sandbox

Damage = Callable[[Path, random.Random], None]


def cut(path: Path, chance: random.Random) -> None:
    rewrite(path, path.read_bytes()[: chance.randrange(path.stat().st_size)])


def flip(path: Path, chance: random.Random) -> None:
    content = bytearray(path.read_bytes())
    for _ in range(chance.randint(1, 4)):
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    rewrite(path, bytes(content))


def empty(path: Path, _: random.Random) -> None:
    rewrite(path, b"")


def garbage(path: Path, chance: random.Random) -> None:
    rewrite(path, chance.randbytes(chance.randint(1, 9000)))


def zero(path: Path, chance: random.Random) -> None:
    content = bytearray(path.read_bytes())
    start = chance.randrange(len(content))
    content[start : start + 512] = bytes(len(content[start : start + 512]))
    rewrite(path, bytes(content) if any(content[start:]) else b"0")


def exchange(path: Path, chance: random.Random) -> None:
    """Put a whole file of another recording in its place, with its times."""
    others = [other for other in parquet(path.parent.parent) if other != path]
    path.unlink()
    if others:  # the only one is left missing
        shutil.copy2(chance.choice(others), path)


def remove(path: Path, _: random.Random) -> None:
    path.unlink()


def dangle(path: Path, _: random.Random) -> None:
    path.unlink()
    path.symlink_to(path.with_name("nothing"))


def rewrite(path: Path, content: bytes) -> None:
    """Write into the very file, as a careless program would: into all hard links of it."""
    path.chmod(0o644)
    path.write_bytes(content)


DAMAGES: tuple[Damage, ...] = (cut, flip, empty, garbage, zero, exchange, remove, dangle)


def parquet(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*.parquet") if path.is_file())


def damage_some(sandbox: Sandbox, chance: random.Random) -> list[str]:
    """Damage one to three files of the store or of the features folder."""
    done = []
    for _ in range(chance.randint(1, 3)):
        folder = chance.choice([sandbox.private_dir / "objects", sandbox.features_dir])
        path, damage = chance.choice(parquet(folder)), chance.choice(DAMAGES)
        if not path.stat().st_size:
            damage = remove  # of what was emptied just before
        damage(path, chance)
        done.append(f"{damage.__name__} {path.relative_to(sandbox.root)}")
    return done


@pytest.mark.parametrize("where", ["objects", "features"])
def test_a_damaged_file_is_made_anew(built: Sandbox, where: str) -> None:
    chance = random.Random(where)
    folder = built.features_dir if where == "features" else built.private_dir / "objects"
    for damage in chance.sample(DAMAGES, 4):
        damage(chance.choice(parquet(folder)), chance)
        built.build()
        assert built.files() == built.expected, damage.__name__
    built.is_sound()


def flip_without_a_trace(path: Path) -> None:
    """Change a byte, and give the file its time back, as failing memory or a failing disk would."""
    stat = path.stat()
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    rewrite(path, bytes(content))
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))


def test_what_leaves_no_trace_is_found_by_verify_and_mended_by_the_next_build(built: Sandbox) -> None:
    path = parquet(built.features_dir / "points")[0]
    flip_without_a_trace(path)
    assert built.build()["counts"]["built"] == 0
    out, err = built.run("verify", code=1)
    assert path.name in out
    assert "2 findings" in err or "1 findings" in err
    built.is_sound()


def test_a_stage_is_not_built_on_what_is_damaged_without_a_trace(built: Sandbox) -> None:
    tables = {path: read_provenance(path) for path in parquet(built.private_dir / "objects")}
    points = {path: footer["subject"] for path, footer in tables.items() if footer["table"] == "points"}
    for path in points:
        flip_without_a_trace(path)
    shutil.rmtree(built.features_dir / "kinematics")
    for path, footer in tables.items():
        if footer["table"] == "kinematics":
            path.unlink()
    endings = {(event["stage"], event["recording"]): event["ending"] for event in built.build()["events"]}
    assert {endings["depth_points", subject] for subject in points.values()} <= {"built", "linked"}
    assert {endings["kinematics", subject] for subject in points.values()} == {"built"}
    built.is_sound()


def test_a_damaged_index_is_made_anew(built: Sandbox) -> None:
    for damage in (cut, empty, garbage):
        damage(built.private_dir / "index.sqlite", random.Random(damage.__name__))
        built.run("status")
        counts = built.build()["counts"]
        assert {state for state, count in counts.items() if count} == {"fresh"}, damage.__name__
    built.is_sound()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
def test_many_damaged_indexes(built: Sandbox, seed: int) -> None:
    chance = random.Random(seed)
    for _ in range(6):
        chance.choice([cut, flip, empty, garbage, zero, remove])(built.private_dir / "index.sqlite", chance)
        built.run("status")
        built.build()
    built.is_sound()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
def test_many_damaged_files(built: Sandbox, seed: int) -> None:
    chance = random.Random(1000 + seed)
    for _ in range(6):
        done = damage_some(built, chance)
        built.build()
        assert built.files() == built.expected, done
    built.is_sound()


def lose_private(sandbox: Sandbox) -> None:
    shutil.rmtree(sandbox.private_dir)


def lose_features(sandbox: Sandbox) -> None:
    shutil.rmtree(sandbox.features_dir)


def lose_objects(sandbox: Sandbox) -> None:
    shutil.rmtree(sandbox.private_dir / "objects")


def lose_descriptions(sandbox: Sandbox) -> None:
    for path in sandbox.features_dir.rglob("schemas.json"):
        path.unlink()


def damage_descriptions(sandbox: Sandbox) -> None:
    for path in sandbox.features_dir.rglob("schemas.json"):
        path.write_bytes(b"\xff{")


def damage_fingerprints(sandbox: Sandbox) -> None:
    for path in (sandbox.private_dir / "code").iterdir():
        path.write_text('{"entries": {}, "check": 1}')


def leave_scratch(sandbox: Sandbox) -> None:
    for folder in (sandbox.private_dir / "scratch", sandbox.features_dir / ".scratch"):
        (folder / "1f2e").mkdir(parents=True)
        (folder / "1f2e" / "half.parquet").write_bytes(b"PAR1")


def file_for_scratch(sandbox: Sandbox) -> None:
    (sandbox.private_dir / "scratch").write_text("in the way")


def damage_log(sandbox: Sandbox) -> None:
    with (sandbox.private_dir / "log.jsonl").open("ab") as file:
        file.write(b'{"build": \xff\n[]\n{"build": 5}\n{')


def damage_owner(sandbox: Sandbox) -> None:
    (sandbox.private_dir / "lock.owner").write_bytes(b"\xff\xfe")


def touch_bags(sandbox: Sandbox) -> None:
    for path in (sandbox.root / "recordings").iterdir():
        os.utime(path)


def whole_seconds(sandbox: Sandbox) -> None:
    """As a file system or an archive would that keeps no more."""
    for path in sandbox.root.rglob("*"):
        second = path.lstat().st_mtime_ns // 10**9 * 10**9
        os.utime(path, ns=(second, second), follow_symlinks=False)


def other_version(sandbox: Sandbox) -> None:
    with sqlite3.connect(sandbox.private_dir / "index.sqlite") as connection:
        connection.execute("PRAGMA user_version = 99")
        connection.execute("ALTER TABLE result RENAME TO other")


def half_written(sandbox: Sandbox) -> None:
    """As if the machine had stopped between a result's files and its row."""
    with sqlite3.connect(sandbox.private_dir / "index.sqlite") as connection:
        connection.execute("DELETE FROM result WHERE stage = 'kinematics'")


FAULTS: tuple[Callable[[Sandbox], None], ...] = (
    lose_private,
    lose_features,
    lose_objects,
    lose_descriptions,
    damage_descriptions,
    damage_fingerprints,
    leave_scratch,
    file_for_scratch,
    damage_log,
    damage_owner,
    touch_bags,
    whole_seconds,
    other_version,
    half_written,
)


def test_it_heals(built: Sandbox) -> None:
    for fault in FAULTS:
        fault(built)
        built.build()
        assert built.files() == built.expected, fault.__name__
        built.run("log")
    built.is_sound()


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_each_heals_alone(built: Sandbox, fault: Callable[[Sandbox], None]) -> None:
    fault(built)
    built.is_sound()


def test_a_copy_is_fresh(built: Sandbox, tmp_path: Path) -> None:
    shutil.copytree(built.root, tmp_path / "copy", copy_function=shutil.copyfile)
    copy = Sandbox(tmp_path / "copy", built.expected)
    report = copy.build()
    assert {name for name, count in report["counts"].items() if count} == {"fresh"}
    copy.is_sound()


def test_a_workspace_that_was_moved_is_fresh(built: Sandbox, tmp_path: Path) -> None:
    built.root.rename(tmp_path / "elsewhere")
    moved = Sandbox(tmp_path / "elsewhere", built.expected)
    assert {name for name, count in moved.build()["counts"].items() if count} == {"fresh"}
    moved.is_sound()


def test_a_renamed_bag_takes_its_results_along_and_back(built: Sandbox) -> None:
    old, new = NAMES[0], "GreenTowel_Ruler_03_pi16_0.5_R1"
    recordings = built.root / "recordings"
    (recordings / f"{old}.bag").rename(recordings / f"{new}.bag")
    assert old in built.run("status")[1]
    counts = built.build()["counts"]
    assert counts["relabelled"] >= 3
    assert not [name for name in built.files() if old in name]
    assert len(built.files()) == len(built.expected)
    (recordings / f"{new}.bag").rename(recordings / f"{old}.bag")
    built.build()
    assert built.files() == built.expected
    assert new in built.run("gc", "--delete")[0]
    built.is_sound()


def test_what_is_built_of_a_renamed_bag_is_what_a_build_from_nothing_makes(built: Sandbox) -> None:
    recordings = built.root / "recordings"
    (recordings / f"{NAMES[0]}.bag").rename(recordings / "BlueShirt_Free_pi16_0.5_R1.bag")
    built.build()
    moved = built.files()
    lose_private(built)
    lose_features(built)
    built.build()
    assert built.files() == moved


def from_nothing(sandbox: Sandbox, folder: Path) -> dict[str, bytes]:
    """Return what a build of the same recordings makes in a new workspace."""
    shutil.copytree(sandbox.root, folder / "new", ignore=shutil.ignore_patterns(".garment", "features"), symlinks=True)
    made = Sandbox(folder / "new", {})
    made.build()
    return made.files()


def test_a_deleted_bag_leaves_nothing_that_is_read_as_data(built: Sandbox, tmp_path: Path) -> None:
    from garment_dataset import load_features
    from garment_dataset.errors import DataWarning

    (built.root / "recordings" / f"{NAMES[0]}.bag").unlink()
    assert NAMES[0] in built.run("status")[1]
    assert NAMES[0] in built.run("build")[1]
    with pytest.warns(DataWarning, match=NAMES[0]):
        loaded = load_features("points", folder=built.features_dir)
    assert set(loaded["recording"]) == set(NAMES[1:])
    listed = built.run("gc")[0]
    assert f"points/garment=GreenTowel/holding=Ruler/{NAMES[0]}.parquet" in listed
    assert (built.features_dir / "points/garment=GreenTowel/holding=Ruler" / f"{NAMES[0]}.parquet").exists()
    built.run("gc", "--delete")
    Sandbox(built.root, from_nothing(built, tmp_path)).is_sound()


def test_a_folder_where_a_file_should_be_is_named_and_nothing_is_lost(built: Sandbox) -> None:
    path = parquet(built.features_dir / "points")[0]
    path.unlink()
    path.mkdir()
    (path / "precious.txt").write_text("somebody's")
    report = built.build(code=1)
    failed = [event for event in report["events"] if event["ending"] == "failed"]
    assert str(path) in failed[0]["message"]
    assert (path / "precious.txt").exists()
    shutil.rmtree(path)
    built.build()
    built.run("gc", "--delete")  # what was compared without it
    built.is_sound()


def test_a_file_where_a_folder_should_be_is_named(built: Sandbox) -> None:
    shutil.rmtree(built.private_dir)
    built.private_dir.write_text("in the way")
    _, err = built.run("build", code=1)
    assert err.startswith("garment: ")
    assert len(err.splitlines()) == 1
    built.private_dir.unlink()
    built.is_sound()


def test_an_index_that_another_program_holds_is_named(built: Sandbox) -> None:
    connection = sqlite3.connect(built.private_dir / "index.sqlite", isolation_level=None)
    connection.execute("BEGIN EXCLUSIVE")
    _, err = built.run("build", code=1)
    assert "the index is in use" in err
    assert len(err.splitlines()) == 1
    connection.execute("ROLLBACK")
    connection.close()
    built.is_sound()


def test_files_of_a_folder_that_change_places_are_another_source(tmp_path: Path) -> None:
    from garment_dataset.engine.sources import stat_source

    for name in "ab":
        (tmp_path / name).write_text(name)
        os.utime(tmp_path / name, ns=(1, 1))
    before = stat_source(tmp_path)
    (tmp_path / "a").rename(tmp_path / "c")
    (tmp_path / "b").rename(tmp_path / "a")
    (tmp_path / "c").rename(tmp_path / "b")
    assert stat_source(tmp_path) != before
