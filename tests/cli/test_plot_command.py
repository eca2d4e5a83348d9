"""``garment plot``: equal results give equal pictures, and what cannot be drawn is one line."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

from garment_dataset.engine.events import Ending
from tests.conftest import make_workspace

if TYPE_CHECKING:
    from pathlib import Path

    from garment_dataset.workspace import Workspace
    from tests.cli.conftest import Garment

pytest.importorskip("matplotlib", reason="pictures need the extra view")

NAME = "GreenTowel_Ruler_01_pi16_0.5_R1"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory, sample_bags: dict[str, Path]) -> Path:
    """A workspace that is only read."""
    made = make_workspace(tmp_path_factory.mktemp("plot") / "workspace")
    for name, path in sample_bags.items():
        (made.recordings_dir / f"{name}.bag").symlink_to(path)
    assert not made.build(jobs=0).of(Ending.FAILED)
    return made.root


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_equal_results_give_equal_pictures(built: Path, garment: Garment, tmp_path: Path, suffix: str) -> None:
    for name in "ab":
        garment("plot", NAME, "--save", f"{tmp_path}/{name}.{suffix}", cwd=built)
    assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()


def test_a_picture_says_what_it_shows(built: Path, garment: Garment, tmp_path: Path) -> None:
    garment("plot", NAME, "--save", f"{tmp_path}/motion.svg", cwd=built)
    text = re.sub(r"\s+", " ", (tmp_path / "motion.svg").read_text())
    for word in (
        NAME,
        "dz [m]",
        "vz [m/s]",
        "gripper",
        "point 1",
        "point 5",
        "time since the gripper began to move [s]",
    ):
        assert f">{word}<" in text, word


def test_repeats_share_one_panel(built: Path, garment: Garment, tmp_path: Path) -> None:
    garment("plot", "--repeats", "garment=GreenTowel", "--save", f"{tmp_path}/repeats.svg", cwd=built)
    text = (tmp_path / "repeats.svg").read_text()
    assert ">GreenTowel_Ruler_pi16_0.5_R_topics_file1, 2 repeats<" in text


def test_points_and_columns_are_chosen(built: Path, garment: Garment, tmp_path: Path) -> None:
    table = ("--table", "points.pixels", "--point", "2")
    garment("plot", NAME, *table, "--save", f"{tmp_path}/pixels.svg", cwd=built)
    text = (tmp_path / "pixels.svg").read_text()
    assert ">point 2<" in text
    assert ">point 3<" not in text
    assert ">pixels<" in text


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((NAME,), "a picture needs a file: expected --save FILE.png"),
        ((NAME, "--save", "a.gif"), "a.gif: not a kind of picture: expected .png .svg .pdf, found '.gif'"),
        ((NAME, "--save", "a.png", "--table", "kinematics"), "no column: expected TABLE.COLUMN"),
        ((NAME, "--save", "a.png", "--table", "kinematic.vz_m_s"), "no files of table 'kinematic'"),
        ((NAME, "--save", "a.png", "--table", "kinematics.vz"), "'vz' is no column of numbers"),
        ((NAME, "--save", "a.png", "--table", "chains.z_m"), "chains: cannot be drawn over time"),
        ((NAME, "--save", "a.png", "--point", "9"), "kinematics: no point 9: expected 0, 1, 2, 3, 4, 5"),
        (("GreenTowl_Ruler_01*", "--save", "a.png"), "no recording"),
        ((NAME, "--save", "a.png", "--variant", "other"), "no variant 'other'"),
        (("GreenTowel_Corner_02_pi16_0.5_R1", "--save", "a.png"), "nothing to draw: expected recordings with a bag"),
    ],
)
def test_what_cannot_be_drawn_is_said_in_one_line(
    built: Path, garment: Garment, arguments: tuple[str, ...], said: str
) -> None:
    ran = garment("plot", *arguments, cwd=built, code=2)
    assert said in ran.err
    assert len(ran.err.splitlines()) == 1
    assert not (built / "a.png").exists()


def test_before_a_build_it_says_to_build(workspace: Workspace, garment: Garment) -> None:
    ran = garment("plot", NAME, "--save", "a.png", cwd=workspace.root, code=2)
    assert "garment build" in ran.err
