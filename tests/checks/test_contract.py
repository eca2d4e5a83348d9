"""Contracts as files: what is read, what is written, what is learnt."""

from __future__ import annotations

import string
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_dataset.bags import open_bag
from garment_dataset.checks.contract import ColorRule, Contract, DepthRule, GripperRule, TopicRule, read_contract
from garment_dataset.checks.learn import learn, streams_of
from garment_dataset.checks.reading import read_facts
from garment_dataset.checks.runner import judge
from garment_dataset.checks.writing import to_toml
from garment_dataset.errors import BagError, CatalogError
from garment_dataset.layout import packaged_workspace
from tests.checks.conftest import COLOR, DEPTH, good_entries, write

if TYPE_CHECKING:
    from pathlib import Path

    from garment_dataset.checks.facts import Facts

_NAMES = st.text(string.ascii_letters + string.digits + '_/é"\\', min_size=1).map("/{}".format)
_NUMBERS = st.floats(0.001, 1000)
_SHARES = st.floats(0, 1)
_TOPICS = st.builds(
    TopicRule,
    types=st.lists(st.just("sensor_msgs/msg/Image"), max_size=2).map(tuple),
    required=st.booleans(),
    rate_hz=st.none() | st.tuples(_NUMBERS, _NUMBERS).map(sorted).map(tuple),
    max_gap_s=st.none() | _NUMBERS,
)
_SIZES = st.lists(st.tuples(st.integers(1, 5000), st.integers(1, 5000)), max_size=2).map(tuple)
_PARTS = {"topic": _NAMES, "camera_info_topic": _NAMES, "sizes_px": _SIZES, "max_frozen_s": _NUMBERS}
_CONTRACTS = st.builds(
    Contract,
    topics=st.dictionaries(_NAMES, _TOPICS, max_size=3),
    images=st.fixed_dictionaries(
        {
            "depth": st.none() | st.builds(DepthRule, **_PARTS, least_valid=_SHARES),
            "color": st.none() | st.builds(ColorRule, **_PARTS, least_contrast=_NUMBERS),
        }
    ),
    gripper=st.none() | st.builds(GripperRule, topic=_NAMES, least_known=_SHARES, max_speed_m_s=_NUMBERS),
)


@settings(max_examples=50)
@given(contract=_CONTRACTS)
def test_what_is_written_is_read_again(contract: Contract, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("contract") / "contract.toml"
    path.write_text(to_toml(contract, "Some contract."), "utf-8")
    assert read_contract(path) == contract


def test_the_packaged_contract_names_the_topics_of_the_topics_file() -> None:
    folder = packaged_workspace() / "catalog"
    contract = read_contract(folder / "contract.toml")
    assert sorted(contract.topics) == sorted((folder / "topics" / "1.txt").read_text().split())


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[topic]\n", "Did you mean topics?"),
        ('[topics."tf"]\n', "begins with /"),
        ("[recording]\nduration_s = [8, 3]\n", "the smaller first"),
        ("[recording]\nduration_s = 8\n", "recording.duration_s"),
        ('[topics."/tf"]\nrate = [1, 2]\n', "Did you mean rate_hz?"),
        ('[images.depth]\ntopics = "/a"\ncamera_info_topic = "/b"\n', "Did you mean topic?"),
        ('[topics."/tf"]\ntypes = ["TFMessage"]\n', "message type"),
        ('[background]\naxes = ["X"]\n', "'X'"),
        ("[recording\n", "not TOML"),
    ],
)
def test_what_is_not_understood_is_said(text: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "contract.toml"
    path.write_text(text)
    with pytest.raises(CatalogError) as caught:
        read_contract(path)
    assert told in str(caught.value)
    assert str(path) in str(caught.value)


def test_types_may_be_written_as_ros_1_does(tmp_path: Path) -> None:
    path = tmp_path / "contract.toml"
    path.write_text('[topics."/tf"]\ntypes = ["tf2_msgs/TFMessage"]\n')
    assert read_contract(path).topics["/tf"].types == ("tf2_msgs/msg/TFMessage",)


def facts_of(path: Path, base: Contract) -> Facts:
    with open_bag(path) as bag:
        return read_facts(bag, base)


@pytest.mark.parametrize("change", ["nothing", "no depth", "names of one's own", "no gripper"])
def test_what_is_learnt_is_kept_by_those_it_was_learnt_from(change: str, contract: Contract, tmp_path: Path) -> None:
    """The law holds whatever the recordings are, as long as each is good in itself."""
    paths = []
    for number, duration_s in enumerate((1.0, 2.0, 4.0)):
        entries = good_entries(duration_s)
        if change == "no depth":
            entries = [each for each in entries if each.topic != DEPTH]
        elif change == "no gripper":
            entries = [each for each in entries if not each.topic.startswith("/r2")]
        paths.append(write(tmp_path / f"{number}.bag", entries))
    usual = Contract() if change == "names of one's own" else contract
    with open_bag(paths[0]) as bag:
        base = streams_of(bag, usual)
    good = [facts_of(path, base) for path in paths]
    learnt = learn(good, base)
    assert [each for facts in good for each in judge("some", facts, learnt) if each.severity != "note"] == []
    assert (learnt.images.depth is None) == (change == "no depth")
    assert learnt.images.color is not None
    assert learnt.images.color.topic == COLOR
    assert (learnt.gripper is not None) == (change in {"nothing", "no depth"})
    assert all(rule.required and rule.rate_hz is not None for rule in learnt.topics.values())
    worse = facts_of(write(tmp_path / "worse.bag", good_entries(0.3)), base)
    assert "duration" in {each.code for each in judge("worse", worse, learnt)}


def test_a_topic_that_only_some_have_is_not_required(contract: Contract, tmp_path: Path) -> None:
    whole = write(tmp_path / "whole.bag", good_entries(1.0))
    part = write(tmp_path / "part.bag", [each for each in good_entries(1.0) if each.topic != "/joint_states"])
    facts = [facts_of(path, contract) for path in (whole, part)]
    learnt = learn(facts, contract)
    assert not learnt.topics["/joint_states"].required
    assert all(rule.required for name, rule in learnt.topics.items() if name != "/joint_states")


def test_nothing_is_learnt_of_a_bag_without_images(contract: Contract, tmp_path: Path) -> None:
    path = write(tmp_path / "some.bag", [each for each in good_entries(1.0) if each.topic == "/tf"])
    with open_bag(path) as bag, pytest.raises(BagError, match="no images"):
        streams_of(bag, contract)


def test_an_empty_contract_lets_everything_pass(tmp_path: Path) -> None:
    entries: list[Any] = [each for each in good_entries(4.0) if each.topic == "/tf"]
    assert judge("some", facts_of(write(tmp_path / "some.bag", entries), Contract()), Contract()) == []
