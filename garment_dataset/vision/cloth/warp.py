r"""Carry a patch through a recording: the lattice that fits every image, keeps lengths, and moves smoothly in time.

In frame t sample j is at :math:`g_t + r_j + \sum_c B_{jc} d_{tc}`: the gripper, the sample at rest, and how far the
controls have gone from there. The d of all frames minimise, by Gauss-Newton, a sum of squares: distances to the plane
that touches the depth image at the sample's line of sight, and of the outline's samples to the outline, both with the
weights of Geman and McClure; changes of the lengths of links; bending of the displacement; its acceleration between
frames. Frames are first fitted one by one from the rest outwards, and then all together, so that what is seen
later corrects what was guessed before.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.vision.cloth.lattice import Blend, Lattice, normal_matrix, normal_vector
from garment_dataset.vision.cloth.sight import of_the_cloth, sample

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import FloatArray, IntArray
    from garment_dataset.vision.cloth.patch import Patch
    from garment_dataset.vision.cloth.sight import Sight
    from garment_dataset.vision.depth.cloud import Intrinsics


@dataclass(frozen=True, slots=True)
class WarpSettings:
    """Standard deviations of what is minimised.

    Parameters
    ----------
    depth_std_m, outline_std_m : float
        Of a sample's distance from the image's surface, and from its outline.
    depth_cut_m, outline_cut_m : float
        Distances at which their weight has fallen to a quarter.
    strain : float
        Of a link's length, relative.
    bending_std_m : float
        Of a second difference of the controls.
    hold_std_m : float
        Of the cloth at the gripper.
    acceleration_m_s2 : float
        Of a control, relative to the gripper.
    control_step_m : (across, down)
        Distance of the controls.
    caution : float
        By how much errors exceed what these deviations and one frame's image let expect.
    fold_share : float
        How uncertain x is because folds roll, see :func:`~garment_dataset.vision.cloth.relief.fold_std_m`.
    alone, together : int
        Gauss-Newton steps of single frames, and of all together.
    """

    depth_std_m: float = 0.003
    outline_std_m: float = 0.003
    depth_cut_m: float = 0.012
    outline_cut_m: float = 0.03
    strain: float = 0.02
    bending_std_m: float = 0.004
    hold_std_m: float = 0.001
    acceleration_m_s2: float = 3.0
    control_step_m: tuple[float, float] = (0.03, 0.04)
    caution: float = 2.0
    fold_share: float = 0.2
    alone: int = 3
    together: int = 3


class Warp:
    """The problem of one recording.

    Parameters
    ----------
    patch : Patch
        At rest.
    sights : sequence of Sight, length T
        In the order of their stamps.
    grippers_m : (T, 3) float64
        End point of the gripper.
    intrinsics : Intrinsics
        Of the images.
    settings : WarpSettings
        See there.
    """

    def __init__(
        self,
        patch: Patch,
        sights: Sequence[Sight],
        grippers_m: FloatArray,
        intrinsics: Intrinsics,
        settings: WarpSettings,
    ) -> None:
        self._patch, self._sights, self._grippers_m = patch, sights, grippers_m
        self._intrinsics, self._settings = intrinsics, settings
        low_m, high_m = patch.places_m.min(axis=0), patch.places_m.max(axis=0)
        low_m[1] = min(low_m[1], 0.0)
        self.lattice = Lattice.over(low_m[:2], high_m[:2], settings.control_step_m)
        self._blend = self.lattice.blend(patch.places_m)
        first, second = patch.links.T
        self._link_blend = self._blend.take(second).less(self._blend.take(first))
        self._link_rest_m = patch.places_m[second] - patch.places_m[first]
        self._edge_blend, self._middle_blend = (self._blend.take(samples) for samples in patch.edges.T)
        self._fixed = self._fixed_normal()

    def _fixed_normal(self) -> FloatArray:
        """Return what is the same in all frames: bending and hold."""
        settings, count = self._settings, self.lattice.size
        bending = np.kron(np.eye(3), self.lattice.bending()) / settings.bending_std_m**2
        hold = self.lattice.blend(np.zeros((1, 2)))
        weight = np.full(1, settings.hold_std_m**-2)
        for axis in np.eye(3):
            bending += normal_matrix(hold, weight, axis[None], count)
        return bending + 1e-3 * np.eye(3 * count)

    def normal(self, frame: int, controls_m: FloatArray, tempered: float = 1.0) -> tuple[FloatArray, FloatArray]:
        """Return the normal matrix of one frame and the downhill vector at ``controls_m`` (C, 3), both of 3 C."""
        count = self.lattice.size
        matrix = self._fixed.copy()
        downhill = -(matrix @ controls_m.T.ravel())
        for blend, weight, direction, residual in (
            self._depth_rows(frame, controls_m, tempered),
            self._edge_rows(frame, controls_m, tempered),
            self._link_rows(controls_m),
        ):
            matrix += normal_matrix(blend, weight, direction, count)
            downhill -= normal_vector(blend, weight * residual, direction, count)
        return matrix, downhill

    def std_m(self, frame: int, controls_m: FloatArray, blend: Blend) -> FloatArray:
        """Return the standard deviations of places (r, 3) by what one frame shows; large where it shows nothing."""
        count = self.lattice.size
        covariance = np.linalg.inv(self.normal(frame, controls_m)[0]).reshape(3, count, 3, count)
        variances = [
            np.einsum("mk,ml,mkl->m", blend.weight, blend.weight, covariance[axis][:, axis][_pairs(blend)])
            for axis in range(3)
        ]
        std_m: FloatArray = np.sqrt(np.stack(variances, axis=1))
        return std_m

    def misfit_m(self, frame: int, controls_m: FloatArray) -> float:
        """Return how far, root mean square, an image's surface is from the samples that it shows; far ones count less.

        NaN where it shows none.
        """
        _, weight, _, residual = self._depth_rows(frame, controls_m, 1.0)
        away_m = np.minimum(np.abs(residual[weight > 0]), self._settings.depth_cut_m)
        return float(np.sqrt(np.mean(away_m**2))) if away_m.size else float("nan")

    def _depth_rows(
        self, frame: int, controls_m: FloatArray, tempered: float
    ) -> tuple[Blend, FloatArray, FloatArray, FloatArray]:
        """Return the samples' distances from the image's surface."""
        settings, k, sight = self._settings, self._intrinsics, self._sights[frame]
        x_m, y_m, z_m = (self._patch.places_m + self._blend.apply(controls_m) + self._grippers_m[frame]).T
        u = k.cx_px + k.fx_px * x_m / z_m - sight.corner_px[0]
        v = k.cy_px + k.fy_px * y_m / z_m - sight.corner_px[1]
        seen_m = sample(sight.z_m, u, v)
        across = (sample(sight.z_m, u + 2, v) - sample(sight.z_m, u - 2, v)) / 4
        down = (sample(sight.z_m, u, v + 2) - sample(sight.z_m, u, v - 2)) / 4
        good = np.isfinite(seen_m) & np.isfinite(across) & np.isfinite(down)
        seen_m, across, down = (np.where(good, values, 0.0) for values in (seen_m, across, down))
        direction = np.stack(
            [
                -across * k.fx_px / z_m,
                -down * k.fy_px / z_m,
                1 + (across * k.fx_px * x_m + down * k.fy_px * y_m) / z_m**2,
            ],
            axis=1,
        )
        steepness = np.linalg.norm(direction, axis=1)
        residual = np.where(good, z_m - seen_m, 0.0) / steepness
        weight = good * _robust(residual, settings.depth_cut_m * tempered) / settings.depth_std_m**2
        return self._blend, weight, direction / steepness[:, None], residual

    def _edge_rows(
        self, frame: int, controls_m: FloatArray, tempered: float
    ) -> tuple[Blend, FloatArray, FloatArray, FloatArray]:
        """Return the distances along x of the samples beside an edge from where the edge now is.

        It is looked for from the middle of the row: where the layer that is seen there ends.
        """
        settings, k, sight, patch = self._settings, self._intrinsics, self._sights[frame], self._patch
        edge_m = patch.places_m[patch.edges[:, 0]] + self._edge_blend.apply(controls_m) + self._grippers_m[frame]
        x_m, y_m, z_m = edge_m.T
        middle_m = patch.places_m[patch.edges[:, 1]] + self._middle_blend.apply(controls_m) + self._grippers_m[frame]
        height, width = sight.before_px.shape
        u = np.rint(k.cx_px + k.fx_px * middle_m[:, 0] / middle_m[:, 2] - sight.corner_px[0]).astype(np.int64)
        v = np.rint(k.cy_px + k.fy_px * y_m / z_m - sight.corner_px[1]).astype(np.int64)
        good = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        u, v = u.clip(0, width - 1), v.clip(0, height - 1)
        first, last = sight.before_px[v, u], sight.after_px[v, u]
        edge = np.where(patch.edge_side < 0, first, last).astype(np.float64)
        good &= (first <= last) & of_the_cloth(edge, width)
        residual = x_m - (edge + sight.corner_px[0] - patch.edge_side * patch.inset_px - k.cx_px) / k.fx_px * z_m
        residual = np.where(good, residual, 0.0)
        weight = good * _robust(residual, settings.outline_cut_m * tempered) / settings.outline_std_m**2
        return self._edge_blend, weight, np.tile([1.0, 0.0, 0.0], (u.size, 1)), residual

    def _link_rows(self, controls_m: FloatArray) -> tuple[Blend, FloatArray, FloatArray, FloatArray]:
        """Return the changes of the links' lengths."""
        way_m = self._link_rest_m + self._link_blend.apply(controls_m)
        length_m = np.linalg.norm(way_m, axis=1)
        weight = (self._settings.strain * self._patch.lengths_m) ** -2
        return self._link_blend, weight, way_m / length_m[:, None], length_m - self._patch.lengths_m


def _pairs(blend: Blend) -> tuple[IntArray, IntArray]:
    return blend.index[:, :, None], blend.index[:, None, :]


def _robust(residual: FloatArray, cut: float) -> FloatArray:
    """Return the weights of Geman and McClure."""
    weights: FloatArray = (1 + (residual / cut) ** 2) ** -2
    return weights
