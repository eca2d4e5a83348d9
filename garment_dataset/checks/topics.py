"""Whether the topics are there that the contract names, with messages of the right type."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.checks.finding import Found
from garment_dataset.errors import nearest_word

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.checks.contract import Contract, TopicRule
    from garment_dataset.checks.facts import Facts


def check_topics(facts: Facts, contract: Contract) -> Iterator[Found]:
    """Yield ``topic-missing``, ``topic-silent`` and ``topic-type``."""
    for name, rule in contract.topics.items():
        topic = facts.topic(name)
        if topic is None:
            if rule.required:
                yield Found("topic-missing", f"no topic {name}", name, hint=_elsewhere(name, rule, facts))
        elif not topic.count:
            if rule.required:
                hint = "Its publisher was announced, and sent nothing: see that it runs, and record again."
                yield Found("topic-silent", f"no message on {topic.name}", topic.name, hint=hint)
        elif topic.name == name and rule.types and not set(topic.types) <= set(rule.types):
            expected, found = " or ".join(rule.types), ", ".join(topic.types)
            yield Found("topic-type", f"expected {expected}, found {found}", name)


def _elsewhere(name: str, rule: TopicRule, facts: Facts) -> str:
    """Name the topic of the same type whose name looks most like that of the missing one."""
    same_type = [topic.name for topic in facts.topics.values() if topic.count and set(topic.types) & set(rule.types)]
    if (nearest := nearest_word(name, same_type, cutoff=0.4)) is None:
        return "Was it left out when the recording was made? `garment record-plan` prints the command."
    return f"{nearest} is there: is it the one that is meant?"
