"""A contract learnt from good recordings: what they have in common, with margins."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from garment_dataset.bags.camera import camera_info_beside, image_base
from garment_dataset.bags.headers import IMAGES
from garment_dataset.checks.contract import (
    ColorRule,
    Contract,
    DepthRule,
    GripperRule,
    ImagesRule,
    RecordingRule,
    TopicRule,
)
from garment_dataset.errors import BagError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from garment_dataset.bags import Bag
    from garment_dataset.checks.contract import Bounds, Stream, StreamRule
    from garment_dataset.checks.facts import Facts, TopicFacts

_MARGIN = 0.2  # of rates and durations, both ways
_TIMES = 2.0  # what only a fault reaches: this many times the largest that was seen
_PERIODS = 4.0  # the same of gaps, at least: so many messages may get lost
_STEADY, _FEW = 10.0, 10  # a topic has a rate when no gap is longer than this many periods, of so many messages


def streams_of(bag: Bag, usual: Contract) -> Contract:
    """Return the usual contract, without topics, of the images that a recording has.

    Parameters
    ----------
    bag : Bag
        An open recording.
    usual : Contract
        Its topics are taken where the recording has them; of others, the first whose images are of the kind.

    Raises
    ------
    BagError
        If the recording has no image topic.
    """
    depth, color = (_stream_topic(bag, usual, stream) for stream in ("depth", "color"))
    if depth is None and color is None:
        raise BagError("no images", where=bag.path, expected="depth or colour images", found=", ".join(bag.topics))
    images = ImagesRule(
        depth=None if depth is None else DepthRule(topic=depth, camera_info_topic=camera_info_beside(depth)),
        color=None if color is None else ColorRule(topic=color, camera_info_topic=camera_info_beside(color)),
    )
    gripper = usual.gripper
    if gripper is not None and (usual.images.depth is None or depth != usual.images.depth.topic):
        gripper = gripper.model_copy(update={"camera_frame": ""})
    return usual.model_copy(update={"topics": {}, "images": images, "gripper": gripper})


def _stream_topic(bag: Bag, usual: Contract, stream: Stream) -> str | None:
    rule = usual.streams.get(stream)
    if rule is not None and bag.image_topic(rule.topic) is not None:
        return rule.topic
    for topic in bag.topics.values():
        if topic.count and {*topic.types} <= {*IMAGES}:
            first = next(iter(bag.images(topic.name, stream)), None)
            if first is not None and first.fault is None:
                return image_base(topic.name)
    return None


def learn(good: Sequence[Facts], base: Contract) -> Contract:
    """Return the contract that good recordings keep.

    Parameters
    ----------
    good : sequence of Facts
        Of at least one recording, read by ``base``.
    base : Contract
        Which streams and which gripper were looked at; bounds that recordings cannot tell are taken from it.

    Returns
    -------
    Contract
        Every one of these recordings keeps it.
    """
    names = sorted({name for facts in good for name, topic in facts.topics.items() if topic.count})
    late_s = max(map(_lateness_s, good))
    return Contract(
        recording=RecordingRule(
            duration_s=_bounds([facts.duration_s for facts in good]),
            max_late_s=_up(max(_TIMES * late_s, 0.5)),
            max_stamp_offset_s=base.recording.max_stamp_offset_s,
        ),
        topics={name: _topic_rule([facts.topics.get(name) for facts in good]) for name in names},
        images=ImagesRule(depth=_depth_rule(good, base), color=_color_rule(good, base)),
        gripper=_gripper_rule(good, base),
        background=base.background,
    )


def _topic_rule(found: Sequence[TopicFacts | None]) -> TopicRule:
    there = [topic for topic in found if topic is not None and topic.count]
    types = tuple(sorted({kind for topic in there for kind in topic.types}))
    required = len(there) == len(found)
    if not all(map(_is_steady, there)):
        return TopicRule(types=types, required=required)
    rates_hz = [topic.rate_hz() or 0.0 for topic in there]
    longest_s = max(float(topic.gaps_s()[0]) for topic in there)
    max_gap_s = _up(max(_TIMES * longest_s, _PERIODS / min(rates_hz)))
    return TopicRule(types=types, required=required, rate_hz=_bounds(rates_hz), max_gap_s=max_gap_s)


def _is_steady(topic: TopicFacts) -> bool:
    rate_hz = topic.rate_hz()
    return len(topic.times_ns) >= _FEW and rate_hz is not None and topic.gaps_s()[0] * rate_hz <= _STEADY


def _stream_parts(good: Sequence[Facts], rule: StreamRule, stream: Stream) -> dict[str, Any]:
    seen = [facts.images[stream] for facts in good if stream in facts.images]
    return {
        "topic": rule.topic,
        "camera_info_topic": rule.camera_info_topic,
        "encodings": tuple(
            sorted({each for images in seen if images.topic == rule.topic for each in images.encodings})
        ),
        "sizes_px": tuple(sorted({size for images in seen for size in images.sizes_px})),
    }


def _least_alive(good: Sequence[Facts], stream: Stream, usual: float) -> float:
    """Return half of the least that was seen, and not more than is usual."""
    alive = [each.alive for facts in good if stream in facts.images for each in facts.images[stream].samples]
    return min(usual, _down(min(alive, default=usual) / _TIMES))


def _depth_rule(good: Sequence[Facts], base: Contract) -> DepthRule | None:
    if (rule := base.images.depth) is None:
        return None
    return DepthRule(**_stream_parts(good, rule, "depth"), least_valid=_least_alive(good, "depth", rule.least_valid))


def _color_rule(good: Sequence[Facts], base: Contract) -> ColorRule | None:
    if (rule := base.images.color) is None:
        return None
    least = _least_alive(good, "color", rule.least_contrast)
    return ColorRule(**_stream_parts(good, rule, "color"), least_contrast=least)


def _gripper_rule(good: Sequence[Facts], base: Contract) -> GripperRule | None:
    """Return the rule of the gripper; None when a recording does not know where it is."""
    rule, found = base.gripper, [facts.gripper for facts in good]
    if rule is None or not all(each is not None and each.known.any() for each in found):
        return None
    tracks = [(facts, each) for facts, each in zip(good, found, strict=True) if each is not None]
    views = [
        float(each.in_view(camera).mean())
        for facts, each in tracks
        if "depth" in facts.cameras and (camera := facts.cameras["depth"].camera) is not None
    ]
    fastest_m_s = max(max(each.speed_m_s, default=0.0) for _, each in tracks)
    return rule.model_copy(
        update={
            "least_known": _down((1 - _MARGIN / 2) * min(float(each.known.mean()) for _, each in tracks)),
            "least_in_view": _down((1 - _MARGIN / 2) * min(views, default=1.0)),
            "least_travel_m": _down(min(each.travel_m for _, each in tracks) / _TIMES),
            "max_speed_m_s": _up(max(_TIMES * fastest_m_s, 1.0)),
        }
    )


def _lateness_s(facts: Facts) -> float:
    ends = [topic.times_ns[[0, -1]] for topic in facts.topics.values() if _is_steady(topic)]
    late_s = (max(facts.time_s(first), facts.duration_s - facts.time_s(last)) for first, last in ends)
    return max(late_s, default=0.0)


def _bounds(seen: Iterable[float]) -> Bounds:
    values = list(seen)
    return _down((1 - _MARGIN) * min(values)), _up((1 + _MARGIN) * max(values))


def _up(value: float) -> float:
    """Return the next number of two digits that is not less."""
    return _rounded(value, math.ceil)


def _down(value: float) -> float:
    """Return the next number of two digits that is not more."""
    return _rounded(value, math.floor)


def _rounded(value: float, to_whole: Callable[[float], int]) -> float:
    if value <= 0:
        return 0.0
    digits = 1 - math.floor(math.log10(value))
    scale = 10.0**digits
    return round(to_whole(round(value * scale, 6)) / scale, digits)
