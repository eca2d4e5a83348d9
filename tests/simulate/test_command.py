from __future__ import annotations

import builtins
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from garment_dataset.cli.simulate import simulate
from garment_dataset.errors import GarmentError, MissingExtraError
from garment_dataset.simulate.orders import DEMO, Order, forecast, names_of
from garment_dataset.simulate.physics import import_mujoco


@pytest.fixture
def app() -> typer.Typer:
    made = typer.Typer()
    made.command()(simulate)
    return made


def order(name: str, *, frames: int | None = None) -> Order:
    return Order(name, Path("out"), 0, "xtion", "full", "none", frames)


def test_thesis_set_is_all_recordings_and_their_empty_scenes() -> None:
    names = names_of([], "thesis")
    assert len(names) == 47
    assert len(set(names)) == 47
    assert names[-1] == "camera_default_0"


def test_demo_set_covers_both_axes() -> None:
    assert names_of([], "demo") == list(DEMO)
    assert {name[-2] for name in DEMO if name != "camera_default_0"} == {"R", "B"}


def test_names_are_made_canonical_and_taken_once() -> None:
    spelled = ["FelShirt_Free_pi16.0.5_B1.bag", "FelShirt_Free_pi16_0.5_B1"]
    assert names_of(spelled, None) == ["FelShirt_Free_pi16_0.5_B1"]


def test_nothing_chosen_is_an_error() -> None:
    with pytest.raises(GarmentError, match="nothing to simulate"):
        names_of([], None)


def test_forecast_says_disk_and_time() -> None:
    full = [order(name) for name in names_of([], "thesis")]
    assert full[0].cost()[0] == pytest.approx(365e6, rel=0.02)
    assert "47 recordings into out: about 17.0 GB" in forecast(full, 2)
    few = order(DEMO[0], frames=10)
    assert few.pairs() == 10
    assert few.cost()[0] < full[0].cost()[0] / 20
    assert few.cost()[1] < full[0].cost()[1]


@pytest.mark.parametrize("jobs", ["1", pytest.param("2", marks=pytest.mark.slow)])
def test_command_writes_what_was_asked_for(app: typer.Typer, tmp_path: Path, jobs: str) -> None:
    arguments = ["camera_default_0", "camera_default_1", "--frames", "1", "--out", str(tmp_path), "--jobs", jobs]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["camera_default_0.bag", "camera_default_1.bag"]
    assert result.stdout == ""
    assert "2 recordings into" in result.stderr
    assert "[2/2]" in result.stderr


def test_without_mujoco_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    real_import = builtins.__import__

    def refuse(name: str, *args: Any, **kwargs: Any) -> Any:
        if name == "mujoco":
            raise ImportError(name)
        return real_import(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(MissingExtraError, match=r"garment-dataset\[simulate\]"):
        import_mujoco()


def test_importing_the_command_is_light() -> None:
    code = (
        "import sys, garment_dataset.simulate.orders, garment_dataset.cli.simulate\n"
        "print([name for name in ('numpy', 'cv2', 'pandas', 'pyarrow', 'rosbags', 'mujoco') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
