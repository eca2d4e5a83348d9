from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from garment_dataset.engine.events import Ending
from tests.conftest import DEPTH_PIPELINE, make_workspace

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace

PAGE = Path(__file__).parents[2] / "docs" / "variants.md"
FILE = re.compile(r"<!-- file: (?P<path>\S+) -->\n```\w+\n(?P<text>.*?)```", re.DOTALL)


@pytest.fixture(scope="session")
def varied(tmp_path_factory: pytest.TempPathFactory, sample_bags: dict[str, Path]) -> Workspace:
    """A workspace with two variants beside the usual one, built: the one of docs/variants.md, and a wider band."""
    made = make_workspace(tmp_path_factory.mktemp("varied") / "workspace")
    for name, path in sample_bags.items():
        (made.recordings_dir / f"{name}.bag").symlink_to(path)
    for found in FILE.finditer(PAGE.read_text("utf-8")):
        (made.root / found["path"]).write_text(found["text"], "utf-8")
    wide = f'variant = "wide"\n{DEPTH_PIPELINE}[params.depth_points]\nband_half_width_m = 0.3\n'
    (made.pipelines_dir / "wide.toml").write_text(wide, "utf-8")
    report = made.build(jobs=0)
    assert not report.of(Ending.FAILED)
    return made
