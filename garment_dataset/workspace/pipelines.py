"""Pipeline files: which stages, for which recordings, with which knobs."""

from __future__ import annotations

import graphlib
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from garment_dataset.catalog.filters import compile_filter
from garment_dataset.catalog.rows import FIXED_WORDS, ROW_KEYS
from garment_dataset.engine.graph import producers
from garment_dataset.errors import (
    DataWarning,
    FilterError,
    PipelineError,
    StageError,
    did_you_mean,
    one_of,
)
from garment_dataset.files import first_fault, hint_of, read_toml
from garment_dataset.stages import Group

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from garment_dataset.catalog.filters import Kind
    from garment_dataset.engine.stage import StageParams
    from garment_dataset.stages import Stage
    from garment_dataset.workspace.known_stages import KnownStages

DEFAULT_VARIANT = "default"
"""What commands call the variant that has no name."""

_MOVED = {
    ("depth_points", "depth_topic"): ("decode", "depth_topic"),
    ("silhouette", "color_topic"): ("decode", "color_topic"),
    ("background", "color_topic"): ("decode", "color_topic"),
}
"""Knobs of version 0.1 that stand elsewhere now, so that nothing is said twice; they are still read."""


class PipelineFile(BaseModel):
    """What a file of ``pipelines/`` says.

    Parameters
    ----------
    description : str
        What it is for.
    variant : str
        Name of the set of results that it makes; empty for the usual one. Pipelines of different variants may give one
        stage of one recording different parameters.
    recordings : tuple of str
        Filter terms, as on the command line.
    stages : tuple of str
        Names of stages; those that feed them must be named too.
    params : mapping of str to mapping
        By stage, the parameters that differ from the defaults.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    description: str = ""
    variant: str = Field(default="", pattern=r"^([A-Za-z0-9][A-Za-z0-9_-]*)?$")
    recordings: tuple[str, ...] = ()
    stages: tuple[str, ...]
    params: dict[str, dict[str, Any]] = {}


@dataclass(frozen=True)
class Pipeline:
    """A pipeline with its stages found and their parameters filled in.

    Parameters
    ----------
    name : str
        The file's name without ``.toml``.
    file : PipelineFile
        What it says.
    stages : tuple of Stage
        In the order of the known ones.
    params : mapping of str to StageParams
        By stage, defaults filled in.
    """

    name: str
    file: PipelineFile
    stages: tuple[Stage, ...]
    params: Mapping[str, StageParams]

    @property
    def makers(self) -> dict[str, Stage]:
        """Which of its stages makes each table."""
        return {output.name: stage for stage in self.stages for output in stage.outputs}


def load_pipelines(folder: Path, known: KnownStages, keys: Mapping[str, Kind] = ROW_KEYS) -> list[Pipeline]:
    """Read every ``*.toml`` of a folder, in the order of their names.

    Parameters
    ----------
    folder : Path
        The pipeline files.
    known : KnownStages
        The stages that they may name.
    keys : mapping of str to type
        What recordings can be filtered by: those of every catalog, or of the one at hand.

    Raises
    ------
    PipelineError
        If there is none, one cannot be read, names an unknown stage or parameter, gives a value that does not fit, or
        leaves out a stage that feeds another.
    StageError
        If a stage that is named cannot be imported.
    """
    pipelines = [_resolved(path, read_pipeline(path), known, keys) for path in sorted(folder.glob("*.toml"))]
    if not pipelines:
        raise PipelineError("no pipeline files", where=folder, expected="at least one NAME.toml")
    return pipelines


def read_pipeline(path: Path) -> PipelineFile:
    """Read one file, whether or not there are the stages that it names.

    Raises
    ------
    PipelineError
        If it cannot be read, or says what no pipeline file can say.
    """
    try:
        file = PipelineFile.model_validate(read_toml(path))
    except ValidationError as error:
        entry, expected, found, hint = first_fault(error, PipelineFile)
        raise PipelineError(
            f"entry {entry!r} is not understood", where=path, expected=expected, found=found, hint=hint
        ) from error
    except (OSError, ValueError) as error:
        raise PipelineError("cannot be read as TOML", where=path, found=error, hint=hint_of(error)) from error
    if file.variant == DEFAULT_VARIANT:
        hint = "Leave `variant` out, or choose another name."
        raise PipelineError(
            f"variant {file.variant!r} is how commands call the one without a name", where=path, hint=hint
        )
    return file


def _resolved(path: Path, file: PipelineFile, known: KnownStages, keys: Mapping[str, Kind]) -> Pipeline:
    _refuse_recordings(path, file, keys)
    given = _with_moved_knobs(path, file)
    for name in (*file.stages, *given):
        if name not in known:
            hint = did_you_mean(name, known.names)
            raise PipelineError(f"unknown stage {name!r}", where=path, expected=one_of(known.names), hint=hint)
    for name in given:
        if name not in file.stages:
            hint = f"Add {name!r} to its stages, or remove the table."
            raise PipelineError(f"[params.{name}] is of no stage of this file", where=path, hint=hint)
    stages = tuple(known[name] for name in known.names if name in file.stages)
    _refuse_misfits(path, stages, known)
    params = {stage.name: _params(stage, given.get(stage.name, {}), path) for stage in stages}
    return Pipeline(path.stem, file, stages, params)


def _refuse_recordings(path: Path, file: PipelineFile, keys: Mapping[str, Kind]) -> None:
    """Refuse terms that no catalog understands; which garments and recordings there are is a catalog's to say."""
    try:
        compile_filter(file.recordings, keys, FIXED_WORDS)
    except FilterError as error:
        raise PipelineError(
            error.what,
            where=f"{path}, recordings: {error.where}",
            expected=error.expected,
            found=error.found,
            hint=error.hint,
        ) from error


def _with_moved_knobs(path: Path, file: PipelineFile) -> dict[str, dict[str, Any]]:
    """Return the parameters as written, with knobs that have moved where they belong now."""
    given = {stage: dict(params) for stage, params in file.params.items()}
    for (stage, name), (home, now) in _MOVED.items():
        if name not in given.get(stage, {}):
            continue
        value = given[stage].pop(name)
        text = f"{path}: [params.{stage}] {name} has moved to [params.{home}] {now}"
        if given.setdefault(home, {}).setdefault(now, value) != value:
            raise PipelineError(
                f"[params.{stage}] {name} and [params.{home}] {now} differ",
                where=path,
                found=f"{value!r} and {given[home][now]!r}",
                hint=f"Remove the first: every stage reads what {home!r} found.",
            )
        warnings.warn(text, DataWarning, stacklevel=2)
    return given


def _refuse_misfits(path: Path, stages: tuple[Stage, ...], known: KnownStages) -> None:
    """Refuse a stage whose inputs nothing here makes, or that cannot be put together with what feeds it."""
    made = {output.name: stage for stage in stages for output in stage.outputs}
    for stage in stages:
        for table in stage.inputs:
            if table not in made and table in stage.optional:
                continue
            if table not in made:
                makers = known.makers_of(table)
                raise PipelineError(
                    f"stage {stage.name!r} reads table {table!r}",
                    where=path,
                    found=[each.name for each in stages],
                    hint=f"Add {' or '.join(map(repr, makers))} to its stages." if makers else "No stage makes it.",
                )
            feeder = made[table]
            if isinstance(feeder.per, Group) and feeder.per != stage.per:
                where = f"table {table!r} is of groups by {', '.join(feeder.per.by)}"
                raise StageError(where, where=stage.name, expected="a stage of the same groups", found=stage.per)
            if isinstance(stage.per, Group) and feeder.per == "position":
                raise StageError(f"table {table!r} is of camera positions", where=stage.name, found="a stage of groups")
    producers(stages)
    feeders = {stage.name: {made[table].name for table in stage.inputs if table in made} for stage in stages}
    try:
        graphlib.TopologicalSorter(feeders).prepare()
    except graphlib.CycleError as error:
        circle = " -> ".join(error.args[1])
        raise PipelineError("stages feed each other in a circle", where=path, found=circle) from error


def _params(stage: Stage, given: Mapping[str, Any], path: Path) -> StageParams:
    try:
        return stage.params.model_validate(given)
    except ValidationError as error:
        name, expected, found, hint = first_fault(error, stage.params)
        raise PipelineError(
            f"[params.{stage.name}] {name}", where=path, expected=expected, found=found, hint=hint
        ) from error
