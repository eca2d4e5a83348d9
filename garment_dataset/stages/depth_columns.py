"""Columns of the tables of ``depth_points``, from the traces of its frames."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from garment_dataset.vision.depth.trace import Trace


def chain_columns(stamps_ns: Mapping[int, int], traces: Mapping[int, Trace]) -> dict[str, Any]:
    """Return the samples of every frame that has a chain, without those that nothing carries.

    Parameters
    ----------
    stamps_ns : mapping
        Stamp by frame.
    traces : mapping
        What the frames show.
    """
    found = [(frame, trace.chain) for frame, trace in traces.items() if trace.chain is not None]
    carried = [np.flatnonzero(np.isfinite(chain.support.bridged_m)) for _, chain in found]
    sizes = [index.size for index in carried]

    def joined(arrays: Iterable[NDArray[Any]], empty: NDArray[Any]) -> NDArray[Any]:
        own = (values[..., index] for values, index in zip(arrays, carried, strict=True))
        return np.concatenate([empty, *own], axis=-1)

    none, nobody = np.empty(0), np.empty(0, np.int64)
    position_m = joined((chain.position_m for _, chain in found), np.empty((3, 0)))
    return {
        "frame": np.repeat([frame for frame, _ in found], sizes),
        "stamp_ns": np.repeat(np.array([stamps_ns[frame] for frame, _ in found], np.int64), sizes),
        "sample": np.concatenate([nobody, *carried]),
        "x_m": position_m[0],
        "y_m": position_m[1],
        "z_m": position_m[2],
        "arc_length_m": joined((chain.arc_length_m for _, chain in found), none),
        "pixels": joined((chain.pixels for _, chain in found), nobody),
        "bridged_m": joined((chain.support.bridged_m for _, chain in found), none),
        "z_spread_m": joined((chain.z_spread_m for _, chain in found), none),
    }


def point_columns(
    stamps_ns: Mapping[int, int], traces: Mapping[int, Trace], point_count: int, common_std_m: float
) -> dict[str, Any]:
    """Return ``point_count`` rows for every frame, null where there is no point.

    Parameters
    ----------
    stamps_ns : mapping
        Stamp by frame.
    traces : mapping
        What the frames show.
    point_count : int
        Points on the garment.
    common_std_m : float
        Standard uncertainty, at 1 m, of an error common to all depths.
    """
    position_m, std_m, fixed_std_m, material_m = np.full((4, 3, len(traces), point_count), np.nan)
    arc_length_m, garment_length_m, bridged_m = np.full((3, len(traces), point_count), np.nan)
    pixels = np.zeros((len(traces), point_count), np.int64)
    reasons: list[str | None] = []
    for row, trace in enumerate(traces.values()):
        points = trace.points
        if trace.chain is None or points is None:
            reasons.extend([trace.reason] * point_count)
            continue
        reasons.extend(points.reasons)
        position_m[:, row], std_m[:, row], fixed_std_m[:, row] = points.position_m, points.std_m, points.fixed_std_m
        arc_length_m[row], bridged_m[row], pixels[row] = points.arc_length_m, points.bridged_m, points.pixels
        if trace.length_reason is None:
            garment_length_m[row] = trace.chain.length_m
        if trace.material_m is not None:
            material_m[:, row] = np.where(np.isfinite(points.bridged_m), trace.material_m, np.nan)
    length_reasons = [None if trace.points is None else trace.length_reason for trace in traces.values()]
    axes = {f"{axis}_m": values.ravel() for axis, values in zip("xyz", position_m, strict=True)}
    axes |= {f"{axis}_std_m": values.ravel() for axis, values in zip("xyz", std_m, strict=True)}
    axes |= {f"{axis}_fixed_m": values.ravel() for axis, values in zip("xyz", fixed_std_m, strict=True)}
    axes |= {f"material_{axis}_m": values.ravel() for axis, values in zip("xyz", material_m, strict=True)}
    return {
        "frame": np.repeat(np.array(list(traces), np.int64), point_count),
        "stamp_ns": np.repeat(np.array([stamps_ns[frame] for frame in traces], np.int64), point_count),
        "point": np.tile(np.arange(1, point_count + 1), len(traces)),
        **axes,
        "z_common_m": common_std_m * axes["z_m"] ** 2,
        "arc_length_m": arc_length_m.ravel(),
        "garment_length_m": garment_length_m.ravel(),
        "length_reason": [reason for reason in length_reasons for _ in range(point_count)],
        "pixels": pixels.ravel(),
        "bridged_m": bridged_m.ravel(),
        "reason": reasons,
    }
