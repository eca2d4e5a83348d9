"""Pictures of one frame of a recording, from its bag and its results."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from garment_dataset.errors import UsageError, require_extra

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from garment_dataset.bags import DepthReading
    from garment_dataset.catalog import CatalogRow
    from garment_dataset.layout import Layout

Stream = Literal["depth", "color"]

FIGURE_SIZE_INCHES = (12.0, 6.5)


def save_frame(workspace: Layout, row: CatalogRow, frame: int, path: Path, *, stream: Stream | None = None) -> None:
    """Draw one frame with what was extracted from it.

    Parameters
    ----------
    workspace : Layout
        Holds the results.
    row : CatalogRow
        The recording; its bag must be there.
    frame : int
        Index of the image in its stream.
    path : Path
        Picture to write; its suffix says the format.
    stream : {"depth", "color"}, optional
        Whose image; by default the one that the recording's axis is about: R depth, B colour.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    UsageError
        If there is no such usable frame.
    StoreError
        If the recording was not built yet.
    """
    chosen: Stream = stream or ("depth" if row.axis == "R" else "color")
    figure = new_figure()
    images = _rows(workspace, "frames", row.recording).query("stream == @chosen")
    check_usable(images, row.recording, frame, chosen)
    draw = _draw_depth if chosen == "depth" else _draw_color
    reading = _reading(workspace, row.recording) if chosen == "depth" else None
    draw(figure, workspace, row, frame, _pixels(row, frame, str(images["topic"].iloc[0]), chosen, reading))
    figure.savefig(path, dpi=110)


def check_usable(images: pd.DataFrame, recording: str, frame: int, stream: Stream) -> None:
    """Refuse a frame that is not there, or of which nothing can be drawn, with the reason.

    Raises
    ------
    UsageError
        With the frames that there are, or with the fault of this one.
    """
    usable = images[images["fault"].isna()]
    if images.empty:
        raise UsageError(f"no {stream} images", where=recording, hint="`garment show` says which topics there are.")
    if frame not in set(images["frame"]):
        raise UsageError(
            f"no such {stream} frame", where=recording, expected=f"0 to {images['frame'].max()}", found=frame
        )
    if frame not in set(usable["frame"]):
        fault = images.loc[images["frame"] == frame, "fault"].iloc[0]
        nearest = None if usable.empty else min(usable["frame"], key=lambda other: abs(other - frame))
        hint = "Not one of them can be used." if nearest is None else f"The nearest that can be drawn is {nearest}."
        raise UsageError(f"{stream} frame {frame} is not used", where=recording, found=fault, hint=hint)


def _draw_depth(figure: Figure, workspace: Layout, row: CatalogRow, frame: int, pixels: NDArray[Any]) -> None:
    from garment_dataset.features.reading import result_params
    from garment_dataset.view.depth import DepthFrame, draw_depth

    tables = {name: _rows(workspace, name, row.recording) for name in ("camera", "gripper", "chains", "points")}
    gripper = tables["gripper"].query("stream == 'depth' and frame == @frame")
    drawn = DepthFrame(
        pixels,
        tables["camera"].query("stream == 'depth'").iloc[0],
        gripper.iloc[0] if len(gripper) else None,
        tables["chains"].query("frame == @frame"),
        tables["points"].query("frame == @frame"),
    )
    params = result_params("points", row.recording, folder=workspace.features_dir)
    draw_depth(
        figure, drawn, f"{row.recording}, depth frame {frame}", band_half_width_m=float(params["band_half_width_m"])
    )


def _draw_color(figure: Figure, workspace: Layout, row: CatalogRow, frame: int, pixels: NDArray[Any]) -> None:
    from garment_dataset.view.color import ColorFrame, draw_color

    silhouette = _rows(workspace, "silhouettes", row.recording).query("frame == @frame").iloc[0]
    drawn = ColorFrame(
        pixels,
        {str(name): value for name, value in silhouette.items()},
        _rows(workspace, "central_curves", row.recording).query("frame == @frame"),
    )
    draw_color(figure, drawn, f"{row.recording}, colour frame {frame}")


def new_figure() -> Figure:
    """Return an empty figure.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    """
    require_extra("matplotlib.figure", "pictures need matplotlib", "view")
    from matplotlib.figure import Figure

    return Figure(figsize=FIGURE_SIZE_INCHES, layout="constrained")


def _rows(workspace: Layout, table: str, recording: str) -> pd.DataFrame:
    from garment_dataset.features.reading import load_features

    return load_features(table, folder=workspace.features_dir, recording=recording)


def _reading(workspace: Layout, recording: str) -> DepthReading:
    """Return in which unit and byte order the build has read the depths."""
    from garment_dataset.bags import DepthReading

    camera = _rows(workspace, "camera", recording).query("stream == 'depth'").iloc[0]
    return DepthReading(float(camera["depth_unit_mm"]), bool(camera["bytes_swapped"]))


def _pixels(row: CatalogRow, frame: int, topic: str, stream: Stream, reading: DepthReading | None) -> NDArray[Any]:
    from garment_dataset.bags import AS_SAID, open_bag

    assert row.path is not None
    with open_bag(row.path) as bag:
        for image in bag.images(topic, stream):
            if image.index == frame:
                return image.pixels(reading or AS_SAID).copy()
    raise UsageError(f"no such {stream} frame", where=row.path, found=frame)
