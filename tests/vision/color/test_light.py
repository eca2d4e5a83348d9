"""What is had only around the garment is what the whole picture would give there."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from garment_dataset.vision.color.background import Background
from garment_dataset.vision.color.light import GainEstimator, Light, LightFinder

Picture = NDArray[np.uint8]
GAIN = np.array([1.04, 0.97, 1.01])


def scene(height: int, width: int) -> NDArray[np.float64]:
    light = 1 - 0.2 * np.linspace(-1, 1, width)[None, :, None] ** 2
    return np.asarray(np.array([180.0, 170.0, 160.0]) * light * np.ones((height, 1, 1)))


def frame(height: int, width: int, left: int) -> Picture:
    picture = scene(height, width) * GAIN
    picture[40:150, left + 12 : left + 60] *= 0.75  # its shadow
    picture[40:150, left : left + 40] = (60, 120, 70)
    noise = np.random.default_rng(left).normal(0, 2, picture.shape)
    return np.asarray(np.clip(np.rint(picture + noise), 0, 255), np.uint8)


def looked_at(height: int, width: int, left: int) -> Light:
    cut = np.zeros((height, width), np.bool_)
    light = LightFinder(scene(height, width))(frame(height, width, left), GAIN, cut, None)
    assert isinstance(light, Light)
    return light


@pytest.mark.parametrize(("height", "width"), [(200, 260), (201, 261)])
@pytest.mark.parametrize("left", [0, 90, 220])
def test_the_box_holds_the_garment_and_what_it_may_go_on_to(height: int, width: int, left: int) -> None:
    light = looked_at(height, width, left)
    rows, columns = light.box
    assert light.garment.shape == light.share.shape == (rows.stop - rows.start, columns.stop - columns.start)
    whole = np.zeros((height, width), np.uint8)
    whole[light.box] = light.garment
    truth = np.zeros((height, width), np.bool_)
    truth[40:150, left : left + 40] = True
    truth = truth[:, :width]
    assert np.count_nonzero((whole > 0) & truth) > 0.95 * np.count_nonzero(truth)
    for side, size in ((light.garment[0], rows.start), (light.garment[-1], height - rows.stop)):
        assert size == 0 or not side.any()


@pytest.mark.parametrize(("height", "width"), [(200, 260), (201, 261)])
def test_what_is_expected_is_mean_times_gain_times_share(height: int, width: int) -> None:
    light, mean = looked_at(height, width, 90), scene(height, width)
    plain = mean[light.box] * GAIN * light.share[..., np.newaxis]
    np.testing.assert_array_equal(light.expected(mean, GAIN), plain)


@pytest.mark.parametrize("left", [0, 90, 220])
def test_the_light_around_a_garment_is_that_of_the_wall(left: int) -> None:
    """In its shadow less; nowhere more than there is."""
    light = looked_at(200, 260, left)
    u = np.arange(260)[light.box[1]]
    beside, shadow = (u < left) | (u >= left + 62), (u >= left + 44) & (u < left + 58)
    row = light.share[100 - light.box[0].start]
    assert np.abs(row[beside] - 1).max(initial=0) < 0.06
    assert shadow.sum() == 0 or np.abs(row[shadow] - 0.75).max() < 0.06
    assert light.share.max() < 1.06


def test_the_gain_is_found_beside_a_garment() -> None:
    mean = scene(200, 260)
    model = Background(mean, np.full(mean.shape, 2.0), 40)
    found = GainEstimator(model)(frame(200, 260, 90))
    np.testing.assert_allclose(found, GAIN, rtol=3e-3)


def test_no_gain_is_told_where_nothing_agrees() -> None:
    mean = scene(200, 260)
    model = Background(mean, np.full(mean.shape, 2.0), 40)
    other = cv2.resize(np.random.default_rng(0).integers(0, 256, (100, 130, 3), np.uint8), (260, 200))
    assert np.isnan(GainEstimator(model)(np.asarray(other, np.uint8))).all()
