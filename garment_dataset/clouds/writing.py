"""The one place that writes clouds: a folder a recording, and ``meta.json`` that says all about them."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from garment_dataset.clouds.ply import write_ply
from garment_dataset.clouds.recording import Collected, cloud_frames
from garment_dataset.clouds.rest_mesh import RECTANGLES, flat_mesh
from garment_dataset.errors import GarmentError, StoreError
from garment_dataset.snapshot.folders import whole_folder
from garment_dataset.viewers.content import gather
from garment_dataset.vision.color.masks import encode_mask

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from garment_dataset.catalog import CatalogRow
    from garment_dataset.layout import Layout
    from garment_dataset.viewers.content import Content

FORMAT = 1
"""Raised when the layout changes."""

_TRUTH = ("points.parquet", "tracks.parquet", "scene.json")
_ARRAYS = {
    "points_m": "(n, 3) float32: the garment's points of all frames, one behind the other",
    "pixels_uv": "(n, 2) uint16: the pixel that each point was seen in, column and row from 0",
    "offsets": "(frames + 1,) int64: points of frame k are points_m[offsets[k]:offsets[k + 1]]",
    "frame": "(frames,) int64: index of the depth image in the recording",
    "stamp_ns": "(frames,) int64: when the camera saw it, ns since the Unix epoch",
    "time_s": "(frames,) float64: seconds since the first usable image of the recording",
    "controller_points": "(frames, 1, 3) float64: end point of the gripper, m; NaN where it is not known",
    "controller_quaternions_xyzw": "(frames, 1, 4) float64: from the gripper's frame to the camera's; NaN: not known",
}


class Written(NamedTuple):
    """Names of the recordings that were written, and of those that could not be, with why."""

    recordings: tuple[str, ...]
    failed: dict[str, str]


@dataclass(frozen=True)
class Form:
    """What is written.

    Parameters
    ----------
    every : int
        Of how many depth frames one is taken.
    ply : bool
        Whether there is a PLY file for each frame, beside the arrays.
    mesh_pitch_m : float
        How far vertices of the mesh at rest are apart.
    variant : str
        Of which variant of the results the settings are by which the garment is found.
    """

    every: int = 1
    ply: bool = True
    mesh_pitch_m: float = 0.02
    variant: str = ""


def write_clouds(
    rows: Iterable[CatalogRow],
    layout: Layout,
    folder: Path,
    form: Form,
    tell: Callable[[str], None] = lambda _: None,
) -> Written:
    """Write the clouds of recordings.

    Parameters
    ----------
    rows : iterable of CatalogRow
        Of which recordings.
    layout : Layout
        Where their results are.
    folder : Path
        Where to; an earlier export there is replaced when the new one is complete.
    form : Form
        See there.
    tell : callable
        Told of each recording that is done.

    Raises
    ------
    StoreError
        If something else is in the folder, or not one recording can be written: then nothing is.
    StorageError
        If it cannot be written.
    """
    failed: dict[str, str] = {}
    described: dict[str, Any] = {}
    present = [row for row in rows if row.path is not None]
    with whole_folder(folder) as new:
        for row in present:
            place = new / row.recording
            try:
                described[row.recording] = _write_recording(row, gather(layout, row, form.variant), place, form)
            except GarmentError as error:
                shutil.rmtree(place, ignore_errors=True)
                failed[row.recording] = str(error)
                continue
            tell(f"wrote {row.recording}")
        if not described:
            found = next(iter(failed.values()), "no recording with a bag")
            raise StoreError("nothing to export", expected="recordings with a bag and depth images, built", found=found)
        meta = {
            "format": FORMAT,
            "units": {"length": "m", "time": "s", "mass": "kg", "stamp": "ns"},
            "axes": "optical frame of the depth camera: x right, y down, z forward",
            "arrays": _ARRAYS,
            "recordings": described,
            "left_out": failed,
        }
        (new / "meta.json").write_text(json.dumps(meta, indent=1, ensure_ascii=False) + "\n", "utf-8")
    return Written(tuple(described), failed)


def _write_recording(row: CatalogRow, content: Content, folder: Path, form: Form) -> dict[str, Any]:
    """Write the files of one recording, and return what is said of it."""
    collected = Collected()
    for name in ("masks", *(["clouds"] if form.ply else [])):
        (folder / name).mkdir(parents=True)
    for each in cloud_frames(content, form.every):
        collected.add(each)
        (folder / "masks" / f"{each.frame:06}.png").write_bytes(encode_mask(each.mask))
        if form.ply:
            write_ply(folder / "clouds" / f"{each.frame:06}.ply", each.points_m)
    arrays = collected.arrays(content.start_ns)
    np.savez_compressed(folder / "clouds.npz", **arrays)  # type: ignore[arg-type]
    truth = [] if content.bag is None else _copy_truth(content.bag.with_suffix(".truth"), folder / "truth")
    counts = np.diff(arrays["offsets"])
    gravity = content.gravity_of("depth")
    camera = content.cameras["depth"]
    k = camera.intrinsics
    return {
        "frames": len(counts),
        "frames_without_points": int((counts == 0).sum()),
        "start_stamp_ns": content.start_ns,
        "K": [[k.fx_px, 0.0, k.cx_px], [0.0, k.fy_px, k.cy_px], [0.0, 0.0, 1.0]],
        "image_size_px": [camera.width_px, camera.height_px],
        "gravity_direction": None if gravity is None else gravity.tolist(),
        "controller": f"end point of the gripper, frame {content.gripper_frame}",
        **_garment(row, folder, form),
        "truth": truth,
    }


def _garment(row: CatalogRow, folder: Path, form: Form) -> dict[str, Any]:
    """Return what is known of the garment; write its mesh at rest where its outline is known."""
    said: dict[str, Any] = {name: row[name] for name in ("garment", "holding", "garment_kind", "color")}
    said |= {name: row[name] for name in ("width_m", "height_m", "weight_kg")}
    said |= {"areal_density_kg_m2": None, "rest_mesh": None, "reason": None}
    if row.width_m is None or row.height_m is None:
        return said | {"reason": "its size is not in the catalog"}
    if row.garment_kind not in RECTANGLES:
        return said | {"reason": f"the outline of a {row.garment_kind} is not in the catalog, only width and height"}
    mesh = flat_mesh(row.width_m, row.height_m, form.mesh_pitch_m)
    write_ply(folder / "rest_mesh.ply", mesh.vertices_m, mesh.faces)
    said["rest_mesh"] = f"{row.recording}/rest_mesh.ply"
    if row.weight_kg is None:
        return said | {"reason": "its weight is not in the catalog"}
    return said | {"areal_density_kg_m2": row.weight_kg / (row.width_m * row.height_m)}


def _copy_truth(source: Path, folder: Path) -> list[str]:
    there = [name for name in _TRUTH if (source / name).is_file()]
    for name in there:
        folder.mkdir(exist_ok=True)
        shutil.copyfile(source / name, folder / name)
    return there
