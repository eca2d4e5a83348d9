r"""How little is known of cloth that shows folds: what is taken for its border may be a fold that rolls over it.

The silhouette of a bundle stays where it is while the bundle turns, and its material moves across the image by its
depth times the angle. Nothing that a depth image shows tells that from standing still but the shape of the folds. So
what is stated of a place grows with how deep the folds around it were at rest, with how far it has gone since, and with
how much worse than at rest the cloth fits what is seen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import FloatArray

_HALF_HEIGHT_M = 0.04
_LEAST_SAMPLES = 12

_MISFIT_M = 0.0015
"""Half of the error of one depth: where the cloth fits worse than at rest by twice that, x is off by 6 mm."""


def relief_m(places_m: FloatArray, start_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Measure how deep the folds are around some places.

    Parameters
    ----------
    places_m : (m, 3) float64
        Samples of the patch at rest, relative to the gripper.
    start_m : (r, 3) float64
        Places on it; NaN where there is none.

    Returns
    -------
    relief_m : (r,) float64
        Standard deviation of z about the plane through the samples within 4 cm above and below; NaN where there are
        too few.
    slope : (r,) float64
        That over the standard deviation of x: how steep their sides are.
    """
    found = np.full((2, start_m.shape[0]), np.nan)
    for place, y_m in enumerate(start_m[:, 1]):
        around_m = places_m[np.abs(places_m[:, 1] - y_m) <= _HALF_HEIGHT_M]
        if len(around_m) >= _LEAST_SAMPLES:
            basis = np.column_stack([np.ones(len(around_m)), around_m[:, :2]])
            plane = np.linalg.lstsq(basis, around_m[:, 2], rcond=None)[0]
            found[0, place] = float((around_m[:, 2] - basis @ plane).std())
            found[1, place] = found[0, place] / max(float(around_m[:, 0].std()), 1e-3)
    return found[0], found[1]


def fold_std_m(
    relief_m: FloatArray, slope: FloatArray, moved_m: FloatArray, worse_m: FloatArray, share: float
) -> FloatArray:
    r"""Return the standard uncertainty of places because folds roll, (T, r, 3).

    Parameters
    ----------
    relief_m, slope : (r,) float64
        From :func:`relief_m`; unknown counts as none.
    moved_m : (T, r, 3) float64
        How far the places are from their rest, relative to the gripper.
    worse_m : (T,) float64
        Root of the misfit's square less its square at rest.
    share : float
        See the notes.

    Notes
    -----
    Along x it is the share of the geometric mean of relief and way, and with it :math:`d^2` / 1.5 mm for a misfit d;
    along z what sliding so far across the steepest of the folds brings, as a fold that rolls comes from elsewhere.
    These laws were found on simulated towels, shorts and shirts, where the share is 0.2 (docs/tracks.md); flat sheets
    obey them.
    """
    away_m = np.linalg.norm(moved_m, axis=2)
    rolled_m = share * np.sqrt(np.nan_to_num(relief_m) * away_m)
    across_m = np.hypot(rolled_m, np.nan_to_num(worse_m)[:, None] ** 2 / _MISFIT_M)
    steepest = float(np.nan_to_num(slope).max(initial=0.0))
    std_m: FloatArray = np.stack([across_m, np.zeros_like(across_m), steepest * across_m], axis=2)
    return std_m
