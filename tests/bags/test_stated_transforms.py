"""Transforms read from bytes are those that rosbags deserialises; what rosbags refuses is left to it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from garment_dataset.bags import open_bag
from garment_dataset.bags.definitions import UNREADABLE
from garment_dataset.bags.stated_transforms import StatedTransform, read_stated_transforms, stated_transforms

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

TF = "tf2_msgs/msg/TFMessage"
STORE = get_typestore(Stores.ROS1_NOETIC)
STORE.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", TF))

numbers = st.floats(width=64, allow_nan=False)
said = st.tuples(
    st.integers(0, 2**31 - 1),
    st.integers(0, 2**32 - 1),
    st.text(st.characters(codec="utf-8"), max_size=8),
    st.text(max_size=3),
    st.tuples(*[numbers] * 7),
)


def serialised(rows: list[tuple[int, int, str, str, tuple[float, ...]]]) -> bytes:
    types = STORE.types
    header, time = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    vector, quaternion = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    transform, stamped = types["geometry_msgs/msg/Transform"], types["geometry_msgs/msg/TransformStamped"]
    transforms = [
        stamped(header(7, time(*when), parent), child, transform(vector(*of[:3]), quaternion(*of[3:])))
        for *when, parent, child, of in rows
    ]
    return bytes(STORE.serialize_ros1(types[TF](transforms), TF))


@given(st.lists(said, max_size=4), st.data())
def test_bytes_are_read_as_rosbags_does_or_not_at_all(rows: list[Any], data: st.DataObject) -> None:
    message = bytearray(serialised(rows))
    for _ in range(data.draw(st.integers(0, 2))):
        message[data.draw(st.integers(0, len(message) - 1))] ^= data.draw(st.integers(0, 255))
    changed = bytes(message[: data.draw(st.integers(0, len(message)))]) if data.draw(st.booleans()) else bytes(message)
    found = read_stated_transforms(memoryview(changed))
    try:
        expected = stated_transforms(STORE.deserialize_ros1(changed, TF))
    except UNREADABLE:
        assert found is None
        return
    assert found is not None
    assert repr(found) == repr(expected)


def test_a_whole_message_is_read() -> None:
    message = memoryview(serialised([(3, 5, "a", "é", (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0))]))
    expected = StatedTransform("a", "é", 3_000_000_005, (0.0, 1.0, 2.0), (3.0, 4.0, 5.0, 6.0))
    assert read_stated_transforms(message) == [expected]


@pytest.mark.parametrize("compression", ["none", "lz4"])
def test_messages_that_differ_in_their_stamp_alone_are_one(
    ros1: Any, write_bag: Callable[..., Path], compression: str
) -> None:
    kind = "sensor_msgs/msg/CompressedImage"
    frames = ["a", "a", "b", "a"]
    entries = [
        ("/depth", kind, 10**18 + number, ros1.compressed(b"x", "png", stamp_ns=10**18 + number, frame_id=frame))
        for number, frame in enumerate(frames)
    ]
    with open_bag(write_bag(entries, compression)) as bag:
        found = [(message.index, message.data.header.frame_id, count) for message, count in bag.distinct("/depth")]
        assert found == [(0, "a", 3), (2, "b", 1)]
        assert bag.distinct("/nothing") == []
