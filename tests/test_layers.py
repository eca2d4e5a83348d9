"""The house rules that a machine can check: imports run one way, and starting up stays light."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import garment_dataset

PACKAGE = Path(garment_dataset.__file__).parent
FLOORS = [
    {"errors"},
    {"names", "vision", "table_spec", "tables", "engine", "filters", "workspace_files"},
    {"catalog", "catalog_rows", "catalog_tables", "bag_folder", "bags", "lint"},
    {"stages"},
    {"pipelines", "building", "workspace", "features", "view", "simulate", "score"},
    {"cli"},
]
HEAVY = {"numpy", "pandas", "pyarrow", "cv2", "rosbags", "duckdb", "matplotlib", "mujoco", "blake3", "rich.console"}


def room_of(module: str) -> str:
    return module.split(".")[1] if "." in module else "__init__"


def imports_of(path: Path) -> set[str]:
    """Return the first-party modules that a file imports when it runs; those for type checkers are left out."""
    tree = ast.parse(path.read_text("utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            node.body = [ast.Pass()]
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("garment_dataset"):
            assert node.level == 0, f"{path}: relative import"
            for alias in node.names:
                found.add(f"{node.module}.{alias.name}")
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name.startswith("garment_dataset")}
    return found


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_run_one_way(path: Path) -> None:
    room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if room == "__init__":
        return
    height = {name: number for number, floor in enumerate(FLOORS) for name in floor}
    assert room in height, f"give {room} a floor in this test"
    for module in imports_of(path):
        other = room_of(module)
        assert other == room or height[other] <= height[room], f"{path.name} imports {module}, which lies above it"
    if room == "engine":
        assert {room_of(module) for module in imports_of(path)} <= {"engine", "errors"}
    if room == "vision":
        assert {room_of(module) for module in imports_of(path)} <= {"vision", "errors"}


@pytest.mark.parametrize("room", ["vision", "stages", "cli", "engine"])
def test_only_bags_and_simulate_know_rosbags(room: str) -> None:
    for path in (PACKAGE / room).rglob("*.py"):
        assert "import rosbags" not in path.read_text("utf-8")
        assert "from rosbags" not in path.read_text("utf-8")


def loaded_by(code: str) -> set[str]:
    script = f"import sys\n{code}\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
    return set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize(
    "code",
    [
        "import garment_dataset.cli",
        "import garment_dataset.stages, garment_dataset.building, garment_dataset.lint",
        "from garment_dataset.cli import app\ntry: app(['--help'])\nexcept SystemExit: pass",
    ],
)
def test_starting_up_loads_nothing_heavy(code: str) -> None:
    loaded = loaded_by(code)
    assert not loaded & HEAVY, sorted(loaded & HEAVY)
    assert "garment_dataset.cli" in loaded or "garment_dataset.stages" in loaded
