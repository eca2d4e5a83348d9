"""A workspace to be maltreated, and what an undisturbed build makes of it."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from garment_dataset.workspace import Workspace
from tests.conftest import write_recording

NAMES = ("GreenTowel_Ruler_01_pi16_0.5_R1", "GreenTowel_Ruler_02_pi16_0.5_R1", "RedSkirt_Belt_pi16_0.5_R1")
ENVIRONMENT = {**os.environ, "NO_COLOR": "1", "COLUMNS": "120"}


@dataclass(frozen=True)
class Sandbox:
    """A workspace, and the bytes that its features folder holds after an undisturbed build."""

    root: Path
    expected: dict[str, bytes]

    @property
    def private_dir(self) -> Path:
        return self.root / ".garment"

    @property
    def features_dir(self) -> Path:
        return self.root / "features"

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        """Run the command in a session of its own, as a terminal would."""
        return subprocess.Popen(
            [sys.executable, "-m", "garment_dataset", *arguments],
            cwd=self.root,
            env=ENVIRONMENT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def run(self, *arguments: str, code: int | None = 0) -> tuple[str, str]:
        process = self.start(*arguments)
        try:
            out, err = process.communicate(timeout=120)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            raise
        assert "Traceback" not in err, err
        assert code is None or process.returncode == code, (process.returncode, out[-600:], err[-600:])
        return out, err

    def build(self, *arguments: str, code: int | None = 0) -> dict[str, Any]:
        out, err = self.run("build", "--json", "-j", "0", *arguments, code=code)
        return dict(json.loads(out)) if out else {"error": err}

    def files(self) -> dict[str, bytes]:
        """Return the bytes of everything in the features folder, hidden files, too."""
        return {
            path.relative_to(self.features_dir).as_posix(): path.read_bytes()
            for path in sorted(self.features_dir.rglob("*"))
            if path.is_file()
        }

    def is_sound(self) -> None:
        """Hold the law of every drill: the next build completes, its bytes are right, nothing is left over."""
        self.build()
        found = self.files()
        assert sorted(found) == sorted(self.expected)
        differing = [name for name, content in self.expected.items() if found[name] != content]
        assert not differing
        assert not (self.private_dir / "scratch").exists()
        assert not list(self.features_dir.glob(".*"))
        self.run("verify")
        counts = json.loads(self.run("status", "--json")[0])["counts"]
        assert {state for state, count in counts.items() if count} == {"fresh"}
        assert "nothing to remove" in self.run("gc")[1]


@pytest.fixture(scope="session")
def template(tmp_path_factory: pytest.TempPathFactory) -> Sandbox:
    root = tmp_path_factory.mktemp("drill") / "template"
    workspace = Workspace.create(root)
    (workspace.pipelines_dir / "colour.toml").unlink()
    for number, name in enumerate(NAMES):
        write_recording(workspace.recordings_dir / f"{name}.bag", shift_m=0.01 * number, frames=12)
    sandbox = Sandbox(root, {})
    sandbox.build()
    found = sandbox.files()
    assert any(name.startswith("kinematics/") for name in found)
    return Sandbox(root, found)


@pytest.fixture
def built(template: Sandbox, tmp_path: Path) -> Sandbox:
    """A copy of the workspace, built."""
    shutil.copytree(template.root, tmp_path / "workspace")
    return Sandbox(tmp_path / "workspace", template.expected)


@pytest.fixture
def bare(built: Sandbox) -> Sandbox:
    """A copy of the workspace, nothing built."""
    shutil.rmtree(built.private_dir)
    shutil.rmtree(built.features_dir)
    return built
