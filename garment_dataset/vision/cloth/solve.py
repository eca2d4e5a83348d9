"""Solve for the controls of all frames of a recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import FloatArray, IntArray
    from garment_dataset.vision.cloth.warp import Warp, WarpSettings

_TEMPERED = (3.0, 1.5, 1.0)
_ANCHOR_STD_M = 0.0005
_CONJUGATE_STEPS = 60
_TOLERANCE = 1e-4


def carry(warp: Warp, time_s: FloatArray, rest: IntArray, settings: WarpSettings) -> FloatArray:
    """Return the controls' displacements from rest, (T, C, 3).

    Parameters
    ----------
    warp : Warp
        The problem.
    time_s : (T,) float64
        Ascending, all different.
    rest : (n,) int64
        Frames that show the rest.
    settings : WarpSettings
        See there.
    """
    controls_m = _alone(warp, time_s, rest, settings)
    for _ in range(settings.together):
        controls_m = _together(warp, time_s, rest, settings, controls_m)
    return controls_m


def _alone(warp: Warp, time_s: FloatArray, rest: IntArray, settings: WarpSettings) -> FloatArray:
    """Fit frames one by one, outwards from the rest, each from where the ones before it lead."""
    size = warp.lattice.size
    controls_m = np.zeros((time_s.size, size, 3))
    for order in (range(int(rest.max()) + 1, time_s.size), range(int(rest.min()) - 1, -1, -1)):
        step = order.step
        for frame in order:
            before, earlier = frame - step, frame - 2 * step
            guess_m = controls_m[before].copy()
            passed_s = abs(time_s[frame] - time_s[before])
            if 0 <= earlier < time_s.size:
                ratio = passed_s / max(abs(time_s[before] - time_s[earlier]), 1e-6)
                guess_m += min(ratio, 2.0) * (controls_m[before] - controls_m[earlier])
            # an acceleration between the two frames moves it by that; there is no more to go by yet
            stiffness = (settings.acceleration_m_s2 * max(passed_s, 1e-3) ** 2) ** -2
            found_m = guess_m
            for tempered in _TEMPERED[-settings.alone :]:
                matrix, downhill = warp.normal(frame, found_m, tempered)
                matrix[np.diag_indices_from(matrix)] += stiffness
                downhill += stiffness * (guess_m - found_m).T.ravel()
                found_m = found_m + np.linalg.solve(matrix, downhill).reshape(3, size).T
            controls_m[frame] = found_m
    return controls_m


def second_differences(time_s: FloatArray) -> FloatArray:
    """Return the weights (T - 2, 3) that make accelerations of three frames' values."""
    before_s, after_s = np.diff(time_s)[:-1], np.diff(time_s)[1:]
    both_s = before_s + after_s
    return 2 * np.stack([1 / (before_s * both_s), -1 / (before_s * after_s), 1 / (after_s * both_s)], axis=1)


def _accelerations(weights: FloatArray, values: FloatArray) -> FloatArray:
    sums: FloatArray = weights[:, [0]] * values[:-2] + weights[:, [1]] * values[1:-1] + weights[:, [2]] * values[2:]
    return sums


def _spread_back(weights: FloatArray, values: FloatArray, frames: int) -> FloatArray:
    """Return the transposed product of :func:`_accelerations`."""
    back = np.zeros((frames, values.shape[1]))
    for place in range(3):
        back[place : frames - 2 + place] += weights[:, [place]] * values
    return back


def _together(
    warp: Warp, time_s: FloatArray, rest: IntArray, settings: WarpSettings, controls_m: FloatArray
) -> FloatArray:
    """Take one Gauss-Newton step of all frames, by conjugate gradients."""
    frames, size = controls_m.shape[:2]
    unknowns = 3 * size
    weights = second_differences(time_s) / settings.acceleration_m_s2
    state = controls_m.transpose(0, 2, 1).reshape(frames, unknowns)
    matrices = np.empty((frames, unknowns, unknowns))
    downhill = np.empty((frames, unknowns))
    for frame in range(frames):
        matrices[frame], downhill[frame] = warp.normal(frame, controls_m[frame])
    matrices[rest[:, None], np.arange(unknowns), np.arange(unknowns)] += _ANCHOR_STD_M**-2
    downhill[rest] -= state[rest] * _ANCHOR_STD_M**-2
    downhill -= _spread_back(weights, _accelerations(weights, state), frames)
    own = np.zeros(frames)
    for place in range(3):
        own[place : frames - 2 + place] += weights[:, place] ** 2

    # they only make the steps good ones, for which half the digits do
    inverses = np.empty(matrices.shape, np.float32)
    for frame in range(frames):
        inverses[frame] = np.linalg.inv(matrices[frame] + own[frame] * np.eye(unknowns))

    def improved(values: FloatArray) -> FloatArray:
        scale = float(np.abs(values).max()) or 1.0
        there = np.matmul(inverses, (values / scale).astype(np.float32)[:, :, None])[:, :, 0]
        result: FloatArray = scale * there.astype(np.float64)
        return result

    def product(values: FloatArray) -> FloatArray:
        there: FloatArray = np.matmul(matrices, values[:, :, None])[:, :, 0]
        return there + _spread_back(weights, _accelerations(weights, values), frames)

    step, residual = np.zeros_like(state), downhill
    direction = conditioned = improved(residual)
    power = first = float((residual * conditioned).sum())
    for _ in range(_CONJUGATE_STEPS):
        if power <= _TOLERANCE**2 * first:
            break
        moved = product(direction)
        length = power / float((direction * moved).sum())
        step = step + length * direction
        residual = residual - length * moved
        conditioned = improved(residual)
        power, last = float((residual * conditioned).sum()), power
        direction = conditioned + power / last * direction
    return controls_m + step.reshape(frames, 3, size).transpose(0, 2, 1)
