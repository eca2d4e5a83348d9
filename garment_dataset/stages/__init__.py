"""The stages: one file each, and the tuple that names them all."""

from __future__ import annotations

from garment_dataset.stages import background, central_curve, decode, depth_points, kinematics, silhouette

STAGES = (
    decode.STAGE,
    depth_points.STAGE,
    kinematics.STAGE,
    background.STAGE,
    silhouette.STAGE,
    central_curve.STAGE,
)
