"""How far a silhouette is trusted: less, the more of it is edge, pale or torn off."""

from __future__ import annotations

import numpy as np

from garment_dataset.vision.color.confidence import Confidence, confidence, inner_part

CONTRAST = np.full((100, 100), 100.0)
NOWHERE = np.zeros((100, 100), np.bool_)


def block(height_px: int = 60, width_px: int = 60) -> np.ndarray:
    mask = np.zeros((100, 100), np.uint8)
    mask[10 : 10 + height_px, 10 : 10 + width_px] = 1
    return mask


def judged(
    mask: np.ndarray,
    *,
    pale: np.ndarray = NOWHERE,
    lost_px: int = 0,
    noise: float = 1.0,
    alone: bool = False,
    doubtful_px: int = 0,
) -> Confidence:
    return confidence(
        mask,
        CONTRAST[inner_part(mask) > 0],
        pale,
        by_edges_alone=alone,
        doubtful_px=doubtful_px,
        lost_px=lost_px,
        noise=noise,
    )


def test_a_broad_sheet_of_clear_contrast_is_sure() -> None:
    assert judged(block()).value > 0.98
    assert judged(block()).doubt is None


def test_it_falls_as_parts_are_deleted() -> None:
    """Here and there: what is left has more edges."""
    mask, values = block(), []
    order = np.random.default_rng(1).permutation(36)
    for part in order[:12].tolist():
        values.append(judged(mask, noise=3.0).value)
        v, u = divmod(part, 6)
        mask[12 + 10 * v : 18 + 10 * v, 12 + 10 * u : 18 + 10 * u] = 0
    assert (np.diff(values) < 0).all()
    assert judged(mask, noise=3.0).doubt == "edges"


def test_it_falls_as_parts_are_torn_off() -> None:
    values = [judged(block(height_px), lost_px=60 * (60 - height_px)).value for height_px in (60, 50, 40, 30)]
    assert (np.diff(values) < -0.1).all()
    assert judged(block(40), lost_px=1200).doubt == "torn"


def test_it_falls_with_the_noise_and_for_thin_sheets() -> None:
    assert judged(block(), noise=1.0).value > judged(block(), noise=4.0).value
    assert judged(block(60, 60), noise=2.0).value > judged(block(60, 8), noise=2.0).value > judged(block(60, 3)).value


def test_it_falls_with_what_the_wall_could_be() -> None:
    pale = NOWHERE.copy()
    pale[10:40] = True
    assert judged(block(), pale=pale).value < judged(block()).value - 0.1
    assert judged(block(), pale=pale).doubt == "like_wall"
    assert judged(block(), alone=True).value < 0.5


def test_it_falls_with_what_beside_it_could_be_cloth() -> None:
    values = [judged(block(), doubtful_px=count).value for count in (0, 500, 2000, 5000)]
    assert (np.diff(values) < 0).all()
    assert judged(block(), doubtful_px=5000).doubt == "like_wall"


def test_it_stays_within_0_and_1() -> None:
    assert judged(block(60, 1), lost_px=5000, noise=90.0, alone=True).value == 0
