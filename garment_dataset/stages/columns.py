"""Columns that tables of several stages share, and stages of your own may."""

from __future__ import annotations

from garment_dataset.engine.table import Column

FRAME = Column("frame", "int32", "1", "index of the image in its stream, from 0, faulty messages counted")
STAMP = Column("stamp_ns", "int64", "ns", "header stamp: when the camera saw it, since the Unix epoch")
PLACE = (
    Column("x_m", "float64", "m", "depth optical frame, right", nullable=True, uncertainty="x_std_m"),
    Column("y_m", "float64", "m", "depth optical frame, down", nullable=True, uncertainty="y_std_m"),
    Column("z_m", "float64", "m", "depth optical frame, forward", nullable=True, uncertainty="z_std_m"),
    *(
        Column(f"{axis}_std_m", "float64", "m", f"standard uncertainty of {axis}", nullable=True)
        for axis in ("x", "y", "z")
    ),
)
RECORD_STAMP = Column("record_stamp_ns", "int64", "ns", "when the recorder received it, since the Unix epoch")
