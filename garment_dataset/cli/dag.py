"""Drawings of the pipelines: text, Mermaid, JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.graph import producers
from garment_dataset.pipelines import load_pipelines
from garment_dataset.stages import STAGES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.engine.stage import Stage, StageParams
    from garment_dataset.pipelines import Pipeline
    from garment_dataset.workspace import Workspace


@dataclass(frozen=True)
class Drawn:
    """A pipeline with its stages in order, and their resolved parameters."""

    pipeline: Pipeline
    stages: tuple[Stage, ...]
    params: dict[str, StageParams]


def load(workspace: Workspace) -> list[Drawn]:
    """Read a workspace's pipelines."""
    known = {stage.name: stage for stage in STAGES}
    drawn = []
    for path, pipeline in load_pipelines(workspace.pipelines_dir):
        params = pipeline.resolved(known, path)
        drawn.append(Drawn(pipeline, tuple(stage for name, stage in known.items() if name in params), params))
    return drawn


def to_text(pipelines: Sequence[Drawn], *, params: bool) -> str:
    """Return the pipelines as indented text."""
    lines: list[str] = []
    for drawn in pipelines:
        lines.append(f"{drawn.pipeline.name}: {drawn.pipeline.description}".rstrip(": "))
        lines.append(f"  recordings: {' '.join(drawn.pipeline.recordings) or 'all'}")
        for stage in drawn.stages:
            made = ", ".join(output.name for output in stage.outputs)
            lines.append(f"  {', '.join(stage.arguments)} -> [{stage.name}] -> {made}")
            if params:
                lines += [f"      {name} = {value}" for name, value in drawn.params[stage.name]]
        lines.append("")
    return "\n".join(lines).rstrip()


def to_mermaid(pipelines: Sequence[Drawn]) -> str:
    """Return the stages of all pipelines as a Mermaid flowchart."""
    stages = {stage.name: stage for drawn in pipelines for stage in drawn.stages}
    made = producers(stages.values())
    lines = ["flowchart LR"]
    for stage in stages.values():
        lines.append(f"    {stage.name}[{stage.name}]")
        lines += [f"    {name}[({name})] --> {stage.name}" for name in stage.arguments if name in stage.sources]
        lines += [f"    {made[table].name} -- {table} --> {stage.name}" for table in stage.inputs]
    read = {table for stage in stages.values() for table in stage.inputs}
    for stage in stages.values():
        ends = [output.name for output in stage.outputs if output.name not in read]
        lines += [f"    {stage.name} --> table_{name}[/{name}/]" for name in ends]
    return "\n".join(lines)


def to_json(pipelines: Sequence[Drawn]) -> list[dict[str, Any]]:
    """Return the pipelines as JSON-like data, parameters resolved."""
    return [
        {
            "pipeline": drawn.pipeline.name,
            "description": drawn.pipeline.description,
            "recordings": list(drawn.pipeline.recordings),
            "stages": [
                {
                    "name": stage.name,
                    "reads": list(stage.arguments),
                    "makes": [output.name for output in stage.outputs],
                    "per": stage.per,
                    "params": drawn.params[stage.name].model_dump(mode="json"),
                }
                for stage in drawn.stages
            ],
        }
        for drawn in pipelines
    ]
