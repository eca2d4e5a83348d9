"""Central curves from stored masks: a straight, a slanted and a forked sheet with known midlines."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.stages.central_curve import CENTRAL_CURVES, STAGE, CentralCurveParams, central_curve
from garment_dataset.stages.silhouette import describe_mask
from garment_dataset.stages.silhouette_table import SILHOUETTES

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

SHAPE = (120, 160)


def table_of(*masks: NDArray[np.bool_]) -> Any:
    """Return the silhouettes of these masks, as frames 0, 2, 4, …"""
    rows = [{"frame": 2 * i, "stamp_ns": 1000 + i, **describe_mask(mask)} for i, mask in enumerate(masks)]
    return SILHOUETTES.table({column.name: [row.get(column.name) for row in rows] for column in SILHOUETTES.columns})


def run(*masks: NDArray[np.bool_], **knobs: Any) -> pd.DataFrame:
    frame: pd.DataFrame = central_curve(table_of(*masks), CentralCurveParams(**knobs))["central_curves"].to_pandas()
    return frame


def block(top: int, height: int, left: int, width: int) -> NDArray[np.bool_]:
    mask = np.zeros(SHAPE, np.bool_)
    mask[top : top + height, left : left + width] = True
    return mask


def test_the_stage_needs_nothing_but_the_silhouettes() -> None:
    assert (STAGE.inputs, STAGE.arguments, STAGE.outputs) == (("silhouettes",), ("silhouettes",), (CENTRAL_CURVES,))


def test_a_straight_sheet_is_cut_at_the_pitch() -> None:
    curve = run(block(20, 80, 60, 21), pitch_px=4.0)
    assert curve["cut"].tolist() == list(range(20))
    np.testing.assert_allclose(curve["u_px"], 70.0)
    np.testing.assert_allclose(curve["width_px"].iloc[1:-1], 21.0)
    np.testing.assert_allclose(curve["width_px"], 21.0, atol=0.05)  # corners between the middles of edges are cut off
    np.testing.assert_allclose(curve["position_px"], 2.0 + 4.0 * np.arange(20))
    np.testing.assert_allclose(curve["v_px"], 19.5 + curve["position_px"])
    np.testing.assert_allclose(curve["arc_length_px"], 4.0 * np.arange(20), atol=1e-12)
    assert set(curve["parts"]) == {1}
    assert set(curve["frame"]) == {0}


def test_frames_without_a_mask_have_no_cuts() -> None:
    curve = run(block(20, 80, 60, 20), np.zeros(SHAPE, np.bool_), block(10, 60, 30, 20), pitch_px=10.0)
    assert curve.groupby("frame").size().to_dict() == {0: 8, 4: 6}
    assert curve.groupby("frame")["stamp_ns"].first().to_dict() == {0: 1000, 4: 1002}
    nothing = run(np.zeros(SHAPE, np.bool_))
    assert len(nothing) == 0
    assert list(nothing.columns) == [column.name for column in CENTRAL_CURVES.columns]


def test_a_fork_is_told_by_its_parts() -> None:
    """Two legs of 10 columns, 20 apart: the curve runs between them, and each cut of them meets two parts."""
    fork = block(20, 40, 60, 40) | block(60, 40, 60, 10) | block(60, 40, 90, 10)
    curve = run(fork, pitch_px=5.0)
    np.testing.assert_allclose(curve["u_px"], 79.5)
    np.testing.assert_allclose(curve["width_px"], 40.0)
    assert curve["parts"].tolist() == [1] * 8 + [2] * 8


@pytest.mark.parametrize("lines", [1, 5])
def test_a_slanted_sheet(lines: int) -> None:
    """A strip of 24 px at 20 degrees from the vertical: its midline is straight, and half of it is 50 px long."""
    v, u = np.indices(SHAPE)
    angle = np.radians(20)
    along = (u - 80) * np.sin(angle) + (v - 60) * np.cos(angle)
    across = (u - 80) * np.cos(angle) - (v - 60) * np.sin(angle)
    curve = run((np.abs(along) <= 50) & (np.abs(across) <= 12), lines=lines)
    off = (curve["u_px"] - 80) * np.cos(angle) - (curve["v_px"] - 60) * np.sin(angle)
    assert np.abs(off.iloc[1:-1]).max() < 0.35
    assert curve["arc_length_px"].iloc[-1] == pytest.approx(100 - 5, abs=2)


@given(st.integers(0, 60), st.integers(0, 100), st.integers(20, 50), st.integers(3, 15))
def test_a_shifted_mask_has_a_shifted_curve(dv: int, du: int, height: int, width: int) -> None:
    here, there = block(0, height, 0, width), block(dv, height, du, width)
    here[height // 2 :, width // 2] = there[dv + height // 2 :, du + width // 2] = False
    here[height - 1, :width] = there[dv + height - 1, du : du + width] = True
    both = run(here, there, pitch_px=3.0)
    one, other = (both[both["frame"] == frame].reset_index(drop=True) for frame in (0, 2))
    np.testing.assert_allclose(one["u_px"] + du, other["u_px"], atol=1e-9)
    np.testing.assert_allclose(one["v_px"] + dv, other["v_px"], atol=1e-9)
    same = ["cut", "width_px", "position_px", "arc_length_px", "parts"]
    np.testing.assert_allclose(one[same], other[same], atol=1e-9)
