"""Drawings of the pipelines: text, Mermaid, JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from garment_dataset.catalog import Catalog
from garment_dataset.catalog.schemes import scheme_of
from garment_dataset.engine.graph import producers
from garment_dataset.stages import Group
from garment_dataset.workspace.known_stages import KnownStages
from garment_dataset.workspace.pipelines import load_pipelines

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.layout import Layout
    from garment_dataset.stages import Stage
    from garment_dataset.workspace.pipelines import Pipeline


def load(layout: Layout) -> list[Pipeline]:
    """Read a workspace's pipelines, whatever is wrong with its tables."""
    keys = Catalog.load(layout.catalog_dir, strict=False, scheme=scheme_of(layout)).filter_keys
    return load_pipelines(layout.pipelines_dir, KnownStages.of(layout), keys)


def to_text(pipelines: Sequence[Pipeline], *, params: bool) -> str:
    """Return the pipelines as indented text."""
    lines: list[str] = []
    for pipeline in pipelines:
        file = pipeline.file
        lines.append(f"{pipeline.name}: {file.description}".rstrip(": "))
        lines.append(f"  recordings: {' '.join(file.recordings) or 'all'}")
        if file.variant:
            lines.append(f"  variant: {file.variant}")
        for stage in pipeline.stages:
            made = ", ".join(output.name for output in stage.outputs)
            per = "" if stage.per == "recording" else f"  (per {per_text(stage)})"
            lines.append(f"  {', '.join(stage.arguments)} -> [{stage.name}] -> {made}{per}")
            if params:
                lines += [f"      {name} = {value}" for name, value in pipeline.params[stage.name]]
        lines.append("")
    return "\n".join(lines).rstrip()


def per_text(stage: Stage) -> str:
    """Say what one run of a stage covers."""
    return f"group of equal {', '.join(stage.per.by)}" if isinstance(stage.per, Group) else stage.per


def to_mermaid(pipelines: Sequence[Pipeline]) -> str:
    """Return the stages of all pipelines as a Mermaid flowchart."""
    lines = ["flowchart LR"]
    stages = {stage.name: stage for pipeline in pipelines for stage in pipeline.stages}
    lines += [f"    {name}[{name}]" for name in stages]
    for stage in stages.values():
        lines += [f"    {name}[({name})] --> {stage.name}" for name in stage.arguments if name in stage.sources]
    for pipeline in pipelines:
        made = producers(pipeline.stages)
        arrows = ((table, stage) for stage in pipeline.stages for table in stage.inputs if table in made)
        lines += [f"    {made[table].name} -- {table} --> {stage.name}" for table, stage in arrows]
    read = {table for stage in stages.values() for table in stage.inputs}
    for stage in stages.values():
        ends = [output.name for output in stage.outputs if output.name not in read]
        lines += [f"    {stage.name} --> table_{name}[/{name}/]" for name in ends]
    return "\n".join(dict.fromkeys(lines))


def to_json(pipelines: Sequence[Pipeline]) -> list[dict[str, Any]]:
    """Return the pipelines as JSON-like data, parameters resolved."""
    return [
        {
            "pipeline": pipeline.name,
            "description": pipeline.file.description,
            "variant": pipeline.file.variant or None,
            "recordings": list(pipeline.file.recordings),
            "stages": [
                {
                    "name": stage.name,
                    "reads": list(stage.arguments),
                    "makes": [output.name for output in stage.outputs],
                    "per": list(stage.per.by) if isinstance(stage.per, Group) else stage.per,
                    "params": pipeline.params[stage.name].model_dump(mode="json"),
                }
                for stage in pipeline.stages
            ],
        }
        for pipeline in pipelines
    ]
