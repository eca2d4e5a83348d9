"""The tables of ``depth_points``: chains down the garment, and points on it."""

from __future__ import annotations

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.stages.columns import FRAME, PLACE, STAMP

CHAINS = TableSpec(
    "chains",
    2,
    "one sample of one depth frame, from the gripper down",
    (
        FRAME,
        STAMP,
        Column(
            "sample",
            "int32",
            "1",
            "number of the sample, from 0 at the gripper; missing where neither pixels nor a bridge carry it",
        ),
        Column("x_m", "float64", "m", "depth optical frame, right"),
        Column("y_m", "float64", "m", "depth optical frame, down"),
        Column("z_m", "float64", "m", "depth optical frame, forward"),
        Column("arc_length_m", "float64", "m", "along the chain, from the gripper's end point"),
        Column("pixels", "int32", "1", "number of pixels in the window; 0 where a gap was bridged"),
        Column("bridged_m", "float64", "m", "length of the bridge it lies on; 0 where pixels carry it"),
        Column("z_spread_m", "float64", "m", "standard deviation of z in the window", nullable=True),
    ),
    keys=("frame", "sample"),
)

POINTS = TableSpec(
    "points",
    4,
    "one point of one depth frame",
    (
        FRAME,
        STAMP,
        Column("point", "int32", "1", "number of the point, 1 next to the gripper"),
        *PLACE,
        Column(
            "z_common_m",
            "float64",
            "m",
            "standard uncertainty of an error of z that all points and frames share, which no recording shows: the "
            "sensor's calibration. Not in z_std_m",
            nullable=True,
        ),
        *(
            Column(
                f"{axis}_fixed_m",
                "float64",
                "m",
                f"the part of {axis}_std_m that stays as it is as long as the cloth does not move",
                nullable=True,
            )
            for axis in "xyz"
        ),
        *(
            Column(
                f"material_{axis}_m",
                "float64",
                "m",
                f"the point on the material line, estimated as the middle of the sheet, {side}; null: cannot be had",
                nullable=True,
            )
            for axis, side in (("x", "right"), ("y", "down"), ("z", "forward"))
        ),
        Column("arc_length_m", "float64", "m", "along the garment, from the gripper's end point", nullable=True),
        Column(
            "garment_length_m",
            "float64",
            "m",
            "length of the garment, which the points divide; null when its hem is not seen: they divide what is",
            nullable=True,
        ),
        Column("length_reason", "string", "", "why there are points, but no length; null otherwise", nullable=True),
        Column("pixels", "int32", "1", "number of pixels the point rests on"),
        Column(
            "bridged_m",
            "float64",
            "m",
            "length of the bridge the point lies on, between two pieces of one surface; 0 where pixels carry it",
            nullable=True,
        ),
        Column("reason", "string", "", "why there is no point; null when there is one", nullable=True),
    ),
    keys=("frame", "point"),
)
