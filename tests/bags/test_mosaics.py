"""Colour that neighbours share: Bayer patterns and YUV 4:2:2, on painted images whose colours are known."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from garment_dataset.bags.images import AS_SAID, ENCODINGS, decode_rows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Image = NDArray[np.uint8]

HEIGHT_PX, WIDTH_PX = 12, 16
PATCHES = ((200, 40, 90), (10, 160, 230))  # left and right: no two channels alike


def painted() -> Image:
    image = np.empty((HEIGHT_PX, WIDTH_PX, 3), np.uint8)
    image[:, : WIDTH_PX // 2], image[:, WIDTH_PX // 2 :] = PATCHES
    return image


def mosaic(rgb: Image, pattern: str) -> Image:
    """Keep one channel a pixel: ``pattern`` names those of the first row's two pixels, then the second row's."""
    kept = np.empty(rgb.shape[:2], np.uint8)
    for place, channel in enumerate(pattern):
        row, column = divmod(place, 2)
        kept[row::2, column::2] = rgb[row::2, column::2, "rgb".index(channel)]
    return kept


def yuv422(rgb: Image, order: str) -> Image:
    """Return ITU-R BT.601 with Y from 16 to 235, two pixels a colour; ``order`` names the bytes of two pixels."""
    r, g, b = np.moveaxis(rgb.astype(float), -1, 0)
    y = 16 + (65.481 * r + 128.553 * g + 24.966 * b) / 255
    u = 128 + (-37.797 * r - 74.203 * g + 112.0 * b) / 255
    v = 128 + (112.0 * r - 93.786 * g - 18.214 * b) / 255
    planes = {"u": u[:, ::2], "v": v[:, ::2]}
    packed = np.empty((*rgb.shape[:2], 2), np.uint8)
    flat = packed.reshape(rgb.shape[0], -1)
    lumas = iter((y[:, ::2], y[:, 1::2]))
    for place, name in enumerate(order):
        flat[:, place::4] = np.rint(next(lumas) if name == "y" else planes[name])
    return packed


def decoded(stored: Image, encoding: str, padding_bytes: int = 0) -> NDArray[Any]:
    rows = [row.tobytes() + b"\xa5" * padding_bytes for row in stored]
    return decode_rows(
        memoryview(b"".join(rows)),
        AS_SAID,
        encoding=ENCODINGS["color"][encoding],
        width_px=stored.shape[1],
        height_px=stored.shape[0],
        step_bytes=len(rows[0]),
        big_endian=False,
    )


@pytest.mark.parametrize("padding_bytes", [0, 5])
@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_every_bayer_pattern_gives_the_painted_colours(pattern: str, padding_bytes: int) -> None:
    pixels = decoded(mosaic(painted(), pattern), f"bayer_{pattern}8", padding_bytes)
    assert pixels.dtype == np.uint8
    assert not pixels.flags.writeable
    away_from_the_seam = np.r_[0 : WIDTH_PX // 2 - 1, WIDTH_PX // 2 + 1 : WIDTH_PX]
    np.testing.assert_array_equal(pixels[:, away_from_the_seam], painted()[:, away_from_the_seam])


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_another_bayer_pattern_gives_other_colours(pattern: str) -> None:
    others = [name for name in ("rggb", "bggr", "gbrg", "grbg") if name != pattern]
    for other in others:
        assert not np.array_equal(decoded(mosaic(painted(), pattern), f"bayer_{other}8")[4:8, 2:6], painted()[4:8, 2:6])


@pytest.mark.parametrize("padding_bytes", [0, 6])
@pytest.mark.parametrize(("encoding", "order"), [("yuv422", "uyvy"), ("yuv422_yuy2", "yuyv")])
def test_both_orders_of_yuv_give_the_painted_colours(encoding: str, order: str, padding_bytes: int) -> None:
    pixels = decoded(yuv422(painted(), order), encoding, padding_bytes)
    assert pixels.dtype == np.uint8
    assert np.abs(pixels.astype(int) - painted()).max() <= 2


def test_black_and_white_in_yuv() -> None:
    bars = np.zeros((4, 4, 3), np.uint8)
    bars[:, 2:] = 255
    np.testing.assert_array_equal(decoded(yuv422(bars, "uyvy"), "yuv422"), bars)
