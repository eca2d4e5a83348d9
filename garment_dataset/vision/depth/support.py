"""Which samples of a chain are carried by pixels, and which gaps between them may be bridged.

A gap is bridged only between two pieces of one surface: each piece, drawn out straight, must meet the other as far as
noise and the curvature of cloth allow. Anything else is a change of layer, or too far to say, and nothing lies on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.arrays import BoolArray, FloatArray

PointReason = Literal["gap", "between_layers", "beyond_band", "unsupported"]
"""Why a single point is missing; ``trace.Reason`` says what the words mean."""

HIDDEN_CURVATURE_PER_M = 20.0
"""Standard curvature of cloth that is not seen: hanging folds have radii of some 5 cm."""

_SAME_SURFACE_PER_M = 10.0
"""So curved a piece may be and still be taken for the same as the one across the gap: a radius of 10 cm."""

_SLOPE_SAMPLES = 8
"""A piece's slope at its end is that of so many samples: 2 cm, over which noise of 2 mm leaves some 0.1."""

_LEAST_SLOPE_SAMPLES = 4


@dataclass(frozen=True, slots=True, eq=False)
class Support:
    """What carries the samples of a chain.

    Parameters
    ----------
    bridged_m : (k,) float64
        0 where pixels carry the sample, the length of the bridge it lies on, NaN where there is neither.
    std_m : (k,) float64
        Standard uncertainty of z that a bridge adds; 0 where there is none.
    between_layers : (k,) bool
        Whether the sample lies in a gap between two layers. One without support that does not is in a gap too long.
    """

    bridged_m: FloatArray
    std_m: FloatArray
    between_layers: BoolArray

    @classmethod
    def full(cls, count: int) -> Support:
        """Return that of samples that are all carried."""
        return cls(np.zeros(count), np.zeros(count), np.zeros(count, np.bool_))


@dataclass(frozen=True, slots=True)
class BridgeLimits:
    """What may be bridged.

    Parameters
    ----------
    jump_m : float
        Neighbouring depths that differ by more are not the same surface.
    longest_m : float
        Longest bridge.
    """

    jump_m: float
    longest_m: float


def bridge_gaps(
    y_m: FloatArray, z_m: FloatArray, carried: BoolArray, hold_z_m: float | None, limits: BridgeLimits
) -> Support:
    r"""Find the gaps of a chain, and judge each.

    Parameters
    ----------
    y_m, z_m : (k,) float64
        Samples from the gripper down; z counts where they are carried.
    carried : (k,) bool
        Whether pixels carry them.
    hold_z_m : float or None
        z of the gripper's end point, from which a gap at the top is bridged: there the cloth is held. None when the
        cloth does not lead there.
    limits : BridgeLimits
        See there.

    Returns
    -------
    Support

    Notes
    -----
    Of a gap of the height h, the pieces drawn out straight miss each other by at most m in depth. They are one surface
    if :math:`m \le j + c h^2 / 2`, j the jump and c = 10 / m. At the distance s from one end of a bridge of length L, z
    has the standard uncertainty :math:`\kappa s (L - s) / 2`, the height of an arc of the curvature :math:`\kappa`
    over its chord: that of what is not seen, 20 / m, together with what was seen, :math:`2 m / h^2`.
    """
    support = Support.full(y_m.size)
    for start, stop in _runs(~carried):
        gap = slice(start, stop)
        if stop == y_m.size or (start == 0 and hold_z_m is None):
            support.bridged_m[gap] = np.nan
            continue
        top_y_m, top_z_m = (y_m[0], hold_z_m) if start == 0 else (y_m[start - 1], z_m[start - 1])
        high_m, deep_m = y_m[stop] - top_y_m, z_m[stop] - top_z_m
        miss_m = 0.0 if start == 0 else _miss_m(y_m, z_m, carried, (start, stop), limits.jump_m)
        support.between_layers[gap] = miss_m > limits.jump_m + _SAME_SURFACE_PER_M * high_m**2 / 2
        length_m = float(np.hypot(high_m, deep_m))
        if support.between_layers[start] or length_m > limits.longest_m:
            support.bridged_m[gap] = np.nan
            continue
        support.bridged_m[gap] = length_m
        along_m = (y_m[gap] - top_y_m) / high_m * length_m
        curvature_per_m = np.hypot(HIDDEN_CURVATURE_PER_M, 2 * miss_m / high_m**2)
        support.std_m[gap] = curvature_per_m * along_m * (length_m - along_m) / 2
    return support


def _runs(flags: BoolArray) -> Iterator[tuple[int, int]]:
    """Yield where runs of True start and stop."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8))).tolist()
    return zip(edges[::2], edges[1::2], strict=True)


def _miss_m(y_m: FloatArray, z_m: FloatArray, carried: BoolArray, gap: tuple[int, int], jump_m: float) -> float:
    """Return by how much the pieces above and below a gap, drawn out straight, miss each other at most."""
    start, stop = gap
    high_m, deep_m = y_m[stop] - y_m[start - 1], z_m[stop] - z_m[start - 1]
    pieces = (np.arange(start - 1, max(start - 1 - _SLOPE_SAMPLES, -1), -1), np.arange(stop, stop + _SLOPE_SAMPLES))
    misses_m = []
    for piece in pieces:
        near = piece[piece < y_m.size]
        ends = ~carried[near[1:]] | (np.abs(np.diff(z_m[near])) > jump_m)
        near = near[: int(np.argmax(ends)) + 1] if ends.any() else near
        if near.size >= _LEAST_SLOPE_SAMPLES:
            centred_m = y_m[near] - y_m[near].mean()
            misses_m.append(abs(deep_m - (centred_m * z_m[near]).sum() / (centred_m**2).sum() * high_m))
    return float(max(misses_m, default=abs(deep_m)))
