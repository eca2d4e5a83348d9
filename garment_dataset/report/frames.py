"""What a page shows of a recording's images: a loop, a few frames drawn large, and clouds of points."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import cv2
import numpy as np

from garment_dataset.bags import AS_SAID, DepthReading, open_bag
from garment_dataset.errors import FilterError, GarmentError, StoreError
from garment_dataset.features.reading import load_features, result_params
from garment_dataset.report.cloud import cloud_of
from garment_dataset.view.color import ColorFrame, draw_color
from garment_dataset.view.depth import DepthFrame, color_limits_m, draw_depth
from garment_dataset.view.frames import new_figure
from garment_dataset.view.rasters import color_raster, depth_raster

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    import pandas as pd
    from numpy.typing import NDArray

Stream = Literal["depth", "color"]

LOOP_FRAMES = 32
_LOOP_WIDTH_PX = 360
_LOOP_QUALITY, _FIGURE_QUALITY = 72, 80
_FIGURE_DPI = 80
_BAND_M = 0.27
"""Half of what is kept of the cloud in depth where no result says it: as much as ``depth_points`` takes."""


@dataclass(frozen=True)
class Pictures:
    """The pictures of a page.

    Parameters
    ----------
    loop : dict
        JSON-like: for each stream frames with ``frame``, ``time_s`` and ``src``, and the duration.
    clouds : list of dict
        JSON-like, see :mod:`garment_dataset.report.cloud`.
    figures : list of dict
        Key frames: ``src``, ``title``, ``alt``.
    faults : list of str
        Why there are not more.
    """

    loop: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    clouds: list[dict[str, Any]] = field(default_factory=list)
    figures: list[dict[str, Any]] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)


class Tables:
    """The tables of one recording; what is not there is empty.

    Parameters
    ----------
    recording : str
        Its name.
    folder : Path
        The features.
    """

    def __init__(self, recording: str, folder: Path) -> None:
        self.recording, self._folder = recording, folder
        self._read: dict[str, pd.DataFrame] = {}

    def __getitem__(self, name: str) -> pd.DataFrame:
        if name not in self._read:
            try:
                self._read[name] = load_features(name, folder=self._folder, recording=self.recording)
                self._read[name].attrs = {}  # pandas copies units and descriptions with every selection
            except (StoreError, FilterError):
                import pandas as pd

                self._read[name] = pd.DataFrame()
        return self._read[name]

    def of_frame(self, name: str, frame: int, columns: Sequence[str]) -> pd.DataFrame:
        """Return the rows of a frame; with the columns named, where there is no such table."""
        import pandas as pd

        rows = self[name]
        return rows[rows["frame"] == frame] if "frame" in rows else pd.DataFrame(columns=list(columns))

    @cached_property
    def band_half_width_m(self) -> float:
        """How far from the gripper the garment may be in depth, by the parameters of the result."""
        try:
            return float(result_params("points", self.recording, folder=self._folder)["band_half_width_m"])
        except (StoreError, KeyError):
            return _BAND_M


def pictures_of(tables: Tables, bag: Path, onset_ns: int | None, wanted: int = LOOP_FRAMES) -> Pictures:
    """Draw the pictures of a recording, in one pass over each stream of its bag.

    Parameters
    ----------
    tables : Tables
        Its results.
    bag : Path
        It is only read.
    onset_ns : int or None
        When time begins; None: with the first frame.
    wanted : int
        Length of the loop, in frames.

    Returns
    -------
    Pictures
        What cannot be drawn is left out, with the reason.
    """
    made = Pictures()
    streams: tuple[Stream, ...] = ("depth", "color")
    for stream in streams:
        images = tables["frames"]
        images = images[images["stream"] == stream] if "stream" in images else images
        if images.empty:
            made.faults.append(f"no {_word(stream)} images")
            continue
        usable = images[images["fault"].isna()]
        if usable.empty:
            made.faults.append(f"none of {len(images)} {_word(stream)} images can be used: {images['fault'].iloc[0]}")
            continue
        try:
            _draw_stream(made, tables, bag, usable, stream, onset_ns, wanted)
        except (GarmentError, KeyError, ValueError, cv2.error) as error:
            made.faults.append(f"{_word(stream)} images cannot be drawn: {_said(error)}")
    return made


def _said(error: Exception) -> str:
    return error.what if isinstance(error, GarmentError) else f"{type(error).__name__}: {error}"


def _word(stream: str) -> str:
    return "colour" if stream == "color" else stream


def _draw_stream(
    made: Pictures, tables: Tables, bag: Path, usable: pd.DataFrame, stream: Stream, onset_ns: int | None, wanted: int
) -> None:
    start_ns = int(usable["stamp_ns"].min()) if onset_ns is None else onset_ns
    time_s = {int(row.frame): (int(row.stamp_ns) - start_ns) * 1e-9 for row in usable.itertuples()}  # type: ignore[arg-type]
    frames = sorted(time_s)
    places = np.unique(np.linspace(0, len(frames) - 1, min(wanted, len(frames))).round().astype(int))
    in_loop = [frames[place] for place in places]
    keys = key_frames(tables, stream, frames)
    cloud_frames = set(in_loop) if stream == "depth" else set()
    made.loop[stream] = []
    for frame, pixels in _pixels(bag, tables, usable, stream, {*in_loop, *keys}):
        drawn = _depth_frame(tables, frame, pixels) if stream == "depth" else _color_frame(tables, frame, pixels)
        known = {"frame": frame, "time_s": round(time_s[frame], 3)}
        if frame in in_loop:
            made.loop[stream].append({**known, "src": _jpeg(_raster(drawn, tables))})
        if frame in cloud_frames and isinstance(drawn, DepthFrame):
            made.clouds.append({**known, **cloud_of(drawn, tables.band_half_width_m)})
        if frame in keys:
            title = f"{_word(stream)} frame {frame}, {time_s[frame]:.2f} s: {keys[frame]}"
            made.figures.append({"src": _figure(drawn, tables, title), "title": title})


def key_frames(tables: Tables, stream: Stream, frames: Sequence[int]) -> dict[int, str]:
    """Return which frames are worth a picture, with what they show: at rest, farthest out, and where least is found.

    Parameters
    ----------
    tables : Tables
        Of the recording.
    stream : {"depth", "color"}
        Whose frames.
    frames : sequence of int
        Those that can be drawn.
    """
    name, value, doubt = (
        ("kinematics", "dz_m", None) if stream == "depth" else ("silhouettes", "centroid_u_px", "confidence")
    )
    rows = tables[name]
    if value not in rows or "frame" not in rows:
        return {}  # nothing was looked for
    rows = rows[rows["frame"].isin(frames)]
    if "point" in rows:
        rows = rows[rows["point"] == rows["point"].max()]
    found = {frames[0]: "the first"}
    known = rows.dropna(subset=[value])
    if len(known):
        away = (known[value] - known[value].iloc[0]).abs()
        found.setdefault(int(known["frame"].iloc[int(away.argmax())]), "farthest from where it began")
    if doubt is not None and len(sure := rows.dropna(subset=[doubt])):
        found.setdefault(int(sure["frame"].iloc[int(sure[doubt].argmin())]), "the least sure")
    missing = rows[rows[value].isna()]
    if len(missing):
        found.setdefault(int(missing["frame"].iloc[0]), f"nothing found: {missing['reason'].iloc[0]}")
    return found


def _pixels(
    bag: Path, tables: Tables, usable: pd.DataFrame, stream: Stream, wanted: Iterable[int]
) -> list[tuple[int, NDArray[Any]]]:
    """Return the images wanted, in the order of the recording."""
    reading = AS_SAID
    if stream == "depth":
        camera = _camera(tables)
        reading = DepthReading(float(camera["depth_unit_mm"]), bool(camera["bytes_swapped"]))
    chosen, last = set(wanted), max(wanted)
    found = []
    with open_bag(bag) as opened:
        for image in opened.images(str(usable["topic"].iloc[0]), stream):
            if image.index in chosen:
                found.append((image.index, image.pixels(reading).copy()))
            if image.index >= last:
                break
    return found


def _camera(tables: Tables) -> pd.Series[Any]:
    cameras = tables["camera"]
    depth = cameras[cameras["stream"] == "depth"] if "stream" in cameras else cameras
    if depth.empty:
        raise StoreError("no calibration of the depth camera")
    return depth.iloc[0]


def _depth_frame(tables: Tables, frame: int, pixels: NDArray[Any]) -> DepthFrame:
    gripper = tables.of_frame("gripper", frame, ["stream", "z_m"])
    gripper = gripper[gripper["stream"] == "depth"]
    place = ["x_m", "y_m", "z_m", "pixels"]
    return DepthFrame(
        pixels,
        _camera(tables),
        gripper.iloc[0] if len(gripper) else None,
        tables.of_frame("chains", frame, place),
        tables.of_frame("points", frame, [*place, "point", "reason", "y_std_m", "z_std_m"]),
    )


def _color_frame(tables: Tables, frame: int, pixels: NDArray[Any]) -> ColorFrame:
    rows = tables.of_frame("silhouettes", frame, [])
    silhouette: Mapping[str, Any] = (
        {str(name): value for name, value in rows.iloc[0].items()} if len(rows) else {"mask": None, "reason": ""}
    )
    return ColorFrame(pixels, silhouette, tables.of_frame("central_curves", frame, ["u_px", "v_px"]))


def _raster(drawn: DepthFrame | ColorFrame, tables: Tables) -> NDArray[np.uint8]:
    if isinstance(drawn, DepthFrame):
        return depth_raster(drawn, color_limits_m(drawn, tables.band_half_width_m), _LOOP_WIDTH_PX)
    return color_raster(drawn, _LOOP_WIDTH_PX)


def _jpeg(picture: NDArray[np.uint8]) -> str:
    _, data = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _LOOP_QUALITY])
    return f"data:image/jpeg;base64,{base64.b64encode(data.tobytes()).decode()}"


def _figure(drawn: DepthFrame | ColorFrame, tables: Tables, title: str) -> str:
    figure = new_figure()
    if isinstance(drawn, DepthFrame):
        draw_depth(figure, drawn, title, band_half_width_m=tables.band_half_width_m)
    else:
        draw_color(figure, drawn, title)
    raw = io.BytesIO()
    figure.savefig(raw, format="rgba", dpi=_FIGURE_DPI)
    width, height = (round(inches * _FIGURE_DPI) for inches in figure.get_size_inches())
    pixels = np.frombuffer(raw.getvalue(), np.uint8).reshape(height, width, 4)
    _, data = cv2.imencode(
        ".webp", cv2.cvtColor(pixels, cv2.COLOR_RGBA2BGR), [cv2.IMWRITE_WEBP_QUALITY, _FIGURE_QUALITY]
    )
    return f"data:image/webp;base64,{base64.b64encode(data.tobytes()).decode()}"
