"""``build --engine dask`` as a user meets it."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import pytest

from tests.dask_cluster import DaskCluster

if TYPE_CHECKING:
    from pathlib import Path

    from garment_dataset.workspace import Workspace
    from tests.cli.conftest import Garment

ONE = "garment=MyScarf"
STAGE = '''
"""A stage of one's own, which takes its time."""

import time
from pathlib import Path

import pyarrow as pa

from garment_dataset.stages import Stage, StageParams
from garment_dataset.engine.table import Column, TableSpec

SLOW = TableSpec("slow", 1, "one", (Column("rows", "int64", "1", "number of rows"),))


class SlowParams(StageParams):
    seconds: float = 0.0


def slow(bag: Path, frames: pa.Table, params: SlowParams):
    if params.seconds:
        bag.with_suffix(".begun").touch()
    time.sleep(params.seconds)
    return {"slow": SLOW.table({"rows": [frames.num_rows]})}


STAGE = Stage(slow, params=SlowParams, outputs=(SLOW,), sources={"bag"})
'''


def feature_bytes(workspace: Workspace) -> dict[str, bytes]:
    root = workspace.features_dir
    return {path.relative_to(root).as_posix(): path.read_bytes() for path in sorted(root.glob("**/*.parquet"))}


def add_stage(workspace: Workspace) -> None:
    (workspace.root / "stages").mkdir(exist_ok=True)
    (workspace.root / "stages" / "slow.py").write_text(STAGE)
    (workspace.root / "garment.toml").write_text('[stages]\nmodules = ["slow"]\n')
    set_params(workspace)


def set_params(workspace: Workspace, **params: object) -> None:
    lines = [f"{name} = {json.dumps(value)}" for name, value in params.items()]
    text = 'stages = ["decode", "slow"]\n\n[params.slow]\n' + "\n".join(lines) + "\n"
    (workspace.pipelines_dir / "slow.toml").write_text(text)


def test_a_cluster_makes_the_same_and_stops_when_told(workspace: Workspace, garment: Garment, tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="the extra dask is not installed")
    add_stage(workspace)
    (bag,) = workspace.recordings_dir.glob("**/MyScarf*.bag")
    shared = bag.resolve()
    bag.unlink()
    shutil.copy(shared, bag)
    garment("build", ONE, cwd=workspace.root)
    local = feature_bytes(workspace)
    shutil.rmtree(workspace.features_dir)
    shutil.rmtree(workspace.private_dir)
    folder = tmp_path / "dask"
    folder.mkdir()
    with DaskCluster(folder) as cluster:
        cluster.start_worker()
        cluster.wait_for_workers()
        options = (ONE, "--engine", "dask", "--scheduler", cluster.address)
        built = garment("build", "--json", *options, cwd=workspace.root)
        assert json.loads(built.out)["counts"]["built"] == 4
        assert feature_bytes(workspace) == local
        assert "nothing to do" in garment("build", *options, cwd=workspace.root).err

        set_params(workspace, seconds=300.0)
        command = [sys.executable, "-m", "garment_dataset", "build", *options]
        with subprocess.Popen(command, cwd=workspace.root, stderr=subprocess.PIPE, text=True) as process:
            until = time.monotonic() + 60
            while not bag.with_suffix(".begun").exists():
                assert process.poll() is None, process.communicate(timeout=60)
                assert time.monotonic() < until
                time.sleep(0.02)
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=60)
        assert process.returncode == 130
        assert said == "garment: interrupted; what was finished is kept, `garment build` goes on from there\n"
        assert feature_bytes(workspace) == local


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--scheduler", "tcp://127.0.0.1:1"), "--scheduler is for --engine dask"),
        (("--engine", "dask"), "--engine dask needs --scheduler"),
        (("--engine", "dask", "--scheduler", "tcp://127.0.0.1:1", "-j", "0"), "--jobs 0 runs in this process"),
        (("--engine", "dask", "--scheduler", "nonsense://here"), "nonsense://here: no scheduler answers: expected"),
    ],
)
def test_options_that_do_not_go_together_are_one_line(
    workspace: Workspace, garment: Garment, options: tuple[str, ...], message: str
) -> None:
    if "nonsense" in message:
        pytest.importorskip("distributed", reason="the extra dask is not installed")
    said = garment("build", *options, cwd=workspace.root, code=2).err
    assert message in said
    assert len(said.splitlines()) == 1


def test_without_the_extra_it_says_what_to_install(workspace: Workspace, garment: Garment, tmp_path: Path) -> None:
    (tmp_path / "absent").mkdir()
    (tmp_path / "absent" / "distributed.py").write_text("raise ImportError")
    options = ("--engine", "dask", "--scheduler", "tcp://127.0.0.1:1")
    said = garment("build", *options, cwd=workspace.root, code=2, package=tmp_path / "absent").err
    assert said == "garment: a cluster needs Dask. pip install 'garment-dataset[dask]'\n"
