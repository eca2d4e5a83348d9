"""The background of a written bag: exact numbers, the interval to the nanosecond, and what is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.errors import BagError, PictureError
from garment_dataset.stages.background import BACKGROUND, STAGE, BackgroundParams, background, background_model

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

TOPIC = "/xtion1/rgb/image_raw"
START = 1_391_700_000_000_000_000
STAMPS = [START + frame * 100_000_000 for frame in range(10)]


def picture(frame: int) -> NDArray[np.uint8]:
    """A picture of 4 rows and 6 columns, other in every pixel and channel: a swap shows."""
    return (7 * frame + np.arange(72) + (frame % 2) * np.arange(72)[::-1]).reshape(4, 6, 3).astype(np.uint8)


def write(recorder: Any, ros: Any, *, sizes: dict[int, tuple[int, int]] | None = None) -> Path:
    for frame, stamp_ns in enumerate(STAMPS):
        height, width = (sizes or {}).get(frame, (4, 6))
        pixels = picture(frame)[:height, :width]
        recorder.add(TOPIC, ros.image(stamp_ns, "camera", np.ascontiguousarray(pixels), "rgb8"))
    path: Path = recorder.write()
    return path


def expected(frames: list[int]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    stack = np.stack([picture(frame) for frame in frames]).astype(np.float64)
    return stack.mean(axis=0), stack.std(axis=0, ddof=1)


def test_the_stage_runs_once_per_camera_position() -> None:
    assert (STAGE.name, STAGE.per, STAGE.inputs, STAGE.outputs) == (
        "background",
        "position",
        ("frames",),
        (BACKGROUND,),
    )
    assert STAGE.partitions == ()


@pytest.mark.parametrize(
    ("interval", "frames"),
    [
        ({}, list(range(10))),
        ({"from_s": 0.3}, list(range(3, 10))),
        ({"to_s": 0.5}, list(range(5))),
        ({"from_s": 0.2, "to_s": 0.4000001}, [2, 3, 4]),
        ({"from_s": 0.1999, "to_s": 0.4}, [2, 3]),
    ],
)
def test_mean_and_deviation_of_an_interval(
    recorder: Any, ros: Any, color_tables: Any, interval: dict[str, float], frames: list[int]
) -> None:
    """The interval begins with its first instant and ends before its last."""
    params = BackgroundParams.model_validate(interval)
    table = background(write(recorder, ros), color_tables.frames(STAMPS), params)["background"]
    model = background_model(table)
    mean, std = expected(frames)
    np.testing.assert_allclose(model.mean, mean, rtol=1e-15)
    np.testing.assert_allclose(model.std, std, rtol=1e-12, atol=1e-12)
    assert model.count == len(frames)
    assert table["v_px"].to_pylist() == [0, 1, 2, 3]


def test_faulty_messages_are_kept_out(recorder: Any, ros: Any, color_tables: Any) -> None:
    """The first usable frame counts for the interval, too."""
    bag = write(recorder, ros)
    frames = color_tables.frames(STAMPS, faulty=(0, 4))
    model = background_model(background(bag, frames, BackgroundParams(to_s=0.5))["background"])
    np.testing.assert_allclose(model.mean, expected([1, 2, 3, 5])[0], rtol=1e-15)


@pytest.mark.parametrize(
    ("interval", "message"),
    [
        ({"from_s": 0.9}, "at least 2 usable colour frames from 0.9 s to its end, found 1"),
        ({"from_s": 5.0, "to_s": 6.0}, "from 5 s to 6 s, found 0"),
    ],
)
def test_too_few_frames_are_refused(
    recorder: Any, ros: Any, color_tables: Any, interval: dict[str, float], message: str
) -> None:
    with pytest.raises(BagError, match=rf"Test_Free_pi16_0\.5_R1\.bag: .*{message}"):
        background(write(recorder, ros), color_tables.frames(STAMPS), BackgroundParams.model_validate(interval))


def test_no_colour_images_and_unequal_ones_are_refused(recorder: Any, ros: Any, color_tables: Any) -> None:
    bag = write(recorder, ros, sizes={3: (3, 6)})
    with pytest.raises(BagError, match=r"at least 2 usable colour frames.* found 0"):
        background(bag, color_tables.frames([]), BackgroundParams())
    with pytest.raises(PictureError, match="unequal size"):
        background(bag, color_tables.frames(STAMPS), BackgroundParams())


@given(st.integers(1, 5), st.integers(1, 7), st.integers(2, 6), st.randoms(use_true_random=False))
def test_the_table_gives_the_model_back(height: int, width: int, count: int, random: Any) -> None:
    shape = (height, width, 3)
    numbers = np.array([random.uniform(0, 255) for _ in range(2 * height * width * 3)]).reshape(2, *shape)
    columns = {name: [row.ravel() for row in values] for name, values in zip(("mean", "std"), numbers, strict=True)}
    table = BACKGROUND.table({"v_px": range(height), "frame_count": [count] * height, **columns})
    model = background_model(table)
    assert (model.mean == numbers[0]).all()
    assert (model.std == numbers[1]).all()
    assert model.count == count
