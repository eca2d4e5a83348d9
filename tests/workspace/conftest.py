from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from typer.testing import CliRunner

from garment_dataset.cli import application
from garment_dataset.engine.events import Ending
from garment_dataset.engine.plan import State
from garment_dataset.workspace import Workspace
from garment_dataset.workspace.session import Session

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.engine.events import Report

LENGTHS = '''
"""How long the garment is that the points of each frame divide."""

import pyarrow as pa

from garment_dataset.stages import FRAME, STAMP, Column, Stage, StageParams, TableSpec
from {helper} import in_metres

LENGTHS = TableSpec(
    "own_lengths", 1, "one frame", (FRAME, STAMP, Column("length_m", "float64", "m", "its length", True)), ("frame",)
)


class LengthsParams(StageParams):
    factor: float = 1.0


def own_lengths(points: pa.Table, params: LengthsParams):
    first = points.filter(pa.compute.equal(points["point"], 1))
    length = [in_metres(value, params.factor) for value in first["garment_length_m"].to_pylist()]
    columns = {{name: first[name] for name in ("frame", "stamp_ns")}}
    return {{"own_lengths": LENGTHS.table({{**columns, "length_m": length}})}}


STAGE = Stage(own_lengths, params=LengthsParams, outputs=(LENGTHS,))
'''
HELPER = "def in_metres(value, factor):\n    return None if value is None else value * factor\n"

SMALL = """
from garment_dataset.stages import REPEATS, Column, Group, Stage, StageParams, TableSpec

TABLE = TableSpec("NAME", 1, "one value", (Column("value", "float64", "1", "whatever is said", True),))


class Params(StageParams):
    KNOBS


def NAME(ARGUMENTS):
    return {"NAME": TABLE.table({"value": [float(VALUE)]})}


STAGE = Stage(NAME, params=Params, outputs=(TABLE,), per=PER)
"""


def small_stage(name: str, arguments: str, *, value: str = "1", per: str = '"recording"', knobs: str = "pass") -> str:
    """Return a module whose stage makes a table of one value, named as itself."""
    text = SMALL.replace("NAME", name).replace("ARGUMENTS", arguments).replace("VALUE", value)
    return text.replace("PER)", f"{per})").replace("KNOBS", knobs)


def put_stages(workspace: Workspace, *modules: str, **files: str) -> Workspace:
    """Write modules into the folder stages/, have garment.toml name some of them, and return the workspace anew."""
    folder = workspace.root / "stages"
    folder.mkdir(exist_ok=True)
    for name, text in files.items():
        (folder / f"{name}.py").write_text(text)
    (workspace.root / "garment.toml").write_text(f"[stages]\nmodules = {list(modules)}\n")
    return Workspace.find(workspace.root)


def name_stages(workspace: Workspace, *stages: str, variant: str = "", params: str = "") -> None:
    """Have the depth pipeline name further stages."""
    names = ["decode", "depth_points", "kinematics", *stages]
    variant = f'variant = "{variant}"\n' if variant else ""
    text = f'recordings = ["axis=R"]\nstages = {names}\n{variant}{params}'.replace("'", '"')
    (workspace.pipelines_dir / "depth.toml").write_text(text)


@pytest.fixture(autouse=True)
def forget_modules(tmp_path: Path) -> Iterator[None]:
    """Leave no stage of one test to the next: they are modules of the same names."""
    path = list(sys.path)
    yield
    sys.path[:] = path
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        places = (file,) if file else getattr(module, "__path__", ())  # a folder without __init__.py has no file
        if any(Path(place).is_relative_to(tmp_path) for place in places):
            del sys.modules[name]


@pytest.fixture
def with_lengths(workspace: Workspace) -> Workspace:
    """A workspace with a stage of its own, which uses a helper beside it."""
    name_stages(workspace, "own_lengths")
    return put_stages(
        workspace, "own_lengths", own_lengths=LENGTHS.format(helper="lengths_helper"), lengths_helper=HELPER
    )


def built(report: Report) -> set[str]:
    """Return the stages that were run; none may have failed."""
    assert not report.of(Ending.FAILED), report.of(Ending.FAILED)
    return {event.node.stage for event in report.of(Ending.BUILT)}


def stale(workspace: Workspace) -> dict[str, set[str]]:
    """Return the reasons of what is not fresh, by stage."""
    found: dict[str, set[str]] = {}
    with Session(workspace) as session:
        for decision in session.plan():
            if decision.state is not State.FRESH:
                found.setdefault(decision.node.stage, set()).update(map(str, decision.reasons))
    return found


def edit(path: Path, old: str, new: str) -> None:
    """Replace what stands once in a file."""
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))


def run(workspace: Workspace, *arguments: str) -> str:
    """Run ``garment`` in this process; return what it prints."""
    done = CliRunner().invoke(application(), [*arguments, "--workspace", str(workspace.root)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output
