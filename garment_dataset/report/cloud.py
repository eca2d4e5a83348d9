"""The cloud of a depth frame around the garment, thinned and rounded to millimetres, with chain and points."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any

import numpy as np

from garment_dataset.view.depth import centre_depth_m

if TYPE_CHECKING:
    import pandas as pd

    from garment_dataset.view.depth import DepthFrame

MOST_POINTS = 1500
_CHAIN_SAMPLES = 60


def cloud_of(frame: DepthFrame, band_half_width_m: float) -> dict[str, Any]:
    """Return what is shown of a frame in space.

    Parameters
    ----------
    frame : DepthFrame
        With its camera.
    band_half_width_m : float
        Depths farther than this from the gripper's are left out.

    Returns
    -------
    dict
        JSON-like: ``cloud``, base64 of little-endian int16 x, y, z of about :data:`MOST_POINTS` points at most, in mm
        (depth optical frame); ``chain``, ``points`` and ``gripper`` in m, null where there is none.
    """
    centre_mm = 1e3 * centre_depth_m(frame)
    depth = frame.depth_mm.astype(np.float64)
    v, u = np.nonzero((frame.depth_mm > 0) & (np.abs(depth - centre_mm) <= 1e3 * band_half_width_m))
    stride = max(1, int(np.ceil(np.sqrt(len(u) / MOST_POINTS))))
    kept = (u % stride == 0) & (v % stride == 0)
    u, v = u[kept], v[kept]
    z = depth[v, u]
    camera = frame.camera
    x = (u - camera["cx_px"]) * z / camera["fx_px"]
    y = (v - camera["cy_px"]) * z / camera["fy_px"]
    millimetres = np.clip(np.round(np.stack([x, y, z], axis=1)), -32768, 32767).astype("<i2")
    chain = frame.chain.iloc[:: max(1, len(frame.chain) // _CHAIN_SAMPLES)]
    gripper = None if frame.gripper is None else _places(frame.gripper.to_frame().T)[0]
    return {
        "cloud": base64.b64encode(millimetres.tobytes()).decode(),
        "chain": [place for place in _places(chain) if place is not None],
        "points": _places(frame.points),
        "gripper": gripper,
    }


def _places(rows: pd.DataFrame) -> list[list[float] | None]:
    values = rows[["x_m", "y_m", "z_m"]].to_numpy(np.float64)
    return [[round(value, 4) for value in place] if np.isfinite(place).all() else None for place in values.tolist()]
