"""From the garment's pixels to points of equal distance along it: thesis 5.3.4.

The pieces are separate, each a function of the one before: pixels (``cloud``), samples, chain, points. Positions are in
the optical frame, ``(3, n)`` with the rows x, y and z.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.vision.depth.cloud import z_std_m

if TYPE_CHECKING:
    from garment_dataset.arrays import FloatArray, IntArray
    from garment_dataset.vision.depth.cloud import Cloud, Intrinsics, Point


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """The sample points s^i of thesis eq. (5.10), from the gripper down.

    Parameters
    ----------
    position_m : (3, k) float64
        x and z are means over the window, NaN where it is empty; y is its middle.
    pixels : (k,) int64
        Number of pixels in the window.
    z_spread_m : (k,) float64
        Sample standard deviation of z in the window (divided by n - 1); NaN for fewer than two pixels.
    """

    position_m: FloatArray
    pixels: IntArray
    z_spread_m: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """Samples without holes, with the arc length along them.

    Parameters
    ----------
    position_m : (3, k) float64
        The samples; interpolated where a gap was bridged.
    arc_length_m : (k,) float64
        Along the chain from its first sample, which is at the height of the gripper's end point.
    pixels : (k,) int64
        Number of pixels of the sample; 0 where a gap was bridged.
    z_spread_m : (k,) float64
        As in :class:`Samples`; NaN where a gap was bridged.
    ends_at_gap : bool
        Whether more of the samples follow after a gap too long to bridge.
    """

    position_m: FloatArray
    arc_length_m: FloatArray
    pixels: IntArray
    z_spread_m: FloatArray
    ends_at_gap: bool

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
        The same of the distance between the gripper's end point and the cloth at its height.
    lean : (k,) float64
        Slope dz/dx of the sheet out of the plane of the profile.
    """

    chain: Chain
    z_noise_m: FloatArray
    end_noise_m: float
    top_noise_m: float
    lean: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ChainPoints:
    """The points P of thesis 5.3.4, from the gripper down.

    Parameters
    ----------
    position_m, std_m : (3, r) float64
        Where the points are, and the standard uncertainty of that.
    arc_length_m : (r,) float64
        Where they are along the chain.
    pixels : (r,) int64
        Number of pixels of the nearest sample.
    """

    position_m: FloatArray
    std_m: FloatArray
    arc_length_m: FloatArray
    pixels: IntArray


def sample_windows(cloud: Cloud, top_y_m: float, *, step_m: float, half_height_m: float) -> Samples:
    r"""Average the pixels over overlapping windows: thesis eqs. (5.9) and (5.10).

    Parameters
    ----------
    cloud : Cloud
        Pixels of the strip, none above ``top_y_m``.
    top_y_m : float
        Height :math:`ee_y` of the gripper's end point.
    step_m : float
        :math:`\Delta y_{us}`: the samples are at :math:`y^i = ee_y + i \Delta y_{us}`, i = 0, 1, …, down to the last
        pixel.
    half_height_m : float
        :math:`\Delta y`: a pixel belongs to sample i if :math:`y^i - \Delta y < y < y^i + \Delta y`.

    Returns
    -------
    Samples
        Without any sample when the cloud is empty.

    Notes
    -----
    Pixels are counted once, by where they lie among the edges of the windows, and a window is the difference of two
    running sums. When its height is a whole multiple of the step, its bottom is the top of a later one, and one count
    serves for both. Sums of z are sums of whole millimetres, and exact.
    """
    if cloud.y_m.size == 0:
        return Samples(np.empty((3, 0)), np.empty(0, np.int64), np.empty(0))
    last_y_m = float(cloud.y_m.max())
    y_m = top_y_m + step_m * np.arange(int((last_y_m - top_y_m) / step_m) + 2)
    y_m = y_m[: int(np.searchsorted(y_m, last_y_m, side="right"))]
    index = np.arange(y_m.size)
    height_in_steps = 2 * half_height_m / step_m
    whole_steps = round(height_in_steps)
    sums = _running_sums(cloud, top_y_m - half_height_m, step_m)
    if abs(height_in_steps - whole_steps) < 1e-9:
        sums_of_bottoms, bottom = sums, index + whole_steps
    else:
        sums_of_bottoms, bottom = _running_sums(cloud, top_y_m + half_height_m, step_m), index
    # Beyond the last pixel the sums stay what they are there.
    to_bottom = sums_of_bottoms.take(2 * bottom, axis=1, mode="clip")
    number, sum_x, sum_z, sum_zz = to_bottom - sums.take(2 * index + 1, axis=1, mode="clip")
    some = np.where(number > 0, number, np.nan)  # an empty window has no mean, and one pixel no spread
    position_m = np.stack([sum_x / some, y_m, sum_z / some / 1000])
    pairs = np.where(number > 1, number * (number - 1), np.nan)
    z_spread_m = np.sqrt(np.maximum(number * sum_zz - sum_z**2, 0) / pairs) / 1000
    return Samples(position_m, number.astype(np.int64), z_spread_m)


def _running_sums(cloud: Cloud, origin_m: float, step_m: float) -> FloatArray:
    """Sum 1, x, z and z² of the pixels above each edge ``origin_m + j * step_m``, in (4, n).

    Column ``2 j`` holds what is above edge j, column ``2 j + 1`` also what lies on it.
    """
    edges = np.maximum((cloud.y_m - origin_m) / step_m, -0.5)
    column = (np.floor(edges) + np.ceil(edges)).astype(np.intp) + 1  # 2 j + 1: on edge j; 2 j + 2: below it
    weights = (None, cloud.x_m, cloud.z_mm, cloud.z_mm**2)
    return np.array([np.bincount(column, weight) for weight in weights], dtype=np.float64).cumsum(axis=1)


def link_samples(samples: Samples, gripper_m: Point, *, step_m: float, max_gap_m: float, min_pixels: int) -> Chain:
    """Bridge short gaps, end at a long one, and measure the way along: thesis eq. (5.11).

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
        The longest run of empty samples, each worth one step, that is bridged by linear interpolation. A longer one
        ends the chain.
    min_pixels : int
        A sample of fewer pixels counts as empty.

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
        return Chain(np.empty((3, 0)), nothing, np.empty(0, np.int64), nothing, ends_at_gap=filled.size > 0)
    long_gaps = np.flatnonzero(np.diff(filled) > longest_run + 1)
    if long_gaps.size:
        filled = filled[: long_gaps[0] + 1]
    size = int(filled[-1]) + 1
    position_m, pixels, z_spread_m = samples.position_m[:, :size], samples.pixels[:size], samples.z_spread_m[:size]
    if filled.size < size:
        position_m = _bridge(filled, position_m, gripper_m)
        bridged = ~np.isin(np.arange(size), filled)
        pixels, z_spread_m = np.where(bridged, 0, pixels), np.where(bridged, np.nan, z_spread_m)
    arc_length_m = np.zeros(size)
    np.cumsum(_link_lengths(position_m), out=arc_length_m[1:])
    return Chain(position_m, arc_length_m, pixels, z_spread_m, ends_at_gap=long_gaps.size > 0)


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
    The uncertainties are of first order, with independent causes. Depth: ``cloud.z_std_m``, which acts along the ray,
    on x by x/z of it and on y by y/z. Across the rays a pixel stands for a square of side z/f: uniform, hence
    :math:`z / (f \sqrt{12})`. Along the cloth a point can be misplaced, which acts on x, y and z through the direction
    of the chain, for two causes. The end is seen up to one step and one pixel too early: rms :math:`1 / \sqrt 3` of
    their sum, of which a point takes its share. And the noise of z makes a chain of short links too long, which shifts
    a point as far as it does so unevenly: by as much as the point would move on a chain with links of two windows.
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
    through_m = position_m / position_m[2] * z_std_m(position_m[2], pixels)
    across_m = position_m[2] / focal_px / np.sqrt(12)
    end_m = step_m + chain.position_m[2, -1] / intrinsics.fy_px
    along_m = np.hypot(share * end_m / np.sqrt(3), _uneven_excess_m(chain, share, 2 * round(window_m / step_m)))
    std_m = np.sqrt(through_m**2 + across_m**2 + (direction * along_m) ** 2)
    return ChainPoints(position_m, std_m, arc_m, pixels)


def _uneven_excess_m(chain: Chain, share: FloatArray, stride: int) -> FloatArray:
    """Return how far points at ``share`` of the length move when links become ``stride`` times as long."""
    last = chain.arc_length_m.size - 1
    nodes = np.append(np.arange(0, last, max(stride, 1)), last)
    excess_m = chain.arc_length_m[nodes]
    excess_m[1:] -= np.cumsum(_link_lengths(chain.position_m[:, nodes]))
    moved_m: FloatArray = np.interp(share * chain.length_m, chain.arc_length_m[nodes], excess_m) - share * excess_m[-1]
    return moved_m
