"""Where the gripper is in a camera's optical frame at the time of each of its images.

The recorder's own topics (``/r2_ee_to_depth``, ``/r2_ee_to_rgb``) say it directly, on stamps of their own; so do the
recorded transforms, from which those topics' node computed the point (thesis 5.3.2): it is the origin of the gripper's
frame.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from garment_dataset.bags.gripper_sources import Answer, CameraFrame, NoAnswer, TopicSource, TransformSource
from garment_dataset.bags.interpolation import standard_uncertainty_m
from garment_dataset.bags.quaternions import without_flips
from garment_dataset.bags.recorded_transforms import RecordedTransforms, warn_of_left_out
from garment_dataset.errors import DataWarning

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from garment_dataset.bags.bag import Bag
    from garment_dataset.bags.gripper_sources import GripperSource

Source = Literal["auto", "topic", "tf"]
"""Whom to ask; ``auto``: both, and per recording the one that says it more surely first."""

_CLEARLY_SURER = 0.95  # ratio of standard uncertainties from which the transforms are asked before the topic

Answers = dict[str, "list[Answer | NoAnswer]"]


@dataclass(frozen=True, eq=False, slots=True)
class GripperTrack:
    """End point of the gripper at given times.

    Parameters
    ----------
    x_m, y_m, z_m : (N,) float64
        In the camera's optical frame, metres; NaN where there is no answer.
    std_m : (N, 3) float64
        Standard uncertainties of the three, metres; NaN where there is no answer, or nothing bounds the interpolation.
    apart_m : (N, 3) float64
        Where the other source says it is, less that; NaN where only one has an answer.
    quaternion_xyzw : (N, 4) float64
        Rotation that takes coordinates in the gripper's frame to the camera's, of unit norm and without changes of
        sign along the recording; NaN where none is known.
    source : tuple of str or None, length N
        ``topic`` or ``tf``.
    gap_ns : tuple of int or None, length N
        Distance in time to the nearest sample the point rests on; of several links, the largest.
    reason : tuple of str or None, length N
        Why there is no point, for each source asked: ``topic: gap; tf: past``. The words are ``no samples``, ``past``
        and ``future`` (outside the samples), ``gap`` (between samples too far apart), and those of
        :data:`~garment_dataset.bags.links.FailureKind`.
    """

    x_m: NDArray[np.float64]
    y_m: NDArray[np.float64]
    z_m: NDArray[np.float64]
    std_m: NDArray[np.float64]
    apart_m: NDArray[np.float64]
    quaternion_xyzw: NDArray[np.float64]
    source: tuple[str | None, ...]
    gap_ns: tuple[int | None, ...]
    reason: tuple[str | None, ...]


def read_gripper(
    bag: Bag,
    stamps_ns: Iterable[int],
    *,
    camera_frame: str,
    gripper_frame: str = "r2_ee",
    source: Source = "auto",
    topic: str = "/r2_ee_to_depth",
    transforms: RecordedTransforms | None = None,
    max_gap_s: float = 0.1,
    std_floor_m: float = 0.0001,
    max_disagreement_m: float = 0.005,
    max_stamp_offset_s: float = 10.0,
    stream: str = "depth",
) -> GripperTrack:
    """Read the end point of the gripper at given times.

    Parameters
    ----------
    bag : Bag
        An open recording.
    stamps_ns : iterable of int, length N
        Header stamps of the images.
    camera_frame, gripper_frame : str
        Optical frame of the camera; frame whose origin is the end point.
    source : {"auto", "topic", "tf"}
        Whom to ask.
    topic : str
        Messages of ``geometry_msgs`` type PointStamped, PoseStamped, TransformStamped or Vector3Stamped.
    transforms : RecordedTransforms, optional
        Those of the bag; by default its ``/tf`` and ``/tf_static``. Whoever asks for both cameras reads them once.
    max_gap_s : float
        Longest time between two samples, in seconds, that is interpolated across.
    std_floor_m : float
        Standard uncertainty of a sample itself, in metres: how well such an arm repeats a position.
    max_disagreement_m : float
        Median distance between the two sources, in metres, beyond which a warning says so.
    max_stamp_offset_s : float
        How far header stamp less record time may be from its median in a sample that is used, in seconds.
    stream : str
        What the images are called in warnings.

    Returns
    -------
    GripperTrack

    Notes
    -----
    A sample of exactly the frame's stamp is taken as it is; how the path runs between two, and what bounds the error,
    :func:`~garment_dataset.bags.interpolation.path_at` says. The standard uncertainty is that bound over √3, and the
    floor, added in quadrature. Before the first and after the last sample there is no answer, as nothing says how far
    the gripper moved there.

    ``auto`` asks the topic first, and the transforms where it has no answer; it is the other way round when the
    standard uncertainties of the transforms are smaller by 5 % (root mean square over the frames where both are known).
    The choice is made once for a stream, so that what the sources disagree by does not look like a motion. A rotation
    that the chosen source does not tell is taken from the other.

    A :class:`~garment_dataset.errors.DataWarning` tells of messages left out, of frames without a point, and of sources
    that disagree.
    """
    if transforms is None:
        transforms = RecordedTransforms(bag, max_stamp_offset_s=max_stamp_offset_s)
    camera = CameraFrame(transforms, camera_frame.lstrip("/"), round(max_gap_s * 1e9))
    times_ns = [int(stamp_ns) for stamp_ns in stamps_ns]
    asked: dict[str, GripperSource] = {}
    if source != "tf":
        asked["topic"] = reader = TopicSource(camera, topic, max_stamp_offset_s)
        warn_of_left_out(bag, reader.left_out)
    if source != "topic":
        asked["tf"] = TransformSource(camera, gripper_frame.lstrip("/"), times_ns)
    answers: Answers = {name: [each.at(stamp_ns) for stamp_ns in times_ns] for name, each in asked.items()}
    if source == "auto":
        answers = _surest_first(answers, std_floor_m)
        _warn_of_disagreement(f"{bag.path.name}: {stream} frames", answers, max_disagreement_m)
    rows = [dict(zip(answers, row, strict=True)) for row in zip(*answers.values(), strict=True)]
    _warn_of_frames_without(f"{bag.path.name}: no gripper position at", stream, rows)
    return _track(rows, std_floor_m)


def _both(answers: Answers) -> list[tuple[Answer, Answer]]:
    """Return the answers of topic and transforms where both have one."""
    pairs = zip(answers["topic"], answers["tf"], strict=True)
    return [(topic, tf) for topic, tf in pairs if isinstance(topic, Answer) and isinstance(tf, Answer)]


def _surest_first(answers: Answers, std_floor_m: float) -> Answers:
    """Put that source first whose standard uncertainty is smaller, the topic unless the difference is clear."""
    bounds_m = np.array([[topic.bound_m, tf.bound_m] for topic, tf in _both(answers)]).reshape(-1, 2, 3)
    known = bounds_m[np.isfinite(bounds_m).all(axis=(1, 2))]
    squares_m2 = (standard_uncertainty_m(known, std_floor_m) ** 2).sum(axis=(0, 2))
    clearly = np.sqrt(squares_m2[1]) < _CLEARLY_SURER * np.sqrt(squares_m2[0])
    return {name: answers[name] for name in (("tf", "topic") if clearly else ("topic", "tf"))}


def _warn_of_disagreement(where: str, answers: Answers, bound_m: float) -> None:
    if not (both := _both(answers)):
        return
    apart_m = float(np.median([np.linalg.norm(topic.position_m - tf.position_m) for topic, tf in both]))
    if apart_m > bound_m:
        text = f"topic and tf disagree on the gripper by {apart_m * 1e3:.1f} mm, median of {len(both)}"
        warnings.warn(f"{where}: {text}; {next(iter(answers))} is asked first", DataWarning, stacklevel=3)


def _warn_of_frames_without(what: str, stream: str, rows: Sequence[Mapping[str, Answer | NoAnswer]]) -> None:
    failed = [index for index, row in enumerate(rows) if not any(isinstance(each, Answer) for each in row.values())]
    if failed:
        detail = _each(rows[failed[0]], "detail")
        text = f"{what} {len(failed)} of {len(rows)} {stream} frames, first at {failed[0]}: {detail}"
        warnings.warn(text, DataWarning, stacklevel=3)


def _each(row: Mapping[str, Answer | NoAnswer], attribute: Literal["reason", "detail"]) -> str:
    """Return what each source gives as its reason, the topic first."""
    failures = {name: each for name, each in sorted(row.items(), reverse=True) if isinstance(each, NoAnswer)}
    return "; ".join(f"{name}: {getattr(failure, attribute)}" for name, failure in failures.items())


def _track(rows: Sequence[Mapping[str, Answer | NoAnswer]], std_floor_m: float) -> GripperTrack:
    known = [{name: each for name, each in row.items() if isinstance(each, Answer)} for row in rows]
    firsts = [next(iter(row.items()), (None, None)) for row in known]
    nowhere = np.full(3, np.nan)
    positions_m = np.array([nowhere if each is None else each.position_m for _, each in firsts]).reshape(-1, 3)
    bounds_m = np.array([nowhere if each is None else each.bound_m for _, each in firsts]).reshape(-1, 3)
    apart_m = [
        nowhere if len(row) < 2 else np.subtract(*[each.position_m for each in row.values()][::-1]) for row in known
    ]
    turns = [next((each.quaternion_xyzw for each in row.values() if each.quaternion_xyzw), None) for row in known]
    x_m, y_m, z_m = positions_m.T
    return GripperTrack(
        x_m=x_m,
        y_m=y_m,
        z_m=z_m,
        std_m=standard_uncertainty_m(bounds_m, std_floor_m),
        apart_m=np.array(apart_m).reshape(-1, 3),
        quaternion_xyzw=np.array([turn or (np.nan,) * 4 for turn in without_flips(turns)]).reshape(-1, 4),
        source=tuple(name for name, _ in firsts),
        gap_ns=tuple(None if each is None else each.gap_ns for _, each in firsts),
        reason=tuple(None if found else _each(row, "reason") for row, found in zip(rows, known, strict=True)),
    )
