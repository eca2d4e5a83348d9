"""The robot's joints as recorded, on stamps that can be believed."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.bags.recorded_transforms import header_stamp_ns, warn_of_left_out
from garment_dataset.bags.stamps import SAMPLE_DISORDER_S, Stamped, check_stamps, median_offset_ns, summarise
from garment_dataset.errors import DataWarning

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.bags.bag import Bag
    from garment_dataset.bags.messages import Message

_JOINT_STATE = "sensor_msgs/msg/JointState"


class JointSample(NamedTuple):
    """One joint in one message."""

    stamp_ns: int
    record_stamp_ns: int
    joint: str
    position_rad: float | None
    velocity_rad_s: float | None


def read_joints(bag: Bag, topic: str, *, max_stamp_offset_s: float = 10.0) -> list[JointSample]:
    """Read every joint of every message, in the order of the recording.

    Parameters
    ----------
    bag : Bag
        An open recording.
    topic : str
        Messages of type ``sensor_msgs/JointState``; positions or velocities may be absent, but not of another length
        than the names.
    max_stamp_offset_s : float
        How far header stamp less record time may be from the topic's median, in seconds.

    Warns
    -----
    DataWarning
        If the topic is missing or silent, or messages are left out: no joint states, or a header stamp that is zero,
        far from the record times, repeated or out of order among the messages that name the same joints (two drivers
        of two arms publish on one topic).
    """
    if topic not in bag.topics or not bag.topics[topic].count:
        why = f"no message on {topic}" if topic in bag.topics else f"{topic} is missing"
        warnings.warn(f"{bag.path.name}: no joints, {why}", DataWarning, stacklevel=2)
    read = list(bag.messages(topic))
    whole = [message for message in read if _is_whole(message)]
    left_out = {f"{topic}, no joint states": len(read) - len(whole)} if len(whole) < len(read) else {}
    publishers: dict[tuple[str, ...], list[Stamped]] = {}
    for message in whole:
        times = Stamped(message.index, header_stamp_ns(message.data), message.record_stamp_ns)
        publishers.setdefault(tuple(message.data.name), []).append(times)
    limits = {"max_offset_s": max_stamp_offset_s, "disorder_s": SAMPLE_DISORDER_S}
    offset_ns = median_offset_ns(times for each in publishers.values() for times in each)
    faults = {
        number: fault
        for each in publishers.values()
        for number, fault in check_stamps(each, **limits, offset_ns=offset_ns).items()
    }
    if faults:
        left_out[f"{topic}, {summarise(dict(sorted(faults.items())))}"] = len(faults)
    warn_of_left_out(bag, left_out)
    return [sample for message in whole if message.index not in faults for sample in _samples(message)]


def _is_whole(message: Message) -> bool:
    state = message.data
    return message.type == _JOINT_STATE and {len(state.position), len(state.velocity)} <= {0, len(state.name)}


def _samples(message: Message) -> Iterator[JointSample]:
    state, stamp_ns = message.data, header_stamp_ns(message.data)
    unknown = [None] * len(state.name)
    positions_rad = state.position.tolist() or unknown
    velocities_rad_s = state.velocity.tolist() or unknown
    for joint, position_rad, velocity_rad_s in zip(state.name, positions_rad, velocities_rad_s, strict=True):
        yield JointSample(stamp_ns, message.record_stamp_ns, joint, position_rad, velocity_rad_s)
