"""Read the facts of a recording: headers of all messages, pixels of a few."""

from __future__ import annotations

import warnings
from hashlib import blake2b
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.bags.camera import is_rectified, read_camera
from garment_dataset.bags.gripper import read_gripper
from garment_dataset.bags.headers import IMAGES
from garment_dataset.bags.recorded_transforms import RecordedTransforms
from garment_dataset.bags.stamps import (
    SAMPLE_DISORDER_S,
    TRANSFORM_DISORDER_S,
    Stamped,
    check_stamps,
    clock_note,
    median_offset_ns,
)
from garment_dataset.bags.stated_transforms import TRANSFORMS
from garment_dataset.checks.facts import CameraFacts, Facts, GripperFacts, ImageFacts, Sample, Some, TopicFacts
from garment_dataset.errors import BagError, DataWarning, MessageError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from garment_dataset.bags import Bag, Glance, ImageMessage, Topic
    from garment_dataset.checks.contract import Contract, Stream, StreamRule

    Images = Mapping[Stream, Sequence[ImageMessage]]

_SAMPLES = 24
"""Images that are looked at per stream: three a second of a usual recording."""


def read_facts(
    bag: Bag,
    contract: Contract,
    *,
    axis: str | None = None,
    background: str | None = None,
    transforms: RecordedTransforms | None = None,
) -> Facts:
    """Read all that checks judge by.

    Parameters
    ----------
    bag : Bag
        An open recording.
    contract : Contract
        Says which streams are looked at, and where the gripper is to be found.
    axis, background
        See :class:`~garment_dataset.checks.facts.Facts`.
    transforms : RecordedTransforms, optional
        Those of the bag, for whoever asks for more of them; by default they are read here.

    Raises
    ------
    BagError
        If it has no message, or (rosbag2 only) its storage is damaged.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", DataWarning)
        glances = {name: list(bag.glances(name)) for name in bag.topics}
        times_ns = [each.record_stamp_ns for of_topic in glances.values() for each in of_topic]
        if not times_ns:
            raise BagError("no messages", where=bag.path)
        sources = {stream: bag.image_topic(rule.topic) for stream, rule in contract.streams.items()}
        messages: Images = {
            stream: list(bag.images(topic, stream)) for stream, topic in sources.items() if topic is not None
        }
        images = {stream: image_facts(str(sources[stream]), stream, seen) for stream, seen in messages.items()}
        cameras = {stream: _camera_facts(bag, rule, images.get(stream)) for stream, rule in contract.streams.items()}
        gripper = _gripper_facts(bag, contract, messages, transforms)
    max_offset_s = contract.recording.max_stamp_offset_s
    return Facts(
        start_ns=min(times_ns),
        end_ns=max(times_ns),
        topics={name: topic_facts(bag.topics[name], seen, max_offset_s) for name, seen in glances.items()},
        images=images,
        cameras=cameras,
        gripper=gripper,
        contradictions=tuple(bag.contradictions()),
        notes=_notes(bag, caught),
        axis=axis,
        background=background,
    )


def _notes(bag: Bag, caught: Sequence[warnings.WarningMessage]) -> tuple[str, ...]:
    texts = (" ".join(str(each.message).split()) for each in caught if issubclass(each.category, DataWarning))
    return tuple(dict.fromkeys(text.removeprefix(f"{bag.path.name}: ") for text in texts))


def topic_facts(topic: Topic, glances: Sequence[Glance], max_offset_s: float) -> TopicFacts:
    """Sum up what the messages of a topic tell.

    Parameters
    ----------
    topic : Topic
        Which.
    glances : sequence of Glance
        At all its messages, in order.
    max_offset_s : float
        How far header stamp less record time may be from its median.
    """
    seen: set[tuple[int, bytes]] = set()
    doubled, lost, single = list[int](), list[tuple[int, str]](), list[int]()
    for number, each in enumerate(glances):
        if each.fault is not None:
            lost.append((number, each.fault))
        elif each.stamp_ns is not None and (each.stamp_ns, each.digest) in seen:
            doubled.append(number)
        else:
            single.append(number)
            seen.add((each.stamp_ns or 0, each.digest))
    stamped = [
        Stamped(number, glance.stamp_ns, glance.record_stamp_ns)
        for number in single
        if (glance := glances[number]).stamp_ns is not None
    ]
    # Of the publishers of transforms, one may be ahead by half a second, and one stamp stands for all of a message
    of_transforms = any(each in TRANSFORMS for each in topic.types)
    disorder_s = TRANSFORM_DISORDER_S if of_transforms else SAMPLE_DISORDER_S
    faults = check_stamps(stamped, max_offset_s=max_offset_s, disorder_s=disorder_s)
    if not any(each in IMAGES for each in topic.types):  # two drivers of joints may well see them at one time
        faults = {number: fault for number, fault in faults.items() if fault.kind != "repeat"}
    shift_ns = median_offset_ns(stamped)
    believed = {each.number: each.stamp_ns - shift_ns for each in stamped if each.number not in faults}
    times_ns = [
        glances[number].record_stamp_ns if of_transforms else believed.get(number, glances[number].record_stamp_ns)
        for number in single
    ]
    return TopicFacts(
        topic.name,
        topic.types,
        topic.count,
        np.sort(np.array(times_ns, np.int64)),
        frozenset(each.digest for each in glances if each.fault is None),
        _some(glances, [(number, "the same as an earlier one") for number in doubled]),
        _some(glances, lost),
        faults,
        glances[min(faults)].record_stamp_ns if faults else None,
        clock_note(stamped),
    )


def _some(glances: Sequence[Glance], faults: Sequence[tuple[int, str]]) -> Some | None:
    if not faults:
        return None
    number, text = faults[0]
    return Some(len(faults), glances[number].record_stamp_ns, text)


def image_facts(topic: str, stream: Stream, messages: Sequence[ImageMessage]) -> ImageFacts:
    """Sum up the images of a stream; the pixels of at most 24 of them are decoded.

    Parameters
    ----------
    topic : str
        That they were read from.
    stream : {"depth", "color"}
        What they are meant to be.
    messages : sequence of ImageMessage
        All of them, of an open bag.
    """
    faulty = {each.index: each.fault for each in messages if each.fault is not None}
    sound = [each for each in messages if each.fault is None]
    sizes_px = {(each.width_px, each.height_px) for each in sound if each.width_px and each.height_px}
    samples: list[Sample] = []
    for place in np.unique(np.linspace(0, len(sound) - 1, _SAMPLES).round().astype(int)) if sound else ():
        image = sound[place]
        try:
            pixels = image.pixels()
        except MessageError as error:
            faulty[image.index] = str(error)
            continue
        sizes_px.add((pixels.shape[1], pixels.shape[0]))
        digest = blake2b(pixels.tobytes(), digest_size=16).digest()
        thin = pixels[::4, ::4]
        alive = float(np.mean(thin > 0)) if stream == "depth" else float(thin.mean(axis=2).std())
        samples.append(Sample(image.record_stamp_ns, digest, alive))
    first = min(faulty, default=None)
    return ImageFacts(
        topic,
        frozenset(sizes_px),
        frozenset(each.encoding for each in sound if each.encoding),
        None if first is None else Some(len(faulty), messages[first].record_stamp_ns, str(faulty[first])),
        tuple(samples),
    )


def _camera_facts(bag: Bag, rule: StreamRule, images: ImageFacts | None) -> CameraFacts:
    topic = rule.camera_info_topic
    missing = topic not in bag.topics or not bag.topics[topic].count
    size_px = next(iter(images.sizes_px)) if images is not None and len(images.sizes_px) == 1 else None
    try:
        camera = read_camera(bag, topic, rectified=is_rectified(rule.topic), image_size_px=size_px)
    except BagError as error:
        return CameraFacts(topic, None, error.what if error.found is None else f"{error.what}: {error.found}", missing)
    return CameraFacts(topic, camera, None, missing)


def _gripper_facts(
    bag: Bag, contract: Contract, messages: Images, transforms: RecordedTransforms | None
) -> GripperFacts | None:
    """Return the gripper at the images whose stamps can be believed."""
    rule = contract.gripper
    images = [each for each in messages.get("depth") or messages.get("color") or () if each.fault is None]
    if rule is None or not images:
        return None
    max_offset_s = contract.recording.max_stamp_offset_s
    stamped = [Stamped(each.index, each.stamp_ns or 0, each.record_stamp_ns) for each in images]
    faults = check_stamps(stamped, max_offset_s=max_offset_s)
    used = [each for each in stamped if each.number not in faults]
    stamps_ns = [each.stamp_ns for each in used]
    track = read_gripper(
        bag,
        stamps_ns,
        camera_frame=rule.camera_frame or images[0].frame_id or "",
        gripper_frame=rule.frame,
        topic=rule.topic,
        transforms=transforms or RecordedTransforms(bag, max_stamp_offset_s=max_offset_s),
        stream="depth" if messages.get("depth") else "color",
    )
    times_ns = np.array([each.record_stamp_ns for each in used], np.int64)
    return GripperFacts(times_ns, np.array(stamps_ns, np.int64), track)
