"""Write a new stage into a workspace: its file, a test that runs, and its name in garment.toml."""

from __future__ import annotations

import contextlib
import json
import re
import tomllib
from dataclasses import dataclass
from keyword import iskeyword
from typing import TYPE_CHECKING

from garment_dataset.errors import UsageError
from garment_dataset.layout import SETTINGS, Layout
from garment_dataset.workspace.known_stages import KnownStages, refuse_shadow
from garment_dataset.workspace.pipelines import read_pipeline
from garment_dataset.workspace.stage_forms import FORMS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from garment_dataset.workspace.stage_forms import Covering

_NAME = re.compile(r"(?!test|conftest)[a-z][a-z0-9_]*")
_WORDS = frozenset({"bag", "notes", "params", "np", "pa", "pc", "stage", "frame", "stamp", "record_stamp", "repeats"})
"""Words that mean something else in the file of a stage."""


@dataclass(frozen=True)
class NewStage:
    """What was written, and what is left to a person.

    Parameters
    ----------
    files : tuple of Path
        The stage and its test.
    settings_line : str or None
        What garment.toml must say under ``[stages]``, when it has a form that is not edited here.
    pipeline : Path
        A pipeline file that makes what the stage reads; where there is none, one that is not there yet.
    pipeline_line : str
        What it must say.
    """

    files: tuple[Path, ...]
    settings_line: str | None
    pipeline: Path
    pipeline_line: str


def write_stage(layout: Layout, name: str, covering: Covering) -> NewStage:
    """Write a stage, its test, and its name in garment.toml.

    Parameters
    ----------
    layout : Layout
        The workspace.
    name : str
        Of the stage, its module and its table.
    covering : {"recording", "position", "repeats"}
        What one run covers.

    Raises
    ------
    UsageError
        If the name cannot be that of a module or is taken, or a file is in the way: nothing is ever overwritten.
    StageError
        If Python knows another module of that name.
    PipelineError
        If a pipeline file cannot be read.
    """
    _refuse_name(name)
    folder = layout.stages_dir
    files = (folder / f"{name}.py", folder / f"test_{name}.py")
    refuse_shadow(name, files[0])
    for path in (*files, folder / name):
        if path.exists():
            raise UsageError("in the way of a new stage", where=path, hint="Nothing was written.")
    form = FORMS[covering]
    pipeline, stages = _pipeline_with(layout.pipelines_dir, form.feeders, name)
    folder.mkdir(parents=True, exist_ok=True)
    camel = "".join(word.capitalize() for word in name.split("_"))
    for path, text in zip(files, (form.stage, form.test), strict=True):
        named = text.replace("example", name).replace("EXAMPLE", name.upper()).replace("Example", camel)
        path.write_text(named, "utf-8")
    return NewStage(files, _name_in_settings(layout, name), pipeline, f"stages = {json.dumps(stages)}")


def _refuse_name(name: str) -> None:
    if not _NAME.fullmatch(name) or iskeyword(name) or name in _WORDS:
        raise UsageError(
            "not a name for a stage",
            expected="lower-case letters, digits and _; no word of Python's or of stages, no test",
            found=repr(name),
        )
    known = KnownStages.of_every_workspace()
    if name in known or known.makers_of(name):
        what = "stage" if name in known else "table"
        raise UsageError(f"there is a {what} {name!r} already", hint="Choose another name.")


def _pipeline_with(folder: Path, feeders: tuple[str, ...], name: str) -> tuple[Path, tuple[str, ...]]:
    """Return the first pipeline file that makes what a new stage reads, and the stages it must name then."""
    for path in sorted(folder.glob("*.toml")):
        stages = read_pipeline(path).stages
        if feeders[-1] in stages:
            return path, (*stages, name)
    return folder / f"{name}.toml", (*feeders, name)


def _name_in_settings(layout: Layout, name: str) -> str | None:
    """Add a module to garment.toml; return what it must say, where its form is not a usual one."""
    if name in layout.stage_modules:
        return None
    path = layout.root / SETTINGS
    text = path.read_bytes().decode("utf-8-sig") if path.is_file() else ""
    wanted = tomllib.loads(text)
    modules = [*layout.stage_modules, name]
    wanted["stages"] = {**wanted.get("stages", {}), "modules": modules}
    for changed in _edits(text, name):
        with contextlib.suppress(tomllib.TOMLDecodeError):
            if tomllib.loads(changed) == wanted:
                path.write_bytes(changed.encode("utf-8"))
                return None
    return f"modules = {json.dumps(modules)}"


def _edits(text: str, name: str) -> Iterator[str]:
    """Yield what garment.toml may look like with a module added; only one that says so is right."""
    yield f'{text.rstrip()}\n\n[stages]\nmodules = ["{name}"]\n'.lstrip()
    yield re.sub(r"(?m)^\[stages\].*$", rf'\g<0>\nmodules = ["{name}"]', text)
    yield re.sub(r"(?m)^(modules\s*=\s*\[[^\]]*)\n\]", rf'\1\n    "{name}",\n]', text)
    yield re.sub(r"(?m)^(modules\s*=\s*\[[^\]]*?),?\s*\]", rf'\1, "{name}"]', text)
    yield re.sub(r"(?m)^(modules\s*=\s*\[)\s*\]", rf'\1"{name}"]', text)
