r"""A hem that rolls up within a few rows of pixels, to the back or to the front.

Surfaces are fitted to windows of some 5 cm, and go on straight where an edge of cloth curls within one. The roll
belongs to the garment, not to the frame: what the last rows show beyond the surfaces is pooled over the recording. Most
of its length is in its last row, where the cloth turns along the ray and no pixel shows it; that part follows from the
arc through the others as far as it is seen, and is stated as uncertain beyond.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, FloatArray
    from garment_dataset.vision.depth.profile import Profile

_ROWS = 24
"""Rows above the end that are compared with the surfaces: half a large window."""

_ROLLED_ROWS = 13
"""A roll is within so many, some 2.5 cm; from the rows above, cloth is drawn out straight: a free edge is not bent."""

_STRAIGHT_ROWS = 40

_FIT_ROWS = 6

_LEAST_FRAMES = 10
_LEAST_SHARE = 0.5
"""Of the frames have to show the last rows on one piece of cloth for these to be followed."""

_LEAST_M = 0.0008
_LEAST_STD = 4.0
"""Beyond the surfaces, the last row has to be off by so much, and by so many times what rows farther up are."""

_MEAN_FRAMES = 9
_LEAST_STEADINESS = 2.0
"""Times the standard deviation of means of so many frames, with little noise: what swings is the end of a bundle."""

_UNSEEN_ROWS = 0.5
"""How far above or below the end of the arc through the rows the hem may be."""

_RADII_M = np.geomspace(0.002, 0.08, 75)


@dataclass(frozen=True, slots=True, eq=False)
class Curl:
    """What a recording shows of its rolled hem.

    Parameters
    ----------
    beyond_m : (n,) float64
        By how much depth is more than that of the surfaces, in the rows above the end; the first is at the end itself.
    above_px : (n,) float64
        How far above the end these are.
    hidden_std_m : float
        Standard uncertainty of the length, as cloth at the end turns along the ray.
    """

    beyond_m: FloatArray
    above_px: FloatArray
    hidden_std_m: float

    def only_stated(self) -> Curl:
        """Return none of the roll, but an uncertainty of as much as it is long beyond the surfaces."""
        return Curl(np.zeros(self.beyond_m.size), self.above_px, float(np.abs(np.diff(self.beyond_m)).sum()))


def find_curl(profiles: Sequence[Profile]) -> Curl | None:
    """Look for a rolled hem in all frames of a recording.

    Parameters
    ----------
    profiles : sequence of Profile
        Of frames that show the hem, with the depths of their final windows.

    Returns
    -------
    Curl or None
        None where the last rows show no more than the surfaces.
    """
    shown = [each for each in map(_last_rows_m, profiles) if each is not None]
    if len(shown) < _LEAST_FRAMES:
        return None
    beyond_m, shape_m, row_m, away = (np.array(part) for part in zip(*shown, strict=True))
    if (np.isfinite(beyond_m).sum(axis=0) < _LEAST_FRAMES).any():
        return None
    pooled_m = np.nanmedian(beyond_m, axis=0)
    pooled_m -= np.mean(pooled_m[_ROLLED_ROWS:])
    usual_m = float(np.std(pooled_m[_ROLLED_ROWS:]))
    if abs(pooled_m[0]) < max(_LEAST_M, _LEAST_STD * usual_m):
        return None
    mostly = len(shown) >= _LEAST_SHARE * len(profiles)
    if mostly and abs(np.nanmedian(beyond_m[:, 0])) < _LEAST_STEADINESS * _swing_m(beyond_m[:, 0]):
        return None
    whole_m = np.nanmedian(shape_m, axis=0)[:_FIT_ROWS]
    back = np.sign(pooled_m[0])
    last_m, hidden_m = _roll(back * whole_m, float(np.median(row_m)), -back * float(np.median(away)))
    end_m = pooled_m[0] + back * last_m - whole_m[0]
    above_px = np.append(0.0, np.arange(_ROLLED_ROWS) + 0.5)
    found = Curl(np.append(end_m, pooled_m[:_ROLLED_ROWS]), above_px, hidden_m / np.sqrt(12))
    # Rolled so far that it comes out again, as a piece of its own: it is known to be there, but not how long it is
    return found if mostly else found.only_stated()


def follow_curl(profiles: Sequence[Profile], hem_seen: BoolArray) -> list[Profile]:
    """Return profiles whose last rows follow the roll, if the recording shows one.

    Parameters
    ----------
    profiles : sequence of Profile, length T
        With the depths of their final windows.
    hem_seen : (T,) bool
        Which end with the garment.
    """
    curl = find_curl([profile for profile, seen in zip(profiles, hem_seen, strict=True) if seen])
    if curl is None:
        return list(profiles)
    return [_curled(profile, curl) if seen else profile for profile, seen in zip(profiles, hem_seen, strict=True)]


def _curled(profile: Profile, curl: Curl) -> Profile:
    if not curl.beyond_m.any():
        return replace(profile, hidden_std_m=curl.hidden_std_m)
    own = (profile.piece == profile.piece[-1]) & (profile.above_px <= curl.above_px[-1])
    z_m = profile.z_m.copy()
    z_m[own] += np.interp(profile.above_px[own], curl.above_px, curl.beyond_m)
    # along the rays; y does not fall
    y_m = np.maximum.accumulate(profile.y_m / profile.z_m * z_m)
    return replace(profile, y_m=y_m, z_m=z_m, end_y_m=float(y_m[-1]), hidden_std_m=curl.hidden_std_m)


def _last_rows_m(profile: Profile) -> tuple[FloatArray, FloatArray, float, float] | None:
    """Return how far the last rows are beyond the surface and from straight, a row's height, and the end's y over z."""
    own = (profile.piece == profile.piece[-1]) & np.isfinite(profile.row_z_m)
    above_px, z_m, row_z_m = profile.above_px[own], profile.z_m[own], profile.row_z_m[own]
    straight = (above_px >= _ROLLED_ROWS) & (above_px < _STRAIGHT_ROWS)
    if np.count_nonzero(straight) < (_STRAIGHT_ROWS - _ROLLED_ROWS) / 2:
        return None
    line = np.polynomial.Polynomial.fit(above_px[straight], row_z_m[straight], 1)
    beyond_m, shape_m = np.full((2, _ROWS), np.nan)
    near = above_px < _ROWS
    row = above_px[near].astype(np.int64)
    beyond_m[row] = row_z_m[near] - z_m[near]
    shape_m[row] = row_z_m[near] - line(above_px[near])
    y_m = profile.y_m[own]
    height_m = (y_m[-1] - y_m[0]) / max(above_px[0] - above_px[-1], 1.0)
    return beyond_m, shape_m, float(height_m), float(profile.y_m[-1] / profile.z_m[-1])


def _swing_m(end_m: FloatArray) -> float:
    """Return the standard deviation, robust, of means of consecutive frames, which may be NaN; at least one is not."""
    parts = np.array_split(end_m, max(end_m.size // _MEAN_FRAMES, 1))
    means_m = np.array([np.nanmean(part) for part in parts if np.isfinite(part).any()])
    return 1.4826 * float(np.median(np.abs(means_m - np.median(means_m))))


def _roll(away_m: FloatArray, row_m: float, shear: float) -> tuple[float, float]:
    """Fit an arc; return how far away its end is, and the length that its last part hides.

    ``away_m`` are distances from straight cloth in the rows above the end, each ``row_m`` high; on a ray cloth moves
    down by ``shear`` of such a distance. The hem is within half a row of its end, and not beyond where it turns
    along the ray.
    """
    above_m = (np.arange(away_m.size) + 0.5) * row_m
    angle = np.linspace(0.0, np.pi / 2 + np.arctan(shear), 61)
    down, away = np.sin(angle) + shear * (1 - np.cos(angle)), 1 - np.cos(angle)
    best = (np.inf, 0.0, 0)
    for radius_m in _RADII_M:
        for end in range(2, angle.size):
            model_m = radius_m * np.interp(down[end] - above_m / radius_m, down, away)
            cost = float(((model_m - away_m) ** 2).sum())
            if cost < best[0]:
                best = cost, float(radius_m), end
    _, radius_m, end = best
    unseen = _UNSEEN_ROWS * row_m / radius_m
    nearest, farthest = np.interp([down[end] - unseen, min(down[end] + unseen, down[-1])], down, angle)
    return radius_m * float(away[end]), radius_m * float(farthest - nearest)
