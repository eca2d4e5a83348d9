"""Scores of made features: perfect ones have no error, moved ones the error they were moved by."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pandas as pd
import pytest
import typer
from typer.testing import CliRunner

from garment_dataset.cli.score import score as score_command
from garment_dataset.errors import StoreError
from garment_dataset.score.points import PointScore, point_errors, score_errors
from garment_dataset.score.recordings import score
from garment_dataset.score.silhouettes import distance_to_line, score_silhouettes, silhouette_errors

if TYPE_CHECKING:
    from pathlib import Path

FRAMES, POINTS = 4, 5
PERIOD_NS = 33_000_000
NAME = "GreenTowel_Ruler_01_pi16_0.5_R1"


def truth_table() -> pd.DataFrame:
    frame, point = np.repeat(np.arange(FRAMES), POINTS), np.tile(np.arange(1, POINTS + 1), FRAMES)
    columns: dict[str, Any] = {"frame": frame, "point": point, "stamp_ns": 10**18 + PERIOD_NS * frame}
    for line, z_m in (("surface", 1.0), ("material", 1.01)):
        place = {"x": 0.1 * point, "y": -0.3 + 0.1 * point, "z": z_m + 0.01 * frame}
        for axis, values in place.items():
            columns[f"{line}_{axis}_m"] = values
            columns[f"{line}_v{axis}_m_s"] = np.where(axis == "z", 0.01 / (PERIOD_NS / 1e9), 0.0) + 0 * values
    return pd.DataFrame({**columns, "surface_in_image": True})


def features(
    truth: pd.DataFrame, *, shift_m: float = 0.0, material_shift_m: float = 0.0
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return points and kinematics that lie on the truth's surface and material line, moved along z."""
    keys = truth[["frame", "point", "stamp_ns"]]
    places = {f"{axis}_m": truth[f"surface_{axis}_m"] + shift_m * (axis == "z") for axis in "xyz"}
    material = {f"material_{axis}_m": truth[f"material_{axis}_m"] + material_shift_m * (axis == "z") for axis in "xyz"}
    points = keys.assign(**places, **{f"{axis}_std_m": 0.001 for axis in "xyz"}, **material)
    speeds = {f"v{axis}_m_s": truth[f"surface_v{axis}_m_s"] for axis in "xyz"}
    speed_stds = {f"v{axis}_std_m_s": 0.01 for axis in "xyz"}
    moving = keys.assign(velocity_stamp_ns=keys["stamp_ns"], **places, **speeds, **speed_stds)
    return points, moving


def scored(points: pd.DataFrame, moving: pd.DataFrame, **options: Any) -> list[PointScore]:
    return score_errors(point_errors(points, moving, truth_table(), **options), NAME, options.get("line", "surface"))


def test_perfect_features_have_no_error() -> None:
    rows = scored(*features(truth_table()))
    assert [row.point for row in rows] == [None, 1, 2, 3, 4, 5]
    assert [row.expected for row in rows] == [FRAMES * POINTS, *[FRAMES] * POINTS]
    for row in rows:
        figures = {name: value for name, value in row.record().items() if name.endswith(("_m", "_m_s", "_variance"))}
        assert len(figures) == 13
        assert all(value == pytest.approx(0, abs=1e-12) for value in figures.values())
        assert row.coverage == 1


def test_features_one_millimetre_off_score_one_millimetre() -> None:
    row = scored(*features(truth_table(), shift_m=-0.001))[0]
    for value in (row.rmse_m, row.median_m, row.p95_m, row.z_rmse_m, row.z_median_m, row.z_p95_m):
        assert value == pytest.approx(0.001)
    assert row.z_variance == pytest.approx(1)
    assert (row.x_variance, row.vz_rmse_m_s) == (0, 0)


def test_root_mean_square_median_and_95_percent_are_told_apart() -> None:
    points, moving = features(truth_table())
    points.loc[points["frame"] == 3, "x_m"] += 0.004
    row = scored(points, moving)[0]
    assert (row.rmse_m, row.median_m, row.p95_m) == pytest.approx((0.002, 0, 0.004))
    assert row.z_rmse_m == 0


def test_the_material_line_is_another_truth_for_columns_of_its_own() -> None:
    points, moving = features(truth_table(), shift_m=0.001, material_shift_m=0.002)
    points.loc[points["frame"] == 1, ["material_x_m", "material_y_m", "material_z_m"]] = np.nan
    row = scored(points, moving, line="material")[0]
    assert (row.coverage, row.rmse_m, row.z_rmse_m) == pytest.approx((0.75, 0.002, 0.002))
    assert (row.z_variance, row.vz_rmse_m_s, row.vz_variance) == (None, None, None)
    surface = scored(points, moving)[0]
    assert (surface.coverage, surface.rmse_m) == pytest.approx((1, 0.001))


def test_points_without_a_material_line_say_nothing_about_it() -> None:
    points, moving = features(truth_table())
    older = points.drop(columns=["material_x_m", "material_y_m", "material_z_m"])
    row = scored(older, moving, line="material")[0]
    assert (row.expected, row.coverage, row.rmse_m) == (FRAMES * POINTS, 0, None)


def test_missing_points_lower_coverage_and_nothing_else() -> None:
    points, moving = features(truth_table(), shift_m=0.001)
    gone = points["frame"] == 2
    points.loc[gone, ["x_m", "y_m", "z_m"]] = np.nan
    row = scored(points, moving)[0]
    assert row.coverage == pytest.approx(0.75)
    assert row.rmse_m == pytest.approx(0.001)
    without = scored(points[~gone], moving[~gone])[0]
    assert without.coverage == pytest.approx(0.75)
    nothing = scored(points[:0], moving[:0])[0]
    assert (nothing.coverage, nothing.rmse_m, nothing.z_variance, nothing.vz_rmse_m_s) == (0, None, None, None)


def test_what_the_image_does_not_hold_is_not_expected() -> None:
    truth = truth_table()
    truth.loc[truth["frame"] == 0, "surface_in_image"] = False
    truth.loc[truth["frame"] == 1, "surface_z_m"] = np.nan
    rows = score_errors(point_errors(*features(truth_table()), truth), NAME, "surface")
    assert (rows[0].expected, rows[0].coverage) == (2 * POINTS, 1)


def test_velocities_between_frames_are_compared_at_the_frames() -> None:
    points, moving = features(truth_table())
    moving["velocity_stamp_ns"] += PERIOD_NS // 2
    moving["vz_m_s"] = moving["vz_m_s"] + 0.5 * moving["frame"]
    row = scored(points, moving)[1]
    # holds at half-way stamps: frames 1, 2, 3 lie between two of them, frame 0 before the first
    assert row.vz_rmse_m_s == pytest.approx(np.sqrt(np.mean([0.25**2, 0.75**2, 1.25**2])))


def png(mask: np.ndarray[Any, np.dtype[np.bool_]]) -> bytes:
    done, data = cv2.imencode(".png", mask.astype(np.uint8) * 255, [cv2.IMWRITE_PNG_BILEVEL, 1])
    assert done
    return bytes(data.tobytes())


def color_tables(*, shift_px: int) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Return silhouettes, curves and truth of a bar of 10 by 40 pixels."""
    mask = np.zeros((60, 80), np.bool_)
    mask[10:50, 30:40] = True
    moved = np.roll(mask, shift_px, axis=1)
    line_v = np.linspace(10, 49, 65)
    truth = pd.DataFrame(
        [
            {
                "frame": frame,
                "garment_mask": png(mask),
                "area_px": 400 if frame < 2 else 0,
                "orientation_rad": np.pi / 2 - 0.01,
                "line_u_px": np.full(65, 34.5),
                "line_v_px": line_v,
            }
            for frame in range(3)
        ]
    )
    found = {"mask": png(moved), "orientation_rad": -np.pi / 2, "gripper_v_px": 5.0}
    silhouettes = pd.DataFrame([{"frame": frame, **found} for frame in range(2)])
    curves = pd.DataFrame({"frame": 0, "u_px": np.full(9, 34.5 + shift_px), "v_px": np.linspace(12, 40, 9)})
    return silhouettes, curves, truth


def test_silhouettes_moved_by_a_fifth_of_their_width() -> None:
    silhouettes, curves, truth = color_tables(shift_px=2)
    row = score_silhouettes([silhouette_errors(silhouettes, curves, truth)], NAME)
    assert (row.expected, row.coverage) == (2, 1)
    assert row.iou_mean == pytest.approx(8 / 12)
    assert row.iou_min == pytest.approx(8 / 12)
    assert row.orientation_mean_rad == pytest.approx(0.01)
    assert (row.midline_mean_px, row.midline_p95_px) == pytest.approx((2, 2))
    assert row.material_mean_px == pytest.approx(2)


def test_missing_silhouettes_lower_coverage() -> None:
    silhouettes, curves, truth = color_tables(shift_px=0)
    silhouettes.loc[1, "mask"] = None
    row = score_silhouettes([silhouette_errors(silhouettes, curves, truth)], NAME)
    assert (row.coverage, row.iou_mean) == (0.5, 1)
    assert row.material_mean_px == pytest.approx(0)
    assert row.midline_mean_px == pytest.approx(0)
    nothing = score_silhouettes([silhouette_errors(silhouettes[:0], None, truth)], NAME)
    assert (nothing.coverage, nothing.iou_mean, nothing.midline_mean_px) == (0, None, None)


def test_distance_to_a_line_is_to_its_nearest_place() -> None:
    line = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])
    points = np.array([[5.0, 2.0], [12.0, 5.0], [-3.0, 4.0], [10.0, 10.0]])
    np.testing.assert_allclose(distance_to_line(points, line), [2, 2, 5, 0], atol=1e-12)


@pytest.fixture
def built(tmp_path: Path) -> tuple[Path, Path]:
    """Write features and truth of two recordings, one of them 1 mm off."""
    for number, shift_m in ((1, 0.0), (2, 0.001)):
        name = NAME.replace("_01_", f"_{number:02}_")
        truth = tmp_path / "recordings" / f"{name}.truth"
        truth.mkdir(parents=True)
        truth_table().to_parquet(truth / "points.parquet")
        for table, rows in zip(("points", "kinematics"), features(truth_table(), shift_m=shift_m), strict=True):
            folder = tmp_path / "features" / table / "garment=GreenTowel" / "holding=Ruler"
            folder.mkdir(parents=True, exist_ok=True)
            rows.assign(recording=name).to_parquet(folder / f"{name}.parquet")
    return tmp_path / "features", tmp_path / "recordings"


def test_recordings_one_by_one_and_pooled(built: tuple[Path, Path]) -> None:
    scores = score(*built)
    assert scores.silhouettes == ()
    whole = {row.recording: row for row in scores.points if row.line == "surface" and row.point is None}
    assert {name: row.rmse_m for name, row in whole.items()} == {
        NAME: pytest.approx(0, abs=1e-12),
        NAME.replace("_01_", "_02_"): pytest.approx(0.001),
        "all": pytest.approx(0.001 / np.sqrt(2)),
    }


def test_recordings_in_which_nothing_was_found_have_a_coverage_of_nothing(tmp_path: Path) -> None:
    """No silhouette, so that the table of the central curves has no row of any recording."""
    silhouettes, curves, truth = color_tables(shift_px=0)
    (folder := tmp_path / "recordings" / f"{NAME}.truth").mkdir(parents=True)
    truth.to_parquet(folder / "color.parquet")
    for table, rows in (("silhouettes", silhouettes.assign(mask=None)), ("central_curves", curves[:0])):
        (folder := tmp_path / "features" / table / "garment=GreenTowel" / "holding=Ruler").mkdir(parents=True)
        rows.assign(recording=pd.Series([NAME] * len(rows), dtype=str)).to_parquet(folder / f"{NAME}.parquet")
    (row,) = score(tmp_path / "features", tmp_path / "recordings").silhouettes
    assert (row.coverage, row.iou_mean) == (0, None)


def test_nothing_to_compare_is_said(built: tuple[Path, Path]) -> None:
    features_folder, recordings = built
    with pytest.raises(StoreError, match=r"no truth: expected <recording>\.truth"):
        score(features_folder, features_folder)
    for path in list(recordings.iterdir()):
        path.rename(path.with_name(f"Other{path.name}"))
    with pytest.raises(StoreError, match="no features of a recording with truth"):
        score(features_folder, recordings)


def test_the_command_prints_a_table_or_json(built: tuple[Path, Path]) -> None:
    app = typer.Typer()
    app.command()(score_command)
    arguments = [str(path) for path in built]
    text = CliRunner().invoke(app, arguments)
    assert text.exit_code == 0
    assert "GreenTowel_Ruler_02" in text.stdout
    answer = CliRunner().invoke(app, [*arguments, "--json"])
    rows = json.loads(answer.stdout)["points"]
    assert len(rows) == 3 * 2 * (POINTS + 1)
    assert {row["line"] for row in rows} == {"surface", "material"}
