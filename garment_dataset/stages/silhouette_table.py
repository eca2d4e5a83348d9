"""The table of the stage ``silhouette``: one row per usable colour frame."""

from __future__ import annotations

from typing import Literal

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.stages.columns import FRAME, STAMP

Reason = Literal["no_gripper", "image_size", "no_garment", "not_at_gripper"]
"""Why a frame has no mask.

``no_gripper``: its end point is not known at this frame, so that the arm could not be told from the garment.
``image_size``: the image is not of the background's size. ``no_garment``: nothing differs from the background, or
nothing as large as ``open_px`` and ``min_area_px2`` ask. ``not_at_gripper``: what differs does not come within
``near_m`` of the gripper's end point, so that it hangs from something else.
"""


SILHOUETTES = TableSpec(
    "silhouettes",
    4,
    "one usable colour frame",
    (
        FRAME,
        STAMP,
        Column("mask", "binary", "", "PNG of one bit per pixel, of the size of the image: white is garment", True),
        Column("area_px2", "int32", "px2", "number of pixels of the mask", nullable=True),
        Column("centroid_u_px", "float64", "px", "mean u of the mask; the centre of the first pixel is 0", True),
        Column("centroid_v_px", "float64", "px", "mean v of the mask; the centre of the first pixel is 0", True),
        Column("major_px", "float64", "px", "length of the major axis, as MATLAB's regionprops", nullable=True),
        Column("minor_px", "float64", "px", "length of the minor axis, as MATLAB's regionprops", nullable=True),
        Column("orientation_rad", "float64", "rad", "of the major axis, counter-clockwise from the u axis", True),
        Column("box_u_px", "int32", "px", "first column of the mask", nullable=True),
        Column("box_v_px", "int32", "px", "first row of the mask", nullable=True),
        Column("box_width_px", "int32", "px", "number of columns from the first to the last of the mask", True),
        Column("box_height_px", "int32", "px", "number of rows from the first to the last of the mask", True),
        Column("outline_u_px", "list<int32>", "px", "u of the outer border's pixels, counter-clockwise", True),
        Column("outline_v_px", "list<int32>", "px", "v of the same pixels", nullable=True),
        Column("gripper_u_px", "float64", "px", "u of the gripper's end point in the image", nullable=True),
        Column("gripper_v_px", "float64", "px", "v of the gripper's end point in the image", nullable=True),
        *(
            Column(
                f"drift_{channel}", "float64", "level", f"change of a pixel of median brightness, {name}", nullable=True
            )
            for channel, name in (("r", "red"), ("g", "green"), ("b", "blue"))
        ),
        Column(
            "confidence", "float64", "1", "about the intersection over union with the truth to expect", nullable=True
        ),
        Column(
            "doubt",
            "string",
            "",
            "what lowers confidence most: like_wall, edges, torn; null where it is 0.95 or more",
            nullable=True,
        ),
        Column("reason", "string", "", "why there is no mask; null when there is one", nullable=True),
    ),
    keys=("frame",),
)
"""``decode_mask(row.mask)`` of :mod:`garment_dataset.vision.color.masks` is the mask, (H, W) bool."""
