"""The page that shows how to add a stage does what it says: its files are written, tested and built."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import garment_dataset
from garment_dataset.features.reading import load_features
from garment_dataset.stages import STAGES
from garment_dataset.workspace import Workspace
from tests.workspace.conftest import built

if TYPE_CHECKING:
    from collections.abc import Iterable

pytestmark = pytest.mark.skipif("lengths" in STAGES, reason="whoever made this checkout has followed the page in it")

PACKAGE = Path(garment_dataset.__file__).parent
PAGE = (Path(__file__).parents[2] / "docs" / "adding-a-stage.md").read_text("utf-8")
FILE = re.compile(r"<!-- file: (?P<path>\S+) -->\n```\w+\n(?P<text>.*?)```", re.DOTALL)


def files_of(title: str) -> dict[str, str]:
    """Return the files of a section of the page, by their paths."""
    (section,) = (text for text in PAGE.split("\n## ") if text.startswith(f"{title}\n"))
    return {found["path"]: found["text"] for found in FILE.finditer(section)}


OWN, GROUPS = files_of("In your workspace"), files_of("Several recordings at once")
INSTALLED = files_of("In a package that you install")


def write(root: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, "utf-8")


def in_process_of_its_own(arguments: Iterable[str], folder: Path, *places: Path) -> str:
    """Run Python where packages are found in some places first; return what it prints."""
    path = os.pathsep.join(map(str, (*places, PACKAGE.parent)))
    environment = {**os.environ, "PYTHONPATH": path, "NO_COLOR": "1"}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def garment(*arguments: str) -> list[str]:
    return ["-c", "from garment_dataset.cli import main; main()", *arguments]


def check_lengths(workspace: Workspace) -> None:
    lengths = load_features("lengths", folder=workspace.features_dir)["length_m"].dropna()
    assert len(lengths)
    assert lengths.between(0.4, 0.6).all()


def test_every_python_and_toml_file_of_the_page_is_named() -> None:
    """A block that no test writes would rot."""
    blocks = re.findall(r"```(?:python|toml)\n", PAGE)
    assert len(blocks) == len(OWN) + len(GROUPS) + len(INSTALLED)
    assert [*OWN] == ["stages/lengths.py", "garment.toml", "pipelines/depth.toml", "stages/test_lengths.py"]
    assert [*GROUPS] == ["stages/spread.py", "garment.toml", "pipelines/depth.toml"]


def test_a_stage_of_the_workspace(workspace: Workspace) -> None:
    write(workspace.root, OWN)
    assert built(Workspace.find(workspace.root).build(jobs=0)) > {"lengths"}
    check_lengths(workspace)
    pytest_ = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "stages"]
    assert "1 passed" in in_process_of_its_own(pytest_, workspace.root)


def test_a_stage_of_groups(workspace: Workspace) -> None:
    write(workspace.root, OWN | GROUPS)
    assert built(Workspace.find(workspace.root).build(jobs=0)) > {"lengths", "spread"}
    spread = load_features("spread", folder=workspace.features_dir, garment="GreenTowel")
    assert spread["repeats"].tolist() == [2] * 6
    assert spread["reach_std_m"].notna().all()


def test_a_stage_of_an_installed_package(workspace: Workspace, tmp_path: Path) -> None:
    source = {"src/cloth_lengths/__init__.py": "", "src/cloth_lengths/lengths.py": OWN["stages/lengths.py"]}
    write(tmp_path / "cloth-lengths", source)
    write(tmp_path, INSTALLED)
    site = tmp_path / "site"
    pip = ["-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--target", str(site)]
    in_process_of_its_own([*pip, "./cloth-lengths"], tmp_path)
    write(workspace.root, {"pipelines/depth.toml": OWN["pipelines/depth.toml"]})
    in_process_of_its_own(garment("build", "-j", "1"), workspace.root, site)
    check_lengths(workspace)
    assert "points -> [lengths] -> lengths" in in_process_of_its_own(garment("dag"), workspace.root, site)


def test_a_stage_of_this_package(workspace: Workspace, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(PACKAGE, copy / PACKAGE.name, ignore=shutil.ignore_patterns("__pycache__"))
    write(copy / PACKAGE.name, {"stages/lengths.py": OWN["stages/lengths.py"]})
    names = copy / PACKAGE.name / "stages" / "__init__.py"
    text, count = re.subn(r'(?ms)^(STAGES = \(.*?"),?\s*\)', r'\1, "lengths")', names.read_text("utf-8"))
    assert count == 1
    names.write_text(text, "utf-8")
    write(workspace.root, {"pipelines/depth.toml": OWN["pipelines/depth.toml"]})
    in_process_of_its_own(garment("build", "-j", "0"), workspace.root, copy)
    check_lengths(workspace)


@pytest.mark.parametrize("link", re.findall(r"\]\(([a-z-]+\.md)\)", PAGE))
def test_the_pages_that_it_names_are_there(link: str) -> None:
    assert (Path(__file__).parents[2] / "docs" / link).is_file()
