"""RVL as image_transport_plugins writes it: there and back, and every damage in words."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from garment_dataset.bags.headers import read_image
from garment_dataset.bags.images import AS_SAID, DepthReading, decode_rvl_depth
from garment_dataset.errors import MessageError

FORM = "16UC1; compressedDepth rvl"
COMPRESSED = "sensor_msgs/msg/CompressedImage"


def nibbles_of(value: int) -> list[int]:
    """Return 3 bits a nibble, the lowest first, with a flag on all but the last."""
    nibbles = []
    while value > 7:
        nibbles.append(8 | value & 7)
        value >>= 3
    return [*nibbles, value]


def numbers_of(pixels: list[int]) -> list[int]:
    numbers: list[int] = []
    place, last = 0, 0
    while place < len(pixels):
        start = place
        while place < len(pixels) and pixels[place] == 0:
            place += 1
        numbers.append(place - start)
        start = place
        while place < len(pixels) and pixels[place] != 0:
            place += 1
        numbers.append(place - start)
        for value in pixels[start:place]:
            difference = value - last
            numbers.append(2 * difference if difference >= 0 else -2 * difference - 1)
            last = value
    return numbers


def words_of(numbers: list[int]) -> bytes:
    nibbles = [nibble for number in numbers for nibble in nibbles_of(number)]
    nibbles += [0] * (-len(nibbles) % 8)
    words = [int("".join(f"{nibble:x}" for nibble in nibbles[at : at + 8]), 16) for at in range(0, len(nibbles), 8)]
    return struct.pack(f"<{len(words)}I", *words)


def encoded(pixels: np.ndarray[Any, Any], a: float = 0.0, b: float = 0.0) -> bytes:
    head = struct.pack("<iffII", 0, a, b, pixels.shape[1], pixels.shape[0])
    return head + words_of(numbers_of(pixels.ravel().tolist()))


def decoded(data: bytes, form: str = FORM, reading: DepthReading = AS_SAID) -> np.ndarray[Any, Any]:
    return decode_rvl_depth(memoryview(data), reading, encoding=form)


def test_a_stream_written_by_hand() -> None:
    # no zeros; 2 pixels: +5 as 10 = 2 | 8 then 1; -1 as 1; then 2 zeros and no more
    stream = struct.pack("<iffIII", 0, 0, 0, 2, 2, 0x02A1_1200)
    np.testing.assert_array_equal(decoded(stream), [[5, 4], [0, 0]])


@given(hnp.arrays(np.uint16, hnp.array_shapes(min_dims=2, max_dims=2), elements=st.integers(0, 65534)))
def test_there_and_back(pixels: np.ndarray[Any, Any]) -> None:
    found = decoded(encoded(pixels))
    assert found.dtype == np.uint16
    assert not found.flags.writeable
    np.testing.assert_array_equal(found, pixels)


@pytest.mark.parametrize("value", [0, 1070])
def test_an_even_image(value: int) -> None:
    np.testing.assert_array_equal(decoded(encoded(np.full((48, 64), value))), np.full((48, 64), value))


def test_metres_are_inverse_depth_as_in_png() -> None:
    found = decoded(encoded(np.array([[0, 6, 15]]), 10.0, 5.0), "32FC1; compressedDepth rvl")
    np.testing.assert_array_equal(found, [[0, 10_000, 1000]])


def test_the_unit_holds_for_rvl_too() -> None:
    np.testing.assert_array_equal(decoded(encoded(np.array([[0, 4280]])), reading=DepthReading(0.25)), [[0, 1070]])


def test_a_message_of_it(wire: Any) -> None:
    pixels = np.array([[0, 1070, 1073], [1, 0, 0]])
    data = wire.compressed(encoded(pixels), FORM)
    header = read_image(memoryview(data), COMPRESSED, "depth", cdr=wire.cdr)
    assert (header.fault, header.encoding, header.compressed) == (None, FORM, True)
    assert header.decode is not None
    assert header.start_bytes is not None
    assert header.size_bytes is not None
    payload = memoryview(data)[header.start_bytes : header.start_bytes + header.size_bytes]
    np.testing.assert_array_equal(header.decode(payload, AS_SAID), pixels)


GOOD = encoded(np.array([[0, 1070, 1073, 1080], [1100, 900, 0, 0]]))
HEAD = struct.pack("<iffII", 0, 0, 0, 4, 2)


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (b"", "rvl header: expected 20 bytes, found 0 bytes"),
        (GOOD[:19], "rvl header: expected 20 bytes, found 19 bytes"),
        (GOOD[:20], "rvl data: expected words of 4 bytes, found 0 bytes"),
        (GOOD[:-1], "rvl data: expected words of 4 bytes, found 7 bytes"),
        (GOOD[:-4], "rvl data: expected 8 pixels, found 3 pixels"),
        (GOOD + b"\0\1\0\0", "rvl data: expected no more than 8 pixels, found further data behind them"),
        (HEAD + b"\xff" * 4, "rvl data: expected 8 pixels, found 0 pixels"),
        (HEAD + b"\xff" * 8 + b"\0" * 4, "rvl data: expected numbers of 32 bit, found one of 51 bit"),
        (HEAD + bytes(400), "rvl data: expected 8 pixels, found 0 pixels"),
        (HEAD + words_of([9, 0]), "rvl data: expected 8 pixels, found 9 pixels"),
        (HEAD + words_of([7, 1, 1]), "rvl data: expected depths of 1 to 65535, found -1 to -1"),
        (HEAD + words_of([7, 1, 2 * 65536]), "rvl data: expected depths of 1 to 65535, found 65536 to 65536"),
        (struct.pack("<iffIII", 0, 0, 0, 0, 480, 0), "rvl size: expected 1 to 67108864 pixels, found 0 x 480"),
        (
            struct.pack("<iffIII", 0, 0, 0, 2**31, 2**31, 0),
            "rvl size: expected 1 to 67108864 pixels, found 2147483648 x 2147483648",
        ),
    ],
)
def test_damage_is_said_in_words(data: bytes, fault: str) -> None:
    with pytest.raises(MessageError) as caught:
        decoded(data)
    assert str(caught.value) == fault


def test_words_of_zeros_behind_the_pixels_are_padding() -> None:
    np.testing.assert_array_equal(decoded(GOOD + bytes(8)), decoded(GOOD))


@given(st.binary(max_size=60), st.sampled_from([FORM, "32FC1; compressedDepth rvl"]))
def test_no_stream_raises_anything_else(stream: bytes, form: str) -> None:
    fault, shape = "rvl", (2, 4)
    try:
        shape = decoded(HEAD + stream, form).shape
    except MessageError as error:
        fault = str(error)
    assert fault.startswith("rvl")
    assert shape == (2, 4)


@given(st.integers(0, len(GOOD) - 1))
def test_a_shorter_stream_never_gives_pixels(size: int) -> None:
    with pytest.raises(MessageError, match="rvl"):
        decoded(GOOD[:size])
