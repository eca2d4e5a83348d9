"""How well a fitted chain predicts a recording that it was not fitted to, beside what needs no model."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from examples.estimator.chain import simulate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from examples.estimator.fitting import Fitted
    from examples.estimator.recording import Recording

    FloatArray = NDArray[np.float64]


class Errors(NamedTuple):
    """Root mean squares over points and coordinates from the onset on, m.

    Parameters
    ----------
    chain_m : float
        Of the chain.
    rigid_m : float
        Of a garment that hangs straight below the gripper, whatever that does.
    mean_m : float
        Of the mean displacement of each point in the fitted recording, at all times.
    """

    chain_m: float
    rigid_m: float
    mean_m: float


def judge(fitted: Fitted, source: Recording, recording: Recording) -> Errors:
    """Compare predictions with what was measured.

    Parameters
    ----------
    fitted : Fitted
        The chain.
    source : Recording
        What it was fitted to.
    recording : Recording
        What is predicted.
    """
    moving = recording.time_s >= 0
    usual_m = np.nanmean(source.points_m[source.time_s >= 0], axis=0)
    predictions = (
        simulate(recording, fitted.logarithms[None])[0],
        np.repeat(recording.gripper_m[:, None], recording.count, axis=1),
        np.broadcast_to(usual_m, recording.points_m.shape),
    )
    return Errors(*(_rms_m((each - recording.points_m)[moving]) for each in predictions))


def _rms_m(away_m: FloatArray) -> float:
    return float(np.sqrt(np.nanmean(away_m**2)))
