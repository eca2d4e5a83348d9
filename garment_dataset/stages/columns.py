"""Columns that tables of several stages share, and stages of your own may."""

from __future__ import annotations

from garment_dataset.engine.table import Column

FRAME = Column("frame", "int32", "1", "index of the image in its stream, from 0, faulty messages counted")
STAMP = Column("stamp_ns", "int64", "ns", "header stamp: when the camera saw it, since the Unix epoch")
RECORD_STAMP = Column("record_stamp_ns", "int64", "ns", "when the recorder received it, since the Unix epoch")
