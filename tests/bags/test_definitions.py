"""Damaged definitions are a reason why messages cannot be read, and never an exception of what reads them."""

from __future__ import annotations

import pytest
from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat
from rosbags.typesys import Stores, get_typestore

from garment_dataset.bags.definitions import has_common_transforms, typestore_of

STAMPED = get_typestore(Stores.ROS1_NOETIC).generate_msgdef("geometry_msgs/msg/TransformStamped")[0]
OF_TRANSFORMS = "geometry_msgs/TransformStamped[] transforms\n"
TRANSFORMS = f"{OF_TRANSFORMS}{'=' * 80}\nMSG: geometry_msgs/TransformStamped\n{STAMPED}"


def definition(text: str) -> MessageDefinition:
    return MessageDefinition(MessageDefinitionFormat.MSG, text)


def test_a_type_whose_name_cannot_be_a_name_is_refused() -> None:
    text = f"uint8 x\n{'=' * 80}\nMSG: 3ensor_msgs/Region\nuint8 x\n"
    assert isinstance(typestore_of("pkg/msg/Any", definition(text)), str)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (TRANSFORMS, True),
        (OF_TRANSFORMS, True),  # some recorders write the outermost alone
        (TRANSFORMS.replace("float64 w", "float64 w\nfloat64 v"), False),
        (TRANSFORMS.replace("string child_frame_id", "string child_frame_id\nuint8 more"), False),
        (TRANSFORMS.replace("[] transforms", "[] transforms\nuint8 more"), False),
        (TRANSFORMS.replace("[] transforms", "[2] transforms"), False),
        ("uint8 x\n", False),
        ("nonsense", False),
    ],
)
def test_only_the_common_transforms_are_read_from_their_bytes(text: str, expected: bool) -> None:
    assert has_common_transforms("tf2_msgs/msg/TFMessage", definition(text)) is expected
