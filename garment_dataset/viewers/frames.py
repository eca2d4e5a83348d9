"""The frames of a recording one after the other, each with all that was found in it."""

from __future__ import annotations

import heapq
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from garment_dataset.errors import BagError
from garment_dataset.vision.depth.garment_pixels import garment_mask

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from garment_dataset.arrays import BoolArray, ColorImage, DepthImage, FloatArray, IntArray
    from garment_dataset.bags import Bag, ImageMessage
    from garment_dataset.viewers.content import Content, Stream


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """The gripper in the optical frame of a stream.

    Parameters
    ----------
    position_m : (3,) float64
        Its end point.
    quaternion_xyzw : (4,) float64 or None
        From the gripper's frame to the optical frame; None where it is not known.
    """

    position_m: FloatArray
    quaternion_xyzw: FloatArray | None


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """The points of one frame that were found.

    Parameters
    ----------
    number : (r,) int64
        From the gripper down, 1 next to it.
    position_m, std_m : (r, 3) float64
        In the depth optical frame; standard uncertainties.
    """

    number: IntArray
    position_m: FloatArray
    std_m: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class DepthFrame:
    """A depth image and what was found in it; all positions in its optical frame.

    Parameters
    ----------
    frame : int
        Index of the image.
    stamp_ns : int
        When the camera saw it.
    depth_mm : (H, W) uint16 or None
        Valid until the next frame is asked for; None without a bag.
    mask : (H, W) bool or None
        The garment's pixels; None without an image of the camera's size, or without a gripper.
    gripper : Pose or None
        None where it is not known.
    chain_m : (n, 3) float64
        Profile below the gripper; no rows where there is none.
    points, tracks : Points
        Without rows where there are none.
    """

    frame: int
    stamp_ns: int
    depth_mm: DepthImage | None
    mask: BoolArray | None
    gripper: Pose | None
    chain_m: FloatArray
    points: Points
    tracks: Points


@dataclass(frozen=True, slots=True, eq=False)
class ColorFrame:
    """A colour image and what was found in it.

    Parameters
    ----------
    frame : int
        Index of the image.
    stamp_ns : int
        When the camera saw it.
    rgb : (H, W, 3) uint8 or None
        Valid until the next frame is asked for; None without a bag.
    gripper : Pose or None
        In the colour optical frame; None where it is not known.
    mask_png : bytes or None
        The silhouette, white on black; None where there is none.
    outline_px, curve_px : (n, 2) float64
        Closed outline of the silhouette, and its central curve: u, v. No rows where there is none.
    """

    frame: int
    stamp_ns: int
    rgb: ColorImage | None
    gripper: Pose | None
    mask_png: bytes | None
    outline_px: FloatArray
    curve_px: FloatArray


class Frames:
    """The usable frames of both streams, in the order of their stamps; one image of each is in memory at a time.

    Parameters
    ----------
    content : Content
        Of the recording.
    """

    def __init__(self, content: Content) -> None:
        self._content = content
        self._usable = {stream: content.usable(stream) for stream in content.cameras}
        self._by_frame: dict[tuple[str, int], pd.DataFrame] = {
            (name, int(str(frame))): rows
            for name in ("chains", "points", "tracks", "silhouettes", "central_curves")
            if name in content.tables
            for frame, rows in content.tables[name].groupby("frame")
        }
        self._grippers = {
            (str(stream), int(frame)): _pose(values)
            for stream, frame, *values in content.tables["gripper"][
                ["stream", "frame", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"]
            ].itertuples(index=False)
        }

    def __iter__(self) -> Iterator[DepthFrame | ColorFrame]:
        """Yield them.

        Raises
        ------
        BagError
            If the bag cannot be read, or is not the one that the results are of.
        """
        with ExitStack() as stack:
            bag = None
            if self._content.bag is not None:
                from garment_dataset.bags import open_bag

                bag = stack.enter_context(open_bag(self._content.bag))
            streams = [self._images(bag, stream) for stream in self._content.cameras]
            for _, stream, frame, image in heapq.merge(*streams, key=lambda each: each[0]):
                stamp_ns = self._usable[stream][frame]
                yield self._depth(frame, stamp_ns, image) if stream == "depth" else self._color(frame, stamp_ns, image)

    def _images(self, bag: Bag | None, stream: Stream) -> Iterator[tuple[int, Stream, int, ImageMessage | None]]:
        """Yield the usable images of one stream behind what they are merged by: the latest stamp until there."""
        usable, latest_ns, seen = self._usable[stream], 0, 0
        images = (
            ((frame, None) for frame in usable)
            if bag is None
            else ((image.index, image) for image in bag.images(self._content.cameras[stream].topic, stream))
        )
        for frame, image in images:
            if frame not in usable:
                continue
            if image is not None and image.stamp_ns != usable[frame]:
                self._refuse(f"{stream} image {frame} has another stamp")
            latest_ns, seen = max(latest_ns, usable[frame]), seen + 1
            yield latest_ns, stream, frame, image
        if seen < len(usable):
            self._refuse(f"{seen} of {len(usable)} {stream} images")

    def _refuse(self, found: str) -> None:
        raise BagError(
            "is not the bag that the results are of",
            where=self._content.bag,
            found=found,
            hint="`garment build` makes them anew.",
        )

    def _depth(self, frame: int, stamp_ns: int, image: ImageMessage | None) -> DepthFrame:
        content, gripper = self._content, self._grippers.get(("depth", frame))
        depth_mm = None if image is None else image.pixels(content.depth_reading)
        camera, mask = content.cameras["depth"], None
        if depth_mm is not None and gripper is not None and depth_mm.shape == (camera.height_px, camera.width_px):
            x_m, y_m, z_m = gripper.position_m.tolist()
            mask = garment_mask(
                depth_mm,
                camera.intrinsics,
                (x_m, y_m, z_m),
                band_half_width_m=content.mask.band_half_width_m,
                hold_reach_m=content.mask.hold_reach_m,
            )
        chain = self._rows("chains", frame)
        return DepthFrame(
            frame,
            stamp_ns,
            depth_mm,
            mask,
            gripper,
            np.empty((0, 3)) if chain is None else _columns(chain, "x_m", "y_m", "z_m"),
            _points(self._rows("points", frame)),
            _points(self._rows("tracks", frame)),
        )

    def _color(self, frame: int, stamp_ns: int, image: ImageMessage | None) -> ColorFrame:
        silhouette, curve = self._rows("silhouettes", frame), self._rows("central_curves", frame)
        mask_png, outline_px = None, np.empty((0, 2))
        if silhouette is not None and silhouette["mask"].iloc[0] is not None:
            row = silhouette.iloc[0]
            mask_png = bytes(row["mask"])
            outline_px = np.stack([row["outline_u_px"], row["outline_v_px"]], axis=1).astype(np.float64)
            outline_px = np.concatenate([outline_px, outline_px[:1]])
        return ColorFrame(
            frame,
            stamp_ns,
            None if image is None else image.pixels(),
            self._grippers.get(("color", frame)),
            mask_png,
            outline_px,
            np.empty((0, 2)) if curve is None else _columns(curve, "u_px", "v_px"),
        )

    def _rows(self, table: str, frame: int) -> pd.DataFrame | None:
        return self._by_frame.get((table, frame))


def _pose(values: list[Any]) -> Pose | None:
    numbers = np.array(values, np.float64)
    if not np.isfinite(numbers[:3]).all():
        return None
    return Pose(numbers[:3], numbers[3:] if np.isfinite(numbers[3:]).all() else None)


def _points(rows: pd.DataFrame | None) -> Points:
    if rows is None:
        return Points(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3)))
    found = rows.dropna(subset=["x_m", "y_m", "z_m"])
    return Points(
        found["point"].to_numpy(np.int64),
        _columns(found, "x_m", "y_m", "z_m"),
        _columns(found, "x_std_m", "y_std_m", "z_std_m"),
    )


def _columns(rows: pd.DataFrame, *names: str) -> FloatArray:
    return rows[list(names)].to_numpy(np.float64)
