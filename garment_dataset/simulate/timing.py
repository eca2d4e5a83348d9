"""When things are seen and when they are recorded: the clocks of a recording.

Figures of a robot that lifts garments before such a camera: period 33.47 ms with a standard deviation of 2.5 ms, colour
2.07 ms (1.65 to 3.61) after depth, 0.2 % of the frames dropped. Record times lie behind header stamps by what the
driver and the network take.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

PERIOD_S = 0.03347
_JITTER_S = 0.0025 / np.sqrt(2)
_COLOR_LAG_S, _COLOR_LAG_LOW_S, _COLOR_LAG_HIGH_S = 0.00207, 0.00165, 0.00361
_DROPPED_SHARE = 0.002
_FIRST_FRAME_S = 0.06

DEPTH_DELAY_S = (0.0213, 0.0008)
COLOR_DELAY_S = (0.0372, 0.0015)
"""Mean and spread of record time less header stamp."""

_EPOCH_NS = 1_391_700_000 * 10**9


@dataclass(frozen=True)
class FrameTimes:
    """Stamps of one image stream.

    Parameters
    ----------
    stamp_ns, record_ns : ndarray of int64, shape (N,)
        Header stamps and record times.
    time_s : ndarray, shape (N,)
        When the frames were seen, in seconds since the recording began: what the header stamps say, if these are right.
    stamp_s : ndarray, shape (N,)
        What the header stamps say, likewise.
    """

    stamp_ns: NDArray[np.int64]
    record_ns: NDArray[np.int64]
    time_s: NDArray[np.float64]
    stamp_s: NDArray[np.float64]


def start_ns(seed: int) -> int:
    """Return when a recording begins: some time within a year, since the Unix epoch."""
    return _EPOCH_NS + (seed % 31_000_000) * 10**9 + 250_000_000


def frame_times(
    rng: np.random.Generator,
    begin_ns: int,
    duration_s: float,
    limit: int | None,
    unsteady: tuple[float, float] | None = None,
) -> tuple[FrameTimes, FrameTimes]:
    """Return the stamps of the depth and of the colour stream.

    Parameters
    ----------
    rng : numpy.random.Generator
        Jitter, lag and drops.
    begin_ns : int
        When the recording begins.
    duration_s : float
        How long it takes; a frame that would be recorded later is not in it.
    limit : int, optional
        Most frames per stream.
    unsteady : (float, float), optional
        Share of frames that are lost, and the standard deviation of stamps about when the frames were seen, in seconds;
        by default as such a robot's.
    """
    count = int((duration_s - _FIRST_FRAME_S) / PERIOD_S)
    jitter = np.clip(rng.normal(0.0, _JITTER_S, count), -4 * _JITTER_S, 4 * _JITTER_S)
    depth_s = _FIRST_FRAME_S + np.arange(count) * PERIOD_S + jitter
    lag = _COLOR_LAG_LOW_S + rng.gamma(2.0, (_COLOR_LAG_S - _COLOR_LAG_LOW_S) / 2, count)
    color_s = depth_s + np.minimum(lag, _COLOR_LAG_HIGH_S)
    streams = [
        _stream(rng, begin_ns, seen_s, delay, duration_s, limit, unsteady)
        for seen_s, delay in ((depth_s, DEPTH_DELAY_S), (color_s, COLOR_DELAY_S))
    ]
    return streams[0], streams[1]


def _stream(
    rng: np.random.Generator,
    begin_ns: int,
    seen_s: NDArray[np.float64],
    delay_s: tuple[float, float],
    duration_s: float,
    limit: int | None,
    unsteady: tuple[float, float] | None,
) -> FrameTimes:
    lost_share, stamp_std_s = (_DROPPED_SHARE, 0.0) if unsteady is None else unsteady
    recorded_s = seen_s + np.maximum(rng.normal(*delay_s, len(seen_s)), delay_s[0] / 2)
    kept = (rng.random(len(seen_s)) >= lost_share) & (recorded_s < duration_s)
    stamp = begin_ns + np.rint(seen_s[kept] * 1e9).astype(np.int64)
    seen_s = (stamp - begin_ns) / 1e9
    if stamp_std_s > 0:
        # never so far that two frames change places
        off_s = np.clip(rng.spawn(1)[0].normal(0.0, stamp_std_s, stamp.size), -PERIOD_S / 3, PERIOD_S / 3)
        stamp = np.maximum.accumulate(stamp + np.rint(off_s * 1e9).astype(np.int64))
    record = begin_ns + np.rint(recorded_s[kept] * 1e9).astype(np.int64)
    record = np.maximum.accumulate(record)
    return FrameTimes(stamp[:limit], record[:limit], seen_s[:limit], ((stamp - begin_ns) / 1e9)[:limit])


def ticks(begin_ns: int, duration_s: float, rate_hz: float, offset_s: float) -> NDArray[np.int64]:
    """Return the stamps of something that is published at a steady rate."""
    return begin_ns + np.rint(np.arange(offset_s, duration_s, 1 / rate_hz) * 1e9).astype(np.int64)
