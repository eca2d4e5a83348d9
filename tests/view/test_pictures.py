"""Pictures: colours over the garment's own range, points told apart, and refusals with the fault."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from garment_dataset.errors import UsageError
from garment_dataset.view.depth import POINT_COLORS, POINT_MARKERS, DepthFrame, draw_depth
from garment_dataset.view.frames import check_usable

CAMERA = pd.Series({"fx_px": 100.0, "fy_px": 100.0, "cx_px": 20.0, "cy_px": 15.0})


def depth_frame(reason: str | None = None) -> DepthFrame:
    depth_mm = np.full((30, 40), 3000, np.uint16)
    depth_mm[:, 15:25] = 1000
    depth_mm[20:, 15:25] = 1040
    depth_mm[:, 35:] = 0
    y_m = np.linspace(-0.1, 0.1, 21)
    chain = pd.DataFrame({"x_m": 0.0, "y_m": y_m, "z_m": np.linspace(1.0, 1.04, 21), "pixels": [9] * 15 + [0] * 6})
    points = pd.DataFrame(
        {
            "point": [1, 2, 3],
            "x_m": 0.0,
            "y_m": [-0.08, 0.0, np.nan if reason else 0.08],
            "z_m": [1.0, 1.02, np.nan if reason else 1.04],
            "y_std_m": 0.01,
            "z_std_m": 0.002,
            "reason": [None, None, reason],
        }
    )
    gripper = pd.Series({"x_m": 0.0, "y_m": -0.1, "z_m": 1.0})
    return DepthFrame(depth_mm, CAMERA, gripper, chain, points)


def drawn(frame: DepthFrame) -> Figure:
    figure = Figure(figsize=(12, 6))
    draw_depth(figure, frame, "title", band_half_width_m=0.27)
    return figure


def test_colours_change_over_the_garments_own_depths() -> None:
    image = drawn(depth_frame()).axes[0].images[0]
    nearest, farthest = image.get_clim()
    assert 0.98 <= nearest <= 1.0
    assert 1.04 <= farthest <= 1.06
    colors = image.to_rgba(np.array([[0.5, 1.0, 1.04, 3.0]]))[0]
    assert tuple(colors[0][:3]) == to_rgb("black")
    assert tuple(colors[3][:3]) == to_rgb("white")
    assert np.abs(colors[1] - colors[2]).max() > 0.5


def test_points_differ_in_colour_and_in_shape() -> None:
    assert len(set(POINT_COLORS)) == len(set(POINT_MARKERS)) == len(POINT_COLORS) == len(POINT_MARKERS)
    brightness = [np.dot(to_rgb(color), (0.299, 0.587, 0.114)) for color in POINT_COLORS]
    assert np.ptp(brightness) > 0.3
    lines = drawn(depth_frame()).axes[0].lines
    shapes = [line.get_marker() for line in lines if line.get_marker() in POINT_MARKERS]
    assert shapes == list(POINT_MARKERS[:3])


def test_what_no_pixel_carries_is_marked_and_missing_points_give_their_reason() -> None:
    figure = drawn(depth_frame("gap"))
    legend = figure.axes[1].get_legend()
    assert legend is not None
    assert "bridged: no pixels" in [text.get_text() for text in legend.get_texts()]
    assert figure.get_suptitle() == "title; 1 without a point: gap"


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (9, "no such depth frame: expected 0 to 2, found 9"),
        (1, r"depth frame 1 is not used: found data: torn\. The nearest that can be drawn is 0"),
    ],
)
def test_a_frame_that_cannot_be_drawn_is_refused_with_the_reason(frame: int, message: str) -> None:
    images = pd.DataFrame({"frame": [0, 1, 2], "fault": [None, "data: torn", None]})
    with pytest.raises(UsageError, match=message):
        check_usable(images, "NAME", frame, "depth")
    check_usable(images, "NAME", 2, "depth")


def test_a_stream_without_images_is_said_without_nan() -> None:
    nothing = pd.DataFrame({"frame": [], "fault": []})
    with pytest.raises(UsageError, match="no color images") as caught:
        check_usable(nothing, "NAME", 0, "color")
    assert "nan" not in str(caught.value).replace("NAME", "")
    all_torn = pd.DataFrame({"frame": [0], "fault": ["torn"]})
    with pytest.raises(UsageError, match="Not one of them can be used"):
        check_usable(all_torn, "NAME", 0, "color")
