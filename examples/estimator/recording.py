"""One recording of a snapshot, read with nothing but pyarrow: what the gripper did, what the points did, how sure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow.parquet as pq

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

AXES = "yz"
"""The plane that the garment swings in: y down, z away from the camera."""


@dataclass(frozen=True, eq=False)
class Recording:
    """The motion of r points below a gripper, T frames, in the plane of y and z.

    Parameters
    ----------
    name : str
        Of the recording.
    stamp_ns : (T,) int64
        When the camera saw each frame.
    time_s : (T,) float64
        Since the gripper began to move.
    gripper_m, gripper_m_s, gripper_m_s2 : (T, 2) float64
        Its displacement from rest, velocity and acceleration.
    gripper_pitch_rad : (T,) float64
        How far it has turned about x since rest; 0 where its orientation is not known.
    points_m, std_m : (T, r, 2) float64
        Displacements of the points from rest, and their standard uncertainties; NaN where there is none.
    rest_m : (r, 3) float64
        Where the points are at rest: x right, y down, z away from the camera.
    segment_m : float
        Length of a segment; points are in the middles.
    gravity_m_s2 : (2,) float64
        Gravity.
    standing, lag1, next_point : (r, 2) float64
        How errors hang together: the share that stands still, the correlation of the rest from frame to frame, and
        with the next point.
    """

    name: str
    stamp_ns: NDArray[np.int64]
    time_s: FloatArray
    gripper_m: FloatArray
    gripper_m_s: FloatArray
    gripper_m_s2: FloatArray
    gripper_pitch_rad: FloatArray
    points_m: FloatArray
    std_m: FloatArray
    rest_m: FloatArray
    segment_m: float
    gravity_m_s2: FloatArray
    standing: FloatArray
    lag1: FloatArray
    next_point: FloatArray

    @property
    def count(self) -> int:
        """Number of points."""
        return int(self.points_m.shape[1])

    def covariance(self, axis: int) -> FloatArray:
        r"""Return the covariance of the displacements along one axis, (T r, T r), frames first.

        Between point p in frame i and point q in frame j it is :math:`\sigma_{ip} \sigma_{jq} c_{pq} (\sqrt{s_p s_q} +
        \sqrt{(1 - s_p) (1 - s_q)} \rho^{|i - j|})`, with :math:`c_{pq}` the product of the correlations of next points
        between them, as the snapshot's table ``correlations`` describes it.
        """
        share, rho = self.standing[:, axis], float(self.lag1[:, axis].mean())
        chain = np.concatenate([[1.0], np.cumprod(self.next_point[:-1, axis])])
        low, high = np.sort(np.stack(np.meshgrid(*[np.arange(self.count)] * 2)), axis=0)
        along = np.where(high == low, 1.0, np.nan_to_num(chain[high] / np.where(chain[low] == 0, np.nan, chain[low])))
        frames = np.arange(len(self.time_s))
        steps = rho ** np.abs(frames[:, None] - frames)
        standing = np.kron(np.ones_like(steps), along * np.sqrt(np.outer(share, share)))
        moving = np.kron(steps, along * np.sqrt(np.outer(1 - share, 1 - share)))
        sigma = self.std_m[:, :, axis].ravel()
        covariance: FloatArray = (standing + moving) * np.outer(sigma, sigma)
        return covariance


def recordings_of(snapshot: Path) -> list[str]:
    """Return the names of the recordings whose motion a snapshot has, sorted."""
    return sorted(path.stem for path in (snapshot / "kinematics").glob("*.parquet"))


def read(snapshot: Path, name: str) -> Recording:
    """Read one recording of a snapshot.

    Raises
    ------
    ValueError
        If nothing moves in it, or it does not say how long a segment is.
    """
    motion = _table(snapshot, "motion", name).to_pylist()[0]
    if motion["onset_reason"] is not None or motion["segment_length_m"] is None:
        raise ValueError(f"{name}: no onset ({motion['onset_reason']}), or no length ({motion['rest_reason']})")
    table = _table(snapshot, "kinematics", name).sort_by([("stamp_ns", "ascending"), ("point", "ascending")])
    rows = {key: _numbers(table[key]) for key in ("point", "time_s", *_columns("d{}_m", "d{}_std_m"))}
    count = int(rows["point"].max()) + 1
    gripper = table.filter(table["point"].to_numpy() == 0)
    shape = (-1, count, 2)
    points, std = (
        np.stack([rows[form.format(axis)] for axis in AXES], axis=1).reshape(shape) for form in ("d{}_m", "d{}_std_m")
    )
    correlations = _table(snapshot, "correlations", name).to_pylist()
    return Recording(
        name,
        gripper["stamp_ns"].to_numpy(),
        rows["time_s"].reshape(-1, count)[:, 0],
        points[:, 0],
        _vectors(gripper, "v{}_m_s"),
        _vectors(gripper, "a{}_m_s2"),
        _pitch_rad(snapshot, name, gripper["frame"].to_numpy()),
        points[:, 1:],
        std[:, 1:],
        _at_rest_m(table, count),
        float(motion["segment_length_m"]),
        np.array([motion[f"gravity_{axis}_m_s2"] for axis in AXES]),
        *(_about_errors(correlations, key, count - 1) for key in ("standing_share", "moving_lag1", "next_point")),
    )


def _table(snapshot: Path, table: str, name: str) -> Any:  # noqa: ANN401 - an Arrow table
    return pq.read_table(snapshot / table / f"{name}.parquet", partitioning=None)


def _columns(*forms: str) -> list[str]:
    return [form.format(axis) for form in forms for axis in AXES]


def _numbers(column: Any) -> FloatArray:  # noqa: ANN401 - an Arrow column
    found: FloatArray = column.to_numpy().astype(np.float64)
    return found


def _vectors(rows: Any, form: str) -> FloatArray:  # noqa: ANN401 - an Arrow table
    return np.nan_to_num(np.stack([_numbers(rows[form.format(axis)]) for axis in AXES], axis=1))


def _at_rest_m(table: Any, count: int) -> FloatArray:  # noqa: ANN401 - an Arrow table
    """Return where the points are before the gripper moves, (r, 3)."""
    place = np.stack([_numbers(table[f"{axis}_m"]) for axis in "xyz"], axis=1).reshape(-1, count, 3)
    before = _numbers(table["time_s"]).reshape(-1, count)[:, 0] < 0
    rest_m: FloatArray = np.nanmedian(place[before, 1:], axis=0)
    return rest_m


def _about_errors(rows: list[dict[str, Any]], key: str, count: int) -> FloatArray:
    """Return what is said of the errors of displacements, (r, 2)."""
    found = {(row["point"], row["quantity"]): row[key] for row in rows}
    values = [[found.get((point, f"d{axis}_m")) for axis in AXES] for point in range(1, count + 1)]
    return np.nan_to_num(np.array(values, np.float64))


def _pitch_rad(snapshot: Path, name: str, frames: NDArray[np.int64]) -> FloatArray:
    """Return how far the gripper has turned about the x axis since it was first known; 0 where it never is."""
    rows = {row["frame"]: row for row in _table(snapshot, "gripper", name).to_pylist() if row["stream"] == "depth"}
    nothing = dict.fromkeys(("qx", "qy", "qz", "qw"))
    q = np.array([[rows.get(frame, nothing)[key] for key in nothing] for frame in frames.tolist()], np.float64)
    known = np.flatnonzero(np.isfinite(q).all(axis=1))
    if not known.size:
        return np.zeros(len(frames))
    x0, y0, z0, w0 = q[known[0]]
    x, y, z, w = q[known].T
    # the turn since then, q times the conjugate of the first one: of it the part about x
    about_x, real = x * w0 - w * x0 - y * z0 + z * y0, w * w0 + x * x0 + y * y0 + z * z0
    turned = np.unwrap(2 * np.arctan2(about_x, real), period=2 * np.pi)
    pitch: FloatArray = np.interp(np.arange(len(frames)), known, turned)
    return pitch
