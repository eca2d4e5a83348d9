"""The house rules that a machine can check: imports run one way, and starting up stays light."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import garment_dataset
from garment_dataset.cli import VERBS, application

PACKAGE = Path(garment_dataset.__file__).parent
MAY_IMPORT: dict[str, set[str]] = {
    "engine": set(),
    "errors": {"engine"},
    "arrays": set(),
    "files": {"errors"},
    "interrupts": set(),
    "layout": {"errors", "files"},
    "vision": {"arrays", "errors"},
    "catalog": {"engine", "errors", "files", "layout"},
    "bags": {"errors"},
    "stages": {"arrays", "bags", "engine", "errors", "vision"},
    "features": {"arrays", "engine", "errors", "layout"},
    "workspace": {"catalog", "engine", "errors", "files", "interrupts", "layout", "stages"},
    "score": {"arrays", "errors", "features", "layout", "vision"},
    "view": {"arrays", "bags", "catalog", "errors", "features", "layout"},
    "snapshot": {"arrays", "catalog", "engine", "errors", "layout", "stages", "workspace"},
    "clouds": {"arrays", "catalog", "errors", "layout", "snapshot", "viewers", "vision"},
    "viewers": {"arrays", "bags", "catalog", "errors", "features", "files", "layout", "stages", "vision"},
    "simulate": {"catalog", "engine", "errors"},
    "report": {
        *("arrays", "bags", "catalog", "checks", "engine", "errors", "features", "layout", "stages", "view"),
        "workspace",
    },
    "doctor": {"catalog", "engine", "layout"},
    "checks": {"bags", "catalog", "engine", "errors", "files", "layout"},
    "cli": {
        *("bags", "catalog", "checks", "clouds", "doctor", "engine", "errors", "features", "files", "interrupts"),
        *("layout", "report", "score", "simulate", "snapshot", "stages", "view", "viewers", "vision", "workspace"),
    },
    "__main__": {"cli", "interrupts"},
}
"""Which rooms each room may import, beside itself: docs/architecture.md says why."""
HEAVY = {
    *("numpy", "pandas", "pyarrow", "cv2", "rosbags", "duckdb", "matplotlib", "mujoco", "blake3", "rich.console"),
    *("rerun", "mcap", "jinja2", "plotly"),
}


def module_name(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}


def room_of(module: str) -> str:
    """Return the room of a module; that of the package itself is the one whose names it shows."""
    return [*module.split("."), "garment_dataset"][1]


def imports_of(path: Path) -> set[str]:
    """Return the first-party modules that a file imports, anywhere: in functions and for type checkers, too."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            found |= {name if name in MODULES else str(node.module) for name in names}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return found & MODULES.keys()


IMPORTS = {name: imports_of(path) - {name} for name, path in MODULES.items()}


def circle_in(arrows: dict[str, set[str]]) -> list[str]:
    """Return names that lead from one to the next and back, or nothing."""
    done: set[str] = set()

    def follow(name: str, above: list[str]) -> list[str]:
        if name in above:
            return [*above[above.index(name) :], name]
        if name not in done:
            for other in sorted(arrows[name]):
                if found := follow(other, [*above, name]):
                    return found
            done.add(name)
        return []

    return next((found for name in sorted(arrows) if (found := follow(name, []))), [])


@pytest.mark.parametrize("name", [name for name in MODULES if name != "garment_dataset"])
def test_imports_run_one_way(name: str) -> None:
    room = room_of(name)
    assert room in MAY_IMPORT, f"say in this test what {room} may import"
    for other in IMPORTS[name]:
        assert room_of(other) in MAY_IMPORT[room] | {room}, f"{name} imports {other}"


def test_modules_do_not_import_each_other_in_a_circle() -> None:
    assert circle_in(IMPORTS) == []


def test_rooms_do_not_import_each_other_in_a_circle() -> None:
    rooms: dict[str, set[str]] = {room_of(name): set() for name in MODULES}
    for name, others in IMPORTS.items():
        rooms[room_of(name)] |= {room_of(other) for other in others} - {room_of(name)}
    assert circle_in(rooms) == []


def test_a_circle_would_be_found() -> None:
    assert circle_in({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c", "b"]


def test_every_arrow_that_is_allowed_is_there() -> None:
    for room, allowed in MAY_IMPORT.items():
        used = {room_of(other) for name, others in IMPORTS.items() if room_of(name) == room for other in others}
        assert allowed <= used, f"{room} does not import {allowed - used}: say so in this test"


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
        "import garment_dataset.stages, garment_dataset.workspace.session, garment_dataset.catalog.lint",
        "from garment_dataset.cli import application\ntry: application()(['--help'])\nexcept SystemExit: pass",
    ],
)
def test_starting_up_loads_nothing_heavy(code: str) -> None:
    loaded = loaded_by(code)
    assert not loaded & HEAVY, sorted(loaded & HEAVY)
    assert "garment_dataset.cli" in loaded or "garment_dataset.stages" in loaded


@pytest.mark.parametrize(("verb", "modules"), [("doctor", {"doctor"}), ("build", {"build", "status"})])
def test_a_verb_imports_no_other_verb_but_whose_parts_it_uses(verb: str, modules: set[str]) -> None:
    verbs = {f"garment_dataset.cli.{place.split('.')[0]}" for place in VERBS.values()}
    loaded = loaded_by(f"from garment_dataset.cli import application\napplication({verb!r})")
    assert loaded & verbs == {f"garment_dataset.cli.{module}" for module in modules}


@pytest.mark.parametrize("verb", [None, "no-such-verb", "--help"])
def test_without_a_known_verb_all_are_there(verb: str | None) -> None:
    assert [command.name for command in application(verb).registered_commands] == list(VERBS)
