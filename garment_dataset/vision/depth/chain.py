"""From the garment's pixels to points of equal distance along it: thesis 5.3.4.

The pieces are separate, each a function of the one before: pixels (``cloud``), ``samples``, chain, points. Positions
are in the optical frame, ``(3, n)`` with the rows x, y and z.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.vision.depth.cloud import COLUMN_BAND_LEVELS, level_spacing_m, z_std_m
from garment_dataset.vision.depth.support import BridgeLimits, Support, bridge_gaps

if TYPE_CHECKING:
    from garment_dataset.arrays import FloatArray, IntArray
    from garment_dataset.vision.depth.cloud import Intrinsics, Point
    from garment_dataset.vision.depth.samples import Samples
    from garment_dataset.vision.depth.support import PointReason


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """Samples without holes, with the arc length along them.

    Parameters
    ----------
    position_m : (3, k) float64
        The samples; interpolated across gaps, so that the way can be measured. ``support`` says which are there.
    arc_length_m : (k,) float64
        Along the chain from its first sample, which is at the height of the gripper's end point.
    pixels : (k,) int64
        Number of pixels of the sample; 0 where it has none.
    z_spread_m : (k,) float64
        As in :class:`~garment_dataset.vision.depth.samples.Samples`; NaN where the sample has no pixels.
    ends_at_gap : bool
        Whether more of the samples follow after a gap too long to cross.
    support : Support
        What carries the samples.
    """

    position_m: FloatArray
    arc_length_m: FloatArray
    pixels: IntArray
    z_spread_m: FloatArray
    ends_at_gap: bool
    support: Support

    @property
    def length_m(self) -> float:
        """Length of the garment, thesis eq. (5.11); 0 when there is no chain."""
        return float(self.arc_length_m[-1]) if self.arc_length_m.size else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """One frame's chain after smoothing, and what is uncertain about it.

    Parameters
    ----------
    chain : Chain
        From the gripper's end point to the hem.
    z_noise_m : (k,) float64
        Standard deviation of the noise of z at the samples.
    end_noise_m : float
        Standard deviation of the noise of the garment's end along y.
    top_noise_m : float
        Standard uncertainty of the distance between the gripper's end point and the cloth at its height.
    lean : (k,) float64
        Slope dz/dx of the sheet out of the plane of the profile.
    hidden_std_m : float
        Standard uncertainty of the chain's length because of cloth that is turned along the ray at its end.
    """

    chain: Chain
    z_noise_m: FloatArray
    end_noise_m: float
    top_noise_m: float
    lean: FloatArray
    hidden_std_m: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class ChainPoints:
    """The points P of thesis 5.3.4, from the gripper down.

    Parameters
    ----------
    position_m, std_m : (3, r) float64
        Where the points are, and the standard uncertainty of that.
    fixed_std_m : (3, r) float64
        The part of it that stays as it is as long as the cloth does not move.
    arc_length_m : (r,) float64
        Where they are along the chain.
    pixels : (r,) int64
        Number of pixels of the nearest sample.
    bridged_m : (r,) float64
        0 where pixels carry the point, the length of the bridge it lies on otherwise.
    reasons : tuple of (str or None), length r
        Why there is no point; then everything else of it is NaN, and 0 pixels.
    """

    position_m: FloatArray
    std_m: FloatArray
    fixed_std_m: FloatArray
    arc_length_m: FloatArray
    pixels: IntArray
    bridged_m: FloatArray
    reasons: tuple[PointReason | None, ...]


def link_samples(
    samples: Samples, gripper_m: Point, *, step_m: float, max_gap_m: float, min_pixels: int, jump_m: float
) -> Chain:
    """Cross short gaps, end at a long one, and measure the way along: thesis eq. (5.11).

    Parameters
    ----------
    samples : Samples
        From the gripper down, ``step_m`` apart.
    gripper_m : (x, y, z)
        End point of the gripper. It takes the place of the first sample when that is part of a gap; otherwise the chain
        begins at the first sample, as in the thesis: the end point lies between the fingers, the samples on the cloth.
    step_m : float
        Distance between samples along y.
    max_gap_m : float
        The longest run of empty samples, each worth one step, that is crossed by linear interpolation, and bridged if
        both sides are one surface. A longer one ends the chain.
    min_pixels : int
        A sample of fewer pixels counts as empty.
    jump_m : float
        Neighbouring depths that differ by more are not one surface.

    Returns
    -------
    Chain
        Without any sample when none has enough pixels, or when the gap right below the gripper is too long.

    Notes
    -----
    Links this short follow the noise of z, which makes the chain too long: by 2 % on a vertical sheet of 64 cm at
    1.07 m, with the noise of a real sensor. Points at a share of the length hardly move by it.
    """
    filled = np.flatnonzero(samples.pixels >= min_pixels)
    longest_run = int(max_gap_m / step_m + 1e-9)
    if filled.size == 0 or filled[0] > longest_run:
        nothing = np.empty(0)
        return Chain(np.empty((3, 0)), nothing, np.empty(0, np.int64), nothing, filled.size > 0, Support.full(0))
    long_gaps = np.flatnonzero(np.diff(filled) > longest_run + 1)
    if long_gaps.size:
        filled = filled[: long_gaps[0] + 1]
    size = int(filled[-1]) + 1
    position_m, pixels, z_spread_m = samples.position_m[:, :size], samples.pixels[:size], samples.z_spread_m[:size]
    support = Support.full(size)
    if filled.size < size:
        position_m = _bridge(filled, position_m, gripper_m)
        carried = np.isin(np.arange(size), filled)
        pixels, z_spread_m = np.where(carried, pixels, 0), np.where(carried, z_spread_m, np.nan)
        # crossing a gap was allowed by its height; a bridge may be longer by as much as depth may differ
        limits = BridgeLimits(jump_m, np.inf)
        support = bridge_gaps(position_m[1], position_m[2], carried, gripper_m[2], limits)
    arc_length_m = np.zeros(size)
    np.cumsum(_link_lengths(position_m), out=arc_length_m[1:])
    return Chain(position_m, arc_length_m, pixels, z_spread_m, long_gaps.size > 0, support)


def _bridge(filled: IntArray, position_m: FloatArray, gripper_m: Point) -> FloatArray:
    """Interpolate x and z between the filled samples; y is right already."""
    known, known_m = filled, position_m[:, filled]
    if filled[0] > 0:
        known, known_m = np.append(0, known), np.column_stack([gripper_m, known_m])
    index = np.arange(position_m.shape[1])
    return np.stack([np.interp(index, known, known_m[0]), position_m[1], np.interp(index, known, known_m[2])])


def _link_lengths(position_m: FloatArray) -> FloatArray:
    steps = position_m[:, 1:] - position_m[:, :-1]
    lengths: FloatArray = np.sqrt((steps * steps).sum(axis=0))
    return lengths


def divide_chain(
    chain: Chain, intrinsics: Intrinsics, *, point_count: int, step_m: float, window_m: float
) -> ChainPoints:
    r"""Put points in the middles of equal segments of the chain, by linear interpolation along it.

    Parameters
    ----------
    chain : Chain
        Of at least two samples.
    intrinsics : Intrinsics
        Of the image, for the distance between its pixels on the cloth.
    point_count : int
        r; point q = 1..r is at :math:`(2 q - 1) / (2 r)` of the length.
    step_m, window_m : float
        Distance between samples and full height of a window.

    Returns
    -------
    ChainPoints
        From the gripper down.

    Notes
    -----
    The uncertainties are of first order, with independent causes. Depth: ``cloud.z_std_m`` and what a bridge adds,
    which act along the ray, on x by x/z of it and on y by y/z. Across the rays a pixel stands for a square of side z/f:
    uniform, hence :math:`z / (f \sqrt{12})`. Along the cloth a point can be misplaced, which acts on x, y and z through
    the direction of the chain, for two causes. The end is seen up to one step and one pixel too early: rms :math:`1 /
    \sqrt 3` of their sum, of which a point takes its share. And the noise of z makes a chain of short links too long,
    which shifts a point as far as it does so unevenly: by as much as the point would move on a chain with links of two
    windows.
    """
    share = (np.arange(point_count) + 0.5) / point_count
    arc_m = share * chain.length_m
    link = np.searchsorted(chain.arc_length_m, arc_m, side="right") - 1
    start_m, start_arc_m = chain.position_m[:, link], chain.arc_length_m[link]
    link_m = chain.arc_length_m[link + 1] - start_arc_m
    direction = (chain.position_m[:, link + 1] - start_m) / link_m
    position_m = start_m + direction * (arc_m - start_arc_m)
    pixels = chain.pixels[link + (2 * (arc_m - start_arc_m) > link_m)]

    focal_px = np.array([[intrinsics.fx_px], [intrinsics.fy_px], [np.inf]])
    bridge_std_m = np.interp(arc_m, chain.arc_length_m, chain.support.std_m)
    ray = position_m / position_m[2]
    through_m = ray * np.hypot(z_std_m(position_m[2], pixels), bridge_std_m)
    fixed_std_m = np.abs(ray) * COLUMN_BAND_LEVELS * level_spacing_m(position_m[2])
    across_m = position_m[2] / focal_px / np.sqrt(12)
    end_m = step_m + chain.position_m[2, -1] / intrinsics.fy_px
    along_m = np.hypot(share * end_m / np.sqrt(3), _uneven_excess_m(chain, share, 2 * round(window_m / step_m)))
    std_m = np.sqrt(through_m**2 + across_m**2 + (direction * along_m) ** 2)
    return ChainPoints(position_m, std_m, fixed_std_m, arc_m, pixels, np.zeros(point_count), (None,) * point_count)


def _uneven_excess_m(chain: Chain, share: FloatArray, stride: int) -> FloatArray:
    """Return how far points at ``share`` of the length move when links become ``stride`` times as long."""
    last = chain.arc_length_m.size - 1
    nodes = np.append(np.arange(0, last, max(stride, 1)), last)
    excess_m = chain.arc_length_m[nodes]
    excess_m[1:] -= np.cumsum(_link_lengths(chain.position_m[:, nodes]))
    moved_m: FloatArray = np.interp(share * chain.length_m, chain.arc_length_m[nodes], excess_m) - share * excess_m[-1]
    return moved_m
