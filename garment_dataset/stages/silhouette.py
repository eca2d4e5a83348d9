"""Find the garment before the background in every colour frame, and its axes: thesis 5.2.1 and 5.2.2."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, model_validator

from garment_dataset.errors import BagError, DataWarning
from garment_dataset.stages.background import background_model
from garment_dataset.stages.inputs import known_grippers_m, require_images, usable_images, usable_stamps_ns
from garment_dataset.stages.silhouette_table import SILHOUETTES
from garment_dataset.stages.stage import Stage, StageParams

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path
    from typing import Self

    import numpy as np
    import pyarrow as pa
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray
    from garment_dataset.vision.color.background import Background
    from garment_dataset.vision.color.bar import Held
    from garment_dataset.vision.color.silhouette import BackgroundSubtractor

    Row = dict[str, Any]


class SilhouetteParams(StageParams):
    """What counts as garment."""

    alpha: float = Field(
        default=2.0, gt=1, description="difference from the background, in standard deviations, eq. (5.3)"
    )
    min_sigma: float = Field(
        default=2.0,
        ge=0,
        description="smallest standard deviation to assume, in grey levels: a saturated pixel shows none",
    )
    open_px: int = Field(default=3, ge=1, description="odd side of the square that opens; thinner parts are lost")
    close_px: int = Field(default=9, ge=1, description="odd side of the square that closes; narrower gaps are filled")
    min_area_px2: int = Field(
        default=100,
        ge=1,
        description="smaller regions are no garment: noise makes some of up to 30; a garment seen edge-on has 1500",
    )
    edge: Literal["half_contrast", "threshold"] = Field(
        default="half_contrast",
        description="half_contrast: where a pixel is half garment, half background; threshold: the thesis' mask",
    )
    drift: bool = Field(
        default=True, description="allow for a change of the whole picture's brightness: exposure and white balance"
    )
    shadows: bool = Field(
        default=True, description="allow for shadows on the wall: less light at the same hue, unless the garment has it"
    )
    clip: Literal["auto", "none"] = Field(
        default="none",
        description="where a garment can be: none: anywhere; auto: before the largest monochrome part of the "
        "background, which a wall with folds has not; clip_polygon overrides",
    )
    clip_polygon: tuple[tuple[float, float], ...] = Field(
        default=(), description="corners [u, v] of where a garment can be; `garment mask` suggests them"
    )
    remove_gripper: bool = Field(
        default=True, description="remove what is above the gripper's end point, and its surroundings"
    )
    gripper_radius_m: float = Field(
        default=0.01, ge=0, description="radius around the gripper's end point that is removed with it"
    )
    remove_ruler: bool = Field(
        default=True,
        description="with remove_gripper and shadows: remove the bar of another colour that the garment hangs on",
    )
    near_m: float = Field(
        default=0.15,
        ge=0,
        description="how near to the gripper's end point a garment must come; 0: anywhere",
    )

    @model_validator(mode="after")
    def _shapes_exist(self) -> Self:
        if self.open_px % 2 == 0 or self.close_px % 2 == 0:
            raise ValueError("open_px and close_px must be odd")
        if 0 < len(self.clip_polygon) < 3:
            raise ValueError("clip_polygon must have at least three corners")
        return self


def silhouette(
    bag: Path, frames: pa.Table, camera: pa.Table, gripper: pa.Table, background: pa.Table, params: SilhouetteParams
) -> dict[str, pa.Table]:
    """Find the garment in every usable colour frame.

    Parameters
    ----------
    bag : Path
        The recording.
    frames, camera, gripper : pyarrow.Table
        As ``decode`` made them; rows are matched by the index of the image.
    background : pyarrow.Table
        Of the camera position.
    params : SilhouetteParams
        See there.

    Returns
    -------
    dict of str to pyarrow.Table
        ``silhouettes``: one row per usable colour frame, null with a reason where no garment was found.

    Raises
    ------
    BagError
        If the bag has no such topic, or the colour images no camera though the gripper is to be removed.

    Warns
    -----
    DataWarning
        Of frames without a known gripper; of a clip that keeps next to nothing, a background that explains next to
        nothing, and a drift of brightness so large that it is no drift.
    """
    from garment_dataset.bags import open_bag

    require_images(frames, "color", bag.name)
    model = background_model(background)
    clip = _clip(model, params)
    subtractor = _subtractor(model, clip, params)
    stamps_ns = usable_stamps_ns(frames, "color")
    grippers = _grippers(bag, camera, gripper) if params.remove_gripper else {}
    rows: list[Row] = []
    with open_bag(bag) as opened:
        for image in usable_images(opened, frames, "color"):
            found_row = _measure(image.pixels(), model, subtractor, grippers.get(image.index), params)
            rows.append({"frame": image.index, "stamp_ns": stamps_ns[image.index], **found_row})
    if unknown := [row["frame"] for row in rows if row.get("reason") == "no_gripper"]:
        text = f"{bag.name}: the gripper is not known in {len(unknown)} of {len(rows)} colour frames"
        warnings.warn(f"{text}, first in frame {unknown[0]}; they have no silhouette", DataWarning, stacklevel=2)
    _warn_of_picture(bag.name, rows, model.mean.shape[0] * model.mean.shape[1], clip)
    names = [column.name for column in SILHOUETTES.columns]
    return {"silhouettes": SILHOUETTES.table({name: [row.get(name) for row in rows] for name in names})}


_LEAST_CLIP = 0.02
"""Share of the picture: a hanging garment alone fills some 3 to 15 % of it."""

_MOST_CHANGED = 0.6
"""Share of the clip that differs from the background in the median frame: a garment leaves most of it free."""

_MOST_DRIFT_LEVELS = 20.0
"""Real cameras drift by 1 to 5 grey levels; lamps that were switched by tens."""


def _clip(model: Background, params: SilhouetteParams) -> BoolArray | None:
    """Return where a garment can be; None: anywhere."""
    from garment_dataset.vision.color.masks import polygon_mask, suggest_clip_mask

    if params.clip_polygon:
        return polygon_mask(params.clip_polygon, *model.mean.shape[:2])
    if params.clip == "none":
        return None
    suggested = suggest_clip_mask(model)
    return suggested if suggested.any() else None  # nothing is monochrome: nothing speaks for one place


def _warn_of_picture(where: str, rows: list[Row], pixels: int, clip: BoolArray | None) -> None:
    import numpy as np

    kept = pixels if clip is None else int(clip.sum())
    if kept < _LEAST_CLIP * pixels:
        text = f"{where}: garments are looked for in {kept / pixels:.1%} of the picture"
        warnings.warn(f"{text}; `garment mask` suggests a clip_polygon", DataWarning, stacklevel=3)
    areas = [row.get("area_px2", 0) for row in rows]
    if areas and np.median(areas) > _MOST_CHANGED * kept:
        text = f"{where}: the median silhouette fills {np.median(areas) / kept:.0%} of where garments are looked for"
        warnings.warn(f"{text}; the background seems to be of another scene", DataWarning, stacklevel=3)
    drifts = [abs(row[name]) for row in rows for name in ("drift_r", "drift_g", "drift_b") if name in row]
    if drifts and max(drifts) > _MOST_DRIFT_LEVELS:
        text = f"{where}: brightness drifts from the background's by up to {max(drifts):.0f} grey levels"
        warnings.warn(f"{text}; masks may be wrong where the light changed", DataWarning, stacklevel=3)


def _subtractor(model: Background, clip: BoolArray | None, params: SilhouetteParams) -> BackgroundSubtractor:
    from garment_dataset.vision.color.silhouette import BackgroundSubtractor

    return BackgroundSubtractor(
        model,
        clip,
        alpha=params.alpha,
        min_sigma=params.min_sigma,
        open_px=params.open_px,
        close_px=params.close_px,
        edge=params.edge,
        shadows=params.shadows,
    )


def _measure(
    pixels: NDArray[np.uint8],
    model: Background,
    subtractor: BackgroundSubtractor,
    held: Held | None,
    params: SilhouetteParams,
) -> Row:
    """Return what one frame shows, or why it shows nothing."""
    import numpy as np

    if pixels.shape != model.mean.shape:
        return {"reason": "image_size"}
    if params.remove_gripper and held is None:
        return {"reason": "no_gripper"}
    row: Row = {} if held is None else {"gripper_u_px": held.u_px, "gripper_v_px": held.v_px}
    drift = subtractor.drift(pixels) if params.drift else None
    if drift is not None and np.isnan(drift).any():
        drift = None
    if drift is not None:
        row |= dict(zip(("drift_r", "drift_g", "drift_b"), drift.tolist(), strict=True))
    shape = (pixels.shape[0], pixels.shape[1])
    found = subtractor.find(
        pixels,
        drift=drift,
        top_v_px=None if held is None else held.v_px,
        gripper=_disc(held, params.gripper_radius_m, shape),
        near=_disc(held, params.near_m, shape),
        held=held if params.remove_ruler else None,
    )
    if found.is_elsewhere:
        return {**row, "reason": "not_at_gripper"}
    described = describe_mask(found.mask)
    if described.get("area_px2", 0) < params.min_area_px2:
        return {**row, "reason": "no_garment"}
    return {**row, **described, "confidence": found.confidence, "doubt": found.doubt}


def _disc(held: Held | None, radius_m: float, shape: tuple[int, int]) -> BoolArray | None:
    """Return what is within a radius of the gripper's end point; None without gripper or radius."""
    from garment_dataset.vision.color.masks import disc_mask

    if held is None or radius_m == 0:
        return None
    return disc_mask((held.u_px, held.v_px), radius_m * held.px_per_m, *shape)


def describe_mask(mask: NDArray[np.bool_]) -> Row:
    """Return the columns of ``silhouettes`` that a mask decides.

    Parameters
    ----------
    mask : (H, W) bool
        One 8-connected region, or none.
    """
    from garment_dataset.vision.color.axes import region_axes
    from garment_dataset.vision.color.masks import borders, encode_mask

    if not mask.any():
        return {"reason": "no_garment"}
    axes = region_axes(mask)
    outline = borders(mask)[0]
    (first_u, first_v), (last_u, last_v) = outline.min(axis=0).tolist(), outline.max(axis=0).tolist()
    return {
        "mask": encode_mask(mask),
        "area_px2": axes.area_px,
        "centroid_u_px": axes.centroid_u_px,
        "centroid_v_px": axes.centroid_v_px,
        "major_px": axes.major_px,
        "minor_px": axes.minor_px,
        "orientation_rad": axes.orientation_rad,
        "box_u_px": first_u,
        "box_v_px": first_v,
        "box_width_px": last_u - first_u + 1,
        "box_height_px": last_v - first_v + 1,
        "outline_u_px": outline[:, 0],
        "outline_v_px": outline[:, 1],
    }


def _grippers(bag: Path, camera: pa.Table, gripper: pa.Table) -> Mapping[int, Held]:
    """Project the end point into every colour frame in which it is known and before the camera: eq. (5.6)."""
    from garment_dataset.vision.color.bar import Held

    k = next((row for row in camera.to_pylist() if row["stream"] == "color"), None)
    if k is None:
        hint = "Calibrate it, or set remove_gripper = false under [params.silhouette]."
        raise BagError("no camera for the colour images, so the gripper cannot be removed", where=bag.name, hint=hint)
    found: dict[int, Held] = {}
    for frame, (x, y, z) in known_grippers_m(gripper, "color").items():
        if z > 0:
            u_px, v_px = k["fx_px"] * x / z + k["cx_px"], k["fy_px"] * y / z + k["cy_px"]
            found[frame] = Held(u_px, v_px, k["fy_px"] / z)
    return found


STAGE = Stage(silhouette, params=SilhouetteParams, outputs=(SILHOUETTES,))
