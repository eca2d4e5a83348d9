from __future__ import annotations

import numpy as np

from garment_dataset.simulate.followed import seen_on

TRIANGLES = np.array([[0, 1, 2], [3, 4, 5]])
NEAR = np.array([[-1.0, -1.0, 1.0], [1.0, -1.0, 1.1], [0.0, 1.0, 1.2]])
SURFACE_M = np.vstack([NEAR, NEAR + np.array([0.0, 0.0, 0.2])])


def test_points_stay_on_the_layer_that_they_were_seen_on() -> None:
    shares = np.array([[0.2, 0.3, 0.5], [0.6, 0.2, 0.2]])
    start_m = np.stack([shares[0] @ SURFACE_M[:3], shares[1] @ SURFACE_M[3:]])
    blend = seen_on(start_m, SURFACE_M, TRIANGLES)
    np.testing.assert_allclose(blend.apply(SURFACE_M), start_m, atol=1e-12)
    moved_m = np.random.default_rng(0).standard_normal((6, 3))
    np.testing.assert_allclose(blend.apply(moved_m), [shares[0] @ moved_m[:3], shares[1] @ moved_m[3:]], atol=1e-12)


def test_a_point_between_layers_goes_to_the_nearer_one_on_its_line_of_sight() -> None:
    on_near = np.array([0.3, 0.3, 0.4]) @ NEAR
    blend = seen_on(np.stack([1.05 * on_near]), SURFACE_M, TRIANGLES)
    np.testing.assert_allclose(blend.apply(SURFACE_M), [on_near], atol=1e-12)
