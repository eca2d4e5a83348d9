"""Images as files, small enough to be looked at over a network."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2

if TYPE_CHECKING:
    from garment_dataset.arrays import ColorImage, DepthImage

_PNG_LEVEL = 3  # higher ones take twice the time for a seventh of the bytes
_JPEG_QUALITY = 90


def depth_png(depth_mm: DepthImage) -> bytes:
    """Return a depth image, (H, W) uint16 in millimetres, as a PNG of 16 bits: nothing is lost."""
    _, data = cv2.imencode(".png", depth_mm, [cv2.IMWRITE_PNG_COMPRESSION, _PNG_LEVEL])
    return data.tobytes()


def color_jpeg(rgb: ColorImage) -> bytes:
    """Return a colour image, (H, W, 3) uint8 RGB, as a JPEG of quality 90: for looking, not for measuring."""
    _, data = cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return data.tobytes()
