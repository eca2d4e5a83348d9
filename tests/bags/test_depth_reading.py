"""In which byte order and unit depths are, by their content alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset.bags.depth_reading import settle_reading
from garment_dataset.bags.images import AS_SAID, DepthReading, depth_in_millimetres

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Depth = NDArray[np.float64]
    Read = Callable[[DepthReading], list[NDArray[np.uint16]]]


def room_m(noise_m: float = 0.001, garment_m: float = 1.07, wall_m: float = 2.0) -> Depth:
    """A garment before a slanted wall, and a part that the sensor did not see."""
    depth_m = np.linspace(wall_m, wall_m + 0.2, 80) + np.random.default_rng(3).normal(0, noise_m, (60, 80))
    depth_m[10:50, 30:50] += garment_m - wall_m - 0.1
    depth_m[:, :4] = 0
    return depth_m


def reader(stored: NDArray[np.generic]) -> Read:
    """Read one stored image as a bag does."""

    def read(reading: DepthReading) -> list[NDArray[np.uint16]]:
        seen = stored.byteswap() if reading.swapped else stored
        return [depth_in_millimetres(seen, reading.unit_mm)]

    return read


def integers(depth_m: Depth, unit_mm: float = 1.0) -> NDArray[np.uint16]:
    return np.rint(depth_m * 1e3 / unit_mm).astype(np.uint16)


@pytest.mark.parametrize("noise_m", [0, 0.001, 0.01])
def test_a_room_in_millimetres_is_read_as_said(noise_m: float) -> None:
    assert settle_reading(reader(integers(room_m(noise_m))), 1.0) == (AS_SAID, [])


def test_a_room_in_metres_is_read_as_said() -> None:
    assert settle_reading(reader(room_m().astype(np.float32)), 1.0) == (AS_SAID, [])


@pytest.mark.parametrize("noise_m", [0, 0.001, 0.01])
@pytest.mark.parametrize("floating", [False, True])
def test_a_byte_order_that_the_depths_refute(noise_m: float, floating: bool) -> None:
    depth_m = room_m(noise_m)
    stored = depth_m.astype(np.float32) if floating else integers(depth_m)
    reading, notes = settle_reading(reader(stored.byteswap()), 1.0)
    assert reading == DepthReading(swapped=True)
    assert notes == ["depths make sense only in the byte order opposite to is_bigendian, so they are read in that"]


def test_an_even_wall_in_the_wrong_order_is_seen_too() -> None:
    wall = np.full((40, 40), 2000, np.uint16)
    assert settle_reading(reader(wall.byteswap()), 1.0)[0].swapped
    assert not settle_reading(reader(wall), 1.0)[0].swapped


def test_noise_is_no_reason_to_swap() -> None:
    noise = np.random.default_rng(1).integers(0, 2**16, (60, 80), np.uint16)
    assert settle_reading(reader(noise), 1.0)[0] == AS_SAID


TENTHS = "tenths of a millimetre (depth_unit_mm = 0.1, median {})"
QUARTERS = "quarter millimetres (depth_unit_mm = 0.25, median {})"
CENTIMETRES = "centimetres (depth_unit_mm = 10, median {})"
METRES = "metres (depth_unit_mm = 1000, median {})"
FLOATS = "millimetres where metres are due (depth_unit_mm = 0.001, median {})"


@pytest.mark.parametrize(
    ("stored", "units", "now"),
    [
        (
            integers(room_m(), 0.25),
            [TENTHS.format("0.83 m"), QUARTERS.format("2.07 m")],
            "nearest 4.19 m, median 8.28 m",
        ),
        (integers(room_m(), 10.0), [CENTIMETRES.format("2.07 m")], "nearest 0.10 m, median 0.21 m"),
        (integers(room_m(wall_m=3.0), 1000.0), [METRES.format("3.00 m")], "nearest 0.00 m, median 0.00 m"),
        ((room_m() * 1e3).astype(np.float32), [FLOATS.format("2.07 m")], "all beyond 65.5 m or nothing"),
        (
            np.full((9, 9), 7000, np.uint16),
            [TENTHS.format("0.70 m"), QUARTERS.format("1.75 m")],
            "nearest 7.00 m, median 7.00 m",
        ),
        (np.full((9, 9), 100, np.uint16), [CENTIMETRES.format("1.00 m")], "nearest 0.10 m, median 0.10 m"),
        (np.tile(np.arange(16, 27, dtype=np.uint16), (9, 1)), ["none of a room"], "nearest 0.02 m, median 0.02 m"),
    ],
)
def test_depths_of_another_unit_are_named(stored: NDArray[np.generic], units: list[str], now: str) -> None:
    reading, notes = settle_reading(reader(stored), 1.0)
    assert reading == AS_SAID
    text = f"depths look like {' or '.join(units)}; as read: {now}. Set depth_unit_mm under [params.decode]"
    assert notes == [text]


def test_a_unit_that_is_said_is_not_doubted_where_it_fits() -> None:
    assert settle_reading(reader(integers(room_m(), 0.25)), 0.25) == (DepthReading(0.25), [])


def test_a_unit_that_is_said_is_doubted_where_it_does_not_fit() -> None:
    reading, notes = settle_reading(reader(integers(room_m())), 0.1)
    assert reading == DepthReading(0.1)
    assert len(notes) == 1
    assert "median 0.21 m. Set depth_unit_mm" in notes[0]


def test_a_wrong_order_and_another_unit_at_once() -> None:
    reading, notes = settle_reading(reader(integers(room_m(), 0.25).byteswap()), 0.25)
    assert reading == DepthReading(0.25, swapped=True)
    assert len(notes) == 1


@pytest.mark.parametrize("stored", [np.zeros((5, 5), np.uint16), np.full((5, 5), np.nan, np.float32)])
def test_nothing_seen_is_nothing_said(stored: NDArray[np.generic]) -> None:
    assert settle_reading(reader(stored), 1.0) == (AS_SAID, [])
    assert settle_reading(lambda _: [], 1.0) == (AS_SAID, [])
