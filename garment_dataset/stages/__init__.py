"""The stages: one file each, and the tuple that names them all."""

from __future__ import annotations

from garment_dataset.stages import decode, depth_points, kinematics

STAGES = (decode.STAGE, depth_points.STAGE, kinematics.STAGE)
