"""Small drawings as SVG text: sparklines, and the picture of the pipelines. All text in them is escaped."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from garment_dataset.report.facts import StageFact

_SPARK_WIDTH, _SPARK_HEIGHT, _PAD = 120, 28, 2
_BOX_WIDTH, _BOX_HEIGHT, _GAP_X, _GAP_Y, _EDGE = 148, 50, 64, 20, 8
STATES = ("fresh", "stale", "missing", "blocked", "failed")


def sparkline(values: Sequence[float | None], label: str) -> str:
    """Return a curve as small as a word.

    Parameters
    ----------
    values : sequence of float or None
        At equal distances; None breaks the line.
    label : str
        What a screen reader says.
    """
    known = [value for value in values if value is not None]
    if len(known) < 2:
        return ""
    low, high = min(known), max(known)
    spread = (high - low) or 1.0
    step = (_SPARK_WIDTH - 2 * _PAD) / max(1, len(values) - 1)
    pieces: list[list[str]] = [[]]
    for number, value in enumerate(values):
        if value is None:
            pieces.append([])
            continue
        x = _PAD + number * step
        y = _PAD + (_SPARK_HEIGHT - 2 * _PAD) * (1 - (value - low) / spread)
        pieces[-1].append(f"{x:.1f},{y:.1f}")
    lines = "".join(f'<polyline points="{" ".join(piece)}"/>' for piece in pieces if piece)
    return (
        f'<svg class="spark" viewBox="0 0 {_SPARK_WIDTH} {_SPARK_HEIGHT}" width="{_SPARK_WIDTH}" '
        f'height="{_SPARK_HEIGHT}" role="img" aria-label="{escape(label)}">{lines}</svg>'
    )


@dataclass(frozen=True, slots=True)
class _Box:
    """A stage or a source in the picture."""

    name: str
    layer: int
    row: int

    @property
    def x(self) -> int:
        return _EDGE + self.layer * (_BOX_WIDTH + _GAP_X)

    @property
    def y(self) -> int:
        return _EDGE + self.row * (_BOX_HEIGHT + _GAP_Y)


def pipeline_picture(stages: Sequence[StageFact]) -> str:
    """Return the stages of all pipelines as a drawing from left to right, with how many nodes are in which state.

    Parameters
    ----------
    stages : sequence of StageFact
        In an order in which what feeds a stage stands before it.
    """
    edges = _edges(stages)
    boxes = _laid_out(stages, edges)
    counts = {stage.name: stage.counts for stage in stages}
    width = max((box.x for box in boxes.values()), default=0) + _BOX_WIDTH + _EDGE
    height = max((box.y for box in boxes.values()), default=0) + _BOX_HEIGHT + _EDGE
    lines = [_edge(boxes[start], boxes[end], tables) for (start, end), tables in edges.items()]
    drawn = [_drawn_box(box, counts.get(box.name)) for box in boxes.values()]
    return (
        f'<svg class="pipeline" viewBox="0 0 {width} {height}" width="{width}" height="{height}" role="img" '
        'aria-label="The stages from left to right; the table below says the same">'
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0 0 8 4 0 8Z"/></marker></defs>' + "".join(lines) + "".join(drawn) + "</svg>"
    )


def _edges(stages: Sequence[StageFact]) -> dict[tuple[str, str], list[str]]:
    """Return what is handed from where to where."""
    makers = {table: stage.name for stage in stages for table in stage.makes}
    found: dict[tuple[str, str], list[str]] = defaultdict(list)
    for stage in stages:
        for name in stage.reads:
            if makers.get(name) != stage.name:
                found[makers.get(name, f"({name})"), stage.name].append(name)
    return dict(found)


def _laid_out(stages: Sequence[StageFact], edges: Iterable[tuple[str, str]]) -> dict[str, _Box]:
    """Return each box in its layer, one behind the last that feeds it, in the order of what feeds it."""
    feeds: Mapping[str, list[str]] = defaultdict(list)
    for start, end in edges:
        feeds[end].append(start)
    sources = dict.fromkeys(start for start, _ in edges if start.startswith("("))
    layers = dict.fromkeys(sources, 0)
    for _ in stages:  # as often as the longest road may be
        for stage in stages:
            layers[stage.name] = 1 + max((layers.get(name, 0) for name in feeds[stage.name]), default=0)
    boxes: dict[str, _Box] = {}
    for layer in range(max(layers.values(), default=0) + 1):
        names = [name for name, at in layers.items() if at == layer]
        names.sort(key=lambda name: _middle([boxes[each].row for each in feeds[name] if each in boxes]))
        for row, name in enumerate(names):
            boxes[name] = _Box(name, layer, row)
    return boxes


def _middle(rows: Sequence[int]) -> float:
    return sum(rows) / len(rows) if rows else 0.0


def _edge(start: _Box, end: _Box, tables: Sequence[str]) -> str:
    x, y = start.x + _BOX_WIDTH, start.y + _BOX_HEIGHT // 2
    to_x, to_y = end.x, end.y + _BOX_HEIGHT // 2
    bend = _GAP_X // 2
    title = escape(f"{start.name} to {end.name}: {', '.join(tables)}")
    path = f"M{x} {y}C{x + bend} {y} {to_x - bend} {to_y} {to_x} {to_y}"
    return f'<path class="edge" d="{path}" marker-end="url(#tip)"><title>{title}</title></path>'


def _drawn_box(box: _Box, counts: Mapping[str, int] | None) -> str:
    """Return a box with its name, and below a bar of its counts."""
    kind = "source" if counts is None else "stage"
    middle = box.x + _BOX_WIDTH // 2
    name = escape(box.name.strip("()"))
    shape = f'<rect class="{kind}" x="{box.x}" y="{box.y}" width="{_BOX_WIDTH}" height="{_BOX_HEIGHT}" rx="8"/>'
    text_y = box.y + (30 if not counts else 21)
    parts = [shape, f'<text x="{middle}" y="{text_y}">{name}</text>']
    if counts:
        said = " · ".join(f"{counts[state]} {state}" for state in STATES if counts.get(state))
        parts.append(f'<text class="counts" x="{middle}" y="{box.y + 38}">{escape(said)}</text>')
        parts += _bar(box, counts)
    return "".join(parts)


def _bar(box: _Box, counts: Mapping[str, int]) -> list[str]:
    total, x = sum(counts.values()), float(box.x + 8)
    parts = []
    for state in STATES:
        if share := counts.get(state, 0) / total:
            width = share * (_BOX_WIDTH - 16)
            parts.append(
                f'<rect class="bar {state}" x="{x:.1f}" y="{box.y + _BOX_HEIGHT - 7}" width="{width:.1f}" height="3"/>'
            )
            x += width
    return parts
