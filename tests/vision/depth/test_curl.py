"""A hem that rolls up within a few rows: its length is found or stated, and a straight hem is left alone."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest

from garment_dataset.stages.depth_points import DepthPointsParams
from garment_dataset.vision.depth import tracking
from garment_dataset.vision.depth.cloud import LEVEL_SPACING_PER_M, Intrinsics
from garment_dataset.vision.depth.curl import find_curl, follow_curl
from garment_dataset.vision.depth.flat_field import ladder_per_m
from garment_dataset.vision.depth.profile import Profile
from garment_dataset.vision.depth.trace import Trace, trace_profiles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray, FloatArray

K = Intrinsics(fx_px=570.3, fy_px=570.3, cx_px=319.5, cy_px=239.5)
SHAPE = (480, 640)
GRIPPER_M = (0.01, -0.35, 1.065)
STRAIGHT_M = 0.62
ROW_M = GRIPPER_M[2] / K.fy_px
LADDER = ladder_per_m()
LEVELS_MM = np.flatnonzero(LADDER)
FRAMES = 20


def curve_m(radius_m: float, angle_rad: float) -> FloatArray:
    """Return y and z, (2, n), of a sheet that hangs down, then turns away from the camera; towards it if negative."""
    turned = np.linspace(0.0, abs(angle_rad), 400)
    arc_y_m, arc_z_m = radius_m * np.sin(turned), np.copysign(radius_m, angle_rad) * (1 - np.cos(turned))
    down_m = np.linspace(0.0, STRAIGHT_M, 2000, endpoint=False)
    y_m = np.concatenate([down_m, STRAIGHT_M + arc_y_m])
    return np.stack([GRIPPER_M[1] + y_m, GRIPPER_M[2] + np.concatenate([np.zeros_like(down_m), arc_z_m])])


def visible_length_m(curve: FloatArray) -> float:
    """Return the length down to where lines of sight first touch the back of the curve."""
    seen_down_to = int(np.argmax(curve[0] / curve[1])) + 1
    return float(np.hypot(*np.diff(curve[:, :seen_down_to])).sum())


def depth_m(curve: FloatArray) -> FloatArray:
    """Return the exact depth of the sheet, 0.3 m wide, before a wall 1.8 m away."""
    y_m, z_m = curve
    rise = y_m / z_m
    seen = slice(0, int(np.argmax(rise)) + 1)
    v = np.arange(SHAPE[0], dtype=np.float64)
    ray = (v - K.cy_px) / K.fy_px
    row_z_m = np.interp(ray, rise[seen], z_m[seen], left=np.nan, right=np.nan)
    x_m = (np.arange(SHAPE[1]) - K.cx_px) / K.fx_px * row_z_m[:, None]
    there = np.isfinite(row_z_m)[:, None] & (np.abs(x_m - GRIPPER_M[0]) < 0.15)
    return np.where(there, np.nan_to_num(row_z_m)[:, None], 1.8)


def sensed(exact_m: FloatArray, rng: np.random.Generator) -> NDArray[np.uint16]:
    """Return what a sensor with noise in blobs and levels of disparity makes of it."""
    white = cv2.GaussianBlur(rng.standard_normal(SHAPE), (0, 0), 1.5)
    inverse = 1 / exact_m + 0.5 * white / white.std() * LEVEL_SPACING_PER_M
    rising = LADDER[LEVELS_MM][::-1]
    nearest = np.clip(np.searchsorted((rising[1:] + rising[:-1]) / 2, inverse), 0, rising.size - 1)
    return np.asarray(LEVELS_MM[::-1][nearest], np.uint16)


def traces_of(curve: FloatArray, seed: int = 1) -> list[Trace]:
    rng = np.random.default_rng(seed)
    images = [(frame, sensed(depth_m(curve), rng)) for frame in range(FRAMES)]
    stamps_ns = {frame: 33_000_000 * frame for frame, _ in images}
    grippers_m = dict.fromkeys(stamps_ns, GRIPPER_M)
    return list(trace_profiles(images, stamps_ns, K, grippers_m, DepthPointsParams().track_settings()).values())


def length_m(curve: FloatArray) -> float:
    return float(np.median([trace.chain.length_m for trace in traces_of(curve) if trace.chain]))


def followed_m(curve: FloatArray, monkeypatch: pytest.MonkeyPatch) -> tuple[float, float]:
    """Return the length, and how much of it is hidden."""
    hidden_std_m = [0.0]

    def follow(profiles: Sequence[Profile], hem_seen: BoolArray) -> list[Profile]:
        followed = follow_curl(profiles, hem_seen)
        hidden_std_m.append(max(profile.hidden_std_m for profile in followed))
        return followed

    with monkeypatch.context() as patched:
        patched.setattr(tracking, "follow_curl", follow)
        return length_m(curve), hidden_std_m[-1] * 12**0.5


def straight_m(curve: FloatArray, monkeypatch: pytest.MonkeyPatch) -> float:
    """Return the length where surfaces go on straight to the end."""
    with monkeypatch.context() as patched:
        patched.setattr(tracking, "follow_curl", lambda profiles, _: list(profiles))
        return length_m(curve)


def profile_of(rows: int = 120) -> Profile:
    """Return a flat, vertical profile whose rows show exactly its surface."""
    above_px: FloatArray = np.arange(rows, 0, -1, dtype=np.float64) - 0.5
    y_m, z_m, ones = 0.3 - ROW_M * above_px, np.full(rows, 1.0), np.ones(rows)
    return Profile(
        y_m, z_m, np.zeros(rows, np.int64), np.ones(rows, np.int64), 0 * y_m, 0 * y_m, z_m, 0.3,
        ends_at_gap=False, window_z_m=z_m[None], window_gain=ones[None], window_pixels=np.ones((1, rows), np.int64),
        row_z_m=z_m, above_px=above_px,
    )  # fmt: skip


def rolled(profile: Profile, away_m: FloatArray) -> Profile:
    """Return the profile with its last rows farther away by as much, the last first."""
    row_z_m = profile.row_z_m.copy()
    row_z_m[-away_m.size :] += away_m[::-1]
    return replace(profile, row_z_m=row_z_m)


ALL_SEEN = np.ones(30, np.bool_)
ROLL_M = np.array([0.009, 0.005, 0.0025, 0.001, 0.0003])


@pytest.mark.parametrize("back", [1, -1])
@pytest.mark.parametrize(("radius_m", "angle_deg"), [(0.008, 80), (0.015, 75), (0.02, 60)])
def test_a_rolled_hem_is_nearer_to_its_length_than_a_straight_one(
    radius_m: float, angle_deg: float, back: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    curve = curve_m(radius_m, back * np.radians(angle_deg))
    true_m = visible_length_m(curve)
    error_m = abs(followed_m(curve, monkeypatch)[0] - true_m)
    assert error_m < 0.5 * abs(straight_m(curve, monkeypatch) - true_m)


@pytest.mark.parametrize("back", [1, -1])
@pytest.mark.parametrize(("radius_m", "angle_deg"), [(0.008, 80), (0.012, 85), (0.02, 60), (0.006, 90), (0.01, 120)])
def test_its_length_is_right_to_what_the_last_row_hides_and_half_a_row(
    radius_m: float, angle_deg: float, back: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    curve = curve_m(radius_m, back * np.radians(angle_deg))
    found_m, hidden_m = followed_m(curve, monkeypatch)
    assert hidden_m > 0
    assert abs(found_m - visible_length_m(curve)) < hidden_m + ROW_M / 2


def test_a_straight_hem_ends_where_it_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    curve = curve_m(0.01, 0.0)
    assert followed_m(curve, monkeypatch) == (straight_m(curve, monkeypatch), 0.0)


@pytest.mark.parametrize("noise_m", [0.0, 0.002])
def test_rows_that_show_their_surfaces_leave_every_profile_as_it_is(noise_m: float) -> None:
    rng = np.random.default_rng(3)
    flat = profile_of()
    profiles = [rolled(flat, rng.normal(0, noise_m, 60)) for _ in ALL_SEEN]
    assert find_curl(profiles) is None
    assert all(after is before for after, before in zip(follow_curl(profiles, ALL_SEEN), profiles, strict=True))


@pytest.mark.parametrize("back", [1.0, -1.0])
def test_what_rows_show_is_followed_and_nothing_above_is_moved(back: float) -> None:
    profiles = [rolled(profile_of(), back * ROLL_M)] * 30
    for before, after in zip(profiles, follow_curl(profiles, ALL_SEEN), strict=True):
        np.testing.assert_allclose(after.z_m[-5:] - before.z_m[-5:], back * ROLL_M[::-1], atol=1e-4)
        np.testing.assert_array_equal(after.z_m[:-13], before.z_m[:-13])
        assert (np.diff(after.y_m) >= 0).all()
        assert after.end_y_m == after.y_m[-1]


def test_frames_that_do_not_show_the_hem_are_left_alone() -> None:
    profiles = [rolled(profile_of(), ROLL_M)] * 30
    shown = np.arange(30) % 3 > 0
    followed = follow_curl(profiles, shown)
    changed = [after is not before for after, before in zip(followed, profiles, strict=True)]
    np.testing.assert_array_equal(changed, shown)


@pytest.mark.parametrize("frames", [0, 9])
def test_a_few_frames_say_nothing(frames: int) -> None:
    profiles = [rolled(profile_of(), ROLL_M)] * frames + [profile_of(10)] * (30 - frames)
    assert find_curl(profiles) is None


def test_a_roll_that_most_frames_show_as_a_piece_of_its_own_is_only_stated() -> None:
    """It is there, and how long it is behind itself no frame tells: nothing is moved, the length is uncertain by it."""
    own = rolled(profile_of(), ROLL_M)
    apart = replace(own, piece=np.append(np.zeros(110, np.int64), np.ones(10, np.int64)))
    followed = follow_curl([own] * 12 + [apart] * 18, ALL_SEEN)
    for before, after in zip([own] * 12 + [apart] * 18, followed, strict=True):
        np.testing.assert_array_equal(after.z_m, before.z_m)
        assert after.hidden_std_m > np.ptp(ROLL_M)


def test_one_frame_that_is_far_off_does_not_make_a_roll() -> None:
    profiles = [profile_of()] * 29 + [rolled(profile_of(), 10 * ROLL_M)]
    assert find_curl(profiles) is None


def test_an_end_that_swings_is_no_roll_and_one_that_is_noisy_is() -> None:
    """Both are on average as far off as a roll, and single frames are farther than that apart."""
    rng = np.random.default_rng(4)
    frames = 108
    swing, noise = 1.7 * np.sin(np.arange(frames) / 12), 1.2 * rng.standard_normal(frames)
    swinging, noisy = ([rolled(profile_of(), (1 + one) * ROLL_M) for one in each] for each in (swing, noise))
    assert find_curl(swinging) is None
    assert find_curl(noisy) is not None


def test_what_a_roll_hides_is_in_the_uncertainty_along_the_cloth() -> None:
    """A hem rolled by half a turn has its last arc turned along the ray: the farther down a point, the more of it."""
    straight, turned = traces_of(curve_m(0.01, 0.0)), traces_of(curve_m(0.01, np.pi))
    y_std_m = [
        np.mean([trace.points.std_m[1] for trace in each if trace.points], axis=0) for each in (straight, turned)
    ]
    assert (y_std_m[1] > y_std_m[0]).all()
    assert y_std_m[1][-1] - y_std_m[0][-1] > y_std_m[1][0] - y_std_m[0][0]
