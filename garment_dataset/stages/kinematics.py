"""Displacement from rest and velocity of the gripper and the points: thesis 5.3.5."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Self

from pydantic import Field, model_validator

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.stages.columns import FRAME, STAMP
from garment_dataset.stages.stage import Stage, StageParams

if TYPE_CHECKING:
    import pyarrow as pa
    from numpy.typing import NDArray

    from garment_dataset.arrays import FloatArray, IntArray


KINEMATICS = TableSpec(
    "kinematics",
    1,
    "one point of one depth frame, the gripper among them",
    (
        FRAME,
        STAMP,
        Column("point", "int32", "1", "number of the point; 0 is the gripper, 1 next to it"),
        Column("time_s", "float64", "s", "since the gripper began to move; null when it never did", nullable=True),
        *(
            Column(f"{axis}_m", "float64", "m", f"depth optical frame, {side}", nullable=True)
            for axis, side in (("x", "right"), ("y", "down"), ("z", "forward"))
        ),
        *(
            Column(f"d{axis}_m", "float64", "m", f"displacement from rest along {axis}", True, f"d{axis}_std_m")
            for axis in "xyz"
        ),
        *(
            Column(f"d{axis}_std_m", "float64", "m", f"standard uncertainty of d{axis}", nullable=True)
            for axis in "xyz"
        ),
        Column("velocity_stamp_ns", "int64", "ns", "when the velocity holds: middle of its interval", nullable=True),
        *(
            Column(f"v{axis}_m_s", "float64", "m/s", f"velocity along {axis}", True, f"v{axis}_std_m_s")
            for axis in "xyz"
        ),
        *(
            Column(f"v{axis}_std_m_s", "float64", "m/s", f"standard uncertainty of v{axis}", nullable=True)
            for axis in "xyz"
        ),
        Column("reason", "string", "", "why there is no position; null when there is one", nullable=True),
    ),
    keys=("frame", "point"),
)


class KinematicsParams(StageParams):
    """What counts as motion, and how velocity is taken."""

    onset_threshold_m: float = Field(
        default=0.002,
        gt=0,
        description="distance of the gripper from rest that counts as motion: at 0.03 m/s it is passed within two "
        "frames, and a position from joint encoders scatters by far less",
    )
    rest_frames: int = Field(default=5, ge=1, description="frames that must show the gripper at rest before it moves")
    lasting_frames: int = Field(
        default=3, ge=1, description="frames in a row that must be away from rest: one may be wrong"
    )
    velocity_method: Literal["local_polynomial", "thesis"] = Field(
        default="local_polynomial",
        description="thesis: difference of consecutive frames, at the middle of their stamps",
    )
    polynomial_frames: int = Field(
        default=11,
        ge=3,
        description="odd number of frames of a fit: a cubic over 11 frames at 30 fps errs least on made swings, see "
        "docs/accuracy.md",
    )
    polynomial_degree: int = Field(
        default=3, ge=1, le=4, description="3 is exact for motion whose acceleration changes evenly"
    )

    @model_validator(mode="after")
    def _fit_is_determined(self) -> Self:
        if self.polynomial_frames % 2 == 0 or self.polynomial_frames <= self.polynomial_degree:
            raise ValueError("polynomial_frames must be odd and larger than polynomial_degree")
        return self


@dataclass(frozen=True, slots=True, eq=False)
class _Tracks:
    """The gripper as point 0 and the points, in the order of their stamps."""

    frame: IntArray  # (T,)
    stamp_ns: IntArray  # (T,)
    position_m: FloatArray  # (T, P, 3)
    std_m: FloatArray  # (T, P, 3)
    reasons: list[list[str | None]]  # T lists of P


def kinematics(points: pa.Table, gripper: pa.Table, params: KinematicsParams) -> dict[str, pa.Table]:
    """Relate the points to their rest, and differentiate them.

    Parameters
    ----------
    points, gripper : pyarrow.Table
        As ``depth_points`` and ``decode`` made them; rows are matched by the index of the image.
    params : KinematicsParams
        See there.

    Returns
    -------
    dict of str to pyarrow.Table
        ``kinematics``: for every frame of ``points`` the gripper as point 0, whose uncertainty is not known, and the
        points. Time and displacement are null when the gripper never moves or its rest was not seen; position and
        velocity are there all the same.

    Notes
    -----
    Frames are put in the order of their stamps to be differentiated, and back into the order of the images.
    """
    import numpy as np

    from garment_dataset.vision.kinematics import displacement, motion_onset

    tracks = _tracks(points, gripper)
    onset = motion_onset(
        tracks.position_m[:, 0],
        threshold_m=params.onset_threshold_m,
        rest_frames=params.rest_frames,
        lasting_frames=params.lasting_frames,
    )
    if onset is None:
        time_s = np.full(tracks.frame.size, np.nan)
        moved_m = moved_std_m = np.full_like(tracks.position_m, np.nan)
    else:
        time_s = (tracks.stamp_ns - tracks.stamp_ns[onset]) / 1e9
        moved_m, moved_std_m = displacement(tracks.position_m, tracks.std_m, onset)
    velocity_stamp_ns, velocity_m_s, velocity_std_m_s = _velocity(tracks, params)

    order = np.argsort(tracks.frame, kind="stable")
    count = tracks.position_m.shape[1]

    def per_frame(values: NDArray[Any]) -> NDArray[Any]:
        return np.repeat(values[order], count)

    def per_axis(name: str, values: FloatArray) -> dict[str, FloatArray]:
        return {name.format(axis): values[order, :, i].ravel() for i, axis in enumerate("xyz")}

    unknown = np.isnan(velocity_m_s.sum(axis=2))[order].ravel()
    columns: dict[str, Any] = {
        "frame": per_frame(tracks.frame),
        "stamp_ns": per_frame(tracks.stamp_ns),
        "point": np.tile(np.arange(count), tracks.frame.size),
        "time_s": per_frame(time_s),
        **per_axis("{}_m", tracks.position_m),
        **per_axis("d{}_m", moved_m),
        **per_axis("d{}_std_m", moved_std_m),
        "velocity_stamp_ns": np.ma.masked_array(per_frame(velocity_stamp_ns), unknown),
        **per_axis("v{}_m_s", velocity_m_s),
        **per_axis("v{}_std_m_s", velocity_std_m_s),
        "reason": [reason for row in order for reason in tracks.reasons[row]],
    }
    return {"kinematics": KINEMATICS.table(columns)}


def _tracks(points: pa.Table, gripper: pa.Table) -> _Tracks:
    import numpy as np

    frame, first, row = np.unique(points["frame"].to_numpy(), return_index=True, return_inverse=True)
    stamp_ns = points["stamp_ns"].to_numpy()[first]
    order = np.argsort(stamp_ns, kind="stable")
    frame, stamp_ns, row = frame[order], stamp_ns[order], np.argsort(order)[row]

    point = points["point"].to_numpy()
    count = int(point.max(initial=0)) + 1
    position_m, std_m = np.full((2, frame.size, count, 3), np.nan)
    for axis, name in enumerate("xyz"):
        position_m[row, point, axis] = points[f"{name}_m"].to_numpy()
        std_m[row, point, axis] = points[f"{name}_std_m"].to_numpy()
    reasons: list[list[str | None]] = [["no_gripper"] + [None] * (count - 1) for _ in frame]
    for index, number, reason in zip(row, point, points["reason"].to_pylist(), strict=True):
        reasons[index][number] = reason

    rows = {number: index for index, number in enumerate(frame.tolist())}
    for held in gripper.select(["stream", "frame", "x_m", "y_m", "z_m", "reason"]).to_pylist():
        if held["stream"] == "depth" and (index := rows.get(held["frame"])) is not None:
            position_m[index, 0] = [np.nan if held[name] is None else held[name] for name in ("x_m", "y_m", "z_m")]
            reasons[index][0] = held["reason"]
    return _Tracks(frame, stamp_ns, position_m, std_m, reasons)


def _velocity(tracks: _Tracks, params: KinematicsParams) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return when velocities hold, the velocities and their standard uncertainties."""
    from garment_dataset.vision.kinematics import differences, local_polynomial

    if params.velocity_method == "thesis":
        return differences(tracks.stamp_ns, tracks.position_m, tracks.std_m)
    velocity_m_s, velocity_std_m_s = local_polynomial(
        tracks.stamp_ns,
        tracks.position_m,
        tracks.std_m,
        frames=params.polynomial_frames,
        degree=params.polynomial_degree,
    )
    return tracks.stamp_ns, velocity_m_s, velocity_std_m_s


STAGE = Stage(kinematics, params=KinematicsParams, outputs=(KINEMATICS,))
