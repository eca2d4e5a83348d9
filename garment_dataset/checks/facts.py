"""What is read of a recording before it is judged: plain values, so that every check is a pure function of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from garment_dataset.bags.messages import image_forms

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from garment_dataset.bags import Camera, GripperTrack
    from garment_dataset.bags.stamps import StampFault
    from garment_dataset.checks.contract import Stream


class Some(NamedTuple):
    """How many messages something is wrong with, and the first of them."""

    number: int
    first_ns: int
    """Record time."""
    text: str
    """What is wrong with that one."""


@dataclass(frozen=True, eq=False, slots=True)
class TopicFacts:
    """One topic.

    Parameters
    ----------
    name, types, count
        As in the bag.
    times_ns : (N,) int64
        When its messages were sent, in order, on the clock of the recorder: header stamps that can be believed, less
        their median distance from the record times; without header, record times. Doubled messages count once.
    digests : frozenset of bytes
        Of its messages, as far as they can be read: see :class:`~garment_dataset.bags.messages.Glance`.
    doubled : Some or None
        Messages that are another one again: of the same stamp, length, beginning and end.
    lost : Some or None
        Messages whose bytes are not there.
    stamp_faults : mapping of int to StampFault
        Header stamps that cannot be believed, by the number of the message; a doubled message has none.
    first_wrong_ns : int or None
        Record time of the first of these.
    clock : str or None
        What to know of the clock of the header stamps.
    """

    name: str
    types: tuple[str, ...]
    count: int
    times_ns: NDArray[np.int64]
    digests: frozenset[bytes] = frozenset()
    doubled: Some | None = None
    lost: Some | None = None
    stamp_faults: Mapping[int, StampFault] = field(default_factory=dict)
    first_wrong_ns: int | None = None
    clock: str | None = None

    def gaps_s(self, longest_s: float = 0.0) -> NDArray[np.float64]:
        """Return how long each time without a message is that is longer than ``longest_s``, (N,); the longest first."""
        steps_s = np.diff(self.times_ns) / 1e9
        return np.sort(steps_s[steps_s > longest_s])[::-1]

    def longest_gap_ns(self) -> int:
        """Return when the longest time without a message begins."""
        return int(self.times_ns[np.diff(self.times_ns).argmax()])

    def rate_hz(self, longest_s: float | None = None) -> float | None:
        """Return how many messages a second came, outside of gaps longer than that; None of fewer than two."""
        steps_s = np.diff(self.times_ns) / 1e9
        steps_s = steps_s if longest_s is None else steps_s[steps_s <= longest_s]
        return float(len(steps_s) / steps_s.sum()) if steps_s.sum() > 0 else None


class Sample(NamedTuple):
    """One of the images that were looked at."""

    time_ns: int
    """Record time."""
    digest: bytes
    """Of its pixels."""
    alive: float
    """Depth: share of pixels with a return; colour: standard deviation of the grey levels."""


@dataclass(frozen=True, eq=False, slots=True)
class ImageFacts:
    """The images of one stream.

    Parameters
    ----------
    topic : str
        That they were read from: the image topic, or a compressed form.
    sizes_px : frozenset of (int, int)
        Width and height of all of them; of compressed ones, of those that were looked at.
    encodings : frozenset of str
        As the messages say.
    faulty : Some or None
        Messages that cannot be used.
    samples : tuple of Sample
        Some of the images, spread evenly over the recording.
    """

    topic: str
    sizes_px: frozenset[tuple[int, int]]
    encodings: frozenset[str]
    faulty: Some | None
    samples: tuple[Sample, ...]


@dataclass(frozen=True, eq=False, slots=True)
class CameraFacts:
    """The camera of one stream; ``fault`` says why there is none that can be used."""

    topic: str
    camera: Camera | None
    fault: str | None
    missing: bool


@dataclass(frozen=True, eq=False, slots=True)
class GripperFacts:
    """Where the gripper was at the depth images; without depth images at those of colour.

    Parameters
    ----------
    times_ns : (N,) int64
        Record times of these images.
    stamps_ns : (N,) int64
        Their header stamps.
    track : GripperTrack
        Its end points at these.
    """

    times_ns: NDArray[np.int64]
    stamps_ns: NDArray[np.int64]
    track: GripperTrack

    @property
    def position_m(self) -> NDArray[np.float64]:
        """End points in the optical frame, (N, 3); NaN where not known."""
        return np.column_stack([self.track.x_m, self.track.y_m, self.track.z_m])

    @property
    def known(self) -> NDArray[np.bool_]:
        """At which images the end point is known, (N,)."""
        return np.asarray(np.isfinite(self.position_m).all(axis=1))

    @property
    def travel_m(self) -> float:
        """Greatest extent of the known end points along one of the camera's axes; 0 of none."""
        found_m = self.position_m[self.known]
        return float(np.ptp(found_m, axis=0).max()) if len(found_m) else 0.0

    @property
    def speed_m_s(self) -> NDArray[np.float64]:
        """Speed between each known end point and the next one, (n_known - 1,)."""
        way_m = np.linalg.norm(np.diff(self.position_m[self.known], axis=0), axis=1)
        return np.asarray(way_m / (np.diff(self.stamps_ns[self.known]) / 1e9))

    def in_view(self, camera: Camera) -> NDArray[np.bool_]:
        """Return which of the known end points a camera sees, (n_known,)."""
        x_m, y_m, z_m = self.position_m[self.known].T
        with np.errstate(divide="ignore", invalid="ignore"):
            u_px = camera.fx_px * x_m / z_m + camera.cx_px
            v_px = camera.fy_px * y_m / z_m + camera.cy_px
        within = (u_px >= 0) & (u_px < camera.width_px) & (v_px >= 0) & (v_px < camera.height_px)
        return np.asarray(within & (z_m > 0))


@dataclass(frozen=True, eq=False, slots=True)
class Facts:
    """All that is read of one recording.

    Parameters
    ----------
    start_ns, end_ns : int
        First and last record time of all messages.
    topics : mapping of str to TopicFacts
        Of the whole bag.
    images, cameras : mapping
        Of the streams that the contract speaks of; ``images`` has those that the bag holds.
    gripper : GripperFacts or None
        None when the contract does not ask, or there is no image to have it at.
    contradictions : tuple of str
        Where the bag does not hold what its index says.
    notes : tuple of str
        What the readers warned of.
    axis : {"R", "B"} or None
        As the name says.
    background : str or None
        What to provide for the empty scene, if that is missing.
    """

    start_ns: int
    end_ns: int
    topics: Mapping[str, TopicFacts]
    images: Mapping[Stream, ImageFacts]
    cameras: Mapping[Stream, CameraFacts]
    gripper: GripperFacts | None
    contradictions: tuple[str, ...]
    notes: tuple[str, ...]
    axis: str | None = None
    background: str | None = None

    @property
    def duration_s(self) -> float:
        """From the first to the last message."""
        return (self.end_ns - self.start_ns) / 1e9

    def time_s(self, time_ns: float) -> float:
        """Return a record time in seconds after the recording begins."""
        return round(float(time_ns - self.start_ns) / 1e9, 3)

    def topic(self, base: str) -> TopicFacts | None:
        """Return a topic that has messages: itself, or of images a compressed form; else itself, if there."""
        found = [self.topics[name] for name in image_forms(base) if name in self.topics]
        return next((topic for topic in found if topic.count), found[0] if found else None)
