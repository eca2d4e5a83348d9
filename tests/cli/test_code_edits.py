"""Edit the package, not a toy: what is rebuilt, through the command line, on a copy of the package."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import garment_dataset

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace
    from tests.cli.conftest import Garment

PACKAGE = Path(garment_dataset.__file__).parent


@dataclass
class Copy:
    """A copy of the package that can be edited, and a workspace built with it."""

    folder: Path
    workspace: Workspace
    garment: Garment

    def edit(self, module: str, old: str, new: str) -> None:
        path = self.folder / "garment_dataset" / module
        text = path.read_text("utf-8")
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in {module}"
        path.write_text(text.replace(old, new), "utf-8")

    def build(self) -> dict[str, set[str]]:
        """Build, and return the stages by ending."""
        ran = self.garment("build", "--json", "-j", "0", cwd=self.workspace.root, package=self.folder)
        found: dict[str, set[str]] = {}
        for event in json.loads(ran.out)["events"]:
            found.setdefault(event["ending"], set()).add(event["stage"])
        return found

    def why(self) -> str:
        name = "MyScarf_Corner_pi16_0.5_R1"
        return self.garment("why", name, cwd=self.workspace.root, package=self.folder).out


@pytest.fixture
def copy(tmp_path: Path, workspace: Workspace, garment: Garment) -> Copy:
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, tmp_path / "copy" / "garment_dataset", ignore=ignored)
    made = Copy(tmp_path / "copy", workspace, garment)
    assert made.build() == {"built": {"decode", "depth_points", "kinematics"}}
    return made


def test_a_comment_and_an_unrelated_function_rebuild_nothing(copy: Copy) -> None:
    path = copy.folder / "garment_dataset" / "vision" / "depth" / "chain.py"
    unrelated = "\n\ndef nobody_calls_this() -> int:\n    return 1\n"
    path.write_text("# a remark\n\n" + path.read_text("utf-8") + unrelated, "utf-8")
    copy.edit("stages/depth_points.py", "STAGE = Stage(", "# another remark\nSTAGE = Stage(")
    assert copy.build() == {}


@pytest.mark.parametrize(
    ("module", "old", "new", "symbol"),
    [
        # a helper more than two calls away from the stage
        ("vision/depth/chain.py", "(steps * steps).sum", "(steps**2).sum", "vision.depth.chain:_link_lengths"),
        # a module constant that one of them reads
        ("vision/depth/cloud.py", "NOISE_LEVELS = 0.64", "NOISE_LEVELS = 0.64 * 1", "vision.depth.cloud:NOISE_LEVELS"),
    ],
)
def test_a_semantic_edit_rebuilds_what_reaches_it_and_no_more(
    copy: Copy, module: str, old: str, new: str, symbol: str
) -> None:
    copy.edit(module, old, new)
    assert f"{symbol}: changed" in copy.why()
    ended = copy.build()
    assert ended["built"] == {"depth_points"}
    assert ended["fresh"] == {"decode", "kinematics"}
