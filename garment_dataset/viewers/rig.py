"""How the two cameras of a recording stand to each other, by its recorded transforms."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.bags.recorded_transforms import RecordedTransforms
from garment_dataset.bags.transforms import LookupFailedError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.bags import Bag, Transform

_STILL_M, _STILL_ROTATION = 0.001, 0.002
"""By more than that, in space and in a component of the quaternion (0.2 degrees), no rigid rig moves."""


def camera_in_camera(
    bag: Bag,
    target: str,
    source: str,
    stamps_ns: Sequence[int],
    *,
    topics: tuple[str, str],
    max_stamp_offset_s: float,
) -> Transform | None:
    """Return the transform that takes points of one camera's optical frame into another's.

    Parameters
    ----------
    bag : Bag
        An open recording.
    target, source : str
        Names of the optical frames in the recorded transforms.
    stamps_ns : sequence of int
        Of the images.
    topics : (str, str)
        Of the transforms, and of the static ones.
    max_stamp_offset_s : float
        See :class:`~garment_dataset.bags.recorded_transforms.RecordedTransforms`.

    Returns
    -------
    Transform or None
        None where the transforms do not connect the frames, or the cameras move against each other.
    """
    tree = RecordedTransforms(bag, *topics, max_stamp_offset_s).tree
    answers = tree.lookups(target, source, stamps_ns)
    found = [each for each in answers if not isinstance(each, LookupFailedError)]
    if not found:
        return None
    first = found[0]
    moved_m = max(float(np.linalg.norm(each.translation - first.translation)) for each in found)
    # q and -q are one rotation
    alike = min(abs(float(each.quaternion_xyzw @ first.quaternion_xyzw)) for each in found)
    is_still = moved_m <= _STILL_M and 1 - alike <= _STILL_ROTATION**2 / 2
    return first if is_still else None
