"""One recording as arrays, its page, and the example that fits a chain to it."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pandas as pd
import pytest

from examples import fit_chain
from garment_dataset import load_features, load_motion
from garment_dataset.engine.events import Ending
from garment_dataset.errors import StageError, StoreError, UsageError
from garment_dataset.features.motion import Correlation, Motion
from garment_dataset.simulate.motion import Swing
from garment_dataset.stages.motion import STAGE
from garment_dataset.stages.stage import REPEATS
from tests.conftest import RECORDINGS, make_workspace

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.workspace import Workspace

    FloatArray = NDArray[np.float64]

PAGE = Path(__file__).parents[2] / "docs" / "motion.md"
SNIPPETS = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
PIPELINE = 'recordings = ["axis=R"]\nstages = ["decode", "depth_points", "kinematics", "motion"]\n'
TOWEL, _, SCARF = RECORDINGS


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory, sample_bags: dict[str, Path]) -> Workspace:
    made = make_workspace(tmp_path_factory.mktemp("motion") / "workspace")
    (made.pipelines_dir / "depth.toml").write_text(PIPELINE, "utf-8")
    for name, path in sample_bags.items():
        (made.recordings_dir / f"{name}.bag").symlink_to(path)
    assert not made.build(jobs=0).of(Ending.FAILED)
    return made


def test_arrays_are_those_of_the_tables(built: Workspace) -> None:
    motion = load_motion(TOWEL, built.features_dir)
    rows = load_features("kinematics", folder=built.features_dir, recording=TOWEL)
    count = motion.point_count
    for number, point in enumerate((0, 3)):
        track = rows[rows["point"] == point]
        names = ("position_m", "displacement_m", "velocity_m_s", "acceleration_std_m_s2")
        columns = ("{}_m", "d{}_m", "v{}_m_s", "a{}_std_m_s2")
        for name, column in zip(names, columns, strict=True):
            array = getattr(motion, name)
            assert array.shape == (len(track), count + 1, 3)
            expected = track[[column.format(axis) for axis in "xyz"]].to_numpy()
            np.testing.assert_array_equal(array[:, point], expected)
        assert np.isnan(motion.pixels[:, point]).all() == (number == 0)
    assert motion.stamp_ns.tolist() == track["stamp_ns"].tolist()
    assert motion.time_s.tolist() == track["time_s"].tolist()
    assert motion.onset_stamp_ns is not None
    assert motion.onset_reason is None
    np.testing.assert_allclose(motion.time_s, (motion.stamp_ns - motion.onset_stamp_ns) / 1e9, atol=1e-6)
    assert 0 < motion.onset_std_s < 0.033
    assert motion.garment_length_m == pytest.approx(0.5, abs=0.01)
    assert motion.segment_length_m == motion.garment_length_m / count
    assert np.linalg.norm(motion.gravity_m_s2) == pytest.approx(9.81)
    assert motion.gripper_quaternion.shape == (motion.frame.size, 4)


def test_the_garment_is_that_of_the_catalog(built: Workspace) -> None:
    towel, scarf = (load_motion(name, built.features_dir) for name in (TOWEL, SCARF))
    assert (towel.width_m, towel.height_m, towel.weight_kg) == (0.6, 0.36, 0.045)
    assert np.isnan([scarf.width_m, scarf.height_m, scarf.weight_kg]).all()


def test_the_size_of_a_garment_is_a_reason_to_label_motion_again_and_nothing_else(
    workspace: Workspace,
) -> None:
    (workspace.pipelines_dir / "depth.toml").write_text(PIPELINE, "utf-8")
    workspace.build(jobs=0)
    garments = workspace.catalog_dir / "garments.csv"
    table = pd.read_csv(garments, dtype=str, keep_default_na=False)
    table.loc[table["garment"] == "GreenTowel", "weight_g"] = "46"
    table.to_csv(garments, index=False)
    report = workspace.build(jobs=0)
    assert not report.of(Ending.BUILT)
    assert {str(event.node) for event in report.of(Ending.RELABELLED)} == {
        f"motion:{name}" for name in RECORDINGS if "GreenTowel" in name
    }
    assert load_motion(TOWEL, workspace.features_dir).weight_kg == 0.046


def test_only_stages_of_recordings_may_ask_for_columns_of_the_catalog() -> None:
    for wrong in ({"about": ("price_eur",)}, {"per": "position"}, {"per": REPEATS}):
        with pytest.raises(StageError, match="`about` is not understood"):
            dataclasses.replace(STAGE, **wrong)


def test_what_was_not_built_is_named(built: Workspace, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="no motion of GreenTowel_Ruler_09"):
        load_motion("GreenTowel_Ruler_09_pi16_0.5_R1", built.features_dir)
    with pytest.raises(StoreError, match=f"Did you mean {TOWEL}"):
        load_motion(TOWEL.replace("Towel", "Towl"), built.features_dir)
    with pytest.raises(StoreError, match="no files of table 'motion'"):
        load_motion(TOWEL, tmp_path)


def test_covariances_are_of_known_quantities_and_axes(built: Workspace) -> None:
    motion, wrong = load_motion(TOWEL, built.features_dir), cast("Any", "velocty")
    with pytest.raises(UsageError, match=r"no such quantity: .*found 'velocty'\. Did you mean velocity\?"):
        motion.covariance(wrong, 0)
    for axis in (-1, 3):
        with pytest.raises(UsageError, match="no such axis: expected 0, 1 or 2"):
            motion.covariance("position", axis)


def test_covariances_are_what_the_correlations_say(built: Workspace) -> None:
    motion = load_motion(TOWEL, built.features_dir)
    count, std = motion.point_count, motion.position_std_m[:, 1:, 2]
    covariance = motion.covariance("position", 2)
    np.testing.assert_allclose(np.diag(covariance), std.ravel() ** 2)
    assert np.linalg.eigvalsh(covariance).min() > -1e-9 * np.diag(covariance).max()
    later = covariance[1 * count + 2, 5 * count + 2] / (std[1, 2] * std[5, 2])
    assert later == pytest.approx(0.25 + 0.75 * 0.8**4)
    below = covariance[1 * count + 1, 1 * count + 3] / (std[1, 1] * std[1, 3])
    assert below == pytest.approx(0.25**2)


def test_the_snippets_of_the_page_run(built: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(built.root)
    names: dict[str, Any] = {}
    for snippet in SNIPPETS:
        exec(snippet, names)
    assert names["std_m"] > 0
    assert names["covariance_m2"].shape == (names["motion"].frame.size * names["motion"].point_count,) * 2


def swinging(seed: int, logarithms: FloatArray) -> Motion:
    """Return the motion of a chain with these parameters in a simulated swing, measured with correlated errors."""
    rng, count, frames, rho, std_m = np.random.default_rng(seed), 3, 80, 0.8, 0.0005
    swing = Swing("R", np.pi / 16, 0.5, 0.5)
    time_s: FloatArray = 0.0334 * np.arange(frames, dtype=np.float64)
    track = np.zeros((frames, count + 1, 3))
    unknown, steps_s = np.full((frames, count + 1), np.nan), 1e-4
    velocity, acceleration, displacement = track.copy(), track.copy(), track.copy()
    displacement[:, 0] = swing.gripper_m(time_s) - swing.rest_m
    velocity[:, 0] = swing.gripper_velocity_m_s(time_s)
    change = swing.gripper_velocity_m_s(time_s + steps_s) - swing.gripper_velocity_m_s(time_s - steps_s)
    acceleration[:, 0] = change / (2 * steps_s)
    share = np.full((count + 1, 3), 0.0)
    errors = Correlation(share, share + rho, share, share)
    known: dict[str, Any] = {
        field.name: float("nan") for field in dataclasses.fields(Motion) if field.type == "float"
    } | {field.name: None for field in dataclasses.fields(Motion) if "None" in str(field.type)}
    known |= {"recording": "made", "frame": np.arange(frames), "stamp_ns": np.rint(1e9 * time_s).astype(np.int64)}
    known |= {"position_m": track, "position_std_m": track, "velocity_std_m_s": track, "acceleration_std_m_s2": track}
    motion = Motion(
        **(known | {"time_s": time_s - swing.start_s, "segment_length_m": 0.2, "pixels": unknown}),
        displacement_m=displacement,
        displacement_std_m=np.full_like(track, std_m),
        velocity_m_s=velocity,
        acceleration_m_s2=acceleration,
        gripper_quaternion=np.full((frames, 4), np.nan),
        bridged_m=unknown,
        gravity_m_s2=np.array([0, 9.81, 0]),
        correlations={"displacement": errors},
    )
    noise = rng.normal(size=(frames, count, 2))
    for i in range(1, frames):
        noise[i] = rho * noise[i - 1] + np.sqrt(1 - rho**2) * noise[i]
    displacement[:, 1:, 1:] = fit_chain.simulate(motion, logarithms[None])[0] + std_m * noise
    return motion


def test_a_chain_is_found_again_and_predicts_what_it_has_not_seen() -> None:
    true = np.log(np.array([2.0, 0.5, 1.0, 0.5, 0.5, 1.5]))
    fitted, held_back = (swinging(seed, true) for seed in (1, 2))
    chain = fit_chain.fit(fitted)
    away = (chain.logarithms - true) / np.sqrt(np.diag(chain.covariance))
    assert np.abs(away).max() < 3
    report = fit_chain.judge(held_back, chain)
    assert report.rms_m < 0.0007
    assert 0.88 < report.coverage < 0.99


def test_the_example_reads_parquet_alone(built: Workspace, capsys: pytest.CaptureFixture[str]) -> None:
    """The sample's sheet does not swing: the fit is no good, but it runs."""
    reports = fit_chain.main(built.features_dir, *RECORDINGS[:2])
    assert all(np.isfinite(report.rms_m) for report in reports)
    assert "held back  rms" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::garment_dataset.errors.DataWarning")
def test_on_simulated_repeats_onset_intervals_and_prediction_are_right(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    from garment_dataset.simulate.recording import simulate_recording

    made = make_workspace(tmp_path / "workspace")
    (made.pipelines_dir / "depth.toml").write_text(PIPELINE, "utf-8")
    held: list[bool] = []
    for name in RECORDINGS[:2]:
        simulate_recording(name, made.recordings_dir, seed=3, scale="small")
    made.build(jobs=1)
    for name in RECORDINGS[:2]:
        folder = made.recordings_dir / f"{name}.truth"
        motion = load_motion(name, made.features_dir)
        scene = json.loads((folder / "scene.json").read_text("utf-8"))
        assert motion.onset_stamp_ns is not None
        assert abs(motion.onset_stamp_ns - scene["motion_start_ns"]) < 33e6
        truth = pd.read_parquet(folder / "points.parquet").sort_values(["frame", "point"])
        true_m = truth[[f"surface_{axis}_m" for axis in "xyz"]].to_numpy().reshape(-1, motion.point_count, 3)
        errors_m = (motion.position_m[:, 1:] - true_m[motion.frame])[:, :, 1:]
        effective = motion.correlations["position"].effective_frames[1:, 1:]
        mean_std_m = np.sqrt(np.nanmean(motion.position_std_m[:, 1:, 1:] ** 2, axis=0) / effective)
        held += (np.abs(np.nanmean(errors_m, axis=0)) < 1.96 * mean_std_m).ravel().tolist()
    assert np.mean(held) >= 0.9
    fitted, predicted = fit_chain.main(made.features_dir, *RECORDINGS[:2])
    assert max(fitted.rms_m, predicted.rms_m) < 0.0015
    assert predicted.coverage > 0.85
