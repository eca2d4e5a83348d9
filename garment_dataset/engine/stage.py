"""What a stage is: a pure function, its parameters and its output tables."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

from pydantic import BaseModel, ConfigDict

from garment_dataset.engine.canonical import digest

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    import pyarrow as pa

    from garment_dataset.engine.table import TableSpec


NOTES = "notes"
"""Argument that gives a function what the stages that feed it said."""

_NO_INPUTS = frozenset({"params", NOTES})


class StageParams(BaseModel):
    """Knobs of a stage: immutable, every one with a default, unknown ones refused."""

    model_config: ClassVar[ConfigDict] = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


@dataclass(frozen=True)
class Stage:
    """A pure function, with all that its result depends on besides its inputs.

    Parameters
    ----------
    function : callable
        Takes its inputs by name: a table by the table's name (a :class:`pyarrow.Table`; a dict of them, by subject,
        where a node gathers those of several subjects), an external source by the source's name (a
        :class:`pathlib.Path`), ``params``, and ``notes``: what the stages that feed it said of data left out, a tuple
        of texts by stage, those of gathered tables with their subject in front. A table with a default need not be made
        by anyone. Returns a mapping from output name to table. The function's name is the stage's name.
    params : type of StageParams
        The knobs, with their defaults.
    outputs : tuple of TableSpec
        The tables that the function returns.
    sources : frozenset of str
        Which of the arguments are external sources.
    home : Path or None
        Folder to import its module from, where that is not installed.
    reads_identity : bool
        Whether the function sees the identity columns of its input tables. If not, the same rows of another subject are
        the same input. In gathered tables it always sees them.
    """

    function: Callable[..., Mapping[str, pa.Table]]
    params: type[StageParams]
    outputs: tuple[TableSpec, ...]
    sources: frozenset[str] = frozenset()
    home: Path | None = None
    reads_identity: bool = False

    @property
    def name(self) -> str:
        """The function's name."""
        return self.function.__name__

    @property
    def module(self) -> str:
        """The module that holds the function, and this stage as ``STAGE``."""
        return self.function.__module__

    @cached_property
    def arguments(self) -> tuple[str, ...]:
        """The names of the sources and tables that the function takes."""
        return tuple(name for name in inspect.signature(self.function).parameters if name not in _NO_INPUTS)

    @cached_property
    def takes_notes(self) -> bool:
        """Whether the function wants to know what the stages that feed it said."""
        return NOTES in inspect.signature(self.function).parameters

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """The tables it reads."""
        return tuple(name for name in self.arguments if name not in self.sources)

    @cached_property
    def optional(self) -> frozenset[str]:
        """Those of its tables that it can do without."""
        parameters = inspect.signature(self.function).parameters
        return frozenset(name for name in self.inputs if parameters[name].default is not inspect.Parameter.empty)

    @cached_property
    def declaration(self) -> str:
        """Digest of the tables that it declares, as they are described in the files, and of its sources."""
        return digest(
            "stage/1", [[output.describe() for output in self.outputs], sorted(self.sources), self.reads_identity]
        )

    def run(self, arguments: Mapping[str, Any], params: StageParams) -> Mapping[str, pa.Table]:
        """Call the function."""
        return self.function(**arguments, params=params)
