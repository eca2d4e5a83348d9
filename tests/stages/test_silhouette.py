"""Silhouettes of painted frames: the sheet to the pixel, the gripper cut off, and a reason where there is none."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from garment_dataset.errors import BagError, DataWarning
from garment_dataset.stages.background import BACKGROUND
from garment_dataset.stages.silhouette import STAGE, SilhouetteParams, silhouette
from garment_dataset.stages.silhouette_table import SILHOUETTES
from garment_dataset.vision.color.masks import decode_mask

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    Picture = NDArray[np.uint8]

TOPIC = "/xtion1/rgb/image_raw"
START = 1_391_700_000_000_000_000
HEIGHT, WIDTH = 120, 160
FOCAL, CENTRE = 150.0, (80.0, 60.0)
TOP, LEFT = 30, 60
"""Of the sheet, which is 50 rows by 24 columns."""
GRIPPER_M = ((72.0 - CENTRE[0]) / FOCAL, (29.5 - CENTRE[1]) / FOCAL, 1.0)
EXACT = SilhouetteParams(gripper_radius_m=0.0)


def wall(frame: int, level: int = 190) -> NDArray[np.int64]:
    """A plain wall with noise, and a coloured cupboard on the right that no garment hangs before."""
    noise = np.random.default_rng(frame).integers(-2, 3, (HEIGHT, WIDTH, 3))
    image = np.full((HEIGHT, WIDTH, 3), level) + noise
    image[40:, 135:] += np.array([-120, -60, -20])
    return image


def with_sheet(frame: int, *, left: int = LEFT, gain: int = 0, arm: bool = True) -> Picture:
    """A red sheet below a dark arm, which is as wide as five columns."""
    image = wall(frame) + gain
    image[TOP : TOP + 50, left : left + 24] += np.array([-30, -130, -120])
    if arm:
        image[:TOP, left + 10 : left + 15] -= 150
    return np.clip(image, 0, 255).astype(np.uint8)


def truth(left: int = LEFT) -> NDArray[np.bool_]:
    mask = np.zeros((HEIGHT, WIDTH), np.bool_)
    mask[TOP : TOP + 50, left : left + 24] = True
    return mask


@pytest.fixture
def scene(color_tables: Any) -> Any:
    """The table of the empty wall."""
    return color_tables.of(BACKGROUND, background_rows(np.stack([wall(100 + frame) for frame in range(20)])))


def background_rows(stack: NDArray[Any]) -> list[dict[str, Any]]:
    """The rows of the table of these frames, (N, H, W, 3)."""
    rows = zip(stack.mean(axis=0), stack.std(axis=0, ddof=1), strict=True)
    return [
        {"v_px": v, "frame_count": len(stack), "mean": mean.ravel(), "std": std.ravel()}
        for v, (mean, std) in enumerate(rows)
    ]


def xtion_noise(seed: int) -> NDArray[np.float64]:
    white = np.random.default_rng(seed).normal(0, 6.0, (HEIGHT, WIDTH, 3))
    return np.asarray(cv2.GaussianBlur(white, (3, 3), 0.7), np.float64)


def stamps_ns(count: int) -> list[int]:
    return [START + frame * 33_000_000 for frame in range(count)]


@pytest.fixture
def run(recorder: Any, ros: Any, color_tables: Any, scene: Any) -> Any:
    """Run the stage on these pictures."""

    def run(
        *pictures: Picture,
        params: SilhouetteParams = EXACT,
        grippers_m: Sequence[Sequence[float] | None] | None = None,
        faulty: Sequence[int] = (),
        background: Any = None,
    ) -> list[dict[str, Any]]:
        stamps = stamps_ns(len(pictures))
        recorder.rows.clear()
        for stamp_ns, picture in zip(stamps, pictures, strict=True):
            recorder.add(TOPIC, ros.image(stamp_ns, "camera", picture, "rgb8"))
        bag: Path = recorder.write()
        tables = silhouette(
            bag,
            color_tables.frames(stamps, faulty),
            color_tables.camera((WIDTH, HEIGHT), FOCAL, CENTRE),
            color_tables.gripper(stamps, grippers_m or [GRIPPER_M] * len(pictures)),
            scene if background is None else background,
            params,
        )
        rows: list[dict[str, Any]] = tables["silhouettes"].to_pylist()
        return rows

    return run


def test_the_stage_declares_what_it_reads_and_makes() -> None:
    assert STAGE.inputs == ("frames", "camera", "gripper", "background")
    assert STAGE.outputs == (SILHOUETTES,)


def test_a_sheet_is_found_to_the_pixel(run: Any) -> None:
    rows = run(*(with_sheet(frame, left=LEFT + frame) for frame in range(4)))
    assert [row["stamp_ns"] for row in rows] == stamps_ns(4)
    for frame, row in enumerate(rows):
        mask = decode_mask(row["mask"])
        assert (mask == truth(LEFT + frame)).all()
        assert row["area_px2"] == 50 * 24
        box = [row[f"box_{name}_px"] for name in ("u", "v", "width", "height")]
        assert box == [LEFT + frame, TOP, 24, 50]
        assert (row["centroid_u_px"], row["centroid_v_px"]) == (LEFT + frame + 11.5, TOP + 24.5)
        # a rectangle of side a has the variance a^2 / 12 along it
        assert row["major_px"] == pytest.approx(4 * 50 / 12**0.5)
        assert row["minor_px"] == pytest.approx(4 * 24 / 12**0.5)
        assert row["orientation_rad"] == pytest.approx(np.pi / 2)
        assert (row["gripper_u_px"], row["gripper_v_px"]) == pytest.approx((72.0, 29.5))
        assert row["reason"] is None


def test_the_outline_runs_around_the_mask(run: Any) -> None:
    (row,) = run(with_sheet(0))
    outline = list(zip(row["outline_u_px"], row["outline_v_px"], strict=True))
    assert len(set(outline)) == len(outline) == 2 * (50 + 24) - 4
    steps = np.abs(np.diff([*outline, outline[0]], axis=0)).max(axis=1)
    assert (steps == 1).all()
    assert {u for u, _ in outline} == set(range(LEFT, LEFT + 24))


def test_frames_without_a_garment_have_null_rows_with_a_reason(run: Any) -> None:
    empty = np.clip(wall(1), 0, 255).astype(np.uint8)
    small = np.ascontiguousarray(with_sheet(2)[:60])
    pictures = (with_sheet(0), empty, small, with_sheet(3), with_sheet(4), with_sheet(5))
    grippers: list[Any] = [GRIPPER_M] * 6
    grippers[3], grippers[4] = None, (0.0, 0.0, -1.0)
    with pytest.warns(DataWarning, match="not known in 2 of 5 colour frames, first in frame 3"):
        rows = run(*pictures, grippers_m=grippers, faulty=(5,))
    reasons = {row["frame"]: row["reason"] for row in rows}
    assert reasons == {0: None, 1: "no_garment", 2: "image_size", 3: "no_gripper", 4: "no_gripper"}
    kept = {"frame", "stamp_ns", "reason", "gripper_u_px", "gripper_v_px", "drift_r", "drift_g", "drift_b"}
    for row in rows[1:]:
        assert {name for name, value in row.items() if value is not None} <= kept


def test_a_row_says_what_lowers_its_confidence(run: Any) -> None:
    grey = wall(1)
    grey[TOP : TOP + 50, LEFT : LEFT + 24] -= 40  # as flat as a shadow, and of the wall's hue
    red, doubted, none = run(with_sheet(0), grey.astype(np.uint8), wall(2).astype(np.uint8))
    assert (red["doubt"], red["reason"]) == (None, None)
    assert red["confidence"] > 0.95
    assert (doubted["doubt"], doubted["reason"]) == ("like_wall", None)
    assert doubted["confidence"] < 0.6
    assert (none["doubt"], none["confidence"]) == (None, None)


def test_a_speck_is_no_garment(run: Any) -> None:
    picture = np.clip(wall(0), 0, 255).astype(np.uint8)
    picture[33:40, 67:77] = 20
    assert run(picture)[0]["reason"] == "no_garment"
    (row,) = run(picture, params=EXACT.model_copy(update={"min_area_px2": 70}))
    assert (row["area_px2"], row["reason"]) == (70, None)


@pytest.mark.parametrize("slant", [0.0, 0.1, 0.3])
def test_a_sheet_seen_edge_on(run: Any, color_tables: Any, slant: float) -> None:
    """Eight pixels wide, blurred by the lens, in noise of an Xtion's size: its edges are found to a fraction of one."""
    fine = 8
    v, u = np.indices((HEIGHT * fine, WIDTH * fine)) / fine
    across = u - 70 - slant * (v - TOP)
    sheet = (v >= TOP) & (v < 110) & (np.abs(across) < 4 * np.hypot(1, slant))
    share = sheet.reshape(HEIGHT, fine, WIDTH, fine).mean(axis=(1, 3))
    soft = cv2.GaussianBlur(share, (5, 5), 0.6)[..., None]
    image = 190 + soft * np.array([-126, -48, -112]) + xtion_noise(1)
    empty = color_tables.of(BACKGROUND, background_rows(np.stack([190 + xtion_noise(seed) for seed in range(2, 22)])))
    (row,) = run(np.clip(np.rint(image), 0, 255).astype(np.uint8), background=empty)
    found, true = decode_mask(row["mask"]), share >= 0.5
    assert (found & true).sum() / (found | true).sum() > 0.95
    assert row["orientation_rad"] % np.pi == pytest.approx(np.arctan2(1, -slant) % np.pi, abs=np.radians(0.2))


def test_without_removing_the_gripper_the_arm_belongs_to_it_and_none_need_be_known(run: Any) -> None:
    params = SilhouetteParams(remove_gripper=False)
    (row,) = run(with_sheet(0), params=params, grippers_m=[None])
    assert row["box_v_px"] == 0
    assert row["area_px2"] == 50 * 24 + TOP * 5
    assert row["gripper_u_px"] is None


def test_the_surroundings_of_the_gripper_are_removed(run: Any) -> None:
    """At 1 m, 0.02 m are 3 pixels; rows above the end point are gone anyway."""
    (row,) = run(with_sheet(0), params=SilhouetteParams(gripper_radius_m=0.02))
    v, u = np.indices((HEIGHT, WIDTH))
    disc = (u - 72.0) ** 2 + (v - 29.5) ** 2 <= 3.0**2
    assert (decode_mask(row["mask"]) == (truth() & ~disc)).all()


def test_a_brighter_picture_changes_nothing_once_drift_is_allowed_for(run: Any) -> None:
    pictures = [with_sheet(0), with_sheet(0, gain=9)]
    plain, brighter = run(*pictures)
    assert decode_mask(brighter["mask"]).sum() == decode_mask(plain["mask"]).sum() == 1200
    for name in ("drift_r", "drift_g", "drift_b"):
        assert brighter[name] - plain[name] == pytest.approx(9, abs=0.05)
    with pytest.warns(DataWarning, match="background seems to be of another scene"):
        (ignored,) = run(with_sheet(0, gain=9), params=EXACT.model_copy(update={"drift": False, "shadows": False}))
    assert ignored["drift_r"] is None
    assert ignored["area_px2"] > 2 * 1200


def test_only_the_monochrome_part_is_looked_at_unless_told_otherwise(run: Any) -> None:
    """The cupboard has moved since the empty scene was recorded: a larger change than the sheet."""
    picture = with_sheet(0)
    picture[40:, 120:135] = picture[40:, 140:155]
    picture[40:, 135:] = 250
    where = {
        "auto": SilhouetteParams(gripper_radius_m=0.0),
        "none": SilhouetteParams(gripper_radius_m=0.0, clip="none", near_m=0.0),
        "polygon": SilhouetteParams(
            gripper_radius_m=0.0, clip_polygon=((0, 0), (LEFT + 11, 0), (LEFT + 11, 119), (0, 119))
        ),
    }
    areas = {}
    for name, params in where.items():
        (row,) = run(picture, params=params)
        areas[name] = row["area_px2"]
    assert areas["none"] == 80 * 40
    assert areas["auto"] == 1200
    assert areas["polygon"] == 50 * 12


def test_a_wall_that_is_nowhere_plain_is_not_clipped(run: Any, color_tables: Any, scene: Any) -> None:
    rows = scene.to_pylist()
    stripes = np.repeat(np.arange(WIDTH) % 6 < 3, 3) * 60.0
    for row in rows:
        row["mean"] = np.array(row["mean"]) - stripes
    picture = np.clip(with_sheet(0) - stripes.reshape(WIDTH, 3), 0, 255).astype(np.uint8)
    (row,) = run(picture, background=color_tables.of(BACKGROUND, rows))
    assert row["area_px2"] == pytest.approx(1200, rel=0.02)


def test_no_images_and_a_missing_camera_are_refused(run: Any, recorder: Any, color_tables: Any, scene: Any) -> None:
    run(with_sheet(0))
    stamps = stamps_ns(1)
    camera = color_tables.camera((WIDTH, HEIGHT), FOCAL, CENTRE)
    tables = (color_tables.frames(stamps), camera.slice(0, 1), color_tables.gripper(stamps, [GRIPPER_M]), scene)
    with pytest.raises(BagError, match="no colour images: found not one message"):
        silhouette(recorder.path, color_tables.frames([]), *tables[1:], EXACT)
    with pytest.raises(BagError, match=r"no camera for the colour images.* remove_gripper = false"):
        silhouette(recorder.path, *tables, EXACT)
    kept = silhouette(recorder.path, *tables, SilhouetteParams(remove_gripper=False))["silhouettes"]
    assert kept["reason"].to_pylist() == [None]


@pytest.mark.parametrize("wrong", [{"open_px": 4}, {"close_px": 2}, {"clip_polygon": [[0, 0], [1, 1]]}, {"alpha": 1}])
def test_parameters_that_make_no_sense_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        SilhouetteParams.model_validate(wrong)


def notes_of(run: Any, *pictures: Picture, **kwargs: Any) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run(*pictures, **kwargs)
    return [str(one.message) for one in caught]


def test_a_clip_that_keeps_next_to_nothing_is_said(run: Any) -> None:
    corner = SilhouetteParams(clip_polygon=((0, 0), (5, 0), (5, 5), (0, 5)))
    assert any("garments are looked for in 0." in note for note in notes_of(run, with_sheet(0), params=corner))
    assert notes_of(run, with_sheet(0)) == []


def test_a_background_of_another_scene_is_said(run: Any, color_tables: Any, scene: Any) -> None:
    rows = scene.to_pylist()
    for row in rows:
        row["mean"] = 255 - np.array(row["mean"])
    params = SilhouetteParams(clip="none", drift=False, remove_gripper=False)
    said = notes_of(run, with_sheet(0), params=params, background=color_tables.of(BACKGROUND, rows))
    assert any("the background seems to be of another scene" in note for note in said)


def test_light_that_was_switched_is_said(run: Any) -> None:
    brighter = np.clip(with_sheet(0).astype(np.int16) + 23, 0, 255).astype(np.uint8)
    said = notes_of(run, with_sheet(1), brighter, params=SilhouetteParams(clip="none"))
    assert any("brightness drifts from the background's by up to 2" in note for note in said)
