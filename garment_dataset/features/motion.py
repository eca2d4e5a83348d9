"""One recording as an estimator wants it: arrays over frames and points, and how their errors hang together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from garment_dataset.errors import FilterError, StoreError, UsageError, did_you_mean, one_of
from garment_dataset.features.reading import load_features

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    IntArray = NDArray[np.int64]

Quantity = Literal["position", "displacement", "velocity"]

_COLUMNS = {
    "position": ("{}_m", "{}_std_m"),
    "displacement": ("d{}_m", "d{}_std_m"),
    "velocity": ("v{}_m_s", "v{}_std_m_s"),
    "acceleration": ("a{}_m_s2", "a{}_std_m_s2"),
}


@dataclass(frozen=True, slots=True, eq=False)
class Correlation:
    r"""How the errors of a quantity hang together; arrays (r + 1, 3) by point and axis, NaN for the gripper.

    Between frames i and j of one point they correlate by :math:`s + (1 - s) \rho^{|i - j|}`.

    Parameters
    ----------
    standing_share : ndarray
        s.
    moving_lag1 : ndarray
        rho.
    effective_frames : ndarray
        Independent frames that the mean over all is worth.
    next_point : ndarray
        Correlation with the next point's; NaN for the last.
    """

    standing_share: FloatArray
    moving_lag1: FloatArray
    effective_frames: FloatArray
    next_point: FloatArray


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Motion:
    """The motion of one recording: T frames in the order of their time, the gripper as point 0 and r points.

    Vectors are in the depth optical frame: x right, y down, z forward. What is not known is NaN, or None.

    Parameters
    ----------
    recording : str
        Its name.
    frame, stamp_ns : (T,) int64
        Index of the image; header stamp. Frames whose stamp does not fit in are left out.
    time_s : (T,) float64
        Since the onset; NaN without one.
    position_m, position_std_m : (T, r + 1, 3) float64
        And standard uncertainties, as of all that follow.
    displacement_m, displacement_std_m : (T, r + 1, 3) float64
        From rest.
    velocity_m_s, velocity_std_m_s : (T, r + 1, 3) float64
        At the stamps, unless ``kinematics`` was asked for the thesis' differences.
    acceleration_m_s2, acceleration_std_m_s2 : (T, r + 1, 3) float64
        At the stamps.
    gripper_quaternion : (T, 4) float64
        Orientation of the gripper, x y z w.
    pixels, bridged_m : (T, r + 1) float64
        Pixels a point rests on; length of the bridge it lies on.
    onset_stamp_ns : int or None
        When the gripper began to move.
    onset_std_s : float
        Its standard uncertainty: one error of all times.
    onset_reason : str or None
        Why there is no onset.
    garment_length_m, garment_length_std_m, segment_length_m, segment_length_std_m : float
        At rest; a segment is the r-th part.
    gravity_m_s2 : (3,) float64
        Gravity.
    gravity_source : str or None
        ``world`` or ``hanging``.
    width_m, height_m, weight_kg : float
        Of the garment, by the catalog.
    rest_noise_m, moving_noise_m : float
        Scatter of coordinates at rest, and about cubics in motion.
    correlations : mapping of str to Correlation
        Of position, displacement and velocity.
    """

    recording: str
    frame: IntArray
    stamp_ns: IntArray
    time_s: FloatArray
    position_m: FloatArray
    position_std_m: FloatArray
    displacement_m: FloatArray
    displacement_std_m: FloatArray
    velocity_m_s: FloatArray
    velocity_std_m_s: FloatArray
    acceleration_m_s2: FloatArray
    acceleration_std_m_s2: FloatArray
    gripper_quaternion: FloatArray
    pixels: FloatArray
    bridged_m: FloatArray
    onset_stamp_ns: int | None
    onset_std_s: float
    onset_reason: str | None
    garment_length_m: float
    garment_length_std_m: float
    segment_length_m: float
    segment_length_std_m: float
    gravity_m_s2: FloatArray
    gravity_source: str | None
    width_m: float
    height_m: float
    weight_kg: float
    rest_noise_m: float
    moving_noise_m: float
    correlations: Mapping[str, Correlation]

    def __repr__(self) -> str:
        onset = f"onset {self.onset_stamp_ns} ns" if self.onset_reason is None else f"no onset: {self.onset_reason}"
        return f"<Motion {self.recording}: {len(self.frame)} frames, gripper and {self.point_count} points, {onset}>"

    @property
    def point_count(self) -> int:
        """Number of points on the garment: r."""
        return int(self.position_m.shape[1]) - 1

    def covariance(self, quantity: Quantity, axis: int) -> FloatArray:
        r"""Return the covariance of the errors of all points along one axis, over all frames.

        Parameters
        ----------
        quantity : {"position", "displacement", "velocity"}
            Of whose errors.
        axis : int
            0, 1 or 2 for x, y or z.

        Returns
        -------
        (T r, T r) float64
            Unit of the quantity squared; rows and columns as of ``quantity[:, 1:, axis].ravel()``, NaN where there is
            no standard uncertainty.

        Raises
        ------
        UsageError
            If there is no such quantity or axis.

        Notes
        -----
        Between point p in frame i and point q in frame j: :math:`\sigma_{ip} \sigma_{jq} c_{pq}
        (\sqrt{s_p s_q} + \sqrt{(1 - s_p)(1 - s_q)}\, \rho^{|i - j|})`, with :math:`c_{pq}` the product of the
        correlations of next points between them.
        """
        import numpy as np

        if quantity not in self.correlations:
            hint = did_you_mean(quantity, self.correlations)
            expected = one_of(self.correlations)
            raise UsageError("no such quantity", expected=expected, found=repr(quantity), hint=hint)
        if axis not in {0, 1, 2}:
            raise UsageError("no such axis", expected="0, 1 or 2 for x, y or z", found=repr(axis))
        std: FloatArray = getattr(self, {"velocity": "velocity_std_m_s"}.get(quantity, f"{quantity}_std_m"))
        found = self.correlations[quantity]
        share, rho = found.standing_share[1:, axis], found.moving_lag1[1:, axis].mean()
        chain = np.concatenate([[1.0], np.cumprod(found.next_point[1:-1, axis])])
        low, high = np.sort(np.stack(np.meshgrid(*[np.arange(self.point_count)] * 2)), axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            along = np.where(high == low, 1.0, np.nan_to_num(chain[high] / chain[low]))
        steps = rho ** np.abs(self.frame[:, None] - self.frame)
        standing = np.kron(np.ones_like(steps), along * np.sqrt(np.outer(share, share)))
        moving = np.kron(steps, along * np.sqrt(np.outer(1 - share, 1 - share)))
        sigma = std[:, 1:, axis].ravel()
        covariance: FloatArray = (standing + moving) * np.outer(sigma, sigma)
        return covariance


def load_motion(recording: str, folder: Path | str | None = None, variant: str = "") -> Motion:
    """Return the motion of one recording, from the tables ``kinematics``, ``motion``, ``correlations`` and ``gripper``.

    Parameters
    ----------
    recording : str
        Name of the recording.
    folder : Path or str, optional
        The features folder, or a snapshot; by default that of the workspace at or above the current folder.
    variant : str
        Whose results; by default those of the pipelines without a variant.

    Raises
    ------
    StoreError
        If there are no such results.
    """
    try:
        whole, errors, rows = (
            load_features(table, folder=folder, variant=variant, recording=recording)
            for table in ("motion", "correlations", "kinematics")
        )
    except FilterError as error:
        raise StoreError(
            f"no {error.where} of {recording}", where=folder, expected=error.expected, hint=error.hint
        ) from error
    gripper = load_features("gripper", folder=folder, variant=variant, recording=recording, stream="depth")
    rows = rows[rows["time_reason"] != "stamp"].sort_values(["stamp_ns", "point"])
    count = int(whole["point_count"].iloc[0]) + 1
    heads = rows[rows["point"] == 0]
    row = whole.iloc[0]
    names = (
        *("garment_length_m", "garment_length_std_m", "segment_length_m", "segment_length_std_m"),
        *("width_m", "height_m", "weight_kg", "rest_noise_m", "moving_noise_m"),
    )
    numbers: dict[str, Any] = {name: float(row[name]) for name in names}
    return Motion(
        recording=recording,
        frame=heads["frame"].to_numpy("int64"),
        stamp_ns=heads["stamp_ns"].to_numpy("int64"),
        time_s=heads["time_s"].to_numpy("float64"),
        **_vectors(rows, count),
        gripper_quaternion=_orientation(gripper, heads),
        onset_stamp_ns=_whole(row["onset_stamp_ns"]),
        onset_std_s=float(row["onset_std_ns"]) / 1e9,
        onset_reason=_text(row["onset_reason"]),
        gravity_m_s2=row[[f"gravity_{axis}_m_s2" for axis in "xyz"]].to_numpy("float64"),
        gravity_source=_text(row["gravity_source"]),
        correlations=_correlations(errors, count),
        **numbers,
    )


def _vectors(rows: pd.DataFrame, count: int) -> dict[str, Any]:
    """Return the arrays over frames and points, by their names in :class:`Motion`."""
    arrays: dict[str, FloatArray] = {}
    for quantity, (value, std) in _COLUMNS.items():
        unit = value.split("_", 1)[1]
        for name, form in ((f"{quantity}_{unit}", value), (f"{quantity}_std_{unit}", std)):
            columns = rows[[form.format(axis) for axis in "xyz"]]
            arrays[name] = columns.to_numpy("float64").reshape(-1, count, 3)
    for name in ("pixels", "bridged_m"):
        arrays[name] = rows[name].to_numpy("float64", na_value=float("nan")).reshape(-1, count)
    return arrays


def _orientation(gripper: pd.DataFrame, heads: pd.DataFrame) -> FloatArray:
    """Return the gripper's quaternions by frame, x y z w."""
    by_frame = gripper.set_index("frame").reindex(heads["frame"]).reindex(columns=["qx", "qy", "qz", "qw"])
    return by_frame.to_numpy("float64")


def _correlations(errors: pd.DataFrame, count: int) -> dict[str, Correlation]:
    """Return the table ``correlations`` as arrays, by quantity."""

    def values(name: str, form: str) -> FloatArray:
        table = errors.pivot(index="point", columns="quantity", values=name)  # noqa: PD010 - one value each, or null
        table = table.reindex(range(count))
        return table[[form.format(axis) for axis in "xyz"]].to_numpy("float64")

    names = Correlation.__slots__
    return {
        quantity: Correlation(**{name: values(name, form) for name in names})
        for quantity, (form, _) in _COLUMNS.items()
        if form.format("x") in set(errors["quantity"])
    }


def _whole(value: Any) -> int | None:  # noqa: ANN401 - what a cell holds
    return None if _is_missing(value) else int(value)


def _text(value: Any) -> str | None:  # noqa: ANN401 - what a cell holds
    return None if _is_missing(value) else str(value)


def _is_missing(value: Any) -> bool:  # noqa: ANN401 - what a cell holds
    import pandas as pd

    return bool(pd.isna(value))
