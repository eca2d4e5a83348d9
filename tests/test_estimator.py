"""The example estimator: it reads a snapshot alone, finds what is true of a chain, and says what it cannot tell."""

from __future__ import annotations

import ast
import dataclasses
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from examples.estimator import chain, fitting, recording
from examples.estimator.__main__ import main
from examples.estimator.fitting import fit
from examples.estimator.judging import Errors, judge
from examples.estimator.recording import Recording, read, recordings_of
from examples.estimator.validation import chain_made, draw
from garment_dataset import load_motion
from garment_dataset.snapshot.contents import gather
from garment_dataset.snapshot.writing import write_snapshot
from garment_dataset.workspace import Workspace
from garment_dataset.workspace.session import Session
from tests.conftest import RECORDINGS

if TYPE_CHECKING:
    from numpy.typing import NDArray

PAGE = Path(__file__).parents[1] / "docs" / "for-estimators.md"
TRUTH = np.log([8.0, 1.0, 0.8, 1.0])


@pytest.fixture(scope="module")
def snapshot(tmp_path_factory: pytest.TempPathFactory, sample_bags: dict[str, Path]) -> Path:
    made = Workspace.create(tmp_path_factory.mktemp("estimator") / "ws")
    for name, path in sample_bags.items():
        (made.recordings_dir / f"{name}.bag").symlink_to(path)
    made.build(jobs=0)
    with Session(made) as session:
        write_snapshot(gather(session), made.root / "snapshot")
    return made.root / "snapshot"


def swing(seconds: float = 2.5, stop_s: float = 1.6) -> tuple[NDArray[np.float64], ...]:
    """Return times at which the gripper is seen, and its way along z, there, in velocity and acceleration."""
    time_s = np.arange(-0.3, seconds, 1 / 30)
    rate = 2 * np.pi / stop_s
    on = (time_s > 0) & (time_s < stop_s)
    way = np.where(on, 0.09 * (1 - np.cos(rate * time_s)), 0.0)
    speed = np.where(on, 0.09 * rate * np.sin(rate * time_s), 0.0)
    return time_s, way, speed, np.where(on, 0.09 * rate**2 * np.cos(rate * time_s), 0.0)


@pytest.fixture(scope="module")
def template() -> Recording:
    """A recording of five points that are known to half a millimetre; where they are is made up by the tests."""
    time_s, *motion = swing()
    gripper = [np.column_stack([np.zeros_like(each), each]) for each in motion]
    return Recording(
        "made",
        (time_s * 1e9).astype(np.int64),
        time_s,
        gripper_m=gripper[0],
        gripper_m_s=gripper[1],
        gripper_m_s2=gripper[2],
        gripper_pitch_rad=np.zeros_like(time_s),
        points_m=np.zeros((len(time_s), 5, 2)),
        std_m=np.full((len(time_s), 5, 2), 5e-4),
        rest_m=np.zeros((5, 3)),
        segment_m=0.1,
        gravity_m_s2=np.array([9.81, 0.0]),
        standing=np.full((5, 2), 0.3),
        lag1=np.full((5, 2), 0.8),
        next_point=np.tile([0.95, 0.25], (5, 1)),
    )


@pytest.mark.parametrize("module", [chain, fitting, recording])
def test_it_imports_nothing_of_the_package(module: object) -> None:
    folder = Path(str(getattr(module, "__file__", ""))).parent
    for name in ("__main__", "chain", "distance", "fitting", "judging", "recording"):
        for node in ast.walk(ast.parse((folder / f"{name}.py").read_text("utf-8"))):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [getattr(node, "module", None) or "", *(each.name for each in node.names)]
                assert not any(each.startswith("garment_dataset") for each in names)


def test_what_it_reads_is_what_the_package_gives(snapshot: Path) -> None:
    assert recordings_of(snapshot) == sorted(RECORDINGS)
    found, expected = read(snapshot, RECORDINGS[0]), load_motion(RECORDINGS[0], snapshot)
    np.testing.assert_array_equal(found.points_m, expected.displacement_m[:, 1:, 1:])
    np.testing.assert_array_equal(found.std_m, expected.displacement_std_m[:, 1:, 1:])
    np.testing.assert_array_equal(found.stamp_ns, expected.stamp_ns)
    assert found.segment_m == expected.segment_length_m
    np.testing.assert_allclose(found.gravity_m_s2, expected.gravity_m_s2[1:])
    for axis in (0, 1):
        np.testing.assert_allclose(found.covariance(axis), expected.covariance("displacement", axis + 1), rtol=1e-12)


def test_a_chain_at_rest_stays_there(template: Recording) -> None:
    still = np.zeros_like(template.gripper_m)
    resting = dataclasses.replace(template, gripper_m=still, gripper_m_s=still, gripper_m_s2=still)
    assert np.abs(chain.simulate(resting, TRUTH[None])).max() < 1e-12


def test_a_small_swing_of_one_link_is_a_pendulum(template: Recording) -> None:
    """Without air and joints, T = 2 pi sqrt(2 L / 3 g): a rod that hangs from its end."""
    still = np.zeros_like(template.gripper_m)
    kicked = still.copy()
    kicked[:2, 1] = 0.5  # an acceleration at the first frames, then nothing
    rod = dataclasses.replace(
        template,
        gripper_m=still,
        gripper_m_s=still,
        gripper_m_s2=kicked,
        points_m=template.points_m[:, :1],
        std_m=template.std_m[:, :1],
    )
    away = chain.simulate(rod, np.full((1, 4), -30.0))[0, :, 0, 1]
    crossings = np.flatnonzero(np.diff(np.sign(away[4:])) != 0)
    period_s = 2 * np.diff(crossings).mean() / 30
    assert period_s == pytest.approx(2 * np.pi * np.sqrt(2 * 0.1 / 3 / 9.81), rel=0.03)


def test_a_turn_of_the_gripper_bends_a_stiff_chain_with_it(template: Recording) -> None:
    still = np.zeros_like(template.gripper_m)
    turned = dataclasses.replace(
        template,
        gripper_m=still,
        gripper_m_s=still,
        gripper_m_s2=still,
        gripper_pitch_rad=np.minimum(np.linspace(0, 0.4, len(template.time_s)), 0.1),  # and stays
        gravity_m_s2=np.array([0.01, 0.0]),
    )
    stiff = chain.simulate(turned, np.log([[300.0, 30.0, 1e-3, 1e-3]]))[0, -1]
    np.testing.assert_allclose(
        stiff[:, 1], 0.1 * (np.arange(5) + 0.5) * np.sin(0.1), rtol=0.1
    )  # its slowest swing still dies away


def test_the_truth_of_a_chain_is_found_within_its_intervals(template: Recording) -> None:
    held = told = 0
    for seed in range(3):
        found = draw(template, seed)
        held += sum(found.holds)
        told += sum(found.is_told)
    assert held >= 9  # of 12; 95 % each: fewer in one of some thousand runs
    assert told >= 9


def test_what_the_motion_cannot_tell_is_said(template: Recording) -> None:
    """A chain that hardly bends tells no more of its stiffness than how small it is."""
    soft = np.log([0.05, 1.0, 0.8, 1.0])
    found = fit(chain_made(template, soft, 3), is_chain=True)
    bending = found.intervals[0]
    assert bending.low is None
    assert bending.high is not None
    assert not bending.is_told


def test_another_movement_of_the_same_chain_is_predicted(template: Recording) -> None:
    time_s, *motion = swing(stop_s=1.1)
    gripper = [np.column_stack([np.zeros_like(each), each]) for each in motion]
    other = dataclasses.replace(
        template, gripper_m=gripper[0], gripper_m_s=gripper[1], gripper_m_s2=gripper[2], time_s=time_s
    )
    source = chain_made(template, TRUTH, 0)
    errors = judge(fit(source, is_chain=True), source, chain_made(other, TRUTH, 1))
    assert errors.chain_m < 0.7e-3  # the errors of the measurement alone are 0.5 mm
    assert errors.rigid_m > 20 * errors.chain_m
    assert errors.mean_m > 20 * errors.chain_m


def test_the_command_fits_and_predicts(snapshot: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(snapshot, RECORDINGS[0], RECORDINGS[1])
    said = capsys.readouterr().out
    assert f"{RECORDINGS[0]}: 5 links of" in said
    assert "95 %:" in said
    assert f"{RECORDINGS[1]}: predicted to" in said


def test_the_page_runs_from_the_snapshot_on(snapshot: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(snapshot)
    names: dict[str, object] = {}
    for snippet in re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL):
        exec(compile(snippet, str(PAGE), "exec"), names)
    errors = names["errors"]
    assert isinstance(errors, Errors)
    assert np.isfinite(errors).all()
