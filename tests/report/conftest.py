"""Workspaces that were built once, each with its report; tests that change one copy it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from garment_dataset.report.gathering import gather
from garment_dataset.report.site import Site, Written, read_manifest
from garment_dataset.report.writing import write_report
from garment_dataset.workspace import Workspace
from garment_dataset.workspace.session import Session
from tests.conftest import DEPTH_PIPELINE, make_workspace, write_color_recording, write_recording

pytest.importorskip("jinja2", reason="a report needs the extra report")
pytest.importorskip("plotly", reason="a report needs the extra report")
pytest.importorskip("matplotlib", reason="a report needs the extra report")

DEPTH = "GreenTowel_Ruler_01_pi16_0.5_R1"
REPEAT = "GreenTowel_Ruler_02_pi16_0.5_R1"
COLOR = "GreenTowel_Corner_01_pi16_0.5_B1"
FAILED = "GreenTowel_Ruler_03_pi16_0.5_R1"
ABSENT = "RedSkirt_Free_pi16_0.5_R1"
CUT = "GreenTowel_Ruler_04_pi16_0.5_R1"


def fill(place: Workspace) -> None:
    """Give a workspace recordings of all kinds: good ones, one without calibration, one that is cut."""
    whole = DEPTH_PIPELINE.replace('"kinematics"]', '"kinematics", "motion", "quality", "repeatability"]')
    (place.pipelines_dir / "depth.toml").write_text(whole)
    table = place.catalog_dir / "recordings.csv"
    header, *rows = table.read_text().splitlines()
    kept = [row for row in rows if any(name in row for name in (DEPTH, REPEAT, COLOR, FAILED, CUT, ABSENT))]
    table.write_text("\n".join([header, *kept]) + "\n")
    write_recording(place.recordings_dir / f"{DEPTH}.bag")
    write_recording(place.recordings_dir / f"{REPEAT}.bag", shift_m=0.004)
    write_recording(place.recordings_dir / f"{FAILED}.bag", fault="zero_k", frames=6)
    cut = write_recording(place.recordings_dir / f"{CUT}.bag", frames=6)
    cut.write_bytes(cut.read_bytes()[:200_000])
    write_color_recording(place.recordings_dir / f"{COLOR}.bag")
    write_color_recording(place.recordings_dir / "camera_default_0.bag", empty_frames=6, seed=9)


def report(root: Path, out: Path | None = None, *filters: str) -> Written:
    """Write the report of a workspace, as the command does."""
    place = Workspace.find(root)
    folder = out or root / "report"
    site = Site(folder)
    with Session(place, filters) as session:
        facts, checks = gather(session, read_manifest(folder).get("checks", {}))
    return write_report(facts, site, {"checks": checks})


@pytest.fixture(scope="session")
def reported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The root of a workspace that was built, and reported in ``report/``; only read."""
    place = make_workspace(tmp_path_factory.mktemp("report") / "workspace")
    fill(place)
    place.build(jobs=0)
    assert report(place.root).faults == []
    return place.root


@pytest.fixture
def own(reported: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy that a test may change; what takes longest, the large figures, is left out of its new pages."""
    monkeypatch.setattr("garment_dataset.report.frames._figure", lambda *_: "data:,")
    return Path(shutil.copytree(reported, tmp_path / "own", symlinks=True))
