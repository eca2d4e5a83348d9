"""Real frames of a real sensor, shown: every image, and the sensor's depth as it was."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest

from garment_dataset.bags import open_bag
from garment_dataset.viewers.content import gather
from garment_dataset.viewers.mcap_file import save_mcap
from garment_dataset.viewers.rerun_log import save_rrd
from tests.conftest import make_workspace

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.real

NAME = "RealGarments_Floor_01_pi16_0.1_R1"


def test_real_stills_are_shown_in_both_viewers(real_data: Path, tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="Rerun's files need the extra rerun")
    pytest.importorskip("mcap", reason="MCAP files need the extra mcap")
    from rerun.chunk import RrdReader

    place = make_workspace(tmp_path / "real")
    source = real_data / "recordings" / f"{NAME}.bag"
    (place.recordings_dir / source.name).symlink_to(source)
    place.build(jobs=0)
    content = gather(place, place.catalog().row(NAME))
    save_rrd(content, tmp_path / "a.rrd")
    save_mcap(content, tmp_path / "a.mcap")
    with open_bag(source) as bag:
        pixels = [image.pixels().copy() for image in bag.images("/xtion1/depth/image_raw", "depth")]
    chunks = [chunk for chunk in RrdReader(tmp_path / "a.rrd").stream() if str(chunk.entity_path).endswith("depth_mm")]
    blobs = [row["EncodedDepthImage:blob"][0] for chunk in chunks for row in chunk.to_record_batch().to_pylist()]
    with open_bag(tmp_path / "a.mcap") as bag:
        exported = [image.pixels().copy() for image in bag.images("/xtion1/depth/image_raw", "depth")]
        assert bag.topics["/xtion1/rgb/image_raw/compressed"].count == len(pixels)
    for blob, other, expected in zip(blobs, exported, pixels, strict=True):
        decoded = cv2.imdecode(np.frombuffer(bytes(blob), np.uint8), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(decoded, expected)
        np.testing.assert_array_equal(other, expected)
