"""What a recording says about its motion as a whole: onset, lengths, gravity, noise, and how errors hang together."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from pydantic import Field

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.stages.stage import Stage, StageParams

if TYPE_CHECKING:
    import pyarrow as pa

    from garment_dataset.arrays import BoolArray, FloatArray


MOTION = TableSpec(
    "motion",
    1,
    "one recording",
    (
        Column("onset_stamp_ns", "int64", "ns", "when the gripper began to move: time_s = 0", True, "onset_std_ns"),
        Column("onset_std_ns", "float64", "ns", "standard uncertainty of the onset", nullable=True),
        Column("onset_reason", "string", "", "why there is no onset: no_gripper, no_rest, no_motion", nullable=True),
        Column("rest_frames", "int32", "1", "frames before the onset; null when it is not known", nullable=True),
        Column("moving_frames", "int32", "1", "frames from the onset on; null when it is not known", nullable=True),
        Column("rest_noise_m", "float64", "m", "rms scatter of a coordinate about its mean at rest", nullable=True),
        Column("moving_noise_m", "float64", "m", "rms scatter about a cubic over 11 frames in motion", nullable=True),
        Column("point_count", "int32", "1", "number of points on the garment: r"),
        Column("garment_length_m", "float64", "m", "from gripper to hem at rest, median", True, "garment_length_std_m"),
        Column("garment_length_std_m", "float64", "m", "standard uncertainty of garment_length", nullable=True),
        Column("segment_length_m", "float64", "m", "garment_length / point_count", True, "segment_length_std_m"),
        Column("segment_length_std_m", "float64", "m", "standard uncertainty of segment_length", nullable=True),
        Column(
            "rest_reason", "string", "", "why lengths are null: as onset_reason, or no_points at rest", nullable=True
        ),
        Column("gravity_x_m_s2", "float64", "m/s2", "gravity in the depth optical frame, right", nullable=True),
        Column("gravity_y_m_s2", "float64", "m/s2", "gravity in the depth optical frame, down", nullable=True),
        Column("gravity_z_m_s2", "float64", "m/s2", "gravity in the depth optical frame, forward", nullable=True),
        Column(
            "gravity_source",
            "string",
            "",
            "world: the recorded transforms; hanging: from the first to the last point at rest; null: neither",
            nullable=True,
        ),
    ),
)

CORRELATIONS = TableSpec(
    "correlations",
    1,
    "one quantity of one point",
    (
        Column("point", "int32", "1", "number of the point, 1 next to the gripper"),
        Column("quantity", "string", "", "column of kinematics whose errors these are"),
        Column("frames", "int32", "1", "frames with a value"),
        Column("standing_share", "float64", "1", "s: share of the error's variance that is the same in all frames"),
        Column("moving_lag1", "float64", "1", "rho: correlation of the rest of the error with that a frame later"),
        Column("lag1", "float64", "1", "correlation of the whole error with that a frame later: s + (1 - s) rho"),
        Column(
            "effective_frames", "float64", "1", "independent frames that the mean over them is worth", nullable=True
        ),
        Column("next_point", "float64", "1", "correlation with the next point's; null for the last", nullable=True),
        Column("rest_lag1", "float64", "1", "lag 1 autocorrelation seen at rest; null: too few frames", nullable=True),
    ),
    keys=("point", "quantity"),
)


class MotionParams(StageParams):
    """How errors hang together, as seen on simulated recordings, and the size of gravity."""

    standing_share: float = Field(
        default=0.25,
        ge=0,
        le=1,
        description="share of the variance of y and z that stands still over a recording, besides the gripper's: seen "
        "on simulated recordings, 0.11 to 0.24",
    )
    rest_share: float = Field(
        default=0.3,
        ge=0,
        le=1,
        description="share of the variance of displacements that is the rest's: seen likewise, 0.18 to 0.33",
    )
    moving_lag1: float = Field(
        default=0.8,
        ge=0,
        lt=1,
        description="correlation of the moving errors of neighbouring frames, which smoothing over 5 to 13 frames "
        "makes: seen likewise, 0.5 to 0.9, for positions, displacements and velocities",
    )
    next_y: float = Field(
        default=0.95, ge=0, le=1, description="correlation of neighbouring points along y: hem and hold move them all"
    )
    next_z: float = Field(
        default=0.25, ge=0, le=1, description="correlation of neighbouring points along z: planes overlap little"
    )
    gravity_m_s2: float = Field(default=9.81, gt=0, description="size of gravity")


def motion(
    kinematics: pa.Table, points: pa.Table, params: MotionParams, world: pa.Table | None = None
) -> dict[str, pa.Table]:
    """Put together what an estimator needs to know of a recording besides its tracks.

    Parameters
    ----------
    kinematics, points : pyarrow.Table
        Of the stages of that name, and ``depth_points``.
    params : MotionParams
        See there.
    world : pyarrow.Table, optional
        Direction of gravity, as ``decode`` made it.

    Returns
    -------
    dict of str to pyarrow.Table
        ``motion``: one row. ``correlations``: a row for every point and each of its positions, displacements and
        velocities.
    """
    from garment_dataset.vision.rest import moving_noise_m, rest_noise_m

    tracks = _Tracks.of(kinematics)
    moving = tracks.time_s >= 0
    row = {
        **_onset(kinematics, tracks),
        "rest_noise_m": _known(rest_noise_m(tracks.position_m[tracks.at_rest])),
        "moving_noise_m": _known(moving_noise_m(tracks.time_s[moving], tracks.position_m[moving])),
        "point_count": tracks.count,
        **_lengths(tracks, points),
        **_gravity(tracks, world, params.gravity_m_s2),
    }
    rows = [
        _correlation(tracks, point, kind, axis, params)
        for point in range(1, tracks.count + 1)
        for kind in _QUANTITIES
        for axis in range(3)
    ]
    return {
        "motion": MOTION.table({column.name: [row.get(column.name)] for column in MOTION.columns}),
        "correlations": CORRELATIONS.table({c.name: [row[c.name] for row in rows] for c in CORRELATIONS.columns}),
    }


_QUANTITIES = {"position": "{}_m", "displacement": "d{}_m", "velocity": "v{}_m_s"}


@dataclass(frozen=True)
class _Tracks:
    """The columns of kinematics, a row a frame."""

    values: dict[str, FloatArray]  # each (T, r + 1)
    reason: str | None

    @classmethod
    def of(cls, kinematics: pa.Table) -> _Tracks:
        import numpy as np

        _, row = np.unique(kinematics["frame"].to_numpy(), return_inverse=True)
        point = kinematics["point"].to_numpy()
        shape = int(row.max(initial=-1)) + 1, int(point.max(initial=0)) + 1
        values: dict[str, FloatArray] = {}
        for name in ("time_s", *(f"{axis}_std_m" for axis in "xyz"), *_names()):
            values[name] = np.full(shape, np.nan)
            values[name][row, point] = kinematics[name].to_numpy()
        told = {reason for reason in kinematics["time_reason"].to_pylist() if reason not in {None, "stamp"}}
        return cls(values, told.pop() if told else None)

    @property
    def count(self) -> int:
        """Number of points on the garment."""
        return int(self.values["time_s"].shape[1]) - 1

    @cached_property
    def time_s(self) -> FloatArray:
        """Since the onset, (T,)."""
        return self.values["time_s"][:, 0]

    @cached_property
    def position_m(self) -> FloatArray:
        """Of the points on the garment, (T, r, 3)."""
        import numpy as np

        return np.stack([self.values[f"{axis}_m"][:, 1:] for axis in "xyz"], axis=-1)

    @cached_property
    def at_rest(self) -> BoolArray:
        """Frames in which the gripper surely rests, (T,)."""
        import numpy as np

        return np.ones_like(self.time_s, dtype=np.bool_) if self.reason == "no_motion" else self.time_s < 0


def _names() -> list[str]:
    return [form.format(axis) for form in _QUANTITIES.values() for axis in "xyz"]


def _onset(kinematics: pa.Table, tracks: _Tracks) -> dict[str, Any]:
    """Return the onset, and how many frames are before and after it."""
    import numpy as np

    time_s = kinematics["time_s"].to_numpy()
    if tracks.reason is not None or not np.isfinite(time_s).any():
        counts = (int(tracks.at_rest.sum()), 0) if tracks.reason == "no_motion" else (None, None)
        return {
            "onset_reason": tracks.reason or "no_gripper",
            **dict(zip(("rest_frames", "moving_frames"), counts, strict=True)),
        }
    row = int(np.flatnonzero(np.isfinite(time_s))[0])
    return {
        "onset_stamp_ns": kinematics["stamp_ns"][row].as_py() - round(float(time_s[row]) * 1e9),
        "onset_std_ns": 1e9 * kinematics["time_std_s"][row].as_py(),
        "rest_frames": int(tracks.at_rest.sum()),
        "moving_frames": int((tracks.time_s >= 0).sum()),
    }


def _lengths(tracks: _Tracks, points: pa.Table) -> dict[str, Any]:
    """Return the garment's length at rest, and that of a segment."""
    import numpy as np

    from garment_dataset.vision.rest import length_std_m

    if tracks.reason in {"no_rest", "no_gripper"} or not tracks.at_rest.any():
        return {"rest_reason": tracks.reason or "no_gripper"}
    frame, row = np.unique(points["frame"].to_numpy(), return_inverse=True)
    length_m = np.full(frame.size, np.nan)
    length_m[row] = points["garment_length_m"].to_numpy()
    rest_m = length_m[tracks.at_rest]
    if not np.isfinite(rest_m).any():
        return {"rest_reason": "no_points"}
    length, std = float(np.nanmedian(rest_m)), length_std_m(tracks.values["y_std_m"][tracks.at_rest, 1:])
    return {
        "garment_length_m": length,
        "garment_length_std_m": _known(std),
        "segment_length_m": length / tracks.count,
        "segment_length_std_m": _known(std / tracks.count),
    }


def _gravity(tracks: _Tracks, world: pa.Table | None, size_m_s2: float) -> dict[str, Any]:
    """Return gravity as recorded, else along the garment as it hangs at rest."""
    import numpy as np

    from garment_dataset.vision.rest import hanging_direction

    rows = [] if world is None else [row for row in world.to_pylist() if row["stream"] == "depth"]
    recorded = [row[f"gravity_{axis}"] for row in rows[:1] for axis in "xyz"]
    if recorded and None not in recorded:
        direction, source = np.array(recorded), "world"
    else:
        direction, source = hanging_direction(tracks.position_m[tracks.at_rest]), "hanging"
    if not np.isfinite(direction).all():
        return {}
    gravity = {f"gravity_{axis}_m_s2": size_m_s2 * float(direction[i]) for i, axis in enumerate("xyz")}
    return {**gravity, "gravity_source": source}


def _known(value: float) -> float | None:
    """Return a number, None for NaN."""
    return None if math.isnan(value) else value


def _correlation(tracks: _Tracks, point: int, kind: str, axis: int, params: MotionParams) -> dict[str, Any]:
    """Return the row of one quantity of one point; the error of x is the gripper's, and stands still."""
    import numpy as np

    from garment_dataset.vision.correlation import along_standing_share, effective_frames, lag1_autocorrelation

    name = _QUANTITIES[kind].format("xyz"[axis])
    values = tracks.values[name][:, point]
    frames, rho = int(np.isfinite(values).sum()), params.moving_lag1
    x_std_m, y_std_m = (tracks.values[f"{other}_std_m"][:, point] for other in "xy")
    below = 1 - (point - 0.5) / tracks.count
    along = along_standing_share(below, x_std_m, y_std_m, params.standing_share)
    of_position = (1.0, along, params.standing_share)[axis]
    share = {"position": of_position, "displacement": params.rest_share, "velocity": 0.0}[kind]
    return {
        "point": point,
        "quantity": name,
        "frames": frames,
        "standing_share": share,
        "moving_lag1": rho,
        "lag1": share + (1 - share) * rho,
        "effective_frames": effective_frames(frames, share, rho) if frames else None,
        "next_point": None if point == tracks.count else (1.0, params.next_y, params.next_z)[axis],
        "rest_lag1": _known(float(lag1_autocorrelation(values[tracks.at_rest]))) if kind == "position" else None,
    }


STAGE = Stage(motion, params=MotionParams, outputs=(MOTION, CORRELATIONS), about=("width_m", "height_m", "weight_kg"))
