"""PNG files of one bit per pixel: any image library reads them, and none of their faults passes unseen."""

from __future__ import annotations

import cv2
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from garment_dataset.vision.color.png import read_own_png, write_png

Mask = NDArray[np.bool_]

masks = hnp.arrays(np.bool_, hnp.array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=30))


def by_library(png: bytes) -> Mask:
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert image is not None
    return np.asarray(image) > 0


@given(masks)
def test_it_is_read_as_written_and_as_a_library_reads_it(mask: Mask) -> None:
    own = read_own_png(write_png(mask))
    assert own is not None
    np.testing.assert_array_equal(own, mask)
    np.testing.assert_array_equal(by_library(write_png(mask)), mask)


@given(masks, st.data())
def test_a_changed_byte_is_never_read_as_a_mask(mask: Mask, data: st.DataObject) -> None:
    png = bytearray(write_png(mask))
    png[data.draw(st.integers(0, len(png) - 1))] ^= data.draw(st.integers(1, 255))
    assert read_own_png(bytes(png)) is None


@given(masks, st.data())
def test_neither_is_a_part_nor_more(mask: Mask, data: st.DataObject) -> None:
    png = write_png(mask)
    assert read_own_png(png[: data.draw(st.integers(0, len(png) - 1))]) is None
    assert read_own_png(png + data.draw(st.binary(min_size=1, max_size=40))) is None


def test_those_of_other_programs_are_left_to_the_library() -> None:
    mask = np.random.default_rng(0).random((20, 30)) > 0.5
    done, png = cv2.imencode(".png", mask.astype(np.uint8) * 255)
    assert done
    assert read_own_png(png.tobytes()) is None
