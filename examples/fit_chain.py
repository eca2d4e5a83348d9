"""Fit a chain of rigid links to one recording, and predict a repeat of its movement that the fit has not seen.

The chain hangs from the measured path of the gripper and swings in the plane of y and z: r links as long as the
garment's segments, the mass of each in its middle, where the points are. All that is read is Parquet:
``python examples/fit_chain.py FEATURES FITTED HELD_BACK``.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from examples.estimator.chain import Links, swing
from garment_dataset import load_motion

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.features.motion import Motion

    FloatArray = NDArray[np.float64]

STEPS = 4
"""Steps of the integration between two frames."""

PRIOR = 1.5
"""Standard deviation of the logarithm of every parameter about its start: what the data do not tell stays there."""


@dataclass(frozen=True)
class Report:
    """How well a recording is predicted, over the points on the garment along y and z.

    Parameters
    ----------
    rms_m : float
        Of the difference between prediction and measurement, in one coordinate.
    coverage : float
        Share of the measurements within 1.96 standard uncertainties, those of the prediction and its misfit among them.
    """

    rms_m: float
    coverage: float


@dataclass(frozen=True)
class Fitted:
    """A chain that was fitted.

    Parameters
    ----------
    logarithms : (r + 3,) float64
        Of the parameters, see :func:`simulate`.
    covariance : (r + 3, r + 3) float64
        Of these, with the correlations of the errors.
    misfit_m2 : (2, r) float64
        Variance by which the recording is farther from the chain than its uncertainties say: a chain is no cloth.
    """

    logarithms: FloatArray
    covariance: FloatArray
    misfit_m2: FloatArray


def simulate(motion: Motion, logarithms: FloatArray) -> FloatArray:
    """Return the displacements of the points along y and z, (B, T, r, 2), metres, for B sets of parameters.

    ``logarithms``, (B, r + 3), are of the drag with the square of the speed across the links, in 1/m, the damping and
    stiffness of the joints, in 1/s and 1/s², and the drag of each link with the speed itself, in 1/s. The chain is that
    of :func:`examples.estimator.chain.swing`; the gripper is taken not to turn.
    """
    drag, damping, stiffness = np.exp(logarithms[:, :3]).T[:, :, None]
    links = Links(motion.point_count, motion.segment_length_m, stiffness, damping, np.exp(logarithms[:, 3:]), drag)
    driven = np.nan_to_num(np.concatenate([motion.acceleration_m_s2[:, 0, 1:], motion.velocity_m_s[:, 0, 1:]], axis=1))
    driven = np.column_stack([driven, np.zeros(len(driven))])
    frames_s = np.diff(motion.stamp_ns) / 1e9
    return motion.displacement_m[:, :1, 1:] + swing(links, frames_s, driven, motion.gravity_m_s2[1:], STEPS)


def predict(motion: Motion, logarithms: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the prediction, (2 T r,), y before z, and its derivatives by the parameters."""
    step = 1e-4
    sets = np.concatenate([logarithms[None], logarithms + step * np.eye(logarithms.size)])
    found = np.moveaxis(simulate(motion, sets), -1, 1).reshape(len(sets), -1)
    return found[0], (found[1:] - found[0]).T / step


def measured(motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return the measured displacements and their standard uncertainties in the same order."""
    both = (motion.displacement_m, motion.displacement_std_m)
    value, std = (np.moveaxis(array[:, 1:, 1:], -1, 0).ravel() for array in both)
    return value, std


def fit(motion: Motion) -> Fitted:
    """Return the chain that is closest to a recording.

    Weighted least squares by Gauss and Newton, as if errors were independent: that costs little. What does cost is to
    believe it, so the covariance is :math:`H J^T W C W J H` with C from ``motion.covariance``.
    """
    start = np.log(np.array([1.0, 1.0, 1.0, *[1.0] * motion.point_count]))
    value, std = measured(motion)
    known = np.isfinite(value) & np.isfinite(std)
    logarithms, prior = start, np.eye(start.size) / PRIOR**2
    for _ in range(12):
        found, slope = predict(motion, logarithms)
        weighted = slope[known] / std[known, None] ** 2
        inverse = np.linalg.inv(weighted.T @ slope[known] + prior)
        step = inverse @ (weighted.T @ (value - found)[known] - prior @ (logarithms - start))
        logarithms = logarithms + np.clip(step, -1, 1)
        if np.abs(step).max() < 1e-3:
            break
    half = value.size // 2
    covariance = np.zeros((value.size, value.size))
    covariance[:half, :half] = motion.covariance("displacement", 1)
    covariance[half:, half:] = motion.covariance("displacement", 2)
    errors = weighted.T @ covariance[np.ix_(known, known)] @ weighted
    excess = ((value - found) ** 2 - std**2).reshape(2, -1, motion.point_count)
    return Fitted(logarithms, inverse @ (errors + prior) @ inverse, np.nanmean(excess, axis=1).clip(0))


def judge(motion: Motion, chain: Fitted) -> Report:
    """Compare a prediction with what was measured from the onset on."""
    value, std = measured(motion)
    found, slope = predict(motion, chain.logarithms)
    misfit_m2 = np.repeat(chain.misfit_m2[:, None], motion.frame.size, axis=1).ravel()
    variance = std**2 + ((slope @ chain.covariance) * slope).sum(axis=1) + misfit_m2
    moving = np.tile(np.repeat(motion.time_s >= 0, motion.point_count), 2) & np.isfinite(value) & np.isfinite(variance)
    away = (value - found)[moving]
    return Report(float(np.sqrt((away**2).mean())), float((away**2 < 1.96**2 * variance[moving]).mean()))


def main(folder: Path, fitted: str, held_back: str) -> tuple[Report, Report]:
    """Fit one recording, and say how well the chain predicts it and the other one."""
    motion, other = (load_motion(name, folder) for name in (fitted, held_back))
    chain = fit(motion)
    links = (f"drag of link {link}, 1/s" for link in range(1, motion.point_count + 1))
    names = ["drag, 1/m", "damping, 1/s", "stiffness, 1/s²", *links]
    for name, logarithm, std in zip(names, chain.logarithms, np.sqrt(np.diag(chain.covariance)), strict=True):
        print(f"{name:19} {np.exp(logarithm):8.3f}, uncertain by a factor of {np.exp(std):.2f}")
    reports = judge(motion, chain), judge(other, chain)
    for what, report in zip(("fitted", "held back"), reports, strict=True):
        print(f"{what:9}  rms {1e3 * report.rms_m:.2f} mm, {report.coverage:.0%} of the 95 % intervals hold")
    return reports


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], sys.argv[3])
