"""Facts and pictures to HTML: everything that comes from data is escaped, in text, attributes and scripts."""

from __future__ import annotations

import json
from collections import Counter
from functools import cache
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from garment_dataset.report.drawings import STATES, pipeline_picture, sparkline

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from jinja2 import Environment

    from garment_dataset.report.facts import NodeFact, RecordingFacts, SiteFacts
    from garment_dataset.report.frames import Pictures

_UNSAFE = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026", "\u2028": "\\u2028", "\u2029": "\\u2029"}
_UNITS = {"swing_rad": "rad", "width_m": "m", "height_m": "m", "weight_kg": "kg"}


def script_json(value: object) -> Markup:
    """Return JSON that can stand in a script element, whatever it holds.

    Parameters
    ----------
    value : JSON-like
        Finite numbers only.
    """
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for character, escaped in _UNSAFE.items():
        text = text.replace(character, escaped)
    return Markup(text)  # noqa: S704 - nothing in it can end the script


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    made = Environment(
        loader=PackageLoader("garment_dataset.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters["script_json"] = script_json
    made.filters["plain"] = _plain
    made.filters["short"] = lambda text: "" if text is None else str(text)[:12]
    made.globals["STATES"] = STATES
    return made


def _plain(value: object) -> str:
    """Return a value as a person reads it."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)


def recording_page(
    facts: RecordingFacts,
    curves: Mapping[str, Any] | None,
    table: Sequence[Mapping[str, Any]],
    pictures: Pictures,
    results: Mapping[str, Any],
    faults: Sequence[str],
) -> str:
    """Return the page of a recording.

    Parameters
    ----------
    facts : RecordingFacts
        What is known of it.
    curves, table : mapping or None, sequence of mapping
        See :mod:`garment_dataset.report.curves`.
    pictures : Pictures
        See there.
    results : mapping
        Values of the tables with one row for the recording, and the rows of its quality.
    faults : sequence of str
        What could not be read.
    """
    return (
        _environment()
        .get_template("recording.html")
        .render(
            facts=facts,
            units=_UNITS,
            states=_counts(facts.nodes),
            curves=curves,
            table=table,
            pictures=pictures,
            clouds={"frames": pictures.clouds} if pictures.clouds else None,
            results=results,
            faults=faults,
        )
    )


def failed_page(facts: RecordingFacts, why: str) -> str:
    """Return the page of a recording that could not be shown, with the reason.

    Parameters
    ----------
    facts : RecordingFacts
        What is known of it.
    why : str
        In one line.
    """
    from garment_dataset.report.frames import Pictures

    return recording_page(facts, None, (), Pictures(), {"quality": (), "motion": {}}, [f"the page is not whole: {why}"])


def index_page(
    facts: SiteFacts,
    sparks: Mapping[str, tuple[str, str, Sequence[float | None]]],
    repeats: Sequence[Mapping[str, Any]],
    faults: Sequence[str],
) -> str:
    """Return the first page.

    Parameters
    ----------
    facts : SiteFacts
        All that is known.
    sparks : mapping
        See :func:`garment_dataset.report.curves.spark_values`.
    repeats : sequence of mapping
        See :func:`garment_dataset.report.repeats.repeats_of`.
    faults : sequence of str
        What could not be read.
    """
    nodes = [*(node for each in facts.recordings for node in each.nodes), *facts.others]
    return (
        _environment()
        .get_template("index.html")
        .render(
            facts=facts,
            sparks={name: _spark(*found) for name, found in sparks.items()},
            counts={each.recording: _counts(each.nodes) for each in facts.recordings},
            total=_counts(nodes),
            reasons=_reasons(nodes),
            unsettled=_matrix(nodes, [stage.name for stage in facts.stages]),
            picture=Markup(pipeline_picture(facts.stages)),  # noqa: S704 - escapes its texts
            repeats=repeats,
            faults=faults,
        )
    )


def _spark(what: str, unit: str, values: Sequence[float | None]) -> Markup:
    known = [value for value in values if value is not None]
    label = f"{what}: from {min(known):.3g} to {max(known):.3g} {unit}" if known else what
    return Markup(sparkline(values, label))  # noqa: S704 - escapes its texts


def _counts(nodes: Sequence[NodeFact]) -> dict[str, int]:
    found = Counter(node.state for node in nodes)
    return {state: found[state] for state in STATES if found[state]}


def _reasons(nodes: Sequence[NodeFact]) -> list[tuple[int, str, str]]:
    """Return the reasons with how many nodes of a stage have them, as ``garment status`` counts."""
    found = Counter((node.stage, _grouped(reason)) for node in nodes for reason in node.reasons)
    return [(count, stage, reason) for (stage, reason), count in found.items()]


def _grouped(reason: str) -> str:
    """Return a reason; of what stands above in the graph only the stage."""
    if not reason.startswith("upstream "):
        return reason
    node, _, state = reason.removeprefix("upstream ").partition(": ")
    return f"upstream {node.split(' ')[0].partition(':')[0]}: {state}"


def _matrix(nodes: Sequence[NodeFact], stages: Sequence[str]) -> list[tuple[str, list[NodeFact | None]]]:
    """Return the subjects that are not all fresh, each with its nodes by stage."""
    found: dict[str, dict[str, NodeFact]] = {}
    for node in nodes:
        variant = f" ({node.variant})" if node.variant else ""
        found.setdefault(node.subject + variant, {})[node.stage] = node
    return [
        (subject, [by_stage.get(stage) for stage in stages])
        for subject, by_stage in found.items()
        if any(node.state != "fresh" for node in by_stage.values())
    ]
