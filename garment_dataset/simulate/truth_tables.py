"""The truth as Parquet: one file for the points, one for the silhouettes, each column with its unit."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from garment_dataset.engine.table import Column
from garment_dataset.simulate import truth
from garment_dataset.simulate.followed import seen_on
from garment_dataset.simulate.scene import COLOR_CAMERA

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from garment_dataset.simulate.render import ColorFrame
    from garment_dataset.simulate.timing import FrameTimes
    from garment_dataset.simulate.truth import GarmentView

_FRAME = Column("frame", "int32", "1", "index of the image in its stream, from 0")
_STAMP = Column("stamp_ns", "int64", "ns", "header stamp: the time of which this is true, since the Unix epoch")
_SIDES = (("x", "right"), ("y", "down"), ("z", "forward"))


def _vector(prefix: str, what: str, *, nullable: bool) -> tuple[Column, ...]:
    places = (
        Column(f"{prefix}_{axis}_m", "float64", "m", f"{what}, depth optical frame, {side}", nullable)
        for axis, side in _SIDES
    )
    speeds = (
        Column(f"{prefix}_v{axis}_m_s", "float64", "m/s", f"velocity of {what}, {side}", nullable)
        for axis, side in _SIDES
    )
    return (*places, *speeds)


POINT_COLUMNS = (
    _FRAME,
    _STAMP,
    Column("point", "int32", "1", "number of the point, 1 next to the gripper"),
    *_vector("surface", "the point on the visible surface", nullable=True),
    Column("surface_length_m", "float64", "m", "length of the visible profile below the gripper", nullable=True),
    Column("surface_in_image", "bool", "1", "whether the depth image holds the point on the visible surface"),
    *_vector("material", "the point on the material line", nullable=False),
    Column("material_length_m", "float64", "m", "length of the material line at this time"),
    *_vector("gripper", "the gripper's end point", nullable=False),
)

TRACK_COLUMNS = (
    _FRAME,
    _STAMP,
    Column("point", "int32", "1", "number of the point, 1 next to the gripper"),
    Column("x_m", "float64", "m", "the material point, depth optical frame, right"),
    Column("y_m", "float64", "m", "the material point, depth optical frame, down"),
    Column("z_m", "float64", "m", "the material point, depth optical frame, forward"),
    Column("vx_m_s", "float64", "m/s", "its velocity, right"),
    Column("vy_m_s", "float64", "m/s", "its velocity, down"),
    Column("vz_m_s", "float64", "m/s", "its velocity, forward"),
)

COLOR_COLUMNS = (
    _FRAME,
    _STAMP,
    Column("garment_mask", "binary", "", "PNG of one bit per pixel: where the garment is seen"),
    Column("gripper_mask", "binary", "", "PNG of one bit per pixel: where gripper, arm or ruler are seen"),
    Column("area_px", "int32", "px", "pixels of the garment below the gripper; of these all that follows"),
    Column("centroid_u_px", "float64", "px", "mean u of these pixels; centre of the first is 0", nullable=True),
    Column("centroid_v_px", "float64", "px", "mean v of these pixels; centre of the first is 0", nullable=True),
    Column("major_px", "float64", "px", "length of the major axis, as MATLAB's regionprops defines it", nullable=True),
    Column("minor_px", "float64", "px", "length of the minor axis, as MATLAB's regionprops defines it", nullable=True),
    Column("orientation_rad", "float64", "rad", "of the major axis, counter-clockwise from the u axis", nullable=True),
    Column("line_u_px", "list<float64>", "px", "u of 65 points of the material line, from the gripper down"),
    Column("line_v_px", "list<float64>", "px", "v of the same points"),
)


def point_rows(index: int, stamp_ns: int, time_s: float, view: GarmentView) -> dict[str, Any]:
    """Return the columns of one depth frame, one row per point."""
    count = truth.POINTS
    surface, surface_speed, surface_length = view.surface_points(time_s)
    material, material_speed, material_length = view.material_points(time_s)
    gripper, speed = view.gripper_m(time_s), view.gripper_velocity_m_s(time_s)
    with np.errstate(invalid="ignore"):
        inside = truth.in_image(surface)
    return {
        "frame": np.full(count, index),
        "stamp_ns": np.full(count, stamp_ns),
        "point": np.arange(1, count + 1),
        **_columns("surface", surface, surface_speed),
        "surface_length_m": np.full(count, surface_length),
        "surface_in_image": inside,
        **_columns("material", material, material_speed),
        "material_length_m": np.full(count, material_length),
        **_columns("gripper", np.tile(gripper, (count, 1)), np.tile(speed, (count, 1))),
    }


def _columns(
    prefix: str, place_m: NDArray[np.float64], speed_m_s: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    places = {f"{prefix}_{axis}_m": place_m[:, k] for k, axis in enumerate("xyz")}
    speeds = {f"{prefix}_v{axis}_m_s": speed_m_s[:, k] for k, axis in enumerate("xyz")}
    return {**places, **speeds}


def color_row(index: int, stamp_ns: int, time_s: float, frame: ColorFrame, view: GarmentView) -> dict[str, Any]:
    """Return the row of one colour frame."""
    below = truth.below_gripper(frame, view.gripper_m(time_s))
    line = COLOR_CAMERA.project(view.material_line(time_s)[0].nodes_m)
    return {
        "frame": index,
        "stamp_ns": stamp_ns,
        "garment_mask": truth.as_png(frame.garment),
        "gripper_mask": truth.as_png(frame.gripper),
        "area_px": int(below.sum()),
        **truth.mask_axes(below),
        "line_u_px": line[:, 0].tolist(),
        "line_v_px": line[:, 1].tolist(),
    }


def write_points(path: Path, times: FrameTimes, view: GarmentView) -> None:
    """Write ``points.parquet``: per depth frame and point the surface, the material and the gripper."""
    frames = zip(times.stamp_ns.tolist(), times.stamp_s.tolist(), strict=True)
    rows = [point_rows(index, stamp, time_s, view) for index, (stamp, time_s) in enumerate(frames)]
    columns = {column.name: np.concatenate([row[column.name] for row in rows]) for column in POINT_COLUMNS}
    _write(path, POINT_COLUMNS, columns, "one point of one depth frame")


def write_tracks(path: Path, times: FrameTimes, view: GarmentView) -> None:
    """Write ``tracks.parquet``: the points that divide the visible profile of the first depth frame, followed.

    Nothing is written when that frame shows no profile, or when there is no frame.
    """
    if len(times.time_s) == 0:
        return
    first_s = float(times.time_s[0])
    start_m = view.surface_points(first_s)[0]
    if not np.isfinite(start_m).all():
        return
    followed = seen_on(start_m, view.surface_m(first_s), view.triangles)
    states = [[followed.apply(values) for values in view.surface_state(time_s)] for time_s in times.time_s.tolist()]
    position_m, velocity_m_s = np.array(states).transpose(1, 0, 2, 3).reshape(2, -1, 3)
    frames, count = len(states), len(start_m)
    columns: dict[str, Any] = {
        "frame": np.repeat(np.arange(frames), count),
        "stamp_ns": np.repeat(times.stamp_ns, count),
        "point": np.tile(np.arange(1, count + 1), frames),
        **{f"{axis}_m": position_m[:, k] for k, axis in enumerate("xyz")},
        **{f"v{axis}_m_s": velocity_m_s[:, k] for k, axis in enumerate("xyz")},
    }
    _write(path, TRACK_COLUMNS, columns, "one followed point of one depth frame")


def write_color(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write ``color.parquet``: per colour frame the masks, the axes and the projected material line."""
    columns = {column.name: [row[column.name] for row in rows] for column in COLOR_COLUMNS}
    _write(path, COLOR_COLUMNS, columns, "one colour frame")


def _write(path: Path, columns: tuple[Column, ...], values: Mapping[str, Any], row: str) -> None:
    schema = pa.schema([column.field() for column in columns], metadata={"row": row})
    arrays = [pa.array(values[field.name], from_pandas=True).cast(field.type) for field in schema]
    pq.write_table(pa.Table.from_arrays(arrays, schema=schema), path, compression="zstd", use_dictionary=False)


def write_scene(path: Path, facts: Mapping[str, object]) -> None:
    """Write ``scene.json``: what was simulated, as canonical JSON."""
    path.write_text(json.dumps(facts, indent=1, sort_keys=True) + "\n", encoding="utf-8")
