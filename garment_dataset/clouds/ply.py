"""Stanford's PLY, binary and little-endian: what every program for clouds and meshes reads."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from garment_dataset.arrays import FloatArray, IntArray

_FACE = np.dtype([("corners", "u1"), ("vertex", "<i4", 3)])


def write_ply(path: Path, vertices_m: FloatArray, faces: IntArray | None = None) -> None:
    """Write points, and the triangles between them if there are any.

    Parameters
    ----------
    path : Path
        Where to.
    vertices_m : (n, 3) float
        Positions, stored as float32.
    faces : (m, 3) int, optional
        Indices of the corners.
    """
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices_m)}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    body = np.ascontiguousarray(vertices_m, "<f4").tobytes()
    if faces is not None:
        lines += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
        listed = np.empty(len(faces), _FACE)
        listed["corners"], listed["vertex"] = 3, faces
        body += listed.tobytes()
    path.write_bytes("\n".join([*lines, "end_header", ""]).encode("ascii") + body)
