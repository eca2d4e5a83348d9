"""A built wheel works away from the checkout."""

from __future__ import annotations

import os
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "-w", str(folder)]
    subprocess.run([*command, str(ROOT)], check=True, capture_output=True)
    (built,) = folder.glob("*.whl")
    return built


def run(command: list[str], folder: Path, **environment: str) -> str:
    done = subprocess.run(
        command, cwd=folder, env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_wheel_carries_the_catalog_and_pipelines(wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        archive.extractall(tmp_path / "installed")
    assert "garment_dataset/py.typed" in names
    assert {f"garment_dataset/report/{name}" for name in ("templates/index.html", "static/report.js")} <= {*names}
    assert not [name for name in names if name.startswith(("tests/", "catalog/"))]
    garment = [sys.executable, "-c", "from garment_dataset.cli import main; main()"]
    path = str(tmp_path / "installed")
    where = [sys.executable, "-c", "import garment_dataset; print(garment_dataset.__file__)"]
    assert run(where, tmp_path, PYTHONPATH=path).startswith(path)
    run([*garment, "init", "ws"], tmp_path, PYTHONPATH=path)
    listed = run([*garment, "list", "--csv"], tmp_path / "ws", PYTHONPATH=path)
    assert len(listed.splitlines()) == 47
    assert "depth_points" in run([*garment, "dag"], tmp_path / "ws", PYTHONPATH=path)


@pytest.mark.slow
def test_a_wheel_installs_into_an_empty_environment(wheel: Path, tmp_path: Path) -> None:
    venv.create(tmp_path / "env", with_pip=True)
    scripts = tmp_path / "env" / "bin"
    run([str(scripts / "python"), "-m", "pip", "install", "--quiet", str(wheel)], tmp_path, PYTHONPATH="")
    garment = str(scripts / "garment")
    run([garment, "init", "ws"], tmp_path, PYTHONPATH="")
    assert len(run([garment, "list", "--csv"], tmp_path / "ws", PYTHONPATH="").splitlines()) == 47
    assert "decode" in run([garment, "dag"], tmp_path / "ws", PYTHONPATH="")
