"""``garment view`` and ``garment export mcap``: what they write, what they leave out, and what is one line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from garment_dataset.engine.events import Ending
from tests.conftest import make_workspace

if TYPE_CHECKING:
    from tests.cli.conftest import Garment

NAME = "GreenTowel_Ruler_01_pi16_0.5_R1"
EXTRAS = {
    "view": ("rerun", "the viewer needs Rerun. Install it with: pip install 'garment-dataset[rerun]'"),
    "export": ("mcap", "MCAP files need mcap. Install it with: pip install 'garment-dataset[mcap]'"),
}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory, sample_bags: dict[str, Path]) -> Path:
    """A workspace that is only read, with one recording."""
    made = make_workspace(tmp_path_factory.mktemp("viewed") / "workspace")
    (made.recordings_dir / f"{NAME}.bag").symlink_to(sample_bags[NAME])
    assert not made.build(jobs=0).of(Ending.FAILED)
    return made.root


def test_a_recording_is_saved_for_rerun(built: Path, garment: Garment, tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="Rerun's files need the extra rerun")
    ran = garment("view", NAME, "--save", f"{tmp_path}/a.rrd", cwd=built)
    rig, not_built, wrote = ran.err.splitlines()
    assert rig == "left out, as the recorded transforms do not say it: how the two cameras stand to each other"
    assert not_built == (
        "left out, as not built: tracks, silhouettes, central_curves; name tracks, silhouette, central_curve in a "
        f"pipeline of {NAME}, then `garment build`"
    )
    assert wrote.startswith(f"wrote {tmp_path}/a.rrd (")
    assert (tmp_path / "a.rrd").read_bytes()[:4] == b"RRF2"
    assert [path.name for path in tmp_path.iterdir()] == ["a.rrd"]


def test_a_recording_is_exported_as_mcap(built: Path, garment: Garment, tmp_path: Path) -> None:
    pytest.importorskip("mcap", reason="MCAP files need the extra mcap")
    ran = garment("export", "mcap", NAME, "--out", f"{tmp_path}/a.mcap", cwd=built)
    assert ran.err.splitlines()[-1].startswith(f"wrote {tmp_path}/a.mcap (")
    assert (tmp_path / "a.mcap").read_bytes()[:8] == b"\x89MCAP0\r\n"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("view", NAME, "--save", "a.mcap"), "a.mcap: not the kind of file: expected .rrd, found '.mcap'"),
        (("view", NAME, "--save", "no/a.rrd"), "no/a.rrd: no folder for a file"),
        (("view", "GreenTowel_Ruler_02_pi16_0.5_R1", "--save", "a.rrd"), "nothing to show: no frames"),
        (("view", NAME, "--save", "a.rrd", "--variant", "other"), "no variant 'other'"),
        (("view", "GreenTowl_Ruler_01_pi16_0.5_R1", "--save", "a.rrd"), "GreenTowl_Ruler_01_pi16_0.5_R1"),
        (("export", "mcap", NAME, "--out", "a.bag"), "a.bag: not the kind of file: expected .mcap, found '.bag'"),
    ],
)
def test_what_cannot_be_shown_is_said_in_one_line(
    built: Path, garment: Garment, arguments: tuple[str, ...], said: str
) -> None:
    pytest.importorskip(EXTRAS[arguments[0]][0], reason="needs its extra")
    before = sorted(built.iterdir())
    ran = garment(*arguments, cwd=built, code=2)
    assert said in ran.err
    assert len(ran.err.splitlines()) == 1
    assert sorted(built.iterdir()) == before


def test_without_a_screen_it_says_how_to_do_without(
    built: Path, garment: Garment, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rerun", reason="Rerun's files need the extra rerun")
    if sys.platform != "linux":
        pytest.skip("elsewhere there is always a screen")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    ran = garment("view", NAME, cwd=built, code=2)
    assert ran.err == (
        "garment: no screen to show it on. --save FILE.rrd writes what can be looked at on another machine.\n"
    )


@pytest.mark.parametrize("verb", list(EXTRAS))
def test_without_its_extra_it_is_one_line(built: Path, tmp_path: Path, verb: str) -> None:
    library, said = EXTRAS[verb]
    arguments = {"view": ["view", NAME, "--save", "a.rrd"], "export": ["export", "mcap", NAME, "--out", "a.mcap"]}[verb]
    blocked = f"import sys; sys.modules[{library!r}] = None; from garment_dataset.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", blocked, *arguments], cwd=built, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (2, f"garment: {said}\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform != "linux", reason="limits the size of files as Linux does")
@pytest.mark.parametrize("words", [("view", "--save", "a.rrd"), ("export", "mcap", "--out", "a.mcap")])
def test_a_full_disk_leaves_nothing_and_is_said(built: Path, tmp_path: Path, words: tuple[str, ...]) -> None:
    pytest.importorskip(EXTRAS[words[0]][0], reason="needs its extra")
    *verb, option, name = words
    limited = (
        "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000));"
        "from garment_dataset.cli import main; main()"
    )
    command = [sys.executable, "-c", limited, *verb, NAME, option, str(tmp_path / name)]
    done = subprocess.run(command, cwd=built, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 1, done.stderr
    assert f"garment: {tmp_path / name}: " in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())
