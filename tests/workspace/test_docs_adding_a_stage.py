"""The page that shows how to add a stage does what it says: its files are written and built."""

from __future__ import annotations

import re
from pathlib import Path

from garment_dataset.engine.events import Ending
from garment_dataset.features.reading import load_features
from garment_dataset.workspace import Workspace

PAGE = Path(__file__).parents[2] / "docs" / "adding-a-stage.md"
FILE = re.compile(r"<!-- file: (?P<path>\S+) -->\n```\w+\n(?P<text>.*?)```", re.DOTALL)


def test_the_files_of_the_page_build(workspace: Workspace) -> None:
    files = {found["path"]: found["text"] for found in FILE.finditer(PAGE.read_text("utf-8"))}
    assert list(files) == ["stages/lengths.py", "garment.toml", "pipelines/depth.toml", "stages/spread.py"]
    files["garment.toml"] = files["garment.toml"].replace('"lengths"', '"lengths", "spread"')
    files["pipelines/depth.toml"] = files["pipelines/depth.toml"].replace('"lengths"]', '"lengths", "spread"]')
    for name, text in files.items():
        path = workspace.root / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, "utf-8")
    report = Workspace.find(workspace.root).build(jobs=0)
    assert {event.ending for event in report.events.values()} == {Ending.BUILT}
    lengths = load_features("lengths", folder=workspace.features_dir)
    assert lengths["length_m"].dropna().between(0.4, 0.6).all()
    spread = load_features("spread", folder=workspace.features_dir, garment="GreenTowel")
    assert spread["repeats"].tolist() == [2] * 6
    assert spread["reach_std_m"].notna().all()
