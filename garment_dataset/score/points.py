"""Errors of the points and of their velocities against the truth.

Two lines can be meant: the *surface*, what a depth camera sees in the plane x = x_gripper, which is what the points of
thesis 5.3.4 are on; and the *material* line, fixed to the cloth, which the columns ``material_*`` estimate where it can
be had.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import pandas as pd

    from garment_dataset.arrays import BoolArray, FloatArray, IntArray

Line = Literal["surface", "material"]
_KEYS = ["frame", "point"]
_AXES = ("x", "y", "z")


@dataclass(frozen=True, slots=True, eq=False)
class PointErrors:
    """Errors of one recording, or of several joined: feature less truth, one row per frame and point of the truth.

    Parameters
    ----------
    point : (n,) int64
        Number of the point.
    expected : (n,) bool
        Whether the point should have been found: the truth has it, within the image.
    position_m, std_m : (n, 3) float64
        Error along x, y and z, and the standard uncertainty stated for it; NaN where no point was found.
    velocity_m_s, velocity_std_m_s : (n, 3) float64
        The same of the velocity.
    """

    point: IntArray
    expected: BoolArray
    position_m: FloatArray
    std_m: FloatArray
    velocity_m_s: FloatArray
    velocity_std_m_s: FloatArray


@dataclass(frozen=True, slots=True)
class PointScore:
    """One row of a score; a figure is None when nothing can be said.

    Parameters
    ----------
    recording : str
        Name of the recording, or of the group that was pooled.
    line : {"surface", "material"}
        What was compared with.
    point : int or None
        Number of the point; None for all together.
    expected : int
        Number of points that should have been found.
    coverage : float
        Share of these that were.
    rmse_m, median_m, p95_m : float
        Of the distance in space.
    z_rmse_m, z_median_m, z_p95_m : float
        Of the error along z, its absolute value for the last two.
    vz_rmse_m_s, vz_median_m_s, vz_p95_m_s : float
        The same of the velocity along z.
    x_variance, y_variance, z_variance, vz_variance : float
        Mean square of the errors divided by their stated standard uncertainties: 1 when these are honest.
    """

    recording: str
    line: Line
    point: int | None
    expected: int
    coverage: float | None
    rmse_m: float | None
    median_m: float | None
    p95_m: float | None
    z_rmse_m: float | None
    z_median_m: float | None
    z_p95_m: float | None
    vz_rmse_m_s: float | None
    vz_median_m_s: float | None
    vz_p95_m_s: float | None
    x_variance: float | None
    y_variance: float | None
    z_variance: float | None
    vz_variance: float | None

    def record(self) -> dict[str, object]:
        """Return the row as plain data."""
        return asdict(self)


def point_errors(
    points: pd.DataFrame, kinematics: pd.DataFrame | None, truth: pd.DataFrame, line: Line = "surface"
) -> PointErrors:
    """Subtract the truth from one recording's points.

    Parameters
    ----------
    points, kinematics : pandas.DataFrame
        Tables of that name; without kinematics there are no velocities. The material line has neither uncertainties
        nor velocities, and nothing at all in tables that were built before it was estimated.
    truth : pandas.DataFrame
        ``points.parquet`` of the truth. Points are matched by frame and number.
    line : {"surface", "material"}
        Which of its lines to compare with.
    """
    known = truth.set_index(_KEYS)
    place, speed = (
        known[[f"{line}_{name}" for name in names]].to_numpy(np.float64)
        for names in ([f"{axis}_m" for axis in _AXES], [f"v{axis}_m_s" for axis in _AXES])
    )
    expected = known["surface_in_image"].to_numpy(bool) & np.isfinite(place).all(axis=1)

    def found(table: pd.DataFrame, template: str) -> FloatArray:
        columns = [template.format(axis) for axis in _AXES]
        values: FloatArray = table.set_index(_KEYS).reindex(index=known.index, columns=columns).to_numpy(np.float64)
        return values

    missing = np.full_like(place, np.nan)
    velocity_m_s, velocity_std_m_s = missing, missing
    on_surface = line == "surface"
    if kinematics is not None and on_surface:
        velocity_m_s = found(_at_frames(kinematics, known), "v{}_m_s") - speed
        velocity_std_m_s = found(kinematics, "v{}_std_m_s")
    return PointErrors(
        known.index.get_level_values("point").to_numpy(np.int64),
        expected,
        found(points, "{}_m" if on_surface else "material_{}_m") - place,
        found(points, "{}_std_m") if on_surface else missing,
        velocity_m_s,
        velocity_std_m_s,
    )


def _at_frames(kinematics: pd.DataFrame, known: pd.DataFrame) -> pd.DataFrame:
    """Return velocities at the stamps of the frames: those that hold between two frames are interpolated."""
    names = [f"v{axis}_m_s" for axis in _AXES]
    moved = kinematics.sort_values(["point", "stamp_ns"]).copy()
    start_ns = int(known["stamp_ns"].iloc[0])
    for _, rows in moved.groupby("point"):
        there = rows["velocity_stamp_ns"].notna().to_numpy() & rows[names].notna().all(axis=1).to_numpy()
        if not there.any() or (rows["velocity_stamp_ns"] == rows["stamp_ns"])[there].all():
            continue
        holds_s = (rows["velocity_stamp_ns"][there].astype("int64") - start_ns).to_numpy() / 1e9
        wanted_s = (rows["stamp_ns"] - start_ns).to_numpy() / 1e9
        for name in names:
            values = np.interp(wanted_s, holds_s, rows[name][there].to_numpy(), left=np.nan, right=np.nan)
            moved.loc[rows.index, name] = np.where(rows["x_m"].notna(), values, np.nan)
    return moved


def join_errors(errors: Iterable[PointErrors]) -> PointErrors:
    """Pool recordings."""
    parts = list(errors)
    return PointErrors(
        np.concatenate([part.point for part in parts]),
        np.concatenate([part.expected for part in parts]),
        np.concatenate([part.position_m for part in parts]),
        np.concatenate([part.std_m for part in parts]),
        np.concatenate([part.velocity_m_s for part in parts]),
        np.concatenate([part.velocity_std_m_s for part in parts]),
    )


def score_errors(errors: PointErrors, recording: str, line: Line) -> list[PointScore]:
    """Summarise errors: first all points together, then each."""
    numbers: Sequence[int | None] = [None, *sorted(set(errors.point.tolist()))]
    return [_score(errors, recording, line, number) for number in numbers]


def _score(errors: PointErrors, recording: str, line: Line, point: int | None) -> PointScore:
    chosen = errors.expected if point is None else errors.expected & (errors.point == point)
    position_m, std_m = errors.position_m[chosen], errors.std_m[chosen]
    velocity_m_s, velocity_std_m_s = errors.velocity_m_s[chosen], errors.velocity_std_m_s[chosen]
    there = np.isfinite(position_m).all(axis=1)
    rmse_m, median_m, p95_m = _figures(np.linalg.norm(position_m, axis=1))
    z_rmse_m, z_median_m, z_p95_m = _figures(np.abs(position_m[:, 2]))
    vz_rmse_m_s, vz_median_m_s, vz_p95_m_s = _figures(np.abs(velocity_m_s[:, 2]))
    return PointScore(
        recording=recording,
        line=line,
        point=point,
        expected=int(chosen.sum()),
        coverage=float(there.mean()) if there.size else None,
        rmse_m=rmse_m,
        median_m=median_m,
        p95_m=p95_m,
        z_rmse_m=z_rmse_m,
        z_median_m=z_median_m,
        z_p95_m=z_p95_m,
        vz_rmse_m_s=vz_rmse_m_s,
        vz_median_m_s=vz_median_m_s,
        vz_p95_m_s=vz_p95_m_s,
        x_variance=_variance(position_m[:, 0], std_m[:, 0]),
        y_variance=_variance(position_m[:, 1], std_m[:, 1]),
        z_variance=_variance(position_m[:, 2], std_m[:, 2]),
        vz_variance=_variance(velocity_m_s[:, 2], velocity_std_m_s[:, 2]),
    )


def _figures(sizes: FloatArray) -> tuple[float | None, float | None, float | None]:
    """Return root mean square, median and 95 % of sizes; NaN are left out."""
    known = sizes[np.isfinite(sizes)]
    if known.size == 0:
        return None, None, None
    return float(np.sqrt((known**2).mean())), float(np.median(known)), float(np.percentile(known, 95))


def _variance(error: FloatArray, std: FloatArray) -> float | None:
    known = np.isfinite(error) & (std > 0)
    return float(((error[known] / std[known]) ** 2).mean()) if known.any() else None
