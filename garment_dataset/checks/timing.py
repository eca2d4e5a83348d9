"""Whether the messages came when they should: long enough, often enough, once, and with stamps to be believed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.bags.stamps import summarise
from garment_dataset.checks.finding import Found

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.checks.contract import Contract, TopicRule
    from garment_dataset.checks.facts import Facts, TopicFacts


def check_duration(facts: Facts, contract: Contract) -> Iterator[Found]:
    """Yield ``duration``."""
    shortest_s, longest_s = contract.recording.duration_s
    if not shortest_s <= facts.duration_s <= longest_s:
        expected = f"{shortest_s:g} s to {longest_s:g} s"
        hint = "`rosbag record --duration=8` stops by itself."
        yield Found("duration", f"{facts.duration_s:.2f} s long, expected {expected}", hint=hint)


def check_timing(facts: Facts, contract: Contract) -> Iterator[Found]:
    """Yield ``begins-late``, ``ends-early``, ``gap`` and ``rate`` of the topics that the contract names."""
    for name, rule in contract.topics.items():
        topic = facts.topic(name)
        if topic is None or not topic.count or not len(topic.times_ns):
            continue
        if rule.required and rule.rate_hz is not None:
            yield from _ends(topic, facts, contract.recording.max_late_s)
        if rule.max_gap_s is not None:
            yield from _gap(topic, facts, rule.max_gap_s)
        yield from _rate(topic, rule)


def check_messages(facts: Facts, contract: Contract) -> Iterator[Found]:
    """Yield ``doubled``, ``lost``, ``stamps`` and ``clock`` of the topics that the contract names."""
    for topic in filter(None, map(facts.topic, contract.topics)):
        if topic.doubled is not None:
            count, first_ns, _text = topic.doubled
            hint = "Two recorders, or two publishers of one name? What is the same twice is used once."
            text = f"{count} of {topic.count} messages are there twice"
            yield Found("doubled", text, topic.name, facts.time_s(first_ns), hint)
        if topic.lost is not None:
            count, first_ns, why = topic.lost
            text = f"{count} of {topic.count} messages cannot be read, the first: {why}"
            yield Found("lost", text, topic.name, facts.time_s(first_ns), "`garment salvage` saves what is there.")
        if topic.first_wrong_ns is not None:
            text = summarise(topic.stamp_faults)
            yield Found("stamps", f"of {topic.count} messages, {text}", topic.name, facts.time_s(topic.first_wrong_ns))
        if topic.clock is not None:
            yield Found("clock", topic.clock, topic.name)


def _ends(topic: TopicFacts, facts: Facts, max_late_s: float) -> Iterator[Found]:
    first_s, last_s = facts.time_s(topic.times_ns[0]), facts.time_s(topic.times_ns[-1])
    if first_s > max_late_s:
        yield Found("begins-late", f"first message {first_s:.2f} s after the recording began", topic.name, first_s)
    if (early_s := facts.duration_s - last_s) > max_late_s:
        yield Found("ends-early", f"last message {early_s:.2f} s before the recording ended", topic.name, last_s)


def _gap(topic: TopicFacts, facts: Facts, max_gap_s: float) -> Iterator[Found]:
    gaps_s = topic.gaps_s(max_gap_s)
    if len(gaps_s):
        others = "" if len(gaps_s) == 1 else f", the longest of {len(gaps_s)} gaps"
        text = f"no message for {gaps_s[0]:.3f} s{others}; expected one every {max_gap_s:g} s"
        yield Found("gap", text, topic.name, facts.time_s(topic.longest_gap_ns()))


def _rate(topic: TopicFacts, rule: TopicRule) -> Iterator[Found]:
    """Yield ``rate``; what gaps take from it is no second finding."""
    rate_hz = topic.rate_hz(rule.max_gap_s)
    if rule.rate_hz is not None and rate_hz is not None and not rule.rate_hz[0] <= rate_hz <= rule.rate_hz[1]:
        expected = f"{rule.rate_hz[0]:g} to {rule.rate_hz[1]:g}"
        yield Found("rate", f"{rate_hz:.1f} messages a second, expected {expected}", topic.name)
