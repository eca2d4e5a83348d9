"""Nuisances of the depth images: of the sensor, and of what is known of the gripper.

Shifts are OpenNI's: eighths of a pixel of disparity, 3.35 mm at 1.07 m. Where a range is not one measured on Xtion
frames, the literature that it comes from is named at its draw.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np

PatternKind = Literal["none", "bands", "blobs"]


@dataclass(frozen=True, slots=True)
class Pattern:
    """What a sensor always adds to what it measures.

    Parameters
    ----------
    kind : {"none", "bands", "blobs"}
        Nothing; vertical bands; blobs.
    size_px : float
        Width of a band, or radius of a blob.
    levels_shift : float
        Standard deviation.
    seed : int
        Of the camera.
    """

    kind: PatternKind
    size_px: float
    levels_shift: float
    seed: int


@dataclass(frozen=True, slots=True)
class DepthNuisance:
    """What is unusual about the depth images; None: as usual.

    Parameters
    ----------
    depth_noise : float or None
        How many times as noisy the sensor is.
    depth_exponent : float or None
        Power of the distance with which its noise grows; usually 2, about 1.07 m.
    depth_grain : (float, float) or None
        Radius of the noise's blobs in pixels, and its correlation from one frame to the next.
    depth_step : float or None
        Distance of the levels that it can report, in shifts; reported are whole millimetres, not OpenNI's.
    depth_pattern : Pattern or None
        What it always adds, instead of the usual.
    depth_pattern_stays : float or None
        Share of the variance of its texture that stays on its pixels; the rest goes with the projected dots, over the
        image as the distance changes. Usually all of it stays.
    depth_bias_m : float or None
        Error common to all pixels, at 1.07 m; it grows with the square of the distance.
    depth_drift_m_s : float or None
        How fast that error changes while the sensor warms.
    depth_fattening_px : float or None
        By how much what is nearer grows over what is behind it.
    depth_edge_holes : float or None
        How many times as often pixels near an edge are missing.
    depth_grazing_rad : float or None
        Angle from the normal beyond which a surface returns nothing.
    depth_flying : float or None
        Share of the pixels at edges that lie between both surfaces.
    gripper_error_m : ((x, y, z), (x, y, z)) or None
        By how much ``/tf``, and the topics, misplace the gripper, in the camera's frame.
    camera_tilt_rad : (float, float) or None
        How far the camera looks up, and leans to its right, about the gripper's rest.
    unsteady_frames : (float, float) or None
        Share of frames that are lost, and the standard deviation of stamps about when the frames were seen, in seconds.
    """

    depth_noise: float | None = None
    depth_exponent: float | None = None
    depth_grain: tuple[float, float] | None = None
    depth_step: float | None = None
    depth_pattern: Pattern | None = None
    depth_pattern_stays: float | None = None
    depth_bias_m: float | None = None
    depth_drift_m_s: float | None = None
    depth_fattening_px: float | None = None
    depth_edge_holes: float | None = None
    depth_grazing_rad: float | None = None
    depth_flying: float | None = None
    gripper_error_m: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    camera_tilt_rad: tuple[float, float] | None = None
    unsteady_frames: tuple[float, float] | None = None


USUAL_DEPTH = DepthNuisance()


def _pattern(rng: np.random.Generator) -> Pattern:
    """Draw another camera's fixed pattern.

    Bands of 56 and 96 px were measured, of 0.35 to 0.5 shift; residuals from planes leave room for blobs of up to 0.5
    shift. A sensor calibrated pixel by pixel has none.
    """
    kinds: tuple[PatternKind, ...] = ("none", "bands", "blobs")
    kind = kinds[int(rng.integers(3))]
    size_px = float(rng.uniform(40, 110) if kind == "bands" else rng.uniform(2, 20))
    return Pattern(kind, size_px, float(rng.uniform(0.1, 0.5)), int(rng.integers(1 << 31)))


def _triple(rng: np.random.Generator, std: float) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in rng.normal(0.0, std, 3))
    return x, y, z


DEPTH_DRAWS: Mapping[str, Callable[[np.random.Generator], object]] = {
    # 0.33 to 0.70 shift over seven views of real cameras, about the usual 0.49
    "depth_noise": lambda rng: float(rng.uniform(0.6, 1.5)),
    # triangulation: 2 (Khoshelham and Elberink, 2012); time of flight: less (Wasenmueller and Stricker, 2016)
    "depth_exponent": lambda rng: float(rng.uniform(0.5, 2.5)),
    # correlations of 0.44 to 0.74 at 1 px, and of 0.11 to 0.37 with the next frame; filters in time make more of it
    "depth_grain": lambda rng: (float(rng.uniform(0.4, 3.0)), float(rng.uniform(0.0, 0.5))),
    # from a thirty-second of a pixel, as later stereo cameras have it, to a little more than OpenNI's eighth
    "depth_step": lambda rng: float(10 ** rng.uniform(-0.8, 0.15)),
    "depth_pattern": _pattern,
    # dots are matched with those of a reference image: which dots a window holds changes with the disparity, 16 px from
    # 1.8 to 1.07 m; errors of lens and reference image stay. How they share was not measured
    "depth_pattern_stays": lambda rng: float(rng.uniform(0.0, 1.0)),
    # a few millimetres at 1 m, not calibrated (Smisek, Jancosek and Pajdla, 2011; Herrera et al., 2012)
    "depth_bias_m": lambda rng: float(rng.normal(0.0, 0.002)),
    # up to 1.8 mm per kelvin (Fiedler and Mueller, 2013), of which 8 s see little
    "depth_drift_m_s": lambda rng: float(rng.normal(0.0, 5e-5)),
    # by less than half a correlation window of 9 px (Scharstein and Szeliski, 2002): real edges are ragged by 2 px
    "depth_fattening_px": lambda rng: float(rng.uniform(0.0, 2.0)),
    # left edges without gap: 15 to 51 %; missing within 1.5 px: 18 to 47 %
    "depth_edge_holes": lambda rng: float(rng.uniform(0.5, 3.0)),
    # noise and gaps grow steeply from 60 to 80 degrees (Nguyen, Izadi and Lovell, 2012)
    "depth_grazing_rad": lambda rng: float(rng.uniform(1.1, 1.45)),
    # time of flight mixes what a pixel sees (Sarbolandi, Lefloch and Kolb, 2015); structured light hardly does
    "depth_flying": lambda rng: float(rng.uniform(0.0, 0.5)),
    # hand-eye calibrations of such arms leave some millimetres; a topic may come from a better one
    "gripper_error_m": lambda rng: (_triple(rng, 0.003), _triple(rng, 0.001)),
    # put level by hand: some degrees
    "camera_tilt_rad": lambda rng: (float(rng.uniform(-0.05, 0.05)), float(rng.uniform(-0.05, 0.05))),
    # 0.2 % were dropped; a busy recorder loses more. The driver stamps on arrival, less a guess of the transfer
    "unsteady_frames": lambda rng: (float(rng.uniform(0.0, 0.08)), float(rng.uniform(0.0, 0.002))),
}
"""How each is drawn."""
