"""``garment mask``: where a garment can be seen, suggested from the empty scene."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from garment_dataset.cli.output import JsonOption, WorkspaceOption, print_json, say
from garment_dataset.cli.show import refuse_picture
from garment_dataset.errors import GarmentError, PictureError, StoreError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from garment_dataset.layout import Layout
    from garment_dataset.vision.color.background import Background


def mask(
    position: Annotated[
        int | None,
        typer.Option(min=1, help="Camera position: the number behind the axis, 1 in _B1. [default: if there is one]"),
    ] = None,
    drawn: Annotated[
        Path | None,
        typer.Option(
            "--from", help="Take the region from a picture of the image's size: white where a garment may be."
        ),
    ] = None,
    save: Annotated[Path | None, typer.Option("--save", help="Draw it, too: a .png, .svg or .pdf file.")] = None,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Suggest a clipping polygon, from where the background is not monochrome, as lines for a pipeline file."""
    from garment_dataset.layout import Layout
    from garment_dataset.vision.color.masks import polygon_mask
    from garment_dataset.vision.color.polygons import polygon_of

    if save is not None:
        refuse_picture(save)
    place = Layout.find(workspace)
    number, model = _background(place, position)
    polygon = polygon_of(_region(model, drawn))
    if len(polygon) < 3:
        raise StoreError("no region to clip to", where=drawn or f"position_{number}", expected="a monochrome part")
    clip = polygon_mask(polygon, *model.mean.shape[:2])
    if as_json:
        print_json({"position": number, "clip_polygon": polygon, "share": clip.mean()})
    else:
        print(f"# camera position {number}: {clip.mean():.0%} of the image")
        print("[params.silhouette]")
        print(f"clip_polygon = {[list(corner) for corner in polygon]}")
    if save is not None:
        from garment_dataset.view.color import draw_clip
        from garment_dataset.view.frames import new_figure

        figure = new_figure()
        draw_clip(figure, model.mean, clip, polygon)
        figure.savefig(save, dpi=110)
        say(f"wrote {save}")


def _region(model: Background, drawn: Path | None) -> NDArray[np.bool_]:
    """Return where a garment may be: as a person drew it, or where the background is monochrome."""
    from garment_dataset.vision.color.masks import decode_mask, suggest_clip_mask

    if drawn is None:
        return suggest_clip_mask(model)
    try:
        region = decode_mask(drawn.read_bytes())
    except (OSError, GarmentError) as error:
        raise PictureError("not a picture", where=drawn, found=error) from error
    if region.shape != model.mean.shape[:2]:
        size = "{1} x {0} px".format
        raise PictureError(
            "not of the image's size", where=drawn, expected=size(*model.mean.shape), found=size(*region.shape)
        )
    return region


def _background(place: Layout, position: int | None) -> tuple[int, Background]:
    """Read the background of a position, or the only one there is."""
    import pyarrow.parquet as pq

    from garment_dataset.stages.background import background_model

    folder = place.features_dir / "background"
    built = {int(path.stem.removeprefix("position_")): path for path in folder.glob("position_*.parquet")}
    number = position if position is not None else next(iter(built), None)
    if number not in built or (position is None and len(built) > 1):
        raise StoreError(
            "which camera position?" if built else "no background built",
            where=folder,
            expected=f"--position with one of {sorted(built)}" if built else "position_1.parquet or the like",
            found=position,
            hint=None if built else "`garment build --stage background` makes it.",
        )
    return number, background_model(pq.ParquetFile(built[number]).read())
