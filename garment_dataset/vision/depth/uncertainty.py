"""How certain the points of a smoothed chain are: to first order, from independent causes.

Errors along the ray move a point off the cloth; errors of the way along the cloth let it slide on it, which near a fold
means over its edge. Positions are not touched here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import BoolArray, FloatArray, IntArray
    from garment_dataset.vision.depth.chain import Chain, Track
    from garment_dataset.vision.depth.cloud import Intrinsics
    from garment_dataset.vision.depth.pattern import FixedPattern

BENT_STD_M = 0.002
"""Standard error of z where cloth is bent across the profile within the smallest windows.

Chosen so that normalised errors of z have variance near 1 on simulated towels held by a corner (docs/accuracy.md);
how far the windows disagree does not tell it. 2 mm is how far the middle of a 25 px window, 45 mm, is from the mean of
an arc of some 4 cm radius.
"""

FOLD_SHARE = 0.15
"""Standard error of the length of a fold's side over its extent along z: what the camera sees of it changes.

Chosen likewise, of the length of the whole: 0.21 for sides of 1 to 3 cm, 0.13 for 3 to 6 cm, 0.09 above.
"""

EDGE_STD_M = 0.006
"""Standard error of the height at which cloth jumps from one layer to another, chosen likewise.

The half height of the smallest window, 7 px, is 13 mm, and an error uniform within it has 7.5 mm.
"""

STEEP = 1.0
"""Where depth changes faster than height, cloth goes from one layer to another, however large the windows are."""


@dataclass(frozen=True, slots=True, eq=False)
class ErrorSources:
    """What one frame cannot tell about its own errors.

    Parameters
    ----------
    columns_per_m : (W,) float64
        Standard deviation in inverse depth, by column of the image, of the error that whole columns share.
    pattern : FixedPattern
        The same of what is always added to the mean over a window, by the window's size.
    gripper_std_m : (x, y, z)
        Standard uncertainty of the coordinates of the gripper's end point.
    window_px : (int, int)
        Half width and half height of the largest window that planes are fitted to.
    noise_factor : float
        How many times as large the noise of smoothed values is as it seems from how they scatter, because it hangs
        together from frame to frame.
    """

    columns_per_m: FloatArray
    pattern: FixedPattern
    gripper_std_m: tuple[float, float, float]
    window_px: tuple[int, int]
    noise_factor: float = 1.0


class PointStd(NamedTuple):
    """Standard uncertainties of points, each (3, r) float64, in metres."""

    all_m: FloatArray
    fixed_m: FloatArray
    """The part that stays as it is as long as the cloth does not move."""


def noise_factor(correlation: float) -> float:
    r"""Return how many times as large the noise of means over a few frames is as their scatter says.

    Notes
    -----
    For noise whose correlation falls as :math:`\rho^k` over k frames, the variance of a mean is larger by
    :math:`(1 + \rho) / (1 - \rho)`, and neighbours differ by less, by :math:`1 - \rho`.
    """
    return float(np.sqrt(2 * (1 + correlation)) / (1 - correlation))


def point_std_m(
    track: Track,
    position_m: FloatArray,
    arc_m: FloatArray,
    path_m: tuple[FloatArray, FloatArray],
    intrinsics: Intrinsics,
    sources: ErrorSources,
) -> PointStd:
    r"""Return the standard uncertainties of points on a chain.

    Parameters
    ----------
    track : Track
        One frame's chain.
    position_m : (3, r) float64
        Points, and
    arc_m : (r,) float64
        their places along the path from the gripper's end point.
    path_m : ((n,) float64, (3, n) float64)
        That path: arc length and position of its nodes.
    intrinsics : Intrinsics
        Of the image.
    sources : ErrorSources
        See there.

    Returns
    -------
    PointStd

    Notes
    -----
    Along the ray: the noise of z as seen after smoothing, the fixed error of the columns, the fixed pattern as it is
    averaged over the window, the cloth's bend within the window, and what a bridge may hide. Of the gripper's x: all of
    it on x, and on z by the lean of the sheet.

    Along the cloth, for a point at the share s of the length: the hem is uncertain by its noise, by a row of pixels, as
    sensors let what is near grow at its edges, and by what it hides if it is rolled, of which the point takes s; the
    hold by its noise, the fixed error, the gripper, and by how much of the way from the gripper to the cloth is none
    but their errors, uniform from nothing to all, of which it takes 1 - s; the folds as :func:`fold_std_m` says. What
    that does to x, y and z is the mean square of the ways to the places one standard uncertainty up and down the cloth.
    On the side of a fold, its height is uncertain too.
    """
    chain, share = track.chain, arc_m / track.chain.length_m
    nearest = np.clip(np.searchsorted(chain.arc_length_m, arc_m), 1, chain.arc_length_m.size - 1)
    pixels = chain.pixels[nearest]
    ray_fixed_m = _fixed_std_m(position_m, pixels, intrinsics, sources)
    flat = _flatness(chain.pixels, sources.window_px)
    bent_std_m = _bend_std_m(chain, position_m, flat[nearest], sources.window_px[1] / intrinsics.fy_px)
    bridge_std_m = np.interp(arc_m, chain.arc_length_m, chain.support.std_m)
    noise_m = sources.noise_factor * track.z_noise_m[nearest]
    ray_m = np.sqrt(noise_m**2 + ray_fixed_m**2 + bent_std_m**2 + bridge_std_m**2)

    row_m = np.hypot(chain.position_m[2, -1] / intrinsics.fy_px, track.hidden_std_m)
    held_m = np.hypot(track.top_noise_m, sources.gripper_std_m[1])
    along_fixed_m = np.hypot(share * row_m, (1 - share) * held_m)
    folds_std_m, on_side = fold_std_m(chain, arc_m, flat)
    edge_m: FloatArray = EDGE_STD_M * on_side.astype(np.float64)
    end_m = sources.noise_factor * share * track.end_noise_m
    along_m = np.sqrt(along_fixed_m**2 + end_m**2 + folds_std_m**2 + edge_m**2)

    def stated(ray_m: FloatArray, along_m: FloatArray, edge_m: FloatArray) -> FloatArray:
        variance = slid_m2(path_m, position_m, arc_m, along_m)
        variance[0] += sources.gripper_std_m[0] ** 2
        variance[1] += (position_m[1] / position_m[2] * ray_m) ** 2 + edge_m**2
        variance[2] += ray_m**2 + (track.lean[nearest] * sources.gripper_std_m[0]) ** 2
        std_m: FloatArray = np.sqrt(variance)
        return std_m

    return PointStd(stated(ray_m, along_m, edge_m), stated(ray_fixed_m, along_fixed_m, np.zeros(arc_m.size)))


def slid_m2(
    path_m: tuple[FloatArray, FloatArray], position_m: FloatArray, arc_m: FloatArray, along_m: FloatArray
) -> FloatArray:
    """Return the mean square of the ways to the places so far up and down the cloth, (3, r).

    Parameters
    ----------
    path_m : ((n,) float64, (3, n) float64)
        Arc length and position of the path's nodes.
    position_m : (3, r) float64
        Points on it, and
    arc_m : (r,) float64
        their places.
    along_m : (r,) float64
        How far they may slide.
    """
    place_m = np.stack([arc_m - along_m, arc_m + along_m])
    ways_m = np.stack([np.interp(place_m, path_m[0], axis) for axis in path_m[1]]) - position_m[:, None]
    squares: FloatArray = (ways_m**2).sum(axis=1) / 2
    return squares


def _fixed_std_m(position_m: FloatArray, pixels: IntArray, intrinsics: Intrinsics, sources: ErrorSources) -> FloatArray:
    """Return the standard error of z that stands still, (r,)."""
    column = np.rint(intrinsics.cx_px + intrinsics.fx_px * position_m[0] / position_m[2]).astype(np.int64)
    columns_per_m = sources.columns_per_m[np.clip(column, 0, sources.columns_per_m.size - 1)]
    std_m: FloatArray = position_m[2] ** 2 * np.hypot(columns_per_m, sources.pattern.at(pixels.astype(np.float64)))
    return std_m


def _flatness(pixels: IntArray, window_px: tuple[int, int]) -> FloatArray:
    """Return 1 where windows are larger than half the largest, by their pixels, and towards 0 the smaller they are.

    Small windows mean cloth that is bent, narrow, or not seen.
    """
    half_width_px, half_height_px = window_px
    flat: FloatArray = np.clip(2 * pixels / ((2 * half_width_px + 1) * (2 * half_height_px + 1)), 0, 1)
    return flat


def _bend_std_m(chain: Chain, position_m: FloatArray, flat: FloatArray, half_height: float) -> FloatArray:
    r"""Return the standard error of z because cloth is no plane within a window, (r,).

    A window of half height h, here over z, is off by :math:`z'' h^2 / 6` where the profile has the curvature z''; that
    is seen, and counts where windows are large. Where they are small, the bend across the profile counts, unseen.
    """
    _, y_m, z_m = position_m
    nodes_y_m, nodes_z_m = chain.position_m[1:]
    room_m = np.maximum(np.minimum(y_m - nodes_y_m[0], nodes_y_m[-1] - y_m), 0)
    reach_m = np.minimum(half_height * z_m, room_m)
    above_m, below_m = (np.interp(y_m + sign * reach_m, nodes_y_m, nodes_z_m) for sign in (-1, 1))
    std_m: FloatArray = np.hypot(flat * (above_m - 2 * z_m + below_m) / 6, (1 - flat) * BENT_STD_M)
    return std_m


def fold_std_m(chain: Chain, arc_m: FloatArray, flat: FloatArray) -> tuple[FloatArray, BoolArray]:
    r"""Return how uncertain places along a chain are because of its folds, and which are on a steep side.

    Parameters
    ----------
    chain : Chain
        From the gripper down.
    arc_m : (r,) float64
        Places at fixed shares s of its length.
    flat : (k,) float64
        By sample, 1 for flat cloth, where only steep links belong to folds, 0 for bent, where all do.

    Returns
    -------
    std_m : (r,) float64
    on_side : (r,) bool

    Notes
    -----
    A side is a stretch on which z only rises or only falls. The error :math:`e_j` of its length moves everything below
    it, and makes the whole longer: a place at the share s is off by :math:`(s - 1) e_j` below the side and by
    :math:`s e_j` above and on it. Sides are independent, each with a standard error of :data:`FOLD_SHARE` of its
    extent along z.
    """
    down_m, away_m = np.diff(chain.position_m[1]), np.diff(chain.position_m[2])
    steep = np.abs(away_m) > STEEP * down_m
    starts = np.flatnonzero(np.concatenate([[True], np.sign(away_m[1:]) != np.sign(away_m[:-1])]))
    side_m = np.add.reduceat(np.abs(away_m) * np.where(steep, 1, 1 - flat[1:]), starts)
    below = chain.arc_length_m[np.append(starts[1:], away_m.size)] <= arc_m[:, None]
    weight = arc_m[:, None] / chain.length_m - below
    std_m: FloatArray = FOLD_SHARE * np.sqrt(((weight * side_m) ** 2).sum(axis=1))
    link = np.clip(np.searchsorted(chain.arc_length_m, arc_m) - 1, 0, away_m.size - 1)
    return std_m, steep[link]
