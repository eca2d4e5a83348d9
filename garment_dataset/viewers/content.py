"""What there is to show of a recording: its tables, its cameras, its time, and what is missing."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from garment_dataset.errors import StoreError
from garment_dataset.features.reading import read_result, result_files, result_params, variant_folder
from garment_dataset.vision.depth.cloud import Intrinsics

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

    from garment_dataset.arrays import FloatArray, IntArray
    from garment_dataset.bags import DepthReading, Transform
    from garment_dataset.catalog import CatalogRow
    from garment_dataset.layout import Layout

Stream = Literal["depth", "color"]

_SHOWN = ("chains", "points", "tracks", "kinematics", "silhouettes", "central_curves", "joints", "world")
_STAGES = {
    "chains": "depth_points",
    "points": "depth_points",
    "silhouettes": "silhouette",
    "central_curves": "central_curve",
    "joints": "decode",
    "world": "decode",
}
"""Which stage makes a table, where it is not called after it."""


@dataclass(frozen=True, slots=True)
class ShownCamera:
    """The camera of one stream.

    Parameters
    ----------
    stream : {"depth", "color"}
        Whose.
    frame_id : str
        Name of the optical frame: x right, y down, z forward.
    width_px, height_px : int
        Size of the images.
    intrinsics : Intrinsics
        Focal lengths and principal point.
    distortion_model : str
        As in ``sensor_msgs/CameraInfo``.
    distortion : tuple of float
        Coefficients of that model.
    topic : str
        Where the recording has its images.
    """

    stream: Stream
    frame_id: str
    width_px: int
    height_px: int
    intrinsics: Intrinsics
    distortion_model: str
    distortion: tuple[float, ...]
    topic: str


@dataclass(frozen=True, slots=True)
class MaskSettings:
    """Where the garment can be in a depth image; as in the parameters of ``depth_points``."""

    band_half_width_m: float
    hold_reach_m: float


@dataclass(frozen=True, eq=False)
class Content:
    """A recording as it is shown.

    Parameters
    ----------
    recording : str
        Its name.
    bag : Path or None
        Where its images are; None: they are not to be had.
    main : {"depth", "color"}
        The stream that its axis is about, or the one that there is.
    cameras : dict of str to ShownCamera
        By stream, of those that have usable images.
    start_ns : int
        Stamp of the first usable image: where time begins.
    tables : dict of str to DataFrame
        What is built, by name; ``frames``, ``camera`` and ``gripper`` always.
    mask : MaskSettings
        Which pixels of depth are the garment's.
    gripper_frame : str
        Name of the gripper's frame.
    other_in_main : Transform or None
        Takes points of the other stream's optical frame into that of the main one; None where that is not known.
    left_out : tuple of str
        What is not shown, and what to do about it, one line each.
    """

    recording: str
    bag: Path | None
    main: Stream
    cameras: dict[Stream, ShownCamera]
    start_ns: int
    tables: dict[str, pd.DataFrame]
    mask: MaskSettings
    gripper_frame: str
    other_in_main: Transform | None
    left_out: tuple[str, ...]

    def usable(self, stream: Stream) -> dict[int, int]:
        """Return the stamp in ns of each usable image of a stream, by its index."""
        frames = self.tables["frames"]
        kept = frames[(frames["stream"] == stream) & frames["fault"].isna()]
        return {int(frame): int(stamp) for frame, stamp in zip(kept["frame"], kept["stamp_ns"], strict=True)}

    def main_frames(self, stamps_ns: IntArray) -> IntArray:
        """Return the index of the main stream's image at or before some stamps; before the first one, the first."""
        frames, latest_ns = self._main_times
        found: IntArray = frames[np.maximum(np.searchsorted(latest_ns, stamps_ns, side="right") - 1, 0)]
        return found

    @cached_property
    def _main_times(self) -> tuple[IntArray, IntArray]:
        """Indices of the main stream's images, and the latest stamp until each: one that steps back ends none."""
        usable = self.usable(self.main)
        stamps_ns = np.array(list(usable.values()), np.int64)
        return np.array(list(usable), np.int64), np.maximum.accumulate(stamps_ns)

    @property
    def depth_reading(self) -> DepthReading:
        """In which unit and byte order the build has read the depths."""
        from garment_dataset.bags import DepthReading

        row = self.tables["camera"].query("stream == 'depth'").iloc[0]
        return DepthReading(float(row["depth_unit_mm"]), bool(row["bytes_swapped"]))

    @property
    def gravity(self) -> FloatArray | None:
        """Unit vector of gravity in the main stream's optical frame, (3,); None where it is not known."""
        return self.gravity_of(self.main)

    def gravity_of(self, stream: Stream) -> FloatArray | None:
        """Return the unit vector of gravity in the optical frame of a stream, (3,); None where it is not known."""
        if "world" not in self.tables:
            return None
        rows = self.tables["world"].loc[lambda frame: frame["stream"] == stream]
        vector = rows[["gravity_x", "gravity_y", "gravity_z"]].to_numpy(np.float64)
        return vector[0] if len(vector) and np.isfinite(vector[0]).all() else None


def gather(layout: Layout, row: CatalogRow, variant: str = "") -> Content:
    """Gather what is shown of a recording.

    Parameters
    ----------
    layout : Layout
        Holds the results.
    row : CatalogRow
        The recording; its bag may be missing.
    variant : str
        Whose results; by default those of the pipelines without a variant.

    Raises
    ------
    StoreError
        If it was not built, or not one of its images can be used.
    """
    folder = variant_folder(layout.features_dir, variant)
    tables = {name: rows for name in ("frames", "camera", "gripper", *_SHOWN) if (rows := _rows(folder, name, row))}
    if missing := [name for name in ("frames", "camera", "gripper") if name not in tables]:
        raise StoreError(
            f"nothing to show: no {missing[0]}",
            where=row.recording,
            expected="results of the stage decode",
            hint="`garment build` makes them.",
        )
    params = {name: result_params(name, row.recording, folder=layout.features_dir, variant=variant) for name in tables}
    read = {name: read_result(path) for name, path in tables.items()}
    cameras = _cameras(read["frames"], read["camera"])
    if not cameras:
        raise StoreError("nothing to show: no usable images", where=row.recording, hint="`garment show` says why.")
    frames = read["frames"]
    wanted: Stream = "depth" if row.axis == "R" else "color"
    main = wanted if wanted in cameras else next(iter(cameras))
    stamps_ns = frames.loc[frames["fault"].isna(), "stamp_ns"].tolist()
    between = _between(row.path, params["gripper"], cameras, main, stamps_ns)
    return Content(
        row.recording,
        row.path,
        main,
        cameras,
        min(stamps_ns),
        read,
        _mask_settings(params.get("points")),
        str(params["gripper"]["gripper_frame"]).lstrip("/") or "gripper",
        between,
        tuple(_left_out(row, read, is_rig_known=between is not None or len(cameras) < 2)),
    )


def _rows(folder: Path, table: str, row: CatalogRow) -> Path | None:
    return next((path for path in result_files(folder, table) if path.stem == row.recording), None)


def _cameras(frames: pd.DataFrame, camera: pd.DataFrame) -> dict[Stream, ShownCamera]:
    """Return the cameras of the streams that have usable images."""
    topics = frames[frames["fault"].isna()].groupby("stream")["topic"].first()
    found: dict[Stream, ShownCamera] = {}
    for each in camera.to_dict("records"):
        if each["stream"] in topics:
            found[each["stream"]] = ShownCamera(
                each["stream"],
                str(each["frame_id"]).lstrip("/") or f"{each['stream']}_optical_frame",
                int(each["width_px"]),
                int(each["height_px"]),
                Intrinsics(*(float(each[name]) for name in ("fx_px", "fy_px", "cx_px", "cy_px"))),
                str(each["distortion_model"]),
                tuple(float(value) for value in each["distortion"]),
                str(topics[each["stream"]]),
            )
    return found


def _mask_settings(params: dict[str, Any] | None) -> MaskSettings:
    """Return the settings that the points were made with; without points, the usual ones."""
    if params is None:
        from garment_dataset.stages.depth_points import DepthPointsParams

        params = DepthPointsParams().model_dump()
    return MaskSettings(float(params["band_half_width_m"]), float(params["hold_reach_m"]))


def _between(
    path: Path | None,
    params: dict[str, Any],
    cameras: dict[Stream, ShownCamera],
    main: Stream,
    stamps_ns: list[int],
) -> Transform | None:
    """Return how the other camera stands to the main one, by the names that the stage decode was given."""
    if path is None or len(cameras) < 2:
        return None
    from garment_dataset.bags import open_bag
    from garment_dataset.viewers.rig import camera_in_camera

    names: dict[Stream, str] = {"depth": "camera_frame", "color": "color_camera_frame"}
    frames = {stream: str(params[name]).lstrip("/") or cameras[stream].frame_id for stream, name in names.items()}
    other: Stream = "color" if main == "depth" else "depth"
    with open_bag(path) as bag:
        return camera_in_camera(
            bag,
            frames[main],
            frames[other],
            stamps_ns,
            topics=(str(params["tf_topic"]), str(params["tf_static_topic"])),
            max_stamp_offset_s=float(params["max_stamp_offset_s"]),
        )


def _left_out(row: CatalogRow, tables: dict[str, pd.DataFrame], *, is_rig_known: bool) -> list[str]:
    usable = tables["frames"][tables["frames"]["fault"].isna()]
    blind = sorted({*usable["stream"]} - {*tables["camera"]["stream"]})
    lines = [f"left out, as nothing is known of their camera: {name} images; `garment show` says why" for name in blind]
    if row.path is None:
        lines.append(f"left out, as the bag of {row.recording} is missing: images and cloud; put it into recordings/")
    elif not is_rig_known:
        lines.append("left out, as the recorded transforms do not say it: how the two cameras stand to each other")
    if missing := [name for name in _SHOWN if name not in tables]:
        stages = dict.fromkeys(_STAGES.get(name, name) for name in missing)
        lines.append(
            f"left out, as not built: {', '.join(missing)}; name {', '.join(stages)} in a pipeline of {row.recording}, "
            "then `garment build`"
        )
    return lines
