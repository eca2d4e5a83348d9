"""Knobs of the two methods, as the numerics take them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.vision.depth.profile import ProfileSettings


@dataclass(frozen=True, slots=True)
class WindowSettings:
    """Knobs of the thesis' method: means over windows, each frame alone.

    Parameters
    ----------
    point_count : int
        Points on the garment.
    band_half_width_m, strip_half_width_m : float
        Depth and x from the gripper's that are kept, eqs. (5.8) and (5.9).
    sample_step_m, window_half_height_m : float
        Distance of the samples along y, and half the height that each averages.
    max_gap_m : float
        Longest run of empty samples that is crossed.
    min_pixels : int
        A sample of fewer counts as empty.
    jump_m : float
        Neighbouring depths that differ by more are not the same surface.
    hold_reach_m : float
        The first sample with pixels is no farther from the gripper's end point than that, in space.
    """

    point_count: int
    band_half_width_m: float
    strip_half_width_m: float
    sample_step_m: float
    window_half_height_m: float
    max_gap_m: float
    min_pixels: int
    jump_m: float
    hold_reach_m: float


@dataclass(frozen=True, slots=True)
class TrackSettings:
    """Knobs of the method ``profile``: planes in every frame, smoothed over time.

    Parameters
    ----------
    point_count : int
        Points on the garment.
    profile : ProfileSettings
        Of every frame.
    longest_bridge_m : float
        A longer gap is not bridged, whatever is on its sides.
    sample_step_m : float
        Distance of the samples along y.
    shortest_m : float
        A garment that seems shorter gets no points.
    smoothing_frames : sequence of int
        Lengths of the parabolas in time.
    flat_field_frames : int
        Images from which the fixed errors of the columns are measured, on
    flat_field_beyond_m : float
        what is farther than that.
    gripper_std_m : float
        Standard uncertainty of the end point's coordinates.
    """

    point_count: int
    profile: ProfileSettings
    longest_bridge_m: float
    sample_step_m: float
    shortest_m: float
    smoothing_frames: Sequence[int]
    flat_field_frames: int
    flat_field_beyond_m: float
    gripper_std_m: float
