"""Pictures of one frame of a recording, from its bag and its results."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from garment_dataset.errors import FilterError, MissingExtraError

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from garment_dataset.catalog import CatalogRow
    from garment_dataset.workspace import Workspace

FIGURE_SIZE_INCHES = (12.0, 6.5)


def save_frame(workspace: Workspace, row: CatalogRow, frame: int, path: Path) -> None:
    """Draw one depth frame with what was extracted from it.

    Parameters
    ----------
    workspace : Workspace
        Holds the results.
    row : CatalogRow
        The recording; its bag must be there.
    frame : int
        Index of the image in its stream.
    path : Path
        Picture to write; its suffix says the format.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    FilterError
        If there is no such usable frame.
    StoreError
        If the recording was not built yet.
    """
    from garment_dataset.view.depth import DepthFrame, draw_depth

    figure = _figure()
    tables = {
        name: _rows(workspace, name, row.recording) for name in ("frames", "camera", "gripper", "chains", "points")
    }
    images = tables["frames"].query("stream == 'depth' and fault.isnull()")
    if frame not in set(images["frame"]):
        last = images["frame"].max()
        raise FilterError("no such usable depth frame", where=row.recording, expected=f"0 to {last}", found=frame)
    gripper = tables["gripper"].query("frame == @frame")
    drawn = DepthFrame(
        _pixels(row, frame),
        tables["camera"].query("stream == 'depth'").iloc[0],
        gripper.iloc[0] if len(gripper) else None,
        tables["chains"].query("frame == @frame"),
        tables["points"].query("frame == @frame"),
    )
    draw_depth(figure, drawn, f"{row.recording}, depth frame {frame}", band_half_width_m=0.27)
    figure.savefig(path, dpi=110)


def _figure() -> Figure:
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError(
            "pictures need matplotlib", hint="Install it with: pip install 'garment-dataset[view]'"
        ) from error
    return Figure(figsize=FIGURE_SIZE_INCHES, layout="constrained")


def _rows(workspace: Workspace, table: str, recording: str) -> pd.DataFrame:
    from garment_dataset.features import load_features

    return load_features(table, folder=workspace.features_dir, recording=recording)


def _pixels(row: CatalogRow, frame: int) -> NDArray[Any]:
    from garment_dataset.bags import open_bag
    from garment_dataset.stages.depth_points import DepthPointsParams

    assert row.path is not None
    with open_bag(row.path) as bag:
        topic = bag.image_topic(DepthPointsParams().depth_topic)
        assert topic is not None
        for image in bag.images(topic, "depth"):
            if image.index == frame:
                return image.pixels().copy()
    raise FilterError("no such depth frame", where=row.path, found=frame)
