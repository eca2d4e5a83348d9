from __future__ import annotations

import math
import pickle
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.bags.poses import Transform
from garment_dataset.bags.transforms import LookupFailedError, TransformTree

if TYPE_CHECKING:
    from numpy.typing import NDArray

IDENTITY = (0.0, 0.0, 0.0, 1.0)
QUARTER_Z = (0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4))
SECOND = 1_000_000_000

Numbers = tuple[float, ...]
Turn = tuple[Numbers, float]  # axis and angle
Row = tuple[tuple[str, str], int, Numbers, Turn]  # parent and child, stamp, translation, turn

lengths = st.floats(-3, 3)
vectors = st.tuples(lengths, lengths, lengths)
axes = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda axis: sum(c * c for c in axis) > 1e-2)
turns = st.tuples(axes, st.floats(-math.pi, math.pi))


def quaternion(axis: Numbers, angle: float) -> Numbers:
    unit = np.array(axis) / np.linalg.norm(axis)
    return (*map(float, unit * math.sin(angle / 2)), math.cos(angle / 2))


def rodrigues(axis: Numbers, angle: float) -> NDArray[np.float64]:
    """The rotation matrix, by a way that knows no quaternions."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix: NDArray[np.float64] = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return matrix


def failure_kind(tree: TransformTree, target: str, source: str, stamp_ns: int) -> str:
    with pytest.raises(LookupFailedError) as caught:
        tree.lookup(target, source, stamp_ns)
    return caught.value.kind


samples = st.lists(
    st.tuples(
        st.sampled_from([("root", "a"), ("a", "b"), ("b", "c"), ("root", "d"), ("d", "e")]),
        st.integers(0, 20),
        vectors,
        turns,
    ),
    max_size=30,
)


def tree_of(
    rows: list[Row],
) -> TransformTree:
    """Every link at both ends of 0..20 ns, and at ``rows`` between."""
    tree = TransformTree()
    for parent, child in (("root", "a"), ("a", "b"), ("b", "c"), ("root", "d"), ("d", "e")):
        tree.add(parent, child, -1, (0.1, 0.2, 0.3), quaternion((1, 2, 3), 0.3))
        tree.add(parent, child, 21, (0.2, -0.4, 1.0), quaternion((1, -2, 0.5), -1.2))
    for (parent, child), stamp_ns, translation, turn in rows:
        tree.add(parent, child, stamp_ns, translation, quaternion(*turn))
    return tree


frames = st.sampled_from(["root", "a", "b", "c", "d", "e"])
POINTS = np.array([[0.3, -0.2, 1.0], [0, 0, 0], [1, 2, 3]])


@given(samples, frames, frames, frames, st.integers(0, 20))
def test_a_way_is_the_composition_of_its_parts(
    rows: list[Row],
    a: str,
    b: str,
    c: str,
    stamp_ns: int,
) -> None:
    tree = tree_of(rows)
    parts = tree.lookup(a, b, stamp_ns).apply(tree.lookup(b, c, stamp_ns).apply(POINTS))
    np.testing.assert_allclose(tree.lookup(a, c, stamp_ns).apply(POINTS), parts, atol=1e-12)


@given(samples, frames, frames, st.integers(0, 20))
def test_there_and_back_is_nowhere(
    rows: list[Row],
    a: str,
    b: str,
    stamp_ns: int,
) -> None:
    tree = tree_of(rows)
    there, back = tree.lookup(a, b, stamp_ns), tree.lookup(b, a, stamp_ns)
    np.testing.assert_allclose(back.apply(there.apply(POINTS)), POINTS, atol=1e-12)
    assert math.isclose(float(np.linalg.norm(there.quaternion_xyzw)), 1, abs_tol=1e-12)
    assert (there.nearest_sample_gap_ns, there.bracket_ns) == (back.nearest_sample_gap_ns, back.bracket_ns)


@given(
    st.lists(st.tuples(st.integers(0, 20), vectors, turns), min_size=2, max_size=12, unique_by=lambda row: row[0]),
    st.data(),
)
def test_the_order_of_arrival_does_not_matter(rows: list[tuple[int, Numbers, Turn]], data: st.DataObject) -> None:
    trees = []
    for order in (rows, data.draw(st.permutations(rows))):
        tree = TransformTree()
        for number, (stamp_ns, translation, turn) in enumerate(order):
            tree.add("parent", "child", stamp_ns, translation, quaternion(*turn))
            if number == 1:  # a question in between must not freeze what is known
                tree.lookup("parent", "child", (order[0][0] + order[1][0]) // 2)
        trees.append(tree)
    stamp_ns = data.draw(st.integers(min(row[0] for row in rows), max(row[0] for row in rows)))
    one, other = (tree.lookup("parent", "child", stamp_ns) for tree in trees)
    np.testing.assert_array_equal(one.translation, other.translation)
    np.testing.assert_array_equal(one.quaternion_xyzw, other.quaternion_xyzw)


@given(st.lists(st.tuples(vectors, turns), min_size=1, max_size=6))
def test_a_chain_is_the_product_of_its_matrices(
    links: list[tuple[Numbers, Turn]],
) -> None:
    tree = TransformTree()
    expected = np.eye(4)
    for number, (translation, turn) in enumerate(links):
        tree.add(f"link{number}", f"link{number + 1}", 0, translation, quaternion(*turn), static=True)
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rodrigues(*turn), translation
        expected = expected @ matrix
    found = tree.lookup("link0", f"link{len(links)}", 7).apply(POINTS)
    np.testing.assert_allclose(found, POINTS @ expected[:3, :3].T + expected[:3, 3], atol=1e-12)


def test_points_of_the_child_are_taken_into_the_parent() -> None:
    tree = TransformTree()
    tree.add("parent", "child", 5, (1, 0, 0), QUARTER_Z)
    np.testing.assert_allclose(tree.lookup("parent", "child", 5).apply([1, 0, 0]), [1, 1, 0], atol=1e-15)
    np.testing.assert_allclose(tree.lookup("child", "parent", 5).apply([1, 1, 0]), [1, 0, 0], atol=1e-15)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_third_of_a_quarter_turn_is_thirty_degrees(sign: int) -> None:
    tree = TransformTree()
    tree.add("parent", "child", 0, (0, 0, 0), IDENTITY)
    tree.add("parent", "child", 3 * SECOND, (3, 6, -9), tuple(sign * c for c in QUARTER_Z))  # q and -q turn alike
    third = tree.lookup("parent", "child", SECOND)
    np.testing.assert_allclose(third.translation, [1, 2, -3], atol=1e-15)
    half_angle = math.pi / 12
    np.testing.assert_allclose(third.quaternion_xyzw, [0, 0, math.sin(half_angle), math.cos(half_angle)], atol=1e-15)


@given(axes, st.floats(-3, 3), st.floats(-3, 3), st.integers(0, 10))
def test_a_rotation_about_a_fixed_axis_turns_evenly(axis: Numbers, start: float, swing: float, tenth: int) -> None:
    tree = TransformTree()
    tree.add("parent", "child", 0, (0, 0, 0), quaternion(axis, start))
    tree.add("parent", "child", 10, (0, 0, 0), quaternion(axis, start + swing))
    turned = tree.lookup("parent", "child", tenth).apply(POINTS)
    np.testing.assert_allclose(turned, POINTS @ rodrigues(axis, start + swing * tenth / 10).T, atol=1e-7)


@pytest.mark.parametrize("stamp_ns", [4, 6])
def test_a_link_with_one_sample_answers_at_that_very_time_only(stamp_ns: int) -> None:
    tree = TransformTree()
    tree.add("parent", "child", 5, (1, 2, 3), IDENTITY)
    np.testing.assert_array_equal(tree.lookup("parent", "child", 5).translation, [1, 2, 3])
    with pytest.raises(LookupFailedError) as caught:
        tree.lookup("parent", "child", stamp_ns)
    assert caught.value.kind == ("past" if stamp_ns < 5 else "future")


def test_nothing_is_extrapolated_and_the_ends_belong_to_the_range() -> None:
    tree = TransformTree("recorded.bag")
    tree.add("parent", "child", 10, (1, 0, 0), IDENTITY)
    tree.add("parent", "child", 20, (2, 0, 0), IDENTITY)
    assert tree.lookup("parent", "child", 10).translation[0] == 1
    assert tree.lookup("parent", "child", 20).translation[0] == 2
    with pytest.raises(LookupFailedError, match=r"recorded.bag: .* 9 ns is before its first sample, 10 ns") as past:
        tree.lookup("parent", "child", 9)
    with pytest.raises(LookupFailedError, match="'child', 21 ns is after its last sample, 20 ns") as future:
        tree.lookup("child", "parent", 21)
    assert (past.value.kind, future.value.kind) == ("past", "future")


def test_static_links_hold_at_all_times() -> None:
    tree = TransformTree()
    tree.add("parent", "fixed", 50, (1, 0, 0), IDENTITY, static=True)
    tree.add("fixed", "moving", 10, (0, 1, 0), IDENTITY)
    found = tree.lookup("parent", "moving", 10)
    np.testing.assert_array_equal(found.translation, [1, 1, 0])
    assert (found.nearest_sample_gap_ns, found.bracket_ns) == (0, 0)
    tree.add("parent", "fixed", 60, (2, 0, 0), IDENTITY, static=True)
    assert tree.lookup("parent", "fixed", 0).translation[0] == 2, "of several static ones the last one counts"
    tree.add("parent", "fixed", 70, (3, 0, 0), IDENTITY)
    assert tree.lookup("parent", "fixed", 70).translation[0] == 2, "a static link stays static"


def test_of_two_transforms_with_one_stamp_the_first_stays() -> None:
    tree = TransformTree()
    assert tree.add("parent", "child", 5, (1, 0, 0), IDENTITY)
    assert not tree.add("parent", "child", 5, (2, 0, 0), IDENTITY)
    assert tree.lookup("parent", "child", 5).translation[0] == 1
    assert tree.refused == 0, "repeated, not malformed"


@pytest.mark.parametrize(
    ("parent", "child", "translation", "quaternion_xyzw"),
    [
        ("a", "b", (math.nan, 0, 0), IDENTITY),
        ("a", "b", (0, math.inf, 0), IDENTITY),
        ("a", "b", (0, 0, 0), (0, 0, math.nan, 1)),
        ("a", "b", (0, 0, 0), (0, 0, 0, 0)),
        ("a", "b", (0, 0, 0), (0, 0, 0, math.sqrt(1.0101))),
        ("a", "b", (0, 0, 0), (0, 0, 0, math.sqrt(0.9899))),
        ("a", "/a", (0, 0, 0), IDENTITY),
        ("", "b", (0, 0, 0), IDENTITY),
        ("a", "/", (0, 0, 0), IDENTITY),
    ],
)
def test_a_malformed_transform_is_refused_and_counted(
    parent: str, child: str, translation: Numbers, quaternion_xyzw: Numbers
) -> None:
    tree = TransformTree()
    assert not tree.add(parent, child, 5, translation, quaternion_xyzw)
    assert tree.refused == 1
    with pytest.raises(LookupFailedError) as caught:
        tree.lookup("a", "b", 5)
    assert caught.value.kind == "unknown frame"


def test_a_quaternion_a_little_off_is_taken_and_scales_nothing() -> None:
    tree = TransformTree()
    assert tree.add("a", "b", 5, (0, 0, 0), (0, 0, 0, math.sqrt(1.0099)))
    assert tree.add("b", "c", 5, (1, 0, 0), tuple(c * math.sqrt(0.9901) for c in QUARTER_Z))
    np.testing.assert_allclose(tree.lookup("a", "c", 5).apply([1, 0, 0]), [1, 1, 0], atol=1e-15)


def test_leading_slashes_do_not_count() -> None:
    tree = TransformTree()
    tree.add("/parent", "child", 0, (0, 0, 0), IDENTITY)
    tree.add("parent", "/child", 10, (1, 0, 0), IDENTITY)
    for target, source in (("parent", "child"), ("/parent", "child"), ("parent", "/child")):
        assert tree.lookup(target, source, 5).translation[0] == 0.5


def test_a_new_parent_counts_from_its_first_sample_on() -> None:
    tree = TransformTree()
    tree.add("world", "left", 0, (0, 0, 0), IDENTITY, static=True)
    tree.add("world", "right", 0, (100, 0, 0), IDENTITY, static=True)
    tree.add("left", "cup", 0, (1, 0, 0), IDENTITY)
    tree.add("left", "cup", 10, (2, 0, 0), IDENTITY)
    tree.add("right", "cup", 20, (3, 0, 0), IDENTITY)
    tree.add("right", "cup", 30, (4, 0, 0), IDENTITY)
    found = [float(tree.lookup("world", "cup", stamp_ns).translation[0]) for stamp_ns in (5, 10, 19, 20, 25)]
    assert found == [1.5, 2, 2, 103, 103.5]  # between two parents the earlier sample as it is
    assert tree.lookup("world", "cup", 19).nearest_sample_gap_ns == 9, "it rests on the earlier sample alone"


def test_links_above_the_common_ancestor_need_not_answer() -> None:
    tree = TransformTree()
    tree.add("map", "base", 1000, (0, 0, 0), IDENTITY)  # dated ahead, one sample
    tree.add("base", "left", 0, (1, 0, 0), IDENTITY)
    tree.add("base", "right", 0, (0, 1, 0), IDENTITY)
    found = tree.lookup("left", "right", 0)
    np.testing.assert_array_equal(found.translation, [-1, 1, 0])
    assert found.nearest_sample_gap_ns == 0
    with pytest.raises(LookupFailedError) as caught:
        tree.lookup("map", "right", 0)
    assert caught.value.kind == "past"


def test_of_two_silent_ends_that_of_the_target_is_named() -> None:
    tree = TransformTree()
    tree.add("base", "late", 10, (0, 0, 0), IDENTITY)
    tree.add("base", "early", 0, (0, 0, 0), IDENTITY)
    assert [failure_kind(tree, *ends, 5) for ends in (("late", "early"), ("early", "late"))] == ["past", "future"]


def test_gap_and_bracket_are_those_of_the_worst_link() -> None:
    tree = TransformTree()
    for stamp_ns in (0, 100):
        tree.add("base", "fixed", stamp_ns, (1, 0, 0), IDENTITY)  # a fixed link, published slowly
    for stamp_ns in range(0, 101, 10):
        tree.add("fixed", "arm", stamp_ns, (stamp_ns, 0, 0), IDENTITY)
    found = tree.lookup("base", "arm", 43)
    assert found.nearest_sample_gap_ns == 43
    assert found.bracket_ns == 10, "nothing can be lost between two equal samples"
    assert tree.lookup("base", "arm", 100).nearest_sample_gap_ns == 0


def test_frames_that_are_unknown_or_apart() -> None:
    tree = TransformTree("recorded.bag")
    tree.add("a", "b", 0, (0, 0, 0), IDENTITY, static=True)
    tree.add("c", "d", 0, (0, 0, 0), IDENTITY, static=True)
    with pytest.raises(
        LookupFailedError, match=r"recorded.bag: no transform names .*'x'.*Known frames: a, b, c, d"
    ) as e:
        tree.lookup("a", "x", 0)
    assert e.value.kind == "unknown frame"
    with pytest.raises(LookupFailedError, match=r"from 'd' to 'b'.*no common ancestor") as e:
        tree.lookup("b", "d", 0)
    assert e.value.kind == "not connected"
    with pytest.raises(LookupFailedError, match="no transforms at all"):
        TransformTree().lookup("a", "b", 0)
    assert tree.lookup("/x", "x", 0).nearest_sample_gap_ns == 0, "a frame in itself is the identity, known or not"


def test_a_loop_ends() -> None:
    tree = TransformTree()
    tree.add("a", "b", 0, (0, 0, 0), IDENTITY, static=True)
    tree.add("b", "a", 0, (0, 0, 0), IDENTITY, static=True)
    tree.add("c", "d", 0, (0, 0, 0), IDENTITY, static=True)
    with pytest.raises(LookupFailedError) as caught:
        tree.lookup("d", "a", 0)
    assert caught.value.kind == "loop"


def test_an_error_crosses_a_process_boundary_whole() -> None:
    with pytest.raises(LookupFailedError) as caught:
        TransformTree("recorded.bag").lookup("a", "b", 0)
    copy = pickle.loads(pickle.dumps(caught.value))
    assert (str(copy), copy.kind) == (str(caught.value), "unknown frame")


def spoken(tree: TransformTree, target: str, source: str, stamp_ns: int) -> tuple[object, ...]:
    try:
        found = tree.lookup(target, source, stamp_ns)
    except LookupFailedError as error:
        return error.kind, str(error)
    return told(found)


def told(found: Transform | LookupFailedError) -> tuple[object, ...]:
    if isinstance(found, LookupFailedError):
        return found.kind, str(found)
    numbers = (*found.translation.tolist(), *found.quaternion_xyzw.tolist())
    return (*numbers, found.nearest_sample_gap_ns, found.bracket_ns)


rows = st.lists(
    st.tuples(
        st.sampled_from([("root", "a"), ("a", "b"), ("b", "c"), ("root", "d"), ("d", "e"), ("d", "b"), ("c", "a")]),
        st.integers(0, 20),
        st.sampled_from([(1.0, 2.0, 3.0), (0.5, -2.0, 0.25)]),
        st.sampled_from([IDENTITY, QUARTER_Z, (0.6, 0.0, 0.0, 0.8)]),
        st.sampled_from([False, False, False, True]),
    ),
    max_size=30,
)


@given(rows, st.sampled_from(["a", "c", "e", "root", "nowhere"]), st.sampled_from(["a", "c", "e", "root"]))
def test_many_look_ups_at_once_are_the_single_ones_to_the_last_bit(
    said: list[tuple[tuple[str, str], int, Numbers, Numbers, bool]], target: str, source: str
) -> None:
    tree = TransformTree()
    for (parent, child), stamp_ns, translation, turn, static in said:
        tree.add(parent, child, stamp_ns, translation, turn, static=static)
    stamps_ns = list(range(-1, 23))
    found = tree.lookups(target, source, stamps_ns)
    assert [told(each) for each in found] == [spoken(tree, target, source, stamp_ns) for stamp_ns in stamps_ns]
    assert tree.lookups(target, source, []) == []


def test_points_are_taken_along_as_numpy_crosses_vectors() -> None:
    random = np.random.default_rng(0)
    points = random.normal(size=(2, 5, 3))
    turn = random.normal(size=4)
    turn /= np.linalg.norm(turn)
    moved = Transform(np.array([1.0, 2.0, 3.0]), turn, 0, 0).apply(points)
    once = 2.0 * np.cross(turn[:3], points)
    assert (moved == points + turn[3] * once + np.cross(turn[:3], once) + np.array([1.0, 2.0, 3.0])).all()


def test_the_second_transform_of_a_time_is_not_taken_whatever_it_says() -> None:
    tree = TransformTree()
    assert tree.add("a", "b", 5, (1.0, 0.0, 0.0), IDENTITY)
    assert not tree.add("a", "b", 5, (1.0, 0.0, 0.0), IDENTITY)
    assert not tree.add("a", "b", 5, (2.0, 0.0, 0.0), IDENTITY)
    assert tree.add("a", "b", 6, (1.0, 0.0, 0.0), IDENTITY)
    assert tree.lookup("a", "b", 5).translation.tolist() == [1.0, 0.0, 0.0]
