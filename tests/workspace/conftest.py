from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.workspace import Workspace

LENGTHS = '''
"""How long the garment is that the points of each frame divide."""

import pyarrow as pa

from garment_dataset.stages import FRAME, STAMP, Column, Stage, StageParams, TableSpec
from {helper} import in_metres

LENGTHS = TableSpec(
    "lengths", 1, "one depth frame", (FRAME, STAMP, Column("length_m", "float64", "m", "its length", True)), ("frame",)
)


class LengthsParams(StageParams):
    factor: float = 1.0


def lengths(points: pa.Table, params: LengthsParams):
    first = points.filter(pa.compute.equal(points["point"], 1))
    length = [in_metres(value, params.factor) for value in first["garment_length_m"].to_pylist()]
    columns = {{name: first[name] for name in ("frame", "stamp_ns")}}
    return {{"lengths": LENGTHS.table({{**columns, "length_m": length}})}}


STAGE = Stage(lengths, params=LengthsParams, outputs=(LENGTHS,))
'''
HELPER = "def in_metres(value, factor):\n    return None if value is None else value * factor\n"


@pytest.fixture(autouse=True)
def forget_modules() -> Iterator[None]:
    """Leave no stage of one test to the next: they are modules of the same names."""
    before, path = set(sys.modules), list(sys.path)
    yield
    sys.path[:] = path
    for name in set(sys.modules) - before:
        file = getattr(sys.modules[name], "__file__", None) or ""
        if "/pytest-" in file:
            del sys.modules[name]


def name_stages(workspace: Workspace, *stages: str, variant: str = "", params: str = "") -> None:
    """Have the depth pipeline name further stages."""
    names = ["decode", "depth_points", "kinematics", *stages]
    variant = f'variant = "{variant}"\n' if variant else ""
    text = f'recordings = ["axis=R"]\nstages = {names}\n{variant}{params}'.replace("'", '"')
    (workspace.pipelines_dir / "depth.toml").write_text(text)


@pytest.fixture
def with_lengths(workspace: Workspace) -> Workspace:
    """A workspace with a stage of its own, which uses a helper beside it."""
    (workspace.root / "stages").mkdir()
    (workspace.root / "stages" / "lengths.py").write_text(LENGTHS.format(helper="lengths_helper"))
    (workspace.root / "stages" / "lengths_helper.py").write_text(HELPER)
    (workspace.root / "garment.toml").write_text('[stages]\nmodules = ["lengths"]\n')
    name_stages(workspace, "lengths")
    return type(workspace).find(workspace.root)
