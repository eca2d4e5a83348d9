"""Displacement from rest, velocity and acceleration of the gripper and the points: thesis 5.3.5."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, Self

from pydantic import Field, model_validator

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.errors import PipelineError
from garment_dataset.stages.columns import FRAME, STAMP
from garment_dataset.stages.moving import moving_points
from garment_dataset.stages.stage import Stage, StageParams

if TYPE_CHECKING:
    import pyarrow as pa
    from numpy.typing import NDArray

    from garment_dataset.arrays import FloatArray, IntArray
    from garment_dataset.stages.moving import Moving
    from garment_dataset.vision.onset import Onset, OnsetReason, OnsetSettings


def _vector(name: str, unit: str, what: str) -> tuple[Column, ...]:
    """Return the columns of a vector, x, y and z, and those of its standard uncertainties."""
    suffix = unit.replace("/", "_")
    sides = (("x", "right"), ("y", "down"), ("z", "forward"))
    return (
        *(
            Column(f"{name}{axis}_{suffix}", "float64", unit, f"{what}, {side}", True, f"{name}{axis}_std_{suffix}")
            for axis, side in sides
        ),
        *(
            Column(f"{name}{axis}_std_{suffix}", "float64", unit, f"standard uncertainty of {name}{axis}", True)
            for axis, _ in sides
        ),
    )


KINEMATICS = TableSpec(
    "kinematics",
    3,
    "one point of one depth frame, the gripper among them",
    (
        FRAME,
        STAMP,
        Column("point", "int32", "1", "number of the point; 0 is the gripper, 1 next to it"),
        Column("time_s", "float64", "s", "since the gripper began to move", True, "time_std_s"),
        Column("time_std_s", "float64", "s", "standard uncertainty of that beginning: one error for all rows", True),
        Column(
            "time_reason",
            "string",
            "",
            "why there is no time, and no displacement: no_gripper, no_rest, no_motion; stamp: it is not later than "
            "those of images before it",
            nullable=True,
        ),
        *_vector("", "m", "position in the depth optical frame"),
        *_vector("d", "m", "displacement from rest"),
        Column("velocity_stamp_ns", "int64", "ns", "when the velocity holds: middle of its interval", nullable=True),
        *_vector("v", "m/s", "velocity"),
        *_vector("a", "m/s2", "acceleration at the stamp"),
        Column("pixels", "int32", "1", "number of pixels the point rests on; null for the gripper", nullable=True),
        Column(
            "bridged_m", "float64", "m", "length of the bridge it is on, as in points; null: gripper", nullable=True
        ),
        Column("reason", "string", "", "why there is no position; null when there is one", nullable=True),
        Column(
            "source",
            "string",
            "",
            "whose motion: points, of equal shares of what is seen, or tracks, of the material; the same in all rows",
        ),
    ),
    keys=("frame", "point"),
)


class KinematicsParams(StageParams):
    """What counts as motion, and how velocity is taken."""

    source: Literal["points", "tracks"] = Field(
        default="points",
        description="whose motion: points of equal shares of what is seen, or tracks, which stay on the material; the "
        "pipeline must then have the stage tracks",
    )
    onset_threshold_m: float = Field(
        default=0.002,
        gt=0,
        description="distance of the gripper from rest that counts as motion: a position from joint encoders scatters "
        "by far less. When it began is told from the rise before and after",
    )
    onset_rise_frames: int = Field(
        default=6, ge=2, description="frames of the rise, from the first that stands out of the noise, that are fitted"
    )
    onset_noise_m: float = Field(
        default=2e-5,
        gt=0,
        description="smaller differences of the gripper's position mean nothing: it is interpolated between samples",
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

    def onset_settings(self) -> OnsetSettings:
        """Return the knobs of the onset."""
        from garment_dataset.vision.onset import OnsetSettings

        return OnsetSettings(
            threshold_m=self.onset_threshold_m,
            rest_frames=self.rest_frames,
            lasting_frames=self.lasting_frames,
            rise_frames=self.onset_rise_frames,
            noise_m=self.onset_noise_m,
        )


def kinematics(
    points: pa.Table, gripper: pa.Table, params: KinematicsParams, tracks: pa.Table | None = None
) -> dict[str, pa.Table]:
    """Relate the points to their rest, and differentiate them.

    Parameters
    ----------
    points, gripper : pyarrow.Table
        As ``depth_points`` and ``decode`` made them; rows are matched by the index of the image.
    params : KinematicsParams
        See there.
    tracks : pyarrow.Table, optional
        As the stage of that name made it, where the pipeline has it.

    Returns
    -------
    dict of str to pyarrow.Table
        ``kinematics``: for every frame of ``points`` the gripper as point 0 and the points. Time and displacement are
        null when the gripper never moves or its rest was not seen; position, velocity and acceleration are there all
        the same. The thesis' method has no acceleration.

    Raises
    ------
    PipelineError
        If its source is the tracks, and there are none.

    Notes
    -----
    A frame whose stamp does not fit in keeps its position alone; all others are as if it were not there.
    """
    import numpy as np

    from garment_dataset.vision.kinematics import increasing
    from garment_dataset.vision.onset import find_onset

    moving = moving_points(_source(points, tracks, params), gripper)
    kept = np.flatnonzero(increasing(moving.stamp_ns))
    onset = find_onset(moving.stamp_ns[kept], moving.position_m[kept, 0], params.onset_settings())
    count = moving.position_m.shape[1]
    columns: dict[str, Any] = {
        "frame": np.repeat(moving.frame, count),
        "stamp_ns": np.repeat(moving.stamp_ns, count),
        "point": np.tile(np.arange(count), moving.frame.size),
        **_per_axis("", "m", moving.position_m, moving.std_m),
        **_since_onset(moving, kept, onset),
        **_derivatives(moving, kept, params),
        "pixels": moving.pixels.ravel(),
        "bridged_m": moving.bridged_m.ravel(),
        "reason": [reason for reasons in moving.reasons for reason in reasons],
        "source": [params.source] * (moving.frame.size * count),
    }
    return {"kinematics": KINEMATICS.table(columns)}


def _source(points: pa.Table, tracks: pa.Table | None, params: KinematicsParams) -> pa.Table:
    """Return the table whose points are asked for."""
    if params.source == "points":
        return points
    if tracks is None:
        raise PipelineError(
            "no table tracks",
            where="params.kinematics",
            found='source = "tracks"',
            hint="Add the stage tracks to the pipeline, or leave source out.",
        )
    return tracks


def _per_axis(name: str, unit: str, values: FloatArray, std: FloatArray) -> dict[str, FloatArray]:
    """Return the columns of a vector (T, P, 3) and of its standard uncertainties."""
    columns = {f"{name}{axis}_{unit}": values[:, :, i].ravel() for i, axis in enumerate("xyz")}
    return columns | {f"{name}{axis}_std_{unit}": std[:, :, i].ravel() for i, axis in enumerate("xyz")}


def _spread(values: NDArray[Any], kept: IntArray, count: int) -> NDArray[Any]:
    """Return values of the kept frames for all ``count`` frames, NaN elsewhere."""
    import numpy as np

    spread = np.full((count, *values.shape[1:]), np.nan)
    spread[kept] = values
    return spread


def _since_onset(tracks: Moving, kept: IntArray, onset: Onset | OnsetReason) -> dict[str, Any]:
    """Return the columns of time and displacement."""
    import numpy as np

    from garment_dataset.vision.kinematics import displacement

    frames, count = tracks.position_m.shape[:2]
    if isinstance(onset, str):
        time_s = np.full(frames, np.nan)
        moved_m = moved_std_m = np.full_like(tracks.position_m, np.nan)
        time_std_s = time_s
    else:
        stamp_ns = tracks.stamp_ns[kept]
        time_s = _spread((stamp_ns - onset.stamp_ns) / 1e9, kept, frames)
        time_std_s = np.where(np.isnan(time_s), np.nan, onset.std_s)
        moved = displacement(
            tracks.position_m[kept], tracks.std_m[kept], stamp_ns < onset.stamp_ns, tracks.fixed_m[kept]
        )
        moved_m, moved_std_m = (_spread(values, kept, frames) for values in moved)
    reason = onset if isinstance(onset, str) else "stamp"
    return {
        "time_s": np.repeat(time_s, count),
        "time_std_s": np.repeat(time_std_s, count),
        "time_reason": [reason if missing else None for missing in np.repeat(np.isnan(time_s), count)],
        **_per_axis("d", "m", moved_m, moved_std_m),
    }


def _derivatives(tracks: Moving, kept: IntArray, params: KinematicsParams) -> dict[str, Any]:
    """Return the columns of velocity and acceleration."""
    import numpy as np

    from garment_dataset.vision.kinematics import Derivatives, differences, local_polynomial, with_fixed_errors

    fixed_m = np.nan_to_num(tracks.fixed_m[kept])
    varying_m = np.sqrt(np.maximum(tracks.std_m[kept] ** 2 - fixed_m**2, 0))
    given = tracks.stamp_ns[kept], tracks.position_m[kept], varying_m
    velocity_stamp_ns = tracks.stamp_ns.copy()
    if params.velocity_method == "thesis":
        velocity_stamp_ns[kept], *velocity = differences(*given)
        nothing = np.full_like(given[1], np.nan)
        found = Derivatives(velocity[0], velocity[1], nothing, nothing)
    else:
        found = local_polynomial(*given, frames=params.polynomial_frames, degree=params.polynomial_degree)
    found = with_fixed_errors(found, fixed_m)
    velocity, acceleration = [*found[:2]], [*found[2:]]
    frames, count = tracks.position_m.shape[:2]
    velocity, acceleration = ([_spread(values, kept, frames) for values in pair] for pair in (velocity, acceleration))
    unknown = np.isnan(velocity[0].sum(axis=2)).ravel()
    return {
        "velocity_stamp_ns": np.ma.masked_array(np.repeat(velocity_stamp_ns, count), unknown),
        **_per_axis("v", "m_s", *velocity),
        **_per_axis("a", "m_s2", *acceleration),
    }


STAGE = Stage(kinematics, params=KinematicsParams, outputs=(KINEMATICS,))
