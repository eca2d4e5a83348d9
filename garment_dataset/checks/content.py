"""What a recording shows of what its name and its tables say: read from its bag."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from garment_dataset.bags import LookupFailedError, open_bag
from garment_dataset.bags.joints import read_joints
from garment_dataset.bags.recorded_transforms import RecordedTransforms
from garment_dataset.checks.appearance import Color, color_of, hanging_region
from garment_dataset.checks.motion import Turn, swing_axis, turn_of_gripper, turn_of_joints
from garment_dataset.checks.reading import read_facts
from garment_dataset.errors import DataWarning, MessageError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from garment_dataset.bags import ImageMessage
    from garment_dataset.checks.contract import Contract, Stream
    from garment_dataset.checks.facts import Facts

_REST_M = 0.005  # the gripper has not left by more
_VIEWS = 5
"""Images at rest that the garment is looked at in."""
_JOINTS = "/joint_states"
_APART_NS = 100_000_000  # between a depth image and the colour image beside it


@dataclass(frozen=True, eq=False, slots=True)
class Content:
    """What one recording shows; None where it does not tell.

    Parameters
    ----------
    start_ns : int
        When it begins: first record time.
    messages : mapping of {"depth", "color"} to frozenset of bytes
        Digests of its image messages, of stamp and pixels.
    pixels : mapping of {"depth", "color"} to frozenset of bytes
        Digests of the pixels of some images, those left out that it shows more than once.
    axis : {"R", "B"} or None
        Along which the gripper moved.
    extent_m : (3,) float64
        How far it moved along each axis of the camera.
    turn : Turn or None
        What the joint did that moved most, or the gripper.
    length_m : float or None
        How far the garment hangs below the gripper, at rest.
    is_cut : bool
        Whether it hangs out of the image, and is longer.
    color : Color or None
        Of the garment, at rest.
    """

    start_ns: int
    messages: Mapping[Stream, frozenset[bytes]]
    pixels: Mapping[Stream, frozenset[bytes]]
    axis: Literal["R", "B"] | None
    extent_m: NDArray[np.float64]
    turn: Turn | None
    length_m: float | None
    is_cut: bool
    color: Color | None


def read_content(path: Path, contract: Contract) -> Content:
    """Read what a recording shows.

    Parameters
    ----------
    path : Path
        The bag.
    contract : Contract
        Says where its images and its gripper are to be found.

    Raises
    ------
    BagError
        If it cannot be read, or has no message.
    """
    with warnings.catch_warnings(), open_bag(path) as bag:
        warnings.simplefilter("ignore", DataWarning)  # `garment check` tells them
        transforms = RecordedTransforms(bag, max_stamp_offset_s=contract.recording.max_stamp_offset_s)
        facts = read_facts(bag, contract, transforms=transforms)
        gripper = facts.gripper
        known_m = np.zeros((0, 3)) if gripper is None else gripper.position_m[gripper.known]
        turn = turn_of_joints(read_joints(bag, _JOINTS)) if facts.topic(_JOINTS) is not None else None
        if turn is None and gripper is not None:
            turn = turn_of_gripper(gripper.stamps_ns, gripper.track.quaternion_xyzw)
        views = list(_views(transforms, facts))
        return Content(
            start_ns=facts.start_ns,
            messages={stream: facts.topics[images.topic].digests for stream, images in facts.images.items()},
            pixels={stream: _once(each.digest for each in images.samples) for stream, images in facts.images.items()},
            axis=swing_axis(known_m),
            extent_m=np.ptp(known_m, axis=0) if len(known_m) else np.zeros(3),
            turn=turn,
            length_m=float(np.median([view.length_m for view in views])) if views else None,
            is_cut=any(view.is_cut for view in views),
            color=_median_color([view.color for view in views if view.color is not None]),
        )


def _once(digests: Iterable[bytes]) -> frozenset[bytes]:
    found = list(digests)
    return frozenset(each for each in found if found.count(each) == 1)


@dataclass(frozen=True, slots=True)
class _View:
    """What one image at rest shows of the garment."""

    length_m: float
    is_cut: bool
    color: Color | None


def _views(transforms: RecordedTransforms, facts: Facts) -> Iterator[_View]:
    """Look at the garment in some depth images before the gripper moves, and in the colour images beside them."""
    gripper, camera = facts.gripper, facts.cameras["depth"].camera if "depth" in facts.images else None
    if gripper is None or camera is None or not gripper.known.any():
        return
    position_m, first = gripper.position_m, int(gripper.known.argmax())
    left = gripper.known & (np.linalg.norm(position_m - position_m[first], axis=1) > _REST_M)
    end = int(left.argmax()) if left.any() else len(left)
    chosen = np.unique(np.linspace(first, max(first, end - 1), _VIEWS).round().astype(int))
    by_stamp = {each.stamp_ns: each for each in transforms.bag.images(facts.images["depth"].topic, "depth")}
    colors = _Colors(transforms, facts)
    for place in chosen[gripper.known[chosen]]:
        image = by_stamp[int(gripper.stamps_ns[place])]
        try:
            region = hanging_region(image.pixels(), camera, position_m[place])
        except MessageError:
            continue
        if region is not None:
            yield _View(region.length_m, region.is_cut, colors.of(region.points_m, image))


class _Colors:
    """The colour images of a recording, and where points of the depth camera lie in them."""

    def __init__(self, transforms: RecordedTransforms, facts: Facts) -> None:
        images, bag = facts.images.get("color"), transforms.bag
        self._camera = None if images is None else facts.cameras["color"].camera
        self._images = [] if images is None else [each for each in bag.images(images.topic, "color") if not each.fault]
        self._stamps_ns = np.array([each.stamp_ns for each in self._images], np.int64)
        self._transforms = transforms

    def of(self, points_m: NDArray[np.float64], image: ImageMessage) -> Color | None:
        """Return the colour of points of a depth image; None where nothing says where they are in a colour image."""
        if self._camera is None or not self._images or image.stamp_ns is None:
            return None
        place = int(np.abs(self._stamps_ns - image.stamp_ns).argmin())
        beside = self._images[place]
        if abs(self._stamps_ns[place] - image.stamp_ns) > _APART_NS:
            return None
        try:
            frames = (str(beside.frame_id).lstrip("/"), str(image.frame_id).lstrip("/"))
            transform = self._transforms.tree.lookup(*frames, image.stamp_ns)
            return color_of(beside.pixels(), self._camera, transform.apply(points_m))
        except (LookupFailedError, MessageError):
            return None


def _median_color(colors: Sequence[Color]) -> Color | None:
    return Color(*np.median(np.array(colors), axis=0).tolist()) if colors else None
