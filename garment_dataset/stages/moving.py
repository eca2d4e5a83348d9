"""The gripper and the points of a recording, in the order of its images, as ``kinematics`` takes them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pyarrow as pa

    from garment_dataset.arrays import FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """The gripper as point 0 and the points, in the order of the images."""

    frame: IntArray  # (T,)
    stamp_ns: IntArray  # (T,)
    position_m: FloatArray  # (T, P, 3)
    std_m: FloatArray  # (T, P, 3)
    fixed_m: FloatArray  # (T, P, 3), the part of it that stays as it is while a point does
    pixels: FloatArray  # (T, P)
    bridged_m: FloatArray  # (T, P)
    reasons: list[list[str | None]]  # T lists of P


def moving_points(points: pa.Table, gripper: pa.Table) -> Moving:
    """Return points, or tracks, with the gripper of the same images."""
    frame, first, row = np.unique(points["frame"].to_numpy(), return_index=True, return_inverse=True)
    point = points["point"].to_numpy()
    shape = (frame.size, int(point.max(initial=0)) + 1)

    def placed(name: str) -> FloatArray:
        values = np.full(shape, np.nan)
        if name in points.column_names:  # a stage in place of `depth_points` may leave some out
            values[row, point] = points[name].to_numpy()
        return values

    ends = ("_m", "_std_m", "_fixed_m")
    position_m, std_m, fixed_m = (np.stack([placed(f"{axis}{end}") for axis in "xyz"], axis=-1) for end in ends)
    reasons: list[list[str | None]] = [["no_gripper"] + [None] * (shape[1] - 1) for _ in frame]
    for index, number, reason in zip(row, point, points["reason"].to_pylist(), strict=True):
        reasons[index][number] = reason

    rows = {number: index for index, number in enumerate(frame.tolist())}
    for held in gripper.to_pylist():
        if held["stream"] == "depth" and (index := rows.get(held["frame"])) is not None:
            position_m[index, 0], std_m[index, 0] = (_triple(held, end) for end in ("_m", "_std_m"))
            reasons[index][0] = held["reason"]
    return Moving(
        frame,
        points["stamp_ns"].to_numpy()[first],
        position_m,
        std_m,
        fixed_m,
        placed("pixels"),
        placed("bridged_m"),
        reasons,
    )


def _triple(row: dict[str, Any], end: str) -> list[float]:
    values = (row.get(f"{axis}{end}") for axis in "xyz")
    return [float("nan") if value is None else value for value in values]
