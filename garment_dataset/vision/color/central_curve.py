"""Central curve of a silhouette: midpoints of cuts perpendicular to its major axis (thesis 5.2.3).

The boundary runs through the middles of the pixel edges between region and background. The centres of the border pixels
that ``bwboundaries`` and the thesis take lie inside the region by 0.35 to 0.5 px, depending on the direction of the
border: widths between them are up to 1 px short. Widths between middles of edges are not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import FloatArray, IntArray
    from garment_dataset.vision.color.axes import Axes
    from garment_dataset.vision.color.masks import Border

# The eight neighbours (u, v) by direction, in steps of 45 degrees, clockwise as displayed, from the right
_STEPS = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)])
# Direction of a step, by (du + 1, dv + 1); 8 is no step: the border of a single pixel
_DIRECTION = np.array([(5, 4, 3), (6, 8, 2), (7, 0, 1)])


def _facing_edges(came: int, goes: int) -> list[int]:
    """Return the directions of a border pixel's edges to the background, in the order of the border.

    The region is to the left of the way. So the background is in the directions passed when turning from where it came
    to where it goes, by -45 degrees at a time; even directions are edges.
    """
    if came == 8:
        return [6, 4, 2, 0]
    back = (came + 4) % 8
    turns = (back - goes - 1) % 8
    return [side for side in ((back - turn) % 8 for turn in range(1, turns + 1)) if side % 2 == 0]


_FACING = [[_facing_edges(came, goes) for goes in range(9)] for came in range(9)]
_EDGE_COUNT = np.array([[len(edges) for edges in row] for row in _FACING])
_EDGES = np.array([[(edges + 4 * [0])[:4] for edges in row] for row in _FACING])


class CentralCurves(NamedTuple):
    """Cuts of one or several regions: one entry per cut, from the upper end down, region after region.

    Parameters
    ----------
    region : (n,) int64
        Which of the given regions.
    cut : (n,) int64
        Which cut of the region, from 0 at its upper end.
    u_px, v_px : (n,) float64
        Midpoint between the outermost crossings of cut and boundary.
    width_px : (n,) float64
        Distance between these crossings.
    position_px : (n,) float64
        Distance of the cut from the upper end of the region, along the major axis.
    arc_length_px : (n,) float64
        Length of the curve from the first midpoint.
    parts : (n,) int64
        How many separate parts the cut meets: more than 1 at folds, sleeves and holes.
    """

    region: IntArray
    cut: IntArray
    u_px: FloatArray
    v_px: FloatArray
    width_px: FloatArray
    position_px: FloatArray
    arc_length_px: FloatArray
    parts: IntArray


class Boundaries(NamedTuple):
    """Closed polygons, one after another.

    Parameters
    ----------
    points : (n, 2) float64
        Corners (u, v) in pixels.
    following : (n,) int64
        Index of the corner after each.
    region : (n,) int64
        Region of each corner, ascending.
    """

    points: FloatArray
    following: IntArray
    region: IntArray


def boundaries(regions: Sequence[Sequence[Border]]) -> Boundaries:
    """Turn borders through pixel centres into polygons through the middles of the pixel edges.

    Parameters
    ----------
    regions : sequence of sequences of (k, 2) int32
        Per region its borders, as :func:`garment_dataset.vision.color.masks.borders` gives them; at least one in all.
    """
    lengths = np.array([len(border) for region in regions for border in region])
    region = np.repeat(np.arange(len(regions)), [len(region) for region in regions])
    pixels = np.concatenate([border for region in regions for border in region])
    following = _following(lengths)
    steps = np.take(pixels, following, axis=0) - pixels
    goes = _DIRECTION[steps[:, 0] + 1, steps[:, 1] + 1]
    came = np.empty_like(goes)
    came[following] = goes
    count = _EDGE_COUNT[came, goes]
    facing = _EDGES[came, goes][np.arange(4) < count[:, np.newaxis]]
    points = np.repeat(pixels, count, axis=0) + 0.5 * np.take(_STEPS, facing, axis=0)
    edges = np.add.reduceat(count, np.cumsum(lengths) - lengths)
    return Boundaries(points, _following(edges), np.repeat(region, edges))


def _following(lengths: IntArray) -> IntArray:
    """Return the index of the next element within closed sequences of the given lengths."""
    ends = np.cumsum(lengths)
    following = np.arange(1, ends[-1] + 1)
    following[ends - 1] = ends - lengths
    return following


def central_curves(
    regions: Sequence[Sequence[Border]], axes: Sequence[Axes], pitch_px: float, *, lines: int = 5
) -> CentralCurves:
    """Cut regions across their major axes.

    Parameters
    ----------
    regions : sequence of sequences of (k, 2) int32
        Per region its borders; none for a region without pixels, which gets no cuts.
    axes : sequence of Axes
        Of the same regions.
    pitch_px : float
        Distance of the cuts along the major axis. The first is half a pitch below the upper end.
    lines : int
        A cut stands for the slab of one pitch around it: its crossings are means over so many parallel lines, evenly
        spaced, which halves the noise of the pixel grid. With 1, the cut is the single line of the thesis.

    Returns
    -------
    CentralCurves
        Of each line, the first and the last crossing count; ``parts`` is the largest number over the lines of a cut.

    Raises
    ------
    ValueError
        If a region is not connected: a line between its ends meets nothing.
    """
    present = [i for i, region in enumerate(regions) if region]
    if not present:
        none, nothing = np.zeros(0, np.int64), np.zeros(0)
        return CentralCurves(none, none, nothing, nothing, nothing, nothing, nothing, none)
    outlines = boundaries([regions[i] for i in present])
    down = np.array([axes[i].downward for i in present])
    centre = np.array([(axes[i].centroid_u_px, axes[i].centroid_v_px) for i in present])
    along, across = _turned(outlines, centre, down)
    first = np.searchsorted(outlines.region, np.arange(len(present)))
    upper = np.minimum.reduceat(along, first)
    along -= np.take(upper, outlines.region)
    cuts = np.floor(np.maximum.reduceat(along, first) / pitch_px).astype(np.int64)
    left, right, parts = _crossings(outlines, along, across, cuts * lines, pitch_px / lines)
    left, right = (np.asarray(side.reshape(-1, lines).mean(axis=1), np.float64) for side in (left, right))
    region = np.repeat(np.arange(len(present)), cuts)
    cut = np.arange(len(region)) - np.repeat(np.cumsum(cuts) - cuts, cuts)
    position = np.asarray((cut + 0.5) * pitch_px, np.float64)
    t, s, (du, dv) = upper[region] + position, (left + right) / 2, down[region].T
    u, v = centre[region, 0] + t * du + s * dv, centre[region, 1] + t * dv - s * du
    length = _arc_length(u, v, cut)
    number = np.array(present)[region]
    return CentralCurves(number, cut, u, v, right - left, position, length, parts.reshape(-1, lines).max(axis=1))


def _turned(outlines: Boundaries, centre: FloatArray, down: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return each corner's coordinates along the major axis, downward, and across it, to the right of a level one."""
    u, v = (outlines.points - np.take(centre, outlines.region, axis=0)).T
    du, dv = np.take(down, outlines.region, axis=0).T
    return np.asarray(u * du + v * dv), np.asarray(u * dv - v * du)


def _crossings(
    outlines: Boundaries, along: FloatArray, across: FloatArray, lines: IntArray, pitch_px: float
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Cross all lines with all polygons.

    Parameters
    ----------
    outlines : Boundaries
    along, across : (n,) float64
        Coordinates of the corners; the lines of a region are at ``along = (j + 1/2) * pitch_px``.
    lines : (n_regions,) int64
        How many lines each region has.
    pitch_px : float
        Distance of the lines.

    Returns
    -------
    first, last : (lines.sum(),) float64
        Smallest and largest ``across`` of the crossings of each line.
    parts : (lines.sum(),) int64
        Half the number of crossings.
    """
    # A corner is between lines, never on one: each polygon then crosses each line an even number of times
    between = np.floor(along / pitch_px + 0.5).astype(np.int64)
    other = np.take(between, outlines.following)
    begin = np.minimum(between, other)
    count = np.minimum(np.maximum(between, other), np.take(lines, outlines.region)) - begin
    count = np.maximum(count, 0)
    edge = np.repeat(np.arange(len(count)), count)
    line = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + np.take(begin, edge)
    end = np.take(outlines.following, edge)
    share = ((line + 0.5) * pitch_px - along[edge]) / (along[end] - along[edge])
    crossing = across[edge] + share * (across[end] - across[edge])
    line += np.take(np.cumsum(lines) - lines, np.take(outlines.region, edge))
    total = int(lines.sum())
    first, last = np.full(total, np.inf), np.full(total, -np.inf)
    np.minimum.at(first, line, crossing)
    np.maximum.at(last, line, crossing)
    parts = np.bincount(line, minlength=total) // 2
    if not parts.all():
        raise ValueError("a region to cut is not connected")
    return first, last, parts


def _arc_length(u_px: FloatArray, v_px: FloatArray, cut: IntArray) -> FloatArray:
    """Sum the distances of successive midpoints, from 0 at each region's first."""
    steps = np.hypot(np.diff(u_px, prepend=0), np.diff(v_px, prepend=0))
    length = np.cumsum(steps)
    starts = np.flatnonzero(cut == 0)
    return np.asarray(length - np.repeat(length[starts], np.diff(starts, append=len(cut))), np.float64)


def central_curve(borders: Sequence[Border], axes: Axes, pitch_px: float, *, lines: int = 5) -> CentralCurves:
    """Cut one region across its major axis: see :func:`central_curves`, which is faster for many."""
    return central_curves([borders], [axes], pitch_px, lines=lines)
