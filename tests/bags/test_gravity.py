"""Which way is down: from the transforms, where they reach a level frame."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest

from garment_dataset.bags.gravity import Gravity, read_gravity
from garment_dataset.bags.transforms import TransformTree
from garment_dataset.errors import DataWarning
from garment_dataset.simulate.robot import Robot

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from garment_dataset.bags.recorded_transforms import RecordedTransforms

OPTICAL = "xtion1_depth_optical_frame"
START = 1_391_700_000_000_000_000
IDENTITY = (0.0, 0.0, 0.0, 1.0)


def recorded(tree: TransformTree, tmp_path: Path, *, topic: bool = True) -> RecordedTransforms:
    stand_in: Any = SimpleNamespace(tree=tree, recorded=topic, bag=SimpleNamespace(path=tmp_path / "some.bag"))
    return cast("RecordedTransforms", stand_in)


def pitched(angle_rad: float) -> Sequence[float]:
    return (math.sin(angle_rad / 2), 0.0, 0.0, math.cos(angle_rad / 2))


def test_the_simulated_camera_stands_upright(tmp_path: Path) -> None:
    tree, robot = TransformTree(), Robot(None)
    for link in (*robot.fixed, *robot.links(0.0)):
        tree.add(link.parent, link.child, 0, link.translation_m, link.quaternion_xyzw, static=True)
    found = read_gravity(recorded(tree, tmp_path), [START], camera_frame=f"/{OPTICAL}", level_frame="/base_link")
    assert found.direction is not None
    np.testing.assert_allclose(found.direction, (0.0, 1.0, 0.0), atol=1e-12)
    assert (found.source, found.reason) == ("tf: base_link", None)


def test_a_camera_that_looks_down_has_gravity_ahead(tmp_path: Path) -> None:
    tree = TransformTree()
    # half a turn about x: the optical axis points down, the image's down is the base's -y
    tree.add("base_link", OPTICAL, 0, (1.0, 2.0, 3.0), pitched(math.pi), static=True)
    found = read_gravity(recorded(tree, tmp_path), [START], camera_frame=OPTICAL)
    assert found.direction is not None
    np.testing.assert_allclose(found.direction, (0.0, 0.0, 1.0), atol=1e-12)


def test_where_it_is_not_known_the_reason_is(tmp_path: Path) -> None:
    tree = TransformTree()
    tree.add("base_link", OPTICAL, START, (0.0, 0.0, 0.0), IDENTITY)
    transforms = recorded(tree, tmp_path)
    nothing = recorded(tree, tmp_path, topic=False)
    assert read_gravity(transforms, [START], camera_frame=OPTICAL, level_frame="") == unknown("no level frame")
    assert read_gravity(nothing, [START], camera_frame=OPTICAL) == unknown("not recorded")
    assert read_gravity(transforms, [START], camera_frame=OPTICAL, level_frame="map") == unknown("unknown frame")
    assert read_gravity(transforms, [START + 1], camera_frame=OPTICAL) == unknown("future")
    assert read_gravity(transforms, [], camera_frame=OPTICAL) == unknown("no images")
    assert read_gravity(transforms, [START - 1, START], camera_frame=OPTICAL).source == "tf: base_link"


def unknown(reason: str) -> Gravity:
    return Gravity(None, None, reason)


def test_a_camera_that_moves_is_announced(tmp_path: Path) -> None:
    tree = TransformTree()
    stamps_ns = [START + step * 33_000_000 for step in range(5)]
    for step, stamp_ns in enumerate(stamps_ns):
        tree.add("base_link", OPTICAL, stamp_ns, (0.0, 0.0, 0.0), pitched(math.radians(step)))
    with pytest.warns(
        DataWarning, match=r"some.bag: gravity is up to 2\.0 degrees off its mean in the depth images: the"
    ):
        found = read_gravity(recorded(tree, tmp_path), stamps_ns, camera_frame=OPTICAL)
    assert found.direction is not None
    angle_rad = math.radians(2)
    np.testing.assert_allclose(found.direction, (0.0, -math.sin(angle_rad), -math.cos(angle_rad)), atol=1e-12)
