"""The visible patch of the garment at rest: samples of its surface, what is neighbour to what, and its outline."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from garment_dataset.vision.cloth.sight import layers, of_the_cloth

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, FloatArray, IntArray
    from garment_dataset.vision.cloth.sight import Sight
    from garment_dataset.vision.depth.cloud import Intrinsics

_SAMPLE_PX = 6
"""Distance of the samples: the sensor's noise comes in blobs of about that size."""

_STEEPEST_LINK = 2.0
"""Neighbours whose depths differ by more than that times their distance across may be on two layers."""

_LINK_STEPS = 2
"""Links that must keep their length are two samples long: 2.2 cm at 1.07 m, over which noise matters little."""

_LEAST_FRAMES_SHARE = 0.6
_STRIP_HALF_PX = 8


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """Surface samples at rest, relative to the gripper's end point.

    Parameters
    ----------
    places_m : (m, 3) float64
    links : (l, 2) int64
        Pairs of samples on one layer, whose distance cannot change.
    lengths_m : (l,) float64
        Theirs.
    edges : (b, 2) int64
        Samples beside an edge of the layer, left or right, and one in the middle of its row.
    edge_side : (b,) float64
        -1 on the left, 1 on the right.
    inset_px : (b,) float64
        How far the edge is beside the sample.
    """

    places_m: FloatArray
    links: IntArray
    lengths_m: FloatArray
    edges: IntArray
    edge_side: FloatArray
    inset_px: FloatArray


def patch_at_rest(
    sights: Sequence[Sight], gripper_m: FloatArray, intrinsics: Intrinsics, *, reach_m: float
) -> Patch | None:
    """Average some images at rest, and sample the garment in them.

    Parameters
    ----------
    sights : sequence of Sight
        Of frames in which the gripper rests: of the same crop.
    gripper_m : (3,) float64
        Its end point.
    intrinsics : Intrinsics
        Of the images.
    reach_m : float
        x from the gripper's that is sampled.

    Returns
    -------
    Patch or None
        None when nothing is seen.
    """
    z_m, first = _mean_depth(sights), sights[0]
    rows, columns = z_m.shape
    j, i = np.mgrid[_SAMPLE_PX // 2 : rows : _SAMPLE_PX, _SAMPLE_PX // 2 : columns : _SAMPLE_PX]
    depth_m = z_m[j, i]
    x_m = (i + first.corner_px[0] - intrinsics.cx_px) / intrinsics.fx_px * depth_m
    y_m = (j + first.corner_px[1] - intrinsics.cy_px) / intrinsics.fy_px * depth_m
    grid_m = np.stack([x_m, y_m, depth_m], axis=-1) - gripper_m
    there = (
        _front(z_m, intrinsics, first.corner_px, gripper_m)[j, i]
        & (np.abs(grid_m[..., 0]) <= reach_m)
        & (grid_m[..., 1] > 0)
    )
    if not there.any():
        return None
    number = np.where(there, np.cumsum(there).reshape(there.shape) - 1, -1)
    links = _links(grid_m, number)
    places_m = grid_m[there]
    ways_m = places_m[links[:, 1]] - places_m[links[:, 0]]
    lengths_m = np.linalg.norm(ways_m, axis=1)
    return Patch(places_m, links, lengths_m, *_edges(z_m, (i, j), number))


def _mean_depth(sights: Sequence[Sight]) -> FloatArray:
    """Return the mean depth of pixels that most of the frames show."""
    stack = np.stack([sight.z_m for sight in sights]).astype(np.float64)
    known = np.isfinite(stack)
    count = known.sum(axis=0)
    mean = np.where(known, stack, 0.0).sum(axis=0) / np.maximum(count, 1)
    return np.where(count >= _LEAST_FRAMES_SHARE * len(sights), mean, np.nan)


def _front(z_m: FloatArray, intrinsics: Intrinsics, corner_px: tuple[int, int], gripper_m: FloatArray) -> BoolArray:
    """Return the layer that most of the plane x = x_gripper shows: seams without depth divide layers."""
    _, label = cv2.connectedComponents(np.isfinite(z_m).astype(np.uint8), connectivity=4)
    column = round(intrinsics.cx_px + intrinsics.fx_px * gripper_m[0] / gripper_m[2]) - corner_px[0]
    strip = label[:, max(column - _STRIP_HALF_PX, 0) : column + _STRIP_HALF_PX + 1]
    counts = np.bincount(strip.ravel(), minlength=2)
    if counts[1:].sum() == 0:
        return np.zeros(z_m.shape, np.bool_)
    front: BoolArray = label == 1 + int(counts[1:].argmax())
    return front


def _links(grid_m: FloatArray, number: IntArray) -> IntArray:
    """Return pairs of samples two steps apart, across, down and diagonally, with one layer in between."""
    found = []
    for down, across in ((0, 1), (1, 0), (1, 1), (1, -1)):
        chain = [_shifted(number, step * down, step * across) for step in range(_LINK_STEPS + 1)]
        whole = np.all([part >= 0 for part in chain], axis=0)
        for start, stop in itertools.pairwise(chain):
            flat = grid_m[number >= 0]
            way_m = flat[stop] - flat[start]
            whole &= np.abs(way_m[..., 2]) <= _STEEPEST_LINK * np.hypot(way_m[..., 0], way_m[..., 1])
        found.append(np.stack([chain[0][whole], chain[-1][whole]], axis=1))
    return np.concatenate(found)


def _shifted(number: IntArray, down: int, across: int) -> IntArray:
    """Return the neighbour of each sample, -1 where there is none."""
    rows, columns = number.shape
    j, i = np.mgrid[0:rows, 0:columns]
    j, i = j + down, i + across
    inside = (j < rows) & (i >= 0) & (i < columns)
    return np.where(inside, number[np.minimum(j, rows - 1), np.clip(i, 0, columns - 1)], -1)


def _edges(
    z_m: FloatArray, at_px: tuple[IntArray, IntArray], number: IntArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the first and last sample of each row with the middle one, their sides, and how far the edge is."""
    before_px, after_px = layers(np.isfinite(z_m))
    pairs, sides, insets = [], [], []
    for row in np.flatnonzero((number >= 0).any(axis=1)):
        columns = np.flatnonzero(number[row] >= 0)
        middle = columns[columns.size // 2]
        v, u = at_px[1][row, 0], at_px[0][row]
        for column, side, edge in (
            (columns[0], -1.0, before_px[v, u[middle]]),
            (columns[-1], 1.0, after_px[v, u[middle]]),
        ):
            inset = float(side * (edge - u[column]))
            if abs(inset) <= 2 * _SAMPLE_PX and of_the_cloth(edge, z_m.shape[1]):
                pairs.append((number[row, column], number[row, middle]))
                sides.append(side)
                insets.append(inset)
    return np.array(pairs, np.int64).reshape(-1, 2), np.array(sides), np.array(insets)
