"""Follow the points of the rest on the material: docs/tracks.md."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pydantic import Field

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.stages.cameras import depth_reading
from garment_dataset.stages.columns import FRAME, PLACE, STAMP
from garment_dataset.stages.inputs import known_grippers_m, usable_stamps_ns
from garment_dataset.stages.stage import Stage, StageParams

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import pyarrow as pa

    from garment_dataset.arrays import DepthImage, FloatArray, IntArray
    from garment_dataset.stages.depth_images import DepthImages
    from garment_dataset.vision.cloth.tracks import TrackReason, Tracks
    from garment_dataset.vision.cloth.warp import WarpSettings
    from garment_dataset.vision.depth.cloud import Intrinsics

TRACKS = TableSpec(
    "tracks",
    1,
    "one followed point of one depth frame",
    (
        FRAME,
        STAMP,
        Column("point", "int32", "1", "number of the point, as in points: at rest it is there"),
        *PLACE,
        Column(
            "visible", "bool", "1", "whether the image shows the cloth there; else the rest of it tells", nullable=True
        ),
        Column("reason", "string", "", "why there is no point; null when there is one", nullable=True),
    ),
    keys=("frame", "point"),
)


class TracksParams(StageParams):
    """Where the garment can be, what its rest is, and how its cloth can move."""

    band_half_width_m: float = Field(default=0.27, gt=0, description="depth from the gripper's that is kept, eq. (5.8)")
    reach_m: float = Field(default=0.25, gt=0, description="x from the gripper's that is kept")
    rest_threshold_m: float = Field(default=0.002, gt=0, description="distance of the gripper that ends the rest")
    rest_margin_frames: int = Field(default=2, ge=0, description="frames before that end that are not taken for rest")
    rest_frames: int = Field(default=12, ge=1, description="frames of the rest that are averaged")
    least_rest_frames: int = Field(default=3, ge=1, description="with fewer nothing is followed")
    depth_std_m: float = Field(default=0.003, gt=0, description="error of one sample of a depth image: a level")
    edge_std_m: float = Field(default=0.003, gt=0, description="error of an edge of the cloth in a row: two pixels")
    strain: float = Field(default=0.02, gt=0, description="by how much a distance along the cloth may change, relative")
    bending_std_m: float = Field(
        default=0.004, gt=0, description="by how much neighbouring controls, 3 to 4 cm apart, move unlike each other"
    )
    acceleration_m_s2: float = Field(
        default=3.0, gt=0, description="of the cloth relative to the gripper: a swing of 0.2 m and 1 Hz has 4 at most"
    )
    caution: float = Field(
        default=2.0,
        gt=0,
        description="by how much errors exceed what the terms above let expect, chosen on docs/tracks.md",
    )
    fold_share: float = Field(
        default=0.2,
        ge=0,
        description="standard uncertainty of x over the root of the folds' depth at rest times the way since: a fold "
        "may roll over the cloth; chosen on docs/tracks.md",
    )
    flat_field_frames: int = Field(
        default=8, ge=1, description="images from which the fixed errors of the columns are measured"
    )
    flat_field_beyond_m: float = Field(
        default=1.4, gt=0, description="what is farther is background, and may be a plane to measure them on"
    )

    def rest(self, ends_m: FloatArray) -> IntArray | None:
        """Return which of the gripper's end points (T, 3) are those of the rest."""
        from garment_dataset.vision.cloth.tracks import frames_at_rest

        return frames_at_rest(
            ends_m,
            threshold_m=self.rest_threshold_m,
            margin=self.rest_margin_frames,
            most=self.rest_frames,
            least=self.least_rest_frames,
        )

    def warp_settings(self) -> WarpSettings:
        """Return the knobs of the numerics."""
        from garment_dataset.vision.cloth.warp import WarpSettings

        return WarpSettings(
            depth_std_m=self.depth_std_m,
            outline_std_m=self.edge_std_m,
            strain=self.strain,
            bending_std_m=self.bending_std_m,
            acceleration_m_s2=self.acceleration_m_s2,
            caution=self.caution,
            fold_share=self.fold_share,
        )


def tracks(
    bag: Path, frames: pa.Table, camera: pa.Table, gripper: pa.Table, points: pa.Table, params: TracksParams
) -> dict[str, pa.Table]:
    """Follow the points that divide the garment at rest.

    Parameters
    ----------
    bag : Path
        The recording.
    frames, camera, gripper, points : pyarrow.Table
        As ``decode`` and ``depth_points`` made them; rows are matched by the index of the image.
    params : TracksParams
        See there.

    Returns
    -------
    dict of str to pyarrow.Table
        ``tracks``: for every usable depth frame a row per point, null with a reason where there is none.

    Raises
    ------
    BagError
        If the depth stream has no camera.
    """
    import numpy as np

    from garment_dataset.bags import open_bag
    from garment_dataset.stages.depth_images import DepthImages, depth_camera

    stamps_ns = usable_stamps_ns(frames, "depth")
    numbers = np.unique(points["point"].to_numpy()).tolist()
    reasons: dict[int, TrackReason] = {}
    found: Tracks | TrackReason = "no_rest"
    kept: list[int] = []
    if stamps_ns:
        shape, intrinsics = depth_camera(bag, camera)
        grippers_m = known_grippers_m(gripper, "depth")
        with open_bag(bag) as opened:
            read = DepthImages(opened, frames, shape, depth_reading(camera))
            kept, reasons = _usable(read, stamps_ns, grippers_m)
            ends_m = np.array([grippers_m[frame] for frame in kept]).reshape(-1, 3)
            rest = params.rest(ends_m)
            if rest is not None:
                stamps = np.array([stamps_ns[frame] for frame in kept], np.int64)
                start = _starts(points, [kept[row] for row in rest], ends_m[rest].mean(axis=0), numbers)
                found = _follow(read, kept, stamps, ends_m, rest, start, intrinsics, params)
    return {"tracks": TRACKS.table(_columns(stamps_ns, kept, found, reasons, numbers))}


def _usable(
    read: DepthImages, stamps_ns: dict[int, int], grippers_m: dict[int, tuple[float, float, float]]
) -> tuple[list[int], dict[int, TrackReason]]:
    """Return the images that can be followed, and why others cannot."""
    import numpy as np

    from garment_dataset.vision.kinematics import increasing

    reasons: dict[int, TrackReason] = {}
    usable: list[int] = []
    for frame, depth_mm in read:
        if depth_mm is None or frame not in grippers_m:
            reasons[frame] = "image_size" if depth_mm is None else "no_gripper"
        else:
            usable.append(frame)
    later = increasing(np.array([stamps_ns[frame] for frame in usable], np.int64)).tolist() if usable else []
    for frame, is_later in zip(usable, later, strict=True):
        if not is_later:
            reasons[frame] = "stamp"
    return [frame for frame in usable if frame not in reasons], reasons


def _images(read: DepthImages, wanted: frozenset[int]) -> Iterator[DepthImage]:
    """Yield some images; each holds until the next."""
    yield from (depth_mm for _, depth_mm in replace(read, only=wanted) if depth_mm is not None)


def _starts(
    points: pa.Table, rest: list[int], gripper_m: FloatArray, numbers: list[int]
) -> tuple[FloatArray, FloatArray]:
    """Return where the points are at rest, relative to the gripper, and how well that is known, both (r, 3).

    A point that is missing in half of the frames has no start. Errors at rest stand still: their mean is no better.
    """
    import numpy as np

    table = points.to_pandas()
    table = table[table["frame"].isin(rest)]
    position_m, std_m = np.full((2, len(numbers), 3), np.nan)
    for row, number in enumerate(numbers):
        own = table[table["point"] == number]
        place_m = own[["x_m", "y_m", "z_m"]].dropna()
        if 2 * len(place_m) > len(rest):
            position_m[row] = place_m.to_numpy(np.float64).mean(axis=0) - gripper_m
            std_m[row] = np.nan_to_num(own[["x_std_m", "y_std_m", "z_std_m"]].mean().to_numpy(np.float64))
    return position_m, std_m


def _follow(
    read: DepthImages,
    kept: list[int],
    stamp_ns: IntArray,
    ends_m: FloatArray,
    rest: IntArray,
    start: tuple[FloatArray, FloatArray],
    intrinsics: Intrinsics,
    params: TracksParams,
) -> Tracks | TrackReason:
    import numpy as np

    from garment_dataset.vision.cloth.sight import Reading
    from garment_dataset.vision.cloth.tracks import follow
    from garment_dataset.vision.depth.flat_field import column_offsets, inverse_depth_table
    from garment_dataset.vision.depth.scale import spread_over

    some = [np.array(image) for image in _images(read, spread_over(kept, params.flat_field_frames))]
    table_per_m, on_ladder = inverse_depth_table(some)
    offset = column_offsets(some, table_per_m, beyond_m=params.flat_field_beyond_m) if on_ladder else None
    reading = Reading(table_per_m, offset, params.band_half_width_m, params.reach_m)
    time_s = (stamp_ns - stamp_ns[0]) / 1e9
    found = follow(
        _images(read, frozenset(kept)), time_s, ends_m, rest, *start, intrinsics, reading, params.warp_settings()
    )
    return "no_garment" if found is None else found


def _columns(
    stamps_ns: dict[int, int],
    kept: list[int],
    found: Tracks | TrackReason,
    reasons: dict[int, TrackReason],
    numbers: list[int],
) -> dict[str, Any]:
    """Return the columns of the table."""
    import numpy as np

    index, count = {frame: row for row, frame in enumerate(kept)}, len(numbers)
    position_m, std_m = np.full((2, len(stamps_ns), count, 3), np.nan)
    visible: list[bool | None] = []
    why: list[str | None] = []
    for row, frame in enumerate(stamps_ns):
        if frame not in index or isinstance(found, str):
            visible += [None] * count
            why += [reasons.get(frame, "no_rest" if not isinstance(found, str) else found)] * count
            continue
        own = index[frame]
        position_m[row], std_m[row] = found.position_m[own], found.std_m[own]
        known = np.isfinite(position_m[row]).all(axis=1).tolist()
        visible += [seen if there else None for seen, there in zip(found.visible[own].tolist(), known, strict=True)]
        why += [None if there else "no_start" for there in known]
    return {
        "frame": np.repeat(np.array(list(stamps_ns), np.int64), count),
        "stamp_ns": np.repeat(np.array(list(stamps_ns.values()), np.int64), count),
        "point": np.tile(np.array(numbers, np.int64), len(stamps_ns)),
        **{f"{axis}_m": position_m[..., k].ravel() for k, axis in enumerate("xyz")},
        **{f"{axis}_std_m": std_m[..., k].ravel() for k, axis in enumerate("xyz")},
        "visible": visible,
        "reason": why,
    }


STAGE = Stage(tracks, params=TracksParams, outputs=(TRACKS,))
