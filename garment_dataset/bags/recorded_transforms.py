"""The transforms of a recording: read once, checked, and kept as one tree."""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from garment_dataset.bags.stamps import TRANSFORM_DISORDER_S, Stamped, check_stamps, median_offset_ns
from garment_dataset.bags.stated_transforms import TRANSFORMS
from garment_dataset.bags.transforms import TransformTree
from garment_dataset.errors import DataWarning

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from garment_dataset.bags.bag import Bag
    from garment_dataset.bags.stated_transforms import StatedTransform


class _Recorded(NamedTuple):
    """One transform as it was published: a message holds several."""

    times: Stamped
    transform: StatedTransform


def header_stamp_ns(stamped: Any) -> int:  # noqa: ANN401 - a deserialised message
    """Return the header stamp of a message, in nanoseconds since the Unix epoch."""
    stamp = stamped.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def warn_of_left_out(bag: Bag, left_out: Mapping[str, int]) -> None:
    """Tell of messages that were left out, by reason."""
    for reason, count in left_out.items():
        warnings.warn(f"{bag.path.name}: {count} messages left out: {reason}", DataWarning, stacklevel=3)


@dataclass(eq=False)
class RecordedTransforms:
    """The transforms of a bag, read when first asked for, and then kept for whoever else asks.

    Parameters
    ----------
    bag : Bag
        An open recording.
    tf_topic, tf_static_topic : str
        Messages of type ``tf2_msgs/TFMessage`` or ``tf/tfMessage``.
    max_stamp_offset_s : float
        How far header stamp less record time may be from the topic's median, in seconds.
    """

    bag: Bag
    tf_topic: str = "/tf"
    tf_static_topic: str = "/tf_static"
    max_stamp_offset_s: float = 10.0

    @property
    def recorded(self) -> bool:
        """Whether the bag has any such topic."""
        return self.tf_topic in self.bag.topics or self.tf_static_topic in self.bag.topics

    @cached_property
    def tree(self) -> TransformTree:
        """The tree of all of them; a :class:`~garment_dataset.errors.DataWarning` tells of those left out.

        Left out are malformed ones and, on the topic whose stamps mean something, those whose header stamp is zero, far
        from the record times, or out of order by more than :data:`TRANSFORM_DISORDER_S` among those of its link.
        """
        tree, left_out, moving = TransformTree(), Counter[str](), list[_Recorded]()
        for message in self.bag.transforms(self.tf_topic, self.tf_static_topic):
            if message.type not in TRANSFORMS:
                left_out[f"{message.topic}, of type {message.type} instead of {' or '.join(TRANSFORMS)}"] += 1
                continue
            for stated in message.data:
                if message.topic == self.tf_static_topic:
                    tree.add(*stated, static=True)
                else:
                    times = Stamped(len(moving), stated.stamp_ns, message.record_stamp_ns)
                    moving.append(_Recorded(times, stated))
        wrong = self._wrong_stamps(moving)
        for each in moving:
            if each.times.number not in wrong:
                tree.add(*each.transform)
        if tree.refused:
            text = f"{self.bag.path.name}: {tree.refused} malformed transforms left out"
            warnings.warn(text, DataWarning, stacklevel=2)
        warn_of_left_out(self.bag, left_out)
        return tree

    def _wrong_stamps(self, transforms: Sequence[_Recorded]) -> set[int]:
        """Return the numbers of those whose stamps must not be used; of repeated ones the tree takes the first."""
        offset_ns = median_offset_ns(each.times for each in transforms)
        links: dict[str, list[Stamped]] = {}
        for each in transforms:
            links.setdefault(each.transform.child.lstrip("/"), []).append(each.times)
        wrong: dict[int, str] = {}
        for times in links.values():
            checked = check_stamps(
                times,
                max_offset_s=self.max_stamp_offset_s,
                disorder_s=TRANSFORM_DISORDER_S,
                offset_ns=offset_ns,
            )
            wrong |= {number: fault.text for number, fault in checked.items() if fault.kind != "repeat"}
        if wrong:
            text = f"{len(wrong)} of {len(transforms)} transforms on {self.tf_topic} left out"
            where = f"{self.bag.path.name}: {text}"
            warnings.warn(f"{where}, first: {next(iter(wrong.values()))}", DataWarning, stacklevel=3)
        return set(wrong)
