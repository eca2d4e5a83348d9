"""``garment verify``, ``gc``, ``accept``, ``log``, ``why`` of what is fresh; one build at a time; scripts."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from garment_dataset.engine.artifacts import read_provenance
from garment_dataset.engine.errors import StorageError
from garment_dataset.engine.locking import write_lock
from tests.conftest import RECORDINGS

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace
    from tests.cli.conftest import Garment

NAME = RECORDINGS[2]
STAGES = ("decode", "depth_points", "kinematics")


@pytest.fixture
def built(workspace: Workspace) -> Workspace:
    workspace.build(jobs=0)
    return workspace


def counts(garment: Garment, workspace: Workspace, *arguments: str, package: Path | None = None) -> dict[str, int]:
    ran = garment("build", "--json", "-j", "0", *arguments, cwd=workspace.root, package=package)
    found: dict[str, int] = json.loads(ran.out)["counts"]
    return {name: count for name, count in found.items() if count}


def parquet(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*.parquet"))}


def test_verify_says_how_many_it_read(built: Workspace, garment: Garment) -> None:
    ran = garment("verify", "--bags", "--recompute", "3", cwd=built.root)
    objects = len(list((built.private_dir / "objects").rglob("*.parquet")))
    assert f"all {objects} objects" in ran.err
    assert "3 results came out the same once more" in ran.err
    assert not (built.private_dir / "scratch").exists()


def test_verify_names_what_is_gone_or_foreign(built: Workspace, garment: Garment) -> None:
    gone, foreign = (next((built.features_dir / table).rglob(f"{NAME}.parquet")) for table in ("points", "kinematics"))
    gone.unlink()
    foreign.unlink()
    shutil.copy(next((built.features_dir / "frames").rglob(f"{NAME}.parquet")), foreign)
    ran = garment("verify", "--json", code=1, cwd=built.root)
    found = {finding["where"]: finding["what"] for finding in json.loads(ran.out)["findings"]}
    assert set(found) == {str(gone), str(foreign)}
    counts(garment, built)
    garment("verify", cwd=built.root)


def test_verify_reads_the_bags_when_asked(built: Workspace, garment: Garment) -> None:
    bag = built.recordings_dir / f"{NAME}.bag"
    shutil.copy(bag, built.root / "other")
    bag.unlink()
    shutil.move(built.root / "other", bag)
    garment("verify", cwd=built.root)
    ran = garment("verify", "--bags", code=1, cwd=built.root)
    assert f"{NAME}.bag" in ran.out
    assert counts(garment, built) == {"fresh": 9}
    garment("verify", "--bags", cwd=built.root)


def test_recompute_finds_what_nobody_made(built: Workspace, garment: Garment) -> None:
    """A result under a key that its code and inputs do not give, as a fault of the engine would leave it."""
    import pyarrow.parquet as pq

    from garment_dataset.engine.artifacts import write_artifact
    from garment_dataset.engine.objects import file_digest
    from garment_dataset.engine.results import StoredOutput
    from garment_dataset.engine.store import Store

    store = Store(built.private_dir, built.features_dir)
    key = store.index.published()["kinematics", NAME, ""]
    result = store.results[key]
    (output,) = result.outputs.values()
    path = store.objects.path(output.file.digest)
    table = pq.read_table(path)
    wrong = table.set_column(table.column_names.index("z_m"), table.schema.field("z_m"), table["x_m"])
    scratch = built.root / "scratch.parquet"
    write_artifact(wrong, scratch, read_provenance(path))
    file, _ = store.objects.take_in(scratch, file_digest(scratch))
    changed = {"kinematics": StoredOutput(file, output.content, output.rows, output.labelled)}
    lie = type(result)(**{**vars(result), "outputs": changed, "facts": store.index.facts(key)})
    store.remember(lie)
    store.publish(lie)
    store.close()
    assert counts(garment, built) == {"fresh": 9}
    ran = garment("verify", "--recompute", "99", code=1, cwd=built.root)
    assert f"kinematics:{NAME}" in ran.out
    assert "differ" in ran.err.lower()


def test_gc_lists_first_and_removes_when_told(built: Workspace, garment: Garment) -> None:
    assert "nothing to remove" in garment("gc", cwd=built.root).err
    before = parquet(built.features_dir)
    pipeline = built.pipelines_dir / "depth.toml"
    text = pipeline.read_text()
    pipeline.write_text(text + "[params.kinematics]\nrest_frames = 7\n")
    counts(garment, built)
    pipeline.write_text(text)
    assert counts(garment, built) == {"fresh": 6, "linked": 3}
    listed = json.loads(garment("gc", "--json", cwd=built.root).out)
    assert {item["why"] for item in listed} == {f"kinematics {name}, no longer published" for name in RECORDINGS}
    assert all(item["bytes"] == Path(item["path"]).stat().st_size for item in listed)
    ran = garment("gc", "--delete", cwd=built.root)
    assert "3 files" in ran.err
    assert not any(Path(item["path"]).exists() for item in listed)
    assert parquet(built.features_dir) == before
    assert counts(garment, built) == {"fresh": 9}
    garment("verify", cwd=built.root)


def test_what_a_dropped_pipeline_left_is_named_everywhere_and_removed(built: Workspace, garment: Garment) -> None:
    pipeline = built.pipelines_dir / "depth.toml"
    text = pipeline.read_text()
    (built.pipelines_dir / "wide.toml").write_text(f'variant = "wide"\n{text}[params.kinematics]\nrest_frames = 7\n')
    counts(garment, built)
    (built.pipelines_dir / "wide.toml").unlink()
    pipeline.write_text(text.replace(', "kinematics"', ""))
    for verb in (("status",), ("build",), ("build", "-n")):
        said = garment(*verb, cwd=built.root).err
        assert "no pipeline has the variant 'wide'" in said
        assert "no pipeline makes this table" in said
    lint = garment("lint", "code=orphaned", code=1, cwd=built.root).out
    assert NAME in lint
    garment("gc", "--delete", cwd=built.root)
    assert not (built.features_dir / "variant=wide").exists()
    assert not (built.features_dir / "kinematics").exists()
    assert "orphaned" not in garment("status", cwd=built.root).err
    assert "orphaned" not in garment("lint", code=1, cwd=built.root).out


def test_no_orphans_where_the_bags_are_elsewhere_for_now(built: Workspace, garment: Garment) -> None:
    """A disk that is not mounted must not look like 46 deleted bags."""
    built.recordings_dir.rename(built.root / "unmounted")
    assert "orphaned" not in garment("status", cwd=built.root).err
    assert "nothing to remove" in garment("gc", cwd=built.root).err


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A folder with a copy of the package, to be edited."""
    import garment_dataset

    source = Path(garment_dataset.__file__).parent
    shutil.copytree(source, tmp_path / "copy" / "garment_dataset", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "copy"


def test_a_change_that_is_accepted_runs_nothing_and_is_remembered(
    workspace: Workspace, garment: Garment, package: Path
) -> None:
    counts(garment, workspace, package=package)
    before = {name: read_provenance(workspace.features_dir / name) for name in parquet(workspace.features_dir)}
    module = package / "garment_dataset" / "stages" / "kinematics.py"
    text = module.read_text("utf-8")
    edited = text.replace("def kinematics(", "_UNUSED = 1\n\n\ndef kinematics(", 1)
    first = edited.index("return {", edited.index("def kinematics("))
    module.write_text(edited[:first] + "assert _UNUSED\n    " + edited[first:])
    assert "stale" in garment("status", cwd=workspace.root, package=package).out
    refused = garment("accept", "kinematics", code=2, cwd=workspace.root, package=package)
    assert "no reason given" in refused.err
    garment("accept", "kinematics", "-m", "a constant nobody uses", cwd=workspace.root, package=package)
    assert counts(garment, workspace, package=package) == {"fresh": 9}
    why = garment("why", NAME, "kinematics", cwd=workspace.root, package=package).out
    assert "accepted as equivalent: a constant nobody uses" in why
    garment("verify", cwd=workspace.root, package=package)
    for name, old in before.items():
        new = read_provenance(workspace.features_dir / name)
        assert new["content"] == old["content"]
        assert ("accepted" in new) == name.startswith("kinematics/")
        if "accepted" in new:
            assert new["accepted"] == [
                {"code": old["facts"]["code"], "key": old["key"], "because": "a constant nobody uses"}
            ]
            assert new["key"] != old["key"]
    (workspace.private_dir / "index.sqlite").unlink()
    assert counts(garment, workspace, package=package) == {"fresh": 9}


def test_what_is_stale_for_something_else_is_not_accepted(built: Workspace, garment: Garment) -> None:
    ran = garment("accept", "all", "-m", "no reason", code=2, cwd=built.root)
    assert "nothing is stale for its code alone" in ran.err
    with (built.pipelines_dir / "depth.toml").open("a") as file:
        file.write("[params.kinematics]\nrest_frames = 7\n")
    garment("accept", "kinematics", "-m", "no reason", code=2, cwd=built.root)
    assert counts(garment, built)["built"] == 3


def test_the_log_says_what_each_build_did(built: Workspace, garment: Garment) -> None:
    garment("build", "--force", "-j", "0", cwd=built.root)
    builds: list[dict[str, Any]] = json.loads(garment("log", "--json", cwd=built.root).out)
    assert [build["counts"] for build in builds] == [{"built": 9}, {"built": 9}]
    assert set(builds[0]["code"]) == {*STAGES, "background", "silhouette", "central_curve"}
    assert all(build["seconds"] > 0 and build["failed"] == [] for build in builds)
    assert "9 built" in garment("log", "-n", "1", cwd=built.root).out


def test_why_of_a_fresh_result_says_what_it_was_made_from(built: Workspace, garment: Garment) -> None:
    said = garment("why", NAME, "kinematics", cwd=built.root).out
    for word in (
        "kinematics",
        "fresh",
        "parameter rest_frames",
        "code ",
        "library numpy",
        "library pyarrow",
        "input points",
    ):
        assert word in said
    (found,) = json.loads(garment("why", NAME, "kinematics", "--json", cwd=built.root).out)
    assert found["provenance"]["facts"]["inputs"]["points"]


def test_a_second_build_waits_and_does_nothing_twice(workspace: Workspace, garment: Garment) -> None:
    ran: list[Any] = []
    threads = [
        threading.Thread(target=lambda: ran.append(garment("build", "--json", "-j", "1", cwd=workspace.root)))
        for _ in range(3)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    built = [json.loads(each.out)["counts"].get("built", 0) for each in ran]
    assert sorted(built) == [0, 0, 9]


def test_whoever_waits_is_told_for_whom_or_leaves(workspace: Workspace, garment: Garment) -> None:
    with write_lock(workspace.private_dir, what="garment build", wait=False, tell=print):
        refused = garment("build", "--no-wait", code=4, cwd=workspace.root)
        assert f"process {os.getpid()}" in refused.err
        assert len(refused.err.splitlines()) == 1
        command = [sys.executable, "-m", "garment_dataset", "build", "-j", "0"]
        waiting = subprocess.Popen(command, cwd=workspace.root, stderr=subprocess.PIPE, text=True)
        assert waiting.stderr is not None
        first = waiting.stderr.readline()
        assert first.startswith("garment: waiting for garment build by ")
        assert f"process {os.getpid()}" in first
        garment("status", cwd=workspace.root)  # readers never wait
        time.sleep(0.2)
        assert waiting.poll() is None
    assert "9 built" in waiting.communicate(timeout=60)[1]
    assert waiting.returncode == 0


def test_a_lock_dies_with_its_owner(workspace: Workspace, garment: Garment) -> None:
    code = (
        "import sys, time; from pathlib import Path; from garment_dataset.engine.locking import write_lock\n"
        "with write_lock(Path(sys.argv[1]), what='x', wait=False, tell=print):\n"
        "    print('held', flush=True); time.sleep(99)"
    )
    command = [sys.executable, "-c", code, str(workspace.private_dir)]
    owner = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert owner.stdout is not None
    assert owner.stdout.readline() == "held\n"
    garment("build", "--no-wait", code=4, cwd=workspace.root)
    owner.kill()
    owner.communicate()
    assert counts(garment, workspace, "--no-wait") == {"built": 9}


@pytest.mark.parametrize("form", ["script", "stdin", "module"])
def test_a_script_needs_no_main_guard(workspace: Workspace, form: str) -> None:
    script = workspace.root / "features_of_mine.py"
    script.write_text(
        "from garment_dataset import Workspace\n"
        "report = Workspace.find().build(jobs=2)\n"
        "print(sorted(event.ending.value for event in report.events.values()))\n"
    )
    command = {"script": [script.name], "stdin": ["-"], "module": ["-m", script.stem]}[form]
    done = subprocess.run(
        [sys.executable, *command],
        cwd=workspace.root,
        input=script.read_text() if form == "stdin" else None,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{['built'] * 9}\n"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_workspace_that_may_not_be_written_is_one_line_but_can_be_read(
    workspace: Workspace, garment: Garment
) -> None:
    workspace.root.chmod(0o555)
    try:
        ran = garment("build", code=1, cwd=workspace.root)
        assert len(ran.err.splitlines()) == 1
        garment("status", cwd=workspace.root)
    finally:
        workspace.root.chmod(0o755)


def test_a_private_folder_that_cannot_be_made_is_one_line(workspace: Workspace, garment: Garment) -> None:
    workspace.private_dir.symlink_to("/proc/nowhere")
    ran = garment("build", code=1, cwd=workspace.root)
    assert len(ran.err.splitlines()) == 1
    assert str(workspace.private_dir) in ran.err


def test_the_engine_says_who_cannot_lock(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(StorageError, match="cannot be locked"),
        write_lock(tmp_path / "file", what="x", wait=True, tell=print),
    ):
        pass
