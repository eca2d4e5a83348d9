"""The coarse mask is bit by bit what plain arithmetic gives; refined edges are where the garment's are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from skimage import measure, morphology

from garment_dataset.errors import PictureError
from garment_dataset.vision.color.background import Background, BackgroundAccumulator
from garment_dataset.vision.color.edges import refine_edges
from garment_dataset.vision.color.silhouette import BackgroundSubtractor

if TYPE_CHECKING:
    from collections.abc import Callable

Mask = NDArray[np.bool_]
Image = NDArray[np.uint8]
Floats = NDArray[np.float64]
Color = tuple[float, float, float]

CLOTH: Color = (70.0, 120.0, 90.0)


# What the fast path must equal: eq. (5.3) in float64, every step on the whole frame, with scikit-image


class Options(NamedTuple):
    alpha: float
    min_sigma: float
    open_px: int
    close_px: int


def plain_silhouette(
    frame: Image,
    background: Background,
    options: Options,
    clip: Mask | None = None,
    drift: Floats | None = None,
    top_v_px: float | None = None,
    gripper: Mask | None = None,
) -> Mask:
    change = np.zeros(3) if drift is None else np.rint(drift)
    reach = options.alpha * np.maximum(background.std, options.min_sigma)
    expected = background.mean + change
    lower, upper = np.minimum(expected - reach, 255), np.maximum(expected + reach, 0)
    mask = ((frame < lower) | (frame > upper)).any(axis=2)
    allowed = np.ones(mask.shape, np.bool_) if clip is None else clip
    room = options.open_px + options.close_px
    mask = np.pad(mask & allowed, room)
    mask = morphology.opening(mask, np.ones((options.open_px, options.open_px), np.bool_))
    mask = morphology.closing(mask, np.ones((options.close_px, options.close_px), np.bool_))
    mask = mask[room:-room, room:-room] & allowed
    if top_v_px is not None:
        mask &= np.arange(mask.shape[0])[:, None] >= top_v_px
    if gripper is not None:
        mask &= ~gripper
    labels = measure.label(mask, connectivity=2)  # type: ignore[no-untyped-call]
    regions = measure.regionprops(labels)  # type: ignore[no-untyped-call]
    if not regions:
        return np.zeros_like(allowed)
    best = min(regions, key=lambda region: (-region.area, region.bbox[0], region.bbox[1]))
    return np.asarray(labels == best.label)


def cluttered(seed: int, height: int, width: int, blur_px: float) -> tuple[Background, Image]:
    """A frame of blobs of all sizes, some of them barely outside the noise."""
    rng = np.random.default_rng(seed)
    mean = rng.uniform(60, 190, 3) + rng.normal(0, 4, (height, width, 3))
    std = rng.uniform(0.5, 4, (height, width, 3))
    blobs = cv2.GaussianBlur(rng.normal(0, 1, (height, width)), (0, 0), blur_px)
    blobs *= rng.uniform(5, 30) / blobs.std()
    frame = mean + std * rng.normal(0, 1, mean.shape) + np.maximum(blobs, 0)[..., None] * rng.choice([-1, 0, 1], 3)
    return Background(mean, std, 90), np.clip(np.rint(frame), 0, 255).astype(np.uint8)


@settings(max_examples=150, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(24, 60),
    st.integers(24, 60),
    st.floats(1.0, 8.0),
    st.builds(
        Options,
        st.floats(1.5, 5.0),
        st.sampled_from([0.0, 2.0]),
        st.sampled_from([1, 3, 5, 7, 9, 15]),
        st.sampled_from([1, 3, 5, 9]),
    ),
    st.sets(st.sampled_from(["clip", "drift", "top", "gripper"])),
)
def test_the_coarse_mask_is_the_plain_one_bit_by_bit(
    seed: int, height: int, width: int, blur_px: float, options: Options, given: set[str]
) -> None:
    background, frame = cluttered(seed, height, width, blur_px)
    rng = np.random.default_rng(seed)
    clip = cv2.GaussianBlur(rng.normal(0, 1, frame.shape[:2]), (0, 0), 4) > -0.05
    clip[0, 0] = True
    place: dict[str, Any] = {
        "drift": rng.uniform(-30, 30, 3) if "drift" in given else None,
        "top_v_px": rng.uniform(-3, height + 3) if "top" in given else None,
        "gripper": rng.random((height, width)) < 0.05 if "gripper" in given else None,
    }
    used = clip if "clip" in given else None
    subtractor = BackgroundSubtractor(background, used, **options._asdict(), edge="threshold")
    found = subtractor.find(frame, **place).mask
    np.testing.assert_array_equal(found, plain_silhouette(frame, background, options, used, **place))


# Rendered frames with known edges


def noise(rng: np.random.Generator, shape: tuple[int, int], sd: Color) -> Floats:
    """Noise as fine as a Bayer mosaic leaves it: 0.67 from pixel to pixel in red and blue, 0.40 in green."""
    white, (v, u) = rng.normal(0, 1, shape), np.indices(shape)
    cross = np.array([[0, 1, 0], [1, 4, 1], [0, 1, 0]]) / 4
    square = np.array([[1, 2, 1], [2, 4, 2], [1, 2, 1]]) / 4
    mosaic = [((u % 2 == 0) & (v % 2 == 0), square), ((u + v) % 2 == 1, cross), ((u % 2 == 1) & (v % 2 == 1), square)]
    planes = [cv2.filter2D(np.where(seen, white, 0), -1, kernel) for seen, kernel in mosaic]
    return np.stack([plane * (level / plane.std()) for plane, level in zip(planes, sd, strict=True)], axis=2)


def blurred(image: Floats, blur_px: float) -> Floats:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), blur_px) if blur_px else image, np.float64)


def empty_scene(shape: tuple[int, int]) -> Floats:
    """A cloth, darker towards the borders."""
    v, u = np.indices(shape)
    shade = 1 - 0.25 * (2 * u / shape[1] - 1) ** 2 - 0.1 * v / shape[0]
    return np.asarray(shade[..., None] * np.array(CLOTH))


def coverage(inside: Callable[[Floats, Floats], Mask], shape: tuple[int, int], fine: int = 7) -> Floats:
    """Return the share of each pixel that a shape covers; an odd number of samples, so that it is never half."""
    offsets = (np.arange(fine) + 0.5) / fine - 0.5
    v, u = ((np.arange(size)[:, None] + offsets).ravel() for size in shape)
    covered = inside(u[None, :], v[:, None])
    return np.asarray(covered.reshape(shape[0], fine, shape[1], fine).mean(axis=(1, 3)))


def strip(u: Floats, v: Floats, width_px: float = 8.0) -> Mask:
    """A garment seen edge-on."""
    middle = 60.3 + 0.06 * v + 6 * np.sin(v / 60)
    return np.asarray((np.abs(u - middle) <= width_px / 2) & (v >= 20.2) & (v <= 260.4))


def towel(u: Floats, v: Floats) -> Mask:
    """A garment seen openly."""
    middle, half = 70.2 + 8 * np.sin(v / 70), 35 + 5 * np.sin(v / 30)
    return np.asarray((np.abs(u - middle) <= half) & (v >= 20.2) & (v <= 250 + 5 * np.sin(u / 20)))


class Camera:
    """An empty scene, and frames of a garment before it."""

    shape = (280, 140)

    def __init__(self, seed: int, sd: Color, blur_px: float = 1.0) -> None:
        self.rng, self.sd, self.blur_px = np.random.default_rng(seed), sd, blur_px
        self.scene = empty_scene(self.shape)
        accumulator = BackgroundAccumulator()
        for _ in range(40):
            accumulator.add(self.seen(self.scene, self.rng.normal(0, 1, 3)))
        self.background = accumulator.finish()

    def seen(self, image: Floats, drift: Floats) -> Image:
        levels = blurred(image, self.blur_px) + drift + noise(self.rng, self.shape, self.sd)
        return np.clip(np.rint(levels), 0, 255).astype(np.uint8)

    def frame(self, covered: Floats, garment: Floats, drift: Floats | None = None) -> Image:
        change = self.rng.normal(0, 3, 3) if drift is None else drift
        return self.seen(covered[..., None] * garment + (1 - covered[..., None]) * self.scene, change)


def fabric(color: Color, *, stripe: float = 0.0, shading: float = 0.0) -> Floats:
    """Return the colours of a garment over the whole frame."""
    v, u = np.indices(Camera.shape)
    level = 1 + shading * np.sin(u / 17 + v / 60)
    return np.asarray(np.clip(level[..., None] * np.array(color) + stripe * np.sign(np.sin(v / 4))[..., None], 0, 255))


def overlap(found: Mask, truth: Mask) -> float:
    """Return the intersection over union."""
    return float((found & truth).sum() / (found | truth).sum())


def both_masks(camera: Camera, frame: Image) -> tuple[Mask, Mask]:
    """Return the thesis' mask and the refined one, both with drift compensated."""
    subtractors = [BackgroundSubtractor(camera.background, edge=edge) for edge in ("threshold", "half_contrast")]
    drift = subtractors[0].drift(frame)
    coarse, refined = (subtractor.find(frame, drift=drift).mask for subtractor in subtractors)
    return coarse, refined


@pytest.fixture(scope="module")
def strip_coverage() -> Floats:
    return coverage(strip, Camera.shape)


@pytest.fixture(scope="module")
def towel_coverage() -> Floats:
    return coverage(towel, Camera.shape)


NOISE = {"quiet": (2.4, 2.0, 2.4), "median": (4.0, 2.8, 4.0), "loud": (6.0, 3.6, 6.0)}
FABRICS = {
    "white": fabric((200, 190, 180)),
    "white, striped and shaded": fabric((190, 180, 170), stripe=25, shading=0.12),
    "red": fabric((110, 60, 60)),
    "black, shaded": fabric((40, 60, 50), shading=0.15),
    "little contrast": fabric((105, 145, 115)),
}


@pytest.mark.parametrize("sd", NOISE.values(), ids=list(NOISE))
@pytest.mark.parametrize("material", FABRICS.values(), ids=list(FABRICS))
def test_an_open_garment_is_found_to_its_edges(sd: Color, material: Floats, towel_coverage: Floats) -> None:
    camera = Camera(1, sd)
    coarse, refined = both_masks(camera, camera.frame(towel_coverage, material))
    truth = towel_coverage > 0.5
    assert overlap(refined, truth) >= 0.99
    assert overlap(refined, truth) > overlap(coarse, truth)


@pytest.mark.parametrize("sd", NOISE.values(), ids=list(NOISE))
@pytest.mark.parametrize("material", FABRICS.values(), ids=list(FABRICS))
def test_a_garment_seen_edge_on_is_found_to_its_edges(sd: Color, material: Floats, strip_coverage: Floats) -> None:
    camera = Camera(2, sd)
    coarse, refined = both_masks(camera, camera.frame(strip_coverage, material))
    truth = strip_coverage > 0.5
    assert overlap(refined, truth) >= 0.94
    assert overlap(refined, truth) > overlap(coarse, truth)


def test_a_plain_threshold_is_too_broad_for_a_garment_seen_edge_on(strip_coverage: Floats) -> None:
    camera = Camera(3, NOISE["median"])
    coarse, refined = both_masks(camera, camera.frame(strip_coverage, FABRICS["white"]))
    truth = strip_coverage > 0.5
    assert overlap(coarse, truth) < 0.8
    assert coarse.sum() > 1.25 * truth.sum()
    assert refined.sum() == pytest.approx(truth.sum(), rel=0.02)


def test_stripes_darker_and_brighter_than_the_background_do_not_tear_a_garment(
    strip_coverage: Floats, towel_coverage: Floats
) -> None:
    for seed in range(4):
        camera = Camera(seed, NOISE["median"])
        for covered, least in ((strip_coverage, 0.88), (towel_coverage, 0.97)):
            coarse, refined = both_masks(camera, camera.frame(covered, fabric((130, 130, 130), stripe=100)))
            assert overlap(refined, covered > 0.5) >= least
            assert overlap(refined, covered > 0.5) > overlap(coarse, covered > 0.5)


@pytest.mark.parametrize("blur_px", [0.6, 1.5, 2.0])
def test_blur_does_not_move_the_edges(blur_px: float, towel_coverage: Floats) -> None:
    camera = Camera(4, NOISE["median"], blur_px)
    _, refined = both_masks(camera, camera.frame(towel_coverage, FABRICS["white"]))
    assert overlap(refined, towel_coverage > 0.5) >= 0.975


@pytest.mark.parametrize("level", [-8.0, -3.0, 3.0, 8.0])
def test_drift_matters_and_is_compensated(level: float, towel_coverage: Floats) -> None:
    camera = Camera(5, NOISE["quiet"])
    frame = camera.frame(towel_coverage, FABRICS["little contrast"], np.array([level, level, -level]))
    truth = towel_coverage > 0.5
    coarse, refined = both_masks(camera, frame)
    uncompensated = BackgroundSubtractor(camera.background, edge="threshold").find(frame).mask
    assert overlap(refined, truth) >= 0.99
    assert overlap(coarse, truth) > overlap(uncompensated, truth)


def test_edges_without_noise_and_blur_stay() -> None:
    truth = np.zeros((60, 80), np.bool_)
    truth[10:50, 20:27] = truth[10:30, 20:60] = True
    frame = np.where(truth[..., None], (200, 60, 90), (70, 120, 90)).astype(np.uint8)
    mean = np.full((60, 80, 3), (70.0, 120.0, 90.0))
    for grown in range(3):
        coarse = cv2.dilate(truth.view(np.uint8), np.ones((2 * grown + 1, 2 * grown + 1), np.uint8))
        refined = refine_edges(frame, mean, np.asarray(coarse, np.uint8), np.zeros(3))
        np.testing.assert_array_equal(refined, truth)


def test_refining_leaves_a_mask_alone_where_there_is_nothing_to_see() -> None:
    mask = np.zeros((40, 50), np.uint8)
    mask[10:30, 10:30] = 1
    mean = np.full((40, 50, 3), 100.0)
    frame = np.full((40, 50, 3), 103, np.uint8)
    np.testing.assert_array_equal(refine_edges(frame, mean, mask, np.zeros(3)), mask)
    assert not refine_edges(frame, mean, np.zeros_like(mask), np.zeros(3)).any()


def test_refining_keeps_what_touches_the_border_of_the_image() -> None:
    camera = Camera(6, NOISE["median"])
    covered = coverage(lambda u, v: (np.abs(u - 60.4) <= 30) & (v >= 100.3), Camera.shape)
    _, refined = both_masks(camera, camera.frame(covered, FABRICS["white"]))
    assert overlap(refined, covered > 0.5) >= 0.985
    assert refined[-1, 35:85].all()


def test_the_gripper_and_what_is_above_it_are_removed(towel_coverage: Floats) -> None:
    camera = Camera(7, NOISE["median"])
    covered = np.maximum(towel_coverage, coverage(lambda u, v: (np.abs(u - 75) < 15) & (v < 30), Camera.shape))
    frame = camera.frame(covered, FABRICS["white"])
    gripper = np.zeros(Camera.shape, np.bool_)
    gripper[50:60, 60:90] = True
    found = BackgroundSubtractor(camera.background).find(frame, top_v_px=39.4, gripper=gripper).mask
    assert not found[:40].any()
    assert found[40, 70]
    assert not found[gripper].any()
    truth = (towel_coverage > 0.5) & ~gripper & (np.arange(280)[:, None] >= 40)
    assert overlap(found, truth) >= 0.97


def test_the_garment_is_what_hangs_below_the_gripper_however_large_the_arm() -> None:
    camera = Camera(8, NOISE["median"])
    arm = coverage(lambda u, v: (np.abs(u - 70) < 60) & (v < 150), Camera.shape)
    garment = coverage(lambda u, v: (np.abs(u - 40) < 12) & (v >= 140) & (v < 240), Camera.shape)
    frame = camera.frame(np.maximum(arm, garment), FABRICS["red"])
    found = BackgroundSubtractor(camera.background).find(frame, top_v_px=150).mask
    assert overlap(found, (garment > 0.5) & (np.arange(280)[:, None] >= 150)) >= 0.95


def test_nothing_is_found_beyond_the_clipping_mask(towel_coverage: Floats) -> None:
    camera = Camera(9, NOISE["median"])
    clip = np.zeros(Camera.shape, np.bool_)
    clip[60:200, 50:120] = True
    found = BackgroundSubtractor(camera.background, clip).find(camera.frame(towel_coverage, FABRICS["white"])).mask
    assert not (found & ~clip).any()
    assert overlap(found, (towel_coverage > 0.5) & clip) >= 0.97


@pytest.mark.parametrize(
    "options", [{}, {"top_v_px": 1000.0}, {"top_v_px": 100.0}, {"gripper": np.ones((280, 140), bool)}]
)
def test_an_empty_scene_has_no_silhouette(options: dict[str, Any]) -> None:
    camera = Camera(10, NOISE["loud"])
    frame = camera.frame(np.zeros(Camera.shape), FABRICS["white"])
    subtractor = BackgroundSubtractor(camera.background)
    found = subtractor.find(frame, drift=subtractor.drift(frame), **options).mask
    assert found.shape == Camera.shape
    assert not found.any()


def test_a_frame_is_only_read(towel_coverage: Floats) -> None:
    camera = Camera(11, NOISE["median"])
    frame = camera.frame(towel_coverage, FABRICS["white"])
    before = frame.copy()
    frame.flags.writeable = False
    subtractor = BackgroundSubtractor(camera.background)
    first = subtractor.find(frame, drift=subtractor.drift(frame)).mask
    np.testing.assert_array_equal(frame, before)
    np.testing.assert_array_equal(subtractor.find(frame, drift=subtractor.drift(frame)).mask, first)


@pytest.mark.parametrize(
    ("clip", "message"),
    [
        (np.ones((4, 5), np.bool_), r"another size .* expected \(280, 140\)"),
        (np.zeros((280, 140), np.bool_), "nothing"),
    ],
)
def test_a_clipping_mask_that_does_not_fit_is_refused(clip: Mask, message: str) -> None:
    background = Background(np.zeros((280, 140, 3)), np.ones((280, 140, 3)), 9)
    with pytest.raises(PictureError, match=message):
        BackgroundSubtractor(background, clip)


def test_a_frame_of_unknown_brightness_is_refused() -> None:
    background = Background(np.full((40, 50, 3), 100.0), np.ones((40, 50, 3)), 9)
    subtractor = BackgroundSubtractor(background)
    frame = np.full((40, 50, 3), 250, np.uint8)
    with pytest.raises(ValueError, match="unknown"):
        subtractor.find(frame, drift=subtractor.drift(frame))


def test_even_squares_have_no_middle() -> None:
    background = Background(np.zeros((8, 8, 3)), np.ones((8, 8, 3)), 9)
    with pytest.raises(ValueError, match="odd, not 4 and 5"):
        BackgroundSubtractor(background, open_px=4)
