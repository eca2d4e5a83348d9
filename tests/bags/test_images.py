"""From serialised bytes to canonical pixels, and to faults where they do not fit."""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import Any, Literal

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from garment_dataset.bags.headers import ImageHeader, ImageHeaders, read_image
from garment_dataset.bags.images import (
    AS_SAID,
    ENCODINGS,
    DepthReading,
    decode_compressed_color,
    decode_compressed_depth,
    decode_rows,
    depth_in_millimetres,
)
from garment_dataset.errors import MessageError

Kind = Literal["depth", "color"]

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
STAMP_NS = 1_391_700_000_123_456_789
FRAMES = {"width_px": 3, "height_px": 2}
COLOR = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3) * 11
DEPTH = np.array([[0, 1070, 1073], [65534, 256, 1]], np.uint16)


def padded(pixels: np.ndarray[Any, Any], padding_bytes: int = 0) -> bytes:
    """Return the rows of an image, each with some padding behind it."""
    return b"".join(row.tobytes() + b"\xa5" * padding_bytes for row in pixels)


def pixels_of(data: bytes, header: ImageHeader) -> np.ndarray[Any, Any]:
    assert header.fault is None
    assert header.decode is not None
    assert header.start_bytes is not None
    assert header.size_bytes is not None
    return header.decode(memoryview(data)[header.start_bytes : header.start_bytes + header.size_bytes], AS_SAID)


def png(pixels: np.ndarray[Any, Any]) -> bytes:
    return cv2.imencode(".png", pixels)[1].tobytes()


@pytest.mark.parametrize("padding_bytes", [0, 5])
@pytest.mark.parametrize("big_endian", [False, True])
@pytest.mark.parametrize("encoding", ["16UC1", "mono16"])
def test_depth_in_millimetres_is_itself(wire: Any, encoding: str, big_endian: bool, padding_bytes: int) -> None:
    stored = DEPTH.astype(">u2" if big_endian else "<u2")
    step = 6 + padding_bytes
    data = wire.image(
        padded(stored, padding_bytes), encoding=encoding, step_bytes=step, big_endian=big_endian, **FRAMES
    )
    header = read_image(memoryview(data), IMAGE, "depth", cdr=wire.cdr)
    assert (header.stamp_ns, header.frame_id) == (STAMP_NS, "optical")
    assert (header.encoding, header.height_px, header.width_px, header.step_bytes) == (encoding, 2, 3, step)
    pixels = pixels_of(data, header)
    assert pixels.dtype == np.uint16
    assert pixels.dtype.isnative
    np.testing.assert_array_equal(pixels, DEPTH)


@pytest.mark.parametrize("big_endian", [False, True])
def test_depth_in_metres_is_rounded_and_what_is_no_distance_becomes_zero(wire: Any, big_endian: bool) -> None:
    depth_m = np.array([[np.nan, np.inf, -np.inf, -1.0, 0.0], [0.0004, 1.0704, 1.0706, 65.534, 65.535]])
    stored = depth_m.astype(">f4" if big_endian else "<f4")
    data = wire.image(
        padded(stored, 4), encoding="32FC1", width_px=5, height_px=2, step_bytes=24, big_endian=big_endian
    )
    pixels = pixels_of(data, read_image(memoryview(data), IMAGE, "depth", cdr=wire.cdr))
    np.testing.assert_array_equal(pixels, np.array([[0, 0, 0, 0, 0], [0, 1070, 1071, 65534, 0]], np.uint16))


@pytest.mark.parametrize("encoding", ["16UC1", "mono16"])
def test_65535_is_no_return(encoding: str) -> None:
    stored = np.array([[65535, 1070, 0]], np.uint16)
    for pixels in (
        decode_rows(
            memoryview(stored.tobytes()),
            AS_SAID,
            encoding=ENCODINGS["depth"][encoding],
            width_px=3,
            height_px=1,
            step_bytes=6,
            big_endian=False,
        ),
        decode_compressed_depth(memoryview(png(stored)), AS_SAID, encoding="16UC1; compressedDepth png"),
    ):
        np.testing.assert_array_equal(pixels, [[0, 1070, 0]])


@pytest.mark.parametrize(
    ("dtype", "unit_mm", "stored", "expected"),
    [
        ("u2", 0.25, [4280, 4281, 4282, 65535, 0], [1070, 1070, 1070, 0, 0]),  # halves to even
        ("u2", 10.0, [107, 6553, 6554, 65535, 0], [1070, 65530, 0, 0, 0]),
        ("f4", 0.001, [1070.0, 1070.6, 65535.0, np.nan, 0.0], [1070, 1071, 0, 0, 0]),  # millimetres as 32FC1
    ],
)
@pytest.mark.parametrize("swapped", [False, True])
def test_depth_in_another_unit_and_byte_order(
    dtype: str, unit_mm: float, stored: list[float], expected: list[int], swapped: bool
) -> None:
    data = np.array([stored], dtype=(">" if swapped else "<") + dtype)
    pixels = decode_rows(
        memoryview(data.tobytes()),
        DepthReading(unit_mm, swapped),
        encoding=ENCODINGS["depth"]["16UC1" if dtype == "u2" else "32FC1"],
        width_px=5,
        height_px=1,
        step_bytes=data.nbytes,
        big_endian=False,
    )
    assert pixels.dtype == np.uint16
    np.testing.assert_array_equal(pixels, [expected])


def test_every_whole_millimetre_survives_metres_in_single_precision() -> None:
    depth_mm = np.arange(2**16, dtype=np.uint16).reshape(256, 256)
    depth_mm[-1, -1] = 0  # 65535 is no return
    np.testing.assert_array_equal(depth_in_millimetres(depth_mm.astype(np.float32) / np.float32(1000)), depth_mm)


@pytest.mark.parametrize("padding_bytes", [0, 7])
@pytest.mark.parametrize(
    ("encoding", "stored", "expected"),
    [
        ("rgb8", COLOR, COLOR),
        ("bgr8", COLOR[..., ::-1], COLOR),
        ("rgba8", np.insert(COLOR, 3, 200, axis=-1), COLOR),
        ("bgra8", np.insert(COLOR[..., ::-1], 3, 200, axis=-1), COLOR),
        ("mono8", COLOR[..., 0], np.repeat(COLOR[..., :1], 3, axis=-1)),
        ("8UC3", COLOR[..., ::-1], COLOR),
        ("8UC1", COLOR[..., 0], np.repeat(COLOR[..., :1], 3, axis=-1)),
    ],
)
def test_color_becomes_rgb(
    wire: Any, encoding: str, stored: np.ndarray[Any, Any], expected: np.ndarray[Any, Any], padding_bytes: int
) -> None:
    step = stored[0].nbytes + padding_bytes
    data = wire.image(padded(stored, padding_bytes), encoding=encoding, step_bytes=step, **FRAMES)
    pixels = pixels_of(data, read_image(memoryview(data), IMAGE, "color", cdr=wire.cdr))
    assert pixels.dtype == np.uint8
    np.testing.assert_array_equal(pixels, expected)


@pytest.mark.parametrize(("kind", "encoding"), [(kind, name) for kind in ENCODINGS for name in ENCODINGS[kind]])
def test_pixels_are_read_only_and_views_where_nothing_is_converted(kind: Kind, encoding: str) -> None:
    layout = ENCODINGS[kind][encoding]
    step = 4 * layout.channels * np.dtype(layout.dtype).itemsize + 1
    buffer = bytearray(3 * step)
    pixels = decode_rows(
        memoryview(buffer), AS_SAID, encoding=layout, width_px=4, height_px=3, step_bytes=step, big_endian=False
    )
    assert pixels.shape == ((3, 4) if kind == "depth" else (3, 4, 3))
    assert not pixels.flags.writeable
    assert np.shares_memory(pixels, np.frombuffer(buffer, np.uint8)) == (encoding in {"16UC1", "mono16", "rgb8"})


@pytest.mark.parametrize(
    ("form", "prefix"),
    [
        ("16UC1; compressedDepth", struct.pack("<iff", 0, 0, 0)),
        ("16UC1; compressedDepth png", struct.pack("<iff", 0, 1e30, -5.5)),  # older publishers left noise there
        ("16UC1", struct.pack("<iff", 1, 0, 0)),
        ("16UC1; png compressed ", b""),
        ("png", b""),
        ("", b""),
    ],
)
def test_compressed_depth_is_found_behind_any_header(wire: Any, form: str, prefix: bytes) -> None:
    data = wire.compressed(prefix + png(DEPTH), form)
    header = read_image(memoryview(data), COMPRESSED, "depth", cdr=wire.cdr)
    assert (header.stamp_ns, header.encoding, header.compressed) == (STAMP_NS, form, True)
    pixels = pixels_of(data, header)
    assert not pixels.flags.writeable
    np.testing.assert_array_equal(pixels, DEPTH)


@given(hnp.arrays(np.float32, (4, 5), elements=st.floats(0.25, 9.75, width=32)), st.sampled_from([50.0, 100.0]))
def test_inverse_depth_is_recovered_within_its_quantisation(depth_m: np.ndarray[Any, Any], quantisation: float) -> None:
    depth_m[0, 0] = np.nan
    a = quantisation * (quantisation + 1)  # codec.cpp: the publisher's side, with depth_max = 10
    b = 1 - a / 10
    with np.errstate(invalid="ignore"):
        inverse = np.where(np.isnan(depth_m), 0, a / depth_m + b).astype(np.uint16)
    data = struct.pack("<iff", 0, a, b) + png(inverse)
    depth_mm = decode_compressed_depth(memoryview(data), AS_SAID, encoding="32FC1; compressedDepth png")
    assert depth_mm[0, 0] == 0
    seen = ~np.isnan(depth_m)
    step_mm = 1000 * depth_m[seen] ** 2 / a  # one level of the PNG, to first order
    error_mm = depth_mm[seen] - 1000 * depth_m[seen]
    assert np.all((error_mm >= -0.51) & (error_mm <= 1.05 * step_mm + 0.51))


def test_inverse_depth_without_its_parameters_cannot_be_decoded() -> None:
    with pytest.raises(MessageError, match="expected 12 bytes before the PNG, found 0"):
        decode_compressed_depth(memoryview(png(DEPTH)), AS_SAID, encoding="32FC1; compressedDepth png")


def test_a_pole_of_inverse_depth_is_no_distance() -> None:
    data = struct.pack("<iff", 0, 10.0, 5.0) + png(np.array([[4, 5, 6, 0]], np.uint16))
    depth_mm = decode_compressed_depth(memoryview(data), AS_SAID, encoding="32FC1; compressedDepth")
    np.testing.assert_array_equal(depth_mm, [[0, 0, 10_000, 0]])


@pytest.mark.parametrize(
    ("form", "stored"),
    [
        ("rgb8; png compressed bgr8", COLOR[..., ::-1]),
        ("bgr8; png compressed bgr8", COLOR[..., ::-1]),
        ("png", COLOR[..., ::-1]),
        ("rgb8; png compressed rgb8", COLOR),
    ],
)
def test_compressed_color_becomes_rgb(wire: Any, form: str, stored: np.ndarray[Any, Any]) -> None:
    data = wire.compressed(png(np.ascontiguousarray(stored)), form)
    pixels = pixels_of(data, read_image(memoryview(data), COMPRESSED, "color", cdr=wire.cdr))
    assert not pixels.flags.writeable
    np.testing.assert_array_equal(pixels, COLOR)


def test_a_jpeg_comes_back_nearly_and_is_never_turned() -> None:
    ramp = np.zeros((32, 48, 3), np.uint8)
    ramp[..., 2] = np.arange(48) * 5  # OpenCV's order: red
    jpeg = cv2.imencode(".jpg", ramp, [cv2.IMWRITE_JPEG_QUALITY, 100])[1].tobytes()
    turned = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"  # orientation 6: a quarter turn
    tagged = jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(turned) + 2) + turned + jpeg[2:]
    eager = cv2.imdecode(np.frombuffer(tagged, np.uint8), cv2.IMREAD_COLOR)
    assert eager is not None
    assert eager.shape == (48, 32, 3)
    for file in (jpeg, tagged):
        pixels = decode_compressed_color(memoryview(file), encoding="rgb8; jpeg compressed bgr8")
        assert np.abs(pixels.astype(int) - ramp[..., ::-1]).max() < 8


@pytest.mark.parametrize("cut", [0, 20, 100, -1])
def test_a_truncated_file_cannot_be_decoded(cut: int) -> None:
    noise = np.random.default_rng(1).integers(0, 2**16, (16, 16), np.uint16)
    with pytest.raises(MessageError, match=r"cannot be decoded|png is cut"):
        decode_compressed_depth(memoryview(png(noise)[:cut]), AS_SAID, encoding="16UC1; compressedDepth")
    with pytest.raises(MessageError, match=r"cannot be decoded|png is cut"):
        decode_compressed_color(memoryview(png(noise)[:cut]), encoding="png")


def test_a_png_of_eight_bit_is_no_depth() -> None:
    with pytest.raises(MessageError, match=r"expected uint16 in one channel, found uint8"):
        decode_compressed_depth(memoryview(png(COLOR)), AS_SAID, encoding="png")


GOOD: dict[str, Any] = {"encoding": "16UC1", "width_px": 3, "height_px": 2, "step_bytes": 6}


@pytest.mark.parametrize(
    ("change", "size", "kind", "fault"),
    [
        ({"encoding": "16UC7"}, 12, "depth", "encoding: expected 16UC1 or mono16 or 32FC1, found '16UC7'"),
        ({"encoding": "rgb8"}, 12, "depth", "encoding: expected 16UC1 or mono16 or 32FC1, found 'rgb8'"),
        ({}, 12, "color", "encoding: expected rgb8 or bgr8 or rgba8 or bgra8 or mono8 or 8UC3 or 8UC1 or yuv422 or "),
        ({"encoding": "yuv422"}, 12, "color", "size: expected a width that is a multiple of 2, found 3 x 2"),
        ({"encoding": "bayer_rggb8"}, 12, "color", "size: expected at least 3 x 3 pixels, found 3 x 2"),
        ({"width_px": 0}, 12, "depth", "size: expected at least one pixel, found 0 x 2"),
        ({"height_px": 0}, 0, "depth", "size: expected at least one pixel, found 3 x 0"),
        ({"step_bytes": 5}, 10, "depth", "step: expected at least 6 bytes for 3 pixels, found 5 bytes"),
        ({"encoding": "32FC1"}, 12, "depth", "step: expected at least 12 bytes for 3 pixels, found 6 bytes"),
        ({}, 11, "depth", "data: expected 12 bytes, 2 rows of 6, found 11 bytes"),
        ({}, 13, "depth", "data: expected 12 bytes, 2 rows of 6, found 13 bytes"),
        ({"width_px": 2**31}, 12, "depth", "width: expected less than 2**31, found 2147483648"),
        ({"encoding": "\n"}, 12, "depth", "encoding: expected printable text of at most 256 bytes, found b'\\n"),
        ({"frame_id": "x" * 257}, 12, "depth", "frame_id: expected printable text of at most 256 bytes, found b'x"),
    ],
)
def test_what_does_not_fit_is_a_fault_that_says_so(
    wire: Any, change: dict[str, Any], size: int, kind: Kind, fault: str
) -> None:
    data = wire.image(bytes(size), **{**GOOD, **change})
    header = read_image(memoryview(data), IMAGE, kind, cdr=wire.cdr)
    assert header.fault is not None
    assert header.fault.startswith(fault)
    assert "\n" not in header.fault
    assert header.decode is None
    assert header.stamp_ns == STAMP_NS  # what came before the fault is kept


@pytest.mark.parametrize(
    ("form", "file", "kind", "fault"),
    [
        ("jpeg", b"\xff\xd8\xff\xe0" + b"\0" * 40, "depth", "data: expected a PNG image"),
        (
            "jpeg",
            b"\xff\xd8\xfe" + b"\0" * 40,
            "color",
            "data: expected a JPEG or PNG image, found 'jpeg', b'\\xff\\xd8",
        ),
        ("jpeg", b"", "color", "data: expected a JPEG or PNG image, found 'jpeg', b''"),
        ("rgb8; png compressed bgr8", png(COLOR), "depth", "format: expected a depth image, found 'rgb8; png"),
        ("16UC1; png compressed ", png(DEPTH), "color", "format: expected a color image, found '16UC1; png"),
    ],
)
def test_compressed_data_of_another_sort_are_a_fault(wire: Any, form: str, file: bytes, kind: Kind, fault: str) -> None:
    header = read_image(memoryview(wire.compressed(file, form)), COMPRESSED, kind, cdr=wire.cdr)
    assert header.fault is not None
    assert header.fault.startswith(fault)
    assert header.stamp_ns == STAMP_NS


def test_another_type_is_a_fault(ros1: Any) -> None:
    header = read_image(memoryview(ros1.transforms("a")), "tf2_msgs/msg/TFMessage", "depth", cdr=False)
    assert header.fault == f"type: expected {IMAGE} or {COMPRESSED}, found tf2_msgs/msg/TFMessage"


def test_an_unknown_encapsulation_is_a_fault(ros2: Any) -> None:
    data = b"\x00\x07" + ros2.image(bytes(12), **GOOD)[2:]  # parameter list of XCDR 2
    header = read_image(memoryview(data), IMAGE, "depth", cdr=True)
    assert header.fault == r"encapsulation: expected plain CDR, found b'\x00\x07'"


def test_a_length_that_is_flipped_is_a_fault(ros1: Any) -> None:
    data = bytearray(ros1.image(bytes(12), **GOOD))
    data[12] ^= 0x40  # the length of frame_id
    header = read_image(memoryview(data), IMAGE, "depth", cdr=False)
    assert header.fault == "frame_id: expected 71 bytes, found 45 bytes before the end of the message"
    assert (header.stamp_ns, header.frame_id, header.encoding) == (STAMP_NS, None, None)


def test_nanoseconds_beyond_a_second_are_a_fault(ros1: Any) -> None:
    data = ros1.image(bytes(12), **GOOD)
    data = data[:8] + struct.pack("<I", 10**9) + data[12:]
    assert read_image(memoryview(data), IMAGE, "depth", cdr=False).fault == (
        "stamp: expected less than 1e9 nanoseconds, found 1000000000"
    )


def test_bytes_behind_the_message_are_a_fault(wire: Any) -> None:
    data = wire.image(bytes(12), **GOOD)
    header = read_image(memoryview(data + bytes(4)), IMAGE, "depth", cdr=wire.cdr)
    assert header.fault == f"message: expected {len(data)} bytes, found {len(data) + 4} bytes"


@given(data=st.data(), kind=st.sampled_from(["depth", "color"]), message_type=st.sampled_from([IMAGE, COMPRESSED]))
def test_no_damage_raises(wire: Any, data: st.DataObject, kind: Kind, message_type: str) -> None:
    """A spoiled message is a fault in one line, or is decoded, or (compressed) cannot be."""
    good = wire.image(bytes(12), **GOOD) if message_type == IMAGE else wire.compressed(png(DEPTH), "16UC1; png")
    spoiled = bytearray(good)
    for place in data.draw(st.lists(st.integers(0, len(good) - 1), min_size=1, max_size=4)):
        spoiled[place] = data.draw(st.integers(0, 255))
    del spoiled[data.draw(st.integers(0, len(good))) :]
    header = read_image(memoryview(spoiled), message_type, kind, cdr=wire.cdr)
    if header.fault is not None:
        assert header.decode is None
        assert "\n" not in header.fault
        return
    try:
        pixels = pixels_of(bytes(spoiled), header)
    except MessageError:
        assert header.compressed
    else:
        assert (pixels.dtype, pixels.ndim) == ((np.uint16, 2) if kind == "depth" else (np.uint8, 3))


@given(st.data())
def test_headers_of_a_stream_are_read_as_each_alone(ros1: Any, data: st.DataObject) -> None:
    headers = ImageHeaders("depth", cdr=False)
    for number in range(4):
        whole = bytearray(
            ros1.image(bytes(16), encoding="16UC1", width_px=4, height_px=2, step_bytes=8, stamp_ns=10**18 + number)
        )
        for _ in range(data.draw(st.integers(0, 2))):
            whole[data.draw(st.integers(0, len(whole) - 1))] ^= data.draw(st.integers(0, 255))
        message = memoryview(bytes(whole[: data.draw(st.integers(0, len(whole)))] if number == 2 else whole))
        found, alone = (
            headers.read(message, IMAGE),
            read_image(message, IMAGE, "depth", cdr=False),
        )
        assert replace(found, decode=None) == replace(alone, decode=None)
        if alone.decode is not None and found.decode is not None:
            assert (pixels_of(bytes(message), found) == pixels_of(bytes(message), alone)).all()
        assert (found.decode is None) == (alone.decode is None)
