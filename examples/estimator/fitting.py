"""Fit a chain to a recording, with intervals of the parameters by profile likelihood."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cholesky, solve_triangular  # type: ignore[import-untyped]
from scipy.optimize import least_squares  # type: ignore[import-untyped]
from scipy.stats import chi2  # type: ignore[import-untyped]

from examples.estimator.chain import PARAMETERS, simulate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from examples.estimator.recording import Recording

    FloatArray = NDArray[np.float64]

START = np.log([3.0, 1.0, 1.0, 0.5])
SPAN = 5.0
"""Natural logarithms that a parameter may be away from its start: 150 times as much, or as little."""

STEP = 1e-4
LEVEL = 0.95
SETTLING = 8
"""Steps in which the other parameters follow one that is moved; fewer where nothing is gained any more."""
GAIN = 1e-3
MISFIT_LAG1 = 0.95
"""How much alike a chain is wrong about cloth in neighbouring frames."""


@dataclass(frozen=True)
class Interval:
    """Of one parameter: the best value, and between which values it is; None: the motion does not tell that side."""

    name: str
    best: float
    low: float | None
    high: float | None

    @property
    def is_told(self) -> bool:
        """Whether the motion tells it from both sides."""
        return self.low is not None and self.high is not None


@dataclass(frozen=True, eq=False)
class Fitted:
    """A chain that was fitted.

    Parameters
    ----------
    logarithms : (4,) float64
        Of the parameters.
    intervals : tuple of Interval
        By profile likelihood.
    misfit_m : (r, 2) float64
        Standard deviation by which the points are farther from the chain than their uncertainties say.
    """

    logarithms: FloatArray
    intervals: tuple[Interval, ...]
    misfit_m: FloatArray


class Problem:
    """The displacements of a recording, and what a chain makes of them, in units in which errors are independent.

    Parameters
    ----------
    recording : Recording
        What was measured.
    misfit_m : (r, 2) float64
        By how much a chain is wrong about it.
    """

    def __init__(self, recording: Recording, misfit_m: FloatArray) -> None:
        self.recording = recording
        frames = np.arange(len(recording.time_s))
        alike = MISFIT_LAG1 ** np.abs(frames[:, None] - frames)
        self._known, self._roots = [], []
        for axis in (0, 1):
            known = np.isfinite(recording.points_m[:, :, axis] + recording.std_m[:, :, axis]).ravel()
            misfit = np.kron(alike, np.diag(misfit_m[:, axis] ** 2))
            whole = (recording.covariance(axis) + misfit)[np.ix_(known, known)]
            self._known.append(known)
            self._roots.append(cholesky(whole + 1e-12 * np.eye(len(whole)), lower=True))

    def residuals(self, logarithms: FloatArray) -> FloatArray:
        """Return the residuals of several sets of parameters, (B, n)."""
        away = simulate(self.recording, logarithms) - self.recording.points_m
        parts = []
        for axis, (known, root) in enumerate(zip(self._known, self._roots, strict=True)):
            flat = away[..., axis].reshape(len(away), -1)[:, known]
            parts.append(solve_triangular(root, flat.T, lower=True).T)
        return np.concatenate(parts, axis=1)

    def slopes(self, logarithms: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return residuals, (B, n), and their derivatives by the parameters, (B, n, 4)."""
        sets, count = logarithms.shape
        moved = logarithms[:, None] + STEP * np.concatenate([np.zeros((1, count)), np.eye(count)])
        found = self.residuals(moved.reshape(-1, count)).reshape(sets, count + 1, -1)
        return found[:, 0], np.moveaxis(found[:, 1:] - found[:, :1], 1, 2) / STEP


def fit(recording: Recording, *, is_chain: bool = False) -> Fitted:
    """Return the chain that is closest to a recording.

    Parameters
    ----------
    recording : Recording
        What was measured.
    is_chain : bool
        Whether it is of a chain: then nothing is allowed for its being cloth.
    """
    misfit_m = np.zeros((recording.count, 2))
    best = _best(Problem(recording, misfit_m + (0.0 if is_chain else 1e-3)), START)
    if not is_chain:
        for _ in range(2):
            misfit_m = _misfit_m(recording, best)
            best = _best(Problem(recording, misfit_m), best)
    problem = Problem(recording, misfit_m)
    return Fitted(best, tuple(_intervals(problem, best)), misfit_m)


def _best(problem: Problem, start: FloatArray) -> FloatArray:
    found = least_squares(
        lambda at: problem.residuals(at[None])[0],
        start,
        jac=lambda at: problem.slopes(at[None])[1][0],
        bounds=(START - SPAN, START + SPAN),
        x_scale=0.5,
        xtol=1e-6,
        ftol=1e-8,
        max_nfev=40,
    )
    best: FloatArray = found.x
    return best


def _misfit_m(recording: Recording, logarithms: FloatArray) -> FloatArray:
    away_m = simulate(recording, logarithms[None])[0] - recording.points_m
    excess: FloatArray = np.nanmean(away_m**2 - recording.std_m**2, axis=0)
    misfit: FloatArray = np.sqrt(excess.clip(0))
    return misfit


def _intervals(problem: Problem, best: FloatArray) -> list[Interval]:
    """Follow the least misfit as each parameter moves away from its best value, the others free."""
    residuals, slope = problem.slopes(best[None])
    least = float((residuals[0] ** 2).sum())
    covariance = np.linalg.inv(slope[0].T @ slope[0] + 1e-6 * np.eye(best.size))
    return [_interval(problem, best, least, covariance, number) for number in range(best.size)]


def _interval(problem: Problem, best: FloatArray, least: float, covariance: FloatArray, number: int) -> Interval:
    std = min(float(np.sqrt(covariance[number, number])), SPAN / 4)
    away = std * np.array([0.0, 0.8, 1.6, 2.4, 3.5, 5.0])
    away = np.concatenate([-away[:0:-1], away])
    at = np.clip(best + away[:, None] * covariance[number] / covariance[number, number], START - SPAN, START + SPAN)
    at[:, number] = np.clip(best[number] + away, START[number] - SPAN, START[number] + SPAN)
    rise = _settled(problem, at, np.flatnonzero(np.arange(best.size) != number))
    rise -= min(least, float(rise.min())) + float(chi2.ppf(LEVEL, 1))
    middle = len(away) // 2
    ends = [_crossing(at[side, number], rise[side]) for side in (slice(middle, None, -1), slice(middle, None))]
    low, high = (None if end is None else float(np.exp(end)) for end in ends)
    return Interval(PARAMETERS[number], float(np.exp(best[number])), low, high)


def _settled(problem: Problem, at: FloatArray, others: NDArray[np.int64]) -> FloatArray:
    """Move the other parameters of several sets, in place, to where the misfit is least; return that, (B,).

    Gauss and Newton within the bounds: one that would leave them stays, and a step that makes it worse is not taken.
    """
    low, high = (START - SPAN)[others], (START + SPAN)[others]
    for _ in range(SETTLING):
        residuals, slope = problem.slopes(at)
        part, now = slope[:, :, others], (residuals**2).sum(axis=1)
        downhill = np.swapaxes(part, 1, 2) @ residuals[:, :, None]
        normal = np.swapaxes(part, 1, 2) @ part
        stays = ((at[:, others] <= low) & (downhill[..., 0] > 0)) | ((at[:, others] >= high) & (downhill[..., 0] < 0))
        free = ~stays[:, :, None] & ~stays[:, None, :]
        normal = np.where(free, normal, 0.0) + 1e-6 * np.eye(len(others)) + stays[:, :, None] * np.eye(len(others))
        step = np.where(stays, 0.0, np.linalg.solve(normal, downhill)[:, :, 0]).clip(-1, 1)
        for share in (1.0, 0.25):
            tried = at.copy()
            tried[:, others] = np.clip(at[:, others] - share * step, low, high)
            is_better = (problem.residuals(tried) ** 2).sum(axis=1) < now
            at[is_better] = tried[is_better]
            step[is_better] = 0.0
        found: FloatArray = (problem.residuals(at) ** 2).sum(axis=1)
        if (now - found).max() < GAIN:
            break
    return found


def _crossing(at: FloatArray, rise: FloatArray) -> float | None:
    """Return where a rising curve first passes zero; the rise grows with the square, so roots of it are joined."""
    above = np.flatnonzero(rise[1:] > 0)
    if not above.size:
        return None
    after = int(above[0]) + 1
    level = -rise[0]
    before, beyond = (np.sqrt(max(value + level, 0.0)) for value in (rise[after - 1], rise[after]))
    share = (np.sqrt(level) - before) / max(beyond - before, 1e-12)
    return float(at[after - 1] + share * (at[after] - at[after - 1]))
