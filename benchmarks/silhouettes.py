"""Colour steps: the package beside the same steps written plainly with scikit-image, in one run on the same frames.

The peer works on whole frames in float64, one frame at a time, as the thesis and the docstrings of the package say it.
Coarse masks must be equal, the rest nearly so. Last comes what a build does by default and the peer does not: shadows
told from cloth, the bar that a garment hangs on, confidence, the outline and the stored mask. Only the ratios count:
microseconds depend on the machine.

    python benchmarks/silhouettes.py
"""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from scipy import ndimage  # type: ignore[import-untyped]
from skimage import measure, morphology

from garment_dataset.stages.silhouette import describe_mask
from garment_dataset.vision.color.axes import Axes, region_axes
from garment_dataset.vision.color.background import Background, BackgroundAccumulator
from garment_dataset.vision.color.bar import Held
from garment_dataset.vision.color.central_curve import central_curves
from garment_dataset.vision.color.masks import borders, decode_mask, disc_mask, encode_mask
from garment_dataset.vision.color.silhouette import BackgroundSubtractor

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Image = NDArray[np.uint8]
    Mask = NDArray[np.bool_]
    Floats = NDArray[np.float64]

HEIGHT_PX, WIDTH_PX = 480, 640
GRIPPER_V_PX = 60
HELD = Held(320.0, float(GRIPPER_V_PX), 450.0)
ALPHA, MIN_SIGMA, SQUARE_PX = 3.0, 2.0, 5
PITCH_PX, LINES = 8.0, 5
CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]])
DISC = np.array([[0, 0, 1, 0, 0], *[[1] * 5] * 3, [0, 0, 1, 0, 0]])


def empty_scene() -> Floats:
    """Return a green cloth that is darker towards the left and right."""
    shade = 1 - 0.25 * np.linspace(-1, 1, WIDTH_PX) ** 2
    return np.broadcast_to(shade[:, None] * np.array((70.0, 120.0, 90.0)), (HEIGHT_PX, WIDTH_PX, 3)).copy()


def seen(rng: np.random.Generator, image: Floats) -> Image:
    """Return what a camera with blur, noise and a drifting exposure makes of a scene."""
    noise = np.asarray(cv2.GaussianBlur(rng.normal(0, 1, image.shape), (3, 3), 0))
    frame = cv2.GaussianBlur(image, (0, 0), 1.0) + noise * (3 / noise.std()) + rng.normal(0, 2, 3)
    return np.asarray(np.clip(np.rint(frame), 0, 255), np.uint8)


def swinging_towel(rng: np.random.Generator, number: int) -> Image:
    """Return a frame of a towel below a gripper."""
    v = np.linspace(GRIPPER_V_PX, 420, 60)
    middle = 320 + 60 * np.sin(number / 8) * ((v - GRIPPER_V_PX) / 360) ** 2
    half = 70 + 6 * np.sin(v / 40)
    outline = np.concatenate([np.stack([middle - half, v], 1), np.stack([middle + half, v], 1)[::-1]])
    image = empty_scene()
    image[:GRIPPER_V_PX, 290:350] = 40
    cv2.fillPoly(image, [np.rint(outline * 16).astype(np.int32)], (190, 180, 170), cv2.LINE_8, 4)
    return seen(rng, image)


def plain_background(frames: Sequence[Image]) -> Background:
    """Evaluate eqs. (5.1) and (5.2) on the stack of frames."""
    stack = np.stack(frames).astype(np.float64)
    return Background(stack.mean(axis=0), stack.std(axis=0, ddof=1), len(frames))


def plain_threshold(frame: Image, model: Background, drift: Floats) -> Mask:
    """Evaluate eq. (5.3)."""
    reach = ALPHA * np.maximum(model.std, MIN_SIGMA)
    return np.asarray((np.abs(frame - (model.mean + np.rint(drift))) > reach).any(axis=2))


def plain_opening_closing(mask: Mask) -> Mask:
    """Open, then close."""
    square = np.ones((SQUARE_PX, SQUARE_PX))
    return np.asarray(morphology.closing(morphology.opening(mask, square), square))


def plain_garment(mask: Mask) -> Mask:
    """Remove the gripper and keep the largest region."""
    below = mask & (np.arange(HEIGHT_PX)[:, None] >= GRIPPER_V_PX)
    labels = measure.label(below, connectivity=2)  # type: ignore[no-untyped-call]
    return np.asarray(labels == 1 + np.argmax(np.bincount(labels.ravel())[1:]))


def plain_edges(frame: Image, model: Background, drift: Floats, cleaned: Mask, garment: Mask) -> Mask:
    """Refine the edges by half contrast; some rows of the gripper serve as context, as in the package."""
    mask = garment | (cleaned & (np.arange(HEIGHT_PX)[:, None] < GRIPPER_V_PX))
    layer, peeled = mask.astype(int), mask
    for element in (CROSS, np.ones((3, 3)), CROSS, np.ones((3, 3))):
        peeled = morphology.erosion(peeled, element)
        layer += peeled
    core = mask & (layer == ndimage.maximum_filter(layer, 3))
    distance = np.sqrt(((frame - (model.mean + drift)) ** 2).sum(axis=2))
    counts = ndimage.uniform_filter(core.astype(float), 3)
    contrast = ndimage.uniform_filter(distance * core, 3) / np.maximum(counts, 1e-9)
    v, u = ndimage.distance_transform_edt(~core, return_distances=False, return_indices=True)
    contrast = contrast[v, u]
    thin = (layer[v, u] <= 3) & (contrast >= 24)
    peak = ndimage.maximum_filter(distance * core, 7)[v, u]
    contrast = np.where(thin, np.maximum(peak, contrast), contrast)
    decided = morphology.dilation(mask, DISC) & ~core & (contrast >= 8)
    shares = np.where(decided, np.minimum(distance / np.maximum(contrast, 1e-9), 1.5), mask)
    smooth = ndimage.convolve(shares, np.outer([1, 2, 1], [1, 2, 1]) / 16, mode="mirror")
    return plain_garment(np.where(decided, np.where(thin, shares, smooth) > 0.5, mask))


def plain_axes(mask: Mask) -> Axes:
    """Take the moments from ``regionprops`` and add MATLAB's 1/12."""
    (region,) = measure.regionprops(mask.astype(np.uint8))  # type: ignore[no-untyped-call]
    large, small = (float(np.sqrt(value + 1 / 12)) for value in region.inertia_tensor_eigvals)
    v, u = region.centroid
    return Axes(int(region.area), u, v, 4 * large, 4 * small, float(region.orientation + np.pi / 2))


def plain_curve(mask: Mask, axes: Axes) -> Floats:
    """Cut scikit-image's contours line by line; rows of u, v, width."""
    contours = measure.find_contours(mask.astype(float), 0.5, fully_connected="high")  # type: ignore[no-untyped-call]
    ends = [np.concatenate([part[some] for part in contours]) for some in (slice(None, -1), slice(1, None))]
    du, dv = axes.downward
    v, u = np.stack(ends).transpose(2, 0, 1) - np.array([axes.centroid_v_px, axes.centroid_u_px])[:, None, None]
    along, across = u * du + v * dv, u * dv - v * du
    top = along.min()
    rows = []
    for cut in range(int((along.max() - top) / PITCH_PX)):
        pairs = []
        for line in range(LINES):
            at = top + (cut + (line + 0.5) / LINES) * PITCH_PX
            met = (along[0] < at) != (along[1] < at)
            share = (at - along[0][met]) / (along[1][met] - along[0][met])
            crossings = across[0][met] + share * (across[1][met] - across[0][met])
            pairs.append((crossings.min(), crossings.max()))
        (left, right), t = np.mean(pairs, axis=0), top + (cut + 0.5) * PITCH_PX
        s = (left + right) / 2
        rows.append((axes.centroid_u_px + t * du + s * dv, axes.centroid_v_px + t * dv - s * du, right - left))
    return np.array(rows)


class Timer:
    """Processor time of named steps, per frame."""

    def __init__(self) -> None:
        self.us: dict[str, list[float]] = {}

    def __call__(self, step: str, function: Callable[..., Any], *columns: Sequence[Any]) -> list[Any]:
        """Call a function for each frame, and note its mean time."""
        start = time.process_time()
        results = [function(*row) for row in zip(*columns, strict=True)]
        self.us.setdefault(step, []).append(1e6 * (time.process_time() - start) / len(results))
        return results

    def median_us(self, step: str) -> float:
        """Return the median over the rounds; NaN for a step never taken."""
        return float(np.median(self.us.get(step, [np.nan])))


def run_package(timer: Timer, empty: list[Image], frames: list[Image]) -> dict[str, Any]:
    """Take all steps with the package."""
    accumulator = BackgroundAccumulator()
    timer("background", accumulator.add, empty)
    model = accumulator.finish()
    coarse, refined = (BackgroundSubtractor(model, edge=edge) for edge in ("threshold", "half_contrast"))
    drifts = timer("drift", refined.drift, frames)
    top = float(GRIPPER_V_PX)
    masks = timer(
        "coarse mask", lambda frame, drift: coarse.find(frame, drift=drift, top_v_px=top).mask, frames, drifts
    )
    edges = timer(
        "mask, refined", lambda frame, drift: refined.find(frame, drift=drift, top_v_px=top).mask, frames, drifts
    )
    axes = timer("axes", region_axes, edges)
    start = time.process_time()
    curves = central_curves([borders(mask) for mask in edges], axes, PITCH_PX, lines=LINES)
    timer.us.setdefault("central curve", []).append(1e6 * (time.process_time() - start) / len(frames))
    timer("PNG", encode_mask, edges)
    rows = np.stack([curves.u_px, curves.v_px, curves.width_px], axis=1)
    return {
        "background": model,
        "drifts": drifts,
        "coarse": masks,
        "refined": edges,
        "axes": axes,
        "curves": [rows[curves.region == number] for number in range(len(frames))],
    }


def run_build(timer: Timer, model: Background, frames: list[Image]) -> None:
    """Take the steps of the stages ``silhouette`` and ``central_curve``, the tables left out."""
    subtractor = BackgroundSubtractor(model, shadows=True)
    removed, near = (
        disc_mask((HELD.u_px, HELD.v_px), radius * HELD.px_per_m, HEIGHT_PX, WIDTH_PX) for radius in (0.01, 0.15)
    )

    def find(frame: Image) -> Mask:
        drift = subtractor.drift(frame)
        return subtractor.find(frame, drift=drift, top_v_px=HELD.v_px, gripper=removed, near=near, held=HELD).mask

    masks = timer("build: mask", find, frames)
    rows = timer("build: row", describe_mask, masks)
    start = time.process_time()
    read = [decode_mask(row["mask"]) for row in rows]
    central_curves([borders(mask) for mask in read], [region_axes(mask) for mask in read], PITCH_PX, lines=LINES)
    timer.us.setdefault("build: curve", []).append(1e6 * (time.process_time() - start) / len(frames))


def run_plain(timer: Timer, empty: list[Image], frames: list[Image], package: dict[str, Any]) -> dict[str, Any]:
    """Take the same steps plainly; drift, and the masks that axes and curves are of, come from the package."""
    start = time.process_time()
    model = plain_background(empty)
    timer.us.setdefault("background", []).append(1e6 * (time.process_time() - start) / len(empty))
    models, drifts, refined = [model] * len(frames), package["drifts"], package["refined"]
    marked = timer("threshold", plain_threshold, frames, models, drifts)
    cleaned = timer("opening, closing", plain_opening_closing, marked)
    coarse = timer("largest region", plain_garment, cleaned)
    edges = timer("edges", plain_edges, frames, models, drifts, cleaned, coarse)
    axes = timer("axes", plain_axes, refined)
    curves = timer("central curve", plain_curve, refined, axes)
    return {"background": model, "coarse": coarse, "refined": edges, "axes": axes, "curves": curves}


COARSE = ("threshold", "opening, closing", "largest region")
# What is printed: the package's steps, and the peer's that do the same
ROWS = {
    "background, per frame of it": (("background",), ("background",)),
    "drift": (("drift",), ()),
    "mask of eq. (5.3), cleaned, cut": (("coarse mask",), COARSE),
    "the same with refined edges": (("mask, refined",), (*COARSE, "edges")),
    "axes": (("axes",), ("axes",)),
    f"central curve, {LINES} lines a cut": (("central curve",), ("central curve",)),
    "mask to PNG": (("PNG",), ()),
    "from frame to central curve": (
        ("drift", "mask, refined", "axes", "central curve"),
        (*COARSE, "edges", "axes", "central curve"),
    ),
    "as in a build: mask": (("build: mask",), ()),
    "  its axes, outline and PNG": (("build: row",), ()),
    "  central curve from the PNG": (("build: curve",), ()),
    "  all": (("build: mask", "build: row", "build: curve"), ()),
}


def print_agreement(package: dict[str, Any], plain: dict[str, Any]) -> None:
    """Print the largest differences."""
    models = package["background"], plain["background"]
    mean, std = (np.abs(a - b).max() for a, b in zip(*((model.mean, model.std) for model in models), strict=True))
    print(f"background: mean {mean:.1e}, deviation {std:.1e} grey levels apart")
    for kind in ("coarse", "refined"):
        masks = np.array(package[kind]), np.array(plain[kind])
        print(f"{kind} masks: {(masks[0] != masks[1]).sum()} of {masks[0].sum()} px differ")
    lengths = np.array([[axes.major_px, axes.minor_px] for axes in package["axes"] + plain["axes"]]).reshape(2, -1)
    print(f"axes: {np.abs(lengths[0] - lengths[1]).max():.1e} px apart")
    curves = [np.abs(ours - peer).max() for ours, peer in zip(package["curves"], plain["curves"], strict=True)]
    print(f"central curves: {max(curves):.1e} px apart")


def main() -> None:
    """Run both sides in turns; print how far they agree and what each step takes."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0] if __doc__ else None)
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    rng = np.random.default_rng(1)
    empty = [seen(rng, empty_scene()) for _ in range(40)]
    frames = [swinging_towel(rng, number) for number in range(options.frames)]
    timers = Timer(), Timer()
    for _ in range(options.rounds):
        package = run_package(timers[0], empty, frames)
        plain = run_plain(timers[1], empty, frames, package)
        run_build(timers[0], package["background"], frames)
    print_agreement(package, plain)
    print(f"{'us per frame, median of rounds':34}{'package':>9}{'plain':>10}{'ratio':>8}{'frames/s':>10}")
    for label, sides in ROWS.items():
        ours, peer = (sum(timer.median_us(step) for step in steps) for timer, steps in zip(timers, sides, strict=True))
        text = f"{label:34}{ours:9.0f}"
        print(text + (f"{peer:10.0f}{peer / ours:8.1f}" if peer else 18 * " ") + f"{1e6 / ours:10.0f}")


if __name__ == "__main__":
    main()
