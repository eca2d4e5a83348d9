"""What the depths of a recording are, judged by a few of its images: in which byte order, and of which unit.

``is_bigendian`` is copied from machine to machine without the data, and drivers differ in what 1 means (a millimetre, a
quarter of one, a metre); the pixels themselves tell a room from noise.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.bags.images import DepthReading

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    Read = Callable[[DepthReading], Sequence[NDArray[np.uint16]]]

SAMPLE = 8
"""How many images are looked at."""

_ROOM_MM = (300, 10_000)  # what can be seen indoors
_NEAR_MM = 3_500  # where the range ends that the maker of the Xtion states: a garment is nearer
_STEP_MM = 100  # neighbours on one surface differ by less; in the wrong byte order they differ by 256 at least
_LEAST_SHARE = 0.5
_NEAREST_PERCENT = 1.0  # nearer than that are stray pixels
_UNITS: Mapping[float, str] = {
    0.1: "tenths of a millimetre",
    0.25: "quarter millimetres",
    10.0: "centimetres",
    1000.0: "metres",
    0.001: "millimetres where metres are due",
}


def settle_reading(read: Read, unit_mm: float) -> tuple[DepthReading, list[str]]:
    """Decide how the depths of a recording are read, and say what is odd about them.

    Parameters
    ----------
    read : callable
        Takes a reading; returns a few images, spread over the recording, so read.
    unit_mm : float
        The unit that its owner says; never overruled, only doubted.

    Returns
    -------
    reading : DepthReading
        ``unit_mm``, and the byte order in which the depths make sense: the one that the messages say, unless they do in
        the other order alone.
    notes : list of str
        One line for another byte order, one for depths that lie in no room.

    Notes
    -----
    Depths make sense when most of them are within 0.3 and 10 m, and most neighbours that differ at all do so by at most
    10 cm. Another unit makes no sense either, but the other byte order would make it rougher, not smoother. Depths lie
    in no room when their median does not, or when nothing is nearer than 3.5 m.
    """
    said, swapped = DepthReading(unit_mm), DepthReading(unit_mm, swapped=True)
    reading, notes = said, []
    images = read(said)
    if not _make_sense(images) and _make_sense(others := read(swapped)) and _step_mm(others) <= _step_mm(images):
        reading, images = swapped, others
        notes.append("depths make sense only in the byte order opposite to is_bigendian, so they are read in that")
    depths_mm = _seen(images)
    if not _lie_in_a_room(depths_mm):
        likely = {each: _seen(read(reading._replace(unit_mm=each))) for each in _UNITS if each != unit_mm}
        found = {each: depths for each, depths in likely.items() if depths.size and _lie_in_a_room(depths)}
        if depths_mm.size or found:
            notes.append(_doubt(depths_mm, found))
    return reading, notes


def _seen(images: Sequence[NDArray[np.uint16]]) -> NDArray[np.uint16]:
    return np.concatenate([np.empty(0, np.uint16), *(image[image > 0] for image in images)])


def _make_sense(images: Sequence[NDArray[np.uint16]]) -> bool:
    depths_mm = _seen(images)
    if not depths_mm.size or np.mean((depths_mm >= _ROOM_MM[0]) & (depths_mm <= _ROOM_MM[1])) < _LEAST_SHARE:
        return False
    steps_mm = _steps_mm(images)
    return not steps_mm.size or bool(np.mean(steps_mm <= _STEP_MM) >= _LEAST_SHARE)


def _step_mm(images: Sequence[NDArray[np.uint16]]) -> float:
    """Return the median step between neighbours; without any, as in an even image, that of the roughest noise."""
    steps_mm = _steps_mm(images)
    return float(np.median(steps_mm)) if steps_mm.size else float(np.iinfo(np.uint16).max)


def _steps_mm(images: Sequence[NDArray[np.uint16]]) -> NDArray[np.int32]:
    """Return by how much neighbours in a row differ, where both are seen and differ at all."""
    steps = [np.empty(0, np.int32)]
    for image in images:
        left, right = image[:, :-1].astype(np.int32), image[:, 1:].astype(np.int32)
        steps.append(np.abs(right - left)[(left > 0) & (right > 0) & (left != right)])
    return np.concatenate(steps)


def _lie_in_a_room(depths_mm: NDArray[np.uint16]) -> bool:
    if not depths_mm.size:
        return False
    nearest_mm, median_mm = np.percentile(depths_mm, [_NEAREST_PERCENT, 50])
    return bool(_ROOM_MM[0] <= median_mm <= _ROOM_MM[1] and nearest_mm <= _NEAR_MM)


def _doubt(depths_mm: NDArray[np.uint16], found: Mapping[float, NDArray[np.uint16]]) -> str:
    units = [
        f"{_UNITS[unit]} (depth_unit_mm = {unit:g}, median {_median_text(depths)})" for unit, depths in found.items()
    ]
    now = "all beyond 65.5 m or nothing"
    if depths_mm.size:
        nearest_m = np.percentile(depths_mm, _NEAREST_PERCENT) / 1e3
        now = f"nearest {nearest_m:.2f} m, median {_median_text(depths_mm)}"
    what = f"depths look like {' or '.join(units)}" if units else "depths look like none of a room"
    return f"{what}; as read: {now}. Set depth_unit_mm under [params.decode]"


def _median_text(depths_mm: NDArray[np.uint16]) -> str:
    return f"{np.median(depths_mm) / 1e3:.2f} m"
