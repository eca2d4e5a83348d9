"""Curves over time in Rerun: points and their velocities with two standard uncertainties, gripper, joints."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.viewers import colors

if TYPE_CHECKING:
    import pandas as pd
    import rerun as rr

    from garment_dataset.arrays import FloatArray, IntArray
    from garment_dataset.viewers.content import Content

KINEMATICS = {"z_m": ("stamp_ns", "z_std_m"), "vz_m_s": ("velocity_stamp_ns", "vz_std_m_s")}
"""Columns that are drawn over time: when their values hold, and their uncertainty."""

_TWO_STDS = 2.0
_PALE = 110  # of 255: how much of a band's edge is seen


def log_series(stream: rr.RecordingStream, content: Content, timeline: str) -> None:
    """Send all curves of a recording, whole.

    Parameters
    ----------
    stream : rerun.RecordingStream
        Where to.
    content : Content
        Of the recording.
    timeline : str
        Of seconds since its start; the other one is that of the main stream's images.
    """
    import rerun as rr

    series = _Series(stream, content, timeline)
    if "kinematics" in content.tables:
        for number, rows in content.tables["kinematics"].groupby("point"):
            for column, (stamp, std) in KINEMATICS.items():
                series.send_point(int(str(number)), rows.dropna(subset=[stamp]), column, stamp, std)
    rows = content.tables["gripper"].query("stream == @content.main")
    for axis, shade in zip("xyz", ((230, 60, 60), (60, 180, 60), (60, 100, 230)), strict=True):
        series.send(f"gripper_m/{axis}", _stamps(rows, "stamp_ns"), _values(rows, f"{axis}_m"), [axis], [shade])
    if "joints" in content.tables:
        for joint, rows in content.tables["joints"].groupby("joint"):
            name = str(joint)
            path = f"joints_rad/{rr.escape_entity_path_part(name)}"
            series.send(path, _stamps(rows, "stamp_ns"), _values(rows, "position_rad"), [name], None)


class _Series:
    """Curves on their way into Rerun."""

    def __init__(self, stream: rr.RecordingStream, content: Content, timeline: str) -> None:
        self._stream, self._content, self._timeline = stream, content, timeline

    def send_point(self, number: int, rows: pd.DataFrame, column: str, stamp: str, std: str) -> None:
        """Send a column of one point, and the edges of its band."""
        name = "gripper" if number == 0 else f"point_{number}"
        shade, stamps_ns = colors.point_color(number), _stamps(rows, stamp)
        value, margin = _values(rows, column), _TWO_STDS * _values(rows, std)
        self.send(f"{column}/{name}", stamps_ns, value, [name.replace("_", " ")], [shade])
        edges = np.stack([value - margin, value + margin], axis=1)
        names = [f"{name.replace('_', ' ')} {sign} 2 std" for sign in "-+"]
        self.send(f"{column}/{name}/2_std", stamps_ns, edges, names, [(*shade, _PALE)] * 2)

    def send(
        self,
        path: str,
        stamps_ns: IntArray,
        values: FloatArray,
        names: list[str],
        shades: list[tuple[int, ...]] | None,
    ) -> None:
        """Send one or more curves, (T,) or (T, k), that share their times; NaN where there is no value."""
        import rerun as rr

        if not np.isfinite(values).any():
            return
        self._stream.log(path, rr.SeriesLines(names=names, colors=shades), static=True, strict=True)
        since_start = (stamps_ns - self._content.start_ns).astype("timedelta64[ns]")
        frames = self._content.main_frames(stamps_ns)
        indexes = [
            rr.TimeColumn(self._timeline, duration=since_start),
            rr.TimeColumn(f"{self._content.main}_frame", sequence=frames),
        ]
        self._stream.send_columns(path, indexes, rr.Scalars.columns(scalars=values), strict=True)


def _stamps(rows: pd.DataFrame, column: str) -> IntArray:
    return rows[column].to_numpy(np.int64)


def _values(rows: pd.DataFrame, column: str) -> FloatArray:
    return rows[column].to_numpy(np.float64, na_value=np.nan)
