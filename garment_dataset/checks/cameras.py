"""Whether the ``camera_info`` of each stream describes a camera that took its images."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.checks.finding import Found

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.bags import Camera
    from garment_dataset.checks.contract import Contract
    from garment_dataset.checks.facts import CameraFacts, Facts, ImageFacts

_FOCAL_WIDTHS = (0.4, 4.0)  # of the image's width: opening angles of 103 to 14 degrees
_SQUARE = 0.1  # relative difference of the focal lengths: pixels of such cameras are square
_CENTRE = 0.25  # of the image's size: how far from its middle a principal point can be


def check_cameras(facts: Facts, contract: Contract) -> Iterator[Found]:
    """Yield ``camera-missing``, ``camera-uncalibrated``, ``camera-size`` and ``camera-odd``."""
    for stream in contract.streams:
        if (images := facts.images.get(stream)) is not None:
            yield from _check(facts.cameras[stream], images)


def _check(found: CameraFacts, images: ImageFacts) -> Iterator[Found]:
    camera = found.camera
    if found.missing:
        yield Found("camera-missing", f"no message on {found.topic}", found.topic, hint="Record it with the images.")
    elif camera is None:
        hint = "Calibrate the camera; images without calibration cannot be measured in metres."
        yield Found("camera-uncalibrated", found.fault or "no camera", found.topic, hint=hint)
    else:
        size_px = (camera.width_px, camera.height_px)
        if images.sizes_px and images.sizes_px != {size_px}:
            sizes = " and ".join(f"{width} x {height}" for width, height in sorted(images.sizes_px))
            text = f"it is of a camera of {size_px[0]} x {size_px[1]} pixels, the images have {sizes}"
            yield Found("camera-size", text, found.topic)
        if odd := _oddities(camera):
            hint = "Calibrate it anew, or name the right camera_info topic."
            yield Found("camera-odd", f"no usual camera: {'; '.join(odd)}", found.topic, hint=hint)


def _oddities(camera: Camera) -> list[str]:
    odd: list[str] = []
    if not _FOCAL_WIDTHS[0] <= camera.fx_px / camera.width_px <= _FOCAL_WIDTHS[1]:
        odd.append(f"focal length {camera.fx_px:.1f} px for a width of {camera.width_px} px")
    if abs(camera.fx_px - camera.fy_px) > _SQUARE * max(camera.fx_px, camera.fy_px):
        odd.append(f"focal lengths {camera.fx_px:.1f} and {camera.fy_px:.1f} px")
    off_x = abs(camera.cx_px - camera.width_px / 2) / camera.width_px
    off_y = abs(camera.cy_px - camera.height_px / 2) / camera.height_px
    if max(off_x, off_y) > _CENTRE:
        odd.append(f"principal point ({camera.cx_px:.1f}, {camera.cy_px:.1f}) px, far from the middle")
    return odd
