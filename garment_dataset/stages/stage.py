"""What a stage of this product is: the engine's, with what one run of it covers and whose rows its tables hold."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import Literal

from garment_dataset.engine.stage import Stage as EngineStage
from garment_dataset.engine.stage import StageParams
from garment_dataset.engine.table import Column
from garment_dataset.errors import StageError

__all__ = ["ABOUT", "GROUP_IDENTITY", "IDENTITY", "PARTITIONS", "REPEATS", "Group", "Per", "Stage", "StageParams"]

PARTITIONS = ("garment", "holding")
"""Keys in the paths of all results but those of a camera position."""

_AXIS = Column("axis", "string", "", "R: the garment moves along the optical axis; B: across it", nullable=True)
_SPEED = Column("speed", "float64", "1", "speed of the robot as typed into the file name", nullable=True)
_SWING = Column(
    "swing_rad", "float64", "rad", "swing of the gripper's axis; null when the name has none", nullable=True
)

IDENTITY = (
    Column("recording", "string", "", "name of the recording, without .bag; of an empty-scene bag likewise"),
    _AXIS,
    _SPEED,
    Column("repeat", "int32", "1", "number of the repeat; null when the name has none", nullable=True),
    _SWING,
)
"""The columns that tables of a recording or a camera position begin with: whose rows these are."""

GROUP_IDENTITY = (Column("group", "string", "", "the recordings that were taken together"), _AXIS, _SPEED, _SWING)
"""The columns that tables of a group begin with; what its recordings do not share is null."""

ABOUT = {
    column.name: column
    for column in (
        Column("width_m", "float64", "m", "of the garment, as garments.csv says; null: not known", nullable=True),
        Column("height_m", "float64", "m", "of the garment, as garments.csv says; null: not known", nullable=True),
        Column("weight_kg", "float64", "kg", "of the garment, as garments.csv says; null: not known", nullable=True),
    )
}
"""Further columns of the catalog that a stage of a recording may have put in front of its tables."""


@dataclass(frozen=True, slots=True)
class Group:
    """Recordings that one run covers: those of a pipeline that agree in these columns of the catalog.

    Parameters
    ----------
    by : tuple of str
        Columns of the catalog, such as ``garment`` and ``axis``; none for all recordings together.

    Raises
    ------
    StageError
        If ``by`` is one text: Python takes ``("garment")`` for that.
    """

    by: tuple[str, ...]

    def __post_init__(self) -> None:
        given: object = self.by
        if isinstance(given, str):
            hint = f"Write Group(({given!r},))."
            raise StageError("a group takes a tuple of columns", found=repr(given), hint=hint)


Per = Literal["recording", "position"] | Group
"""What one run of a stage covers."""

REPEATS = Group(("garment", "holding", "swing_rad", "speed", "axis", "topics_file"))
"""The repeats of one movement of one garment, held in one way, seen from one camera position."""


@dataclass(frozen=True)
class Stage(EngineStage):
    """A pure function, with all that its result depends on besides its inputs.

    Parameters
    ----------
    function, params, outputs, home, reads_identity
        As for the engine's stage.
    sources : frozenset of str
        Which of the arguments are external: ``bag`` gives the path of the recording.
    per : {"recording", "position"} or Group
        What one run covers. ``position``: its bag, and the tables of recordings, are those of the bag that shows the
        empty scene of a camera position. A group: tables of recordings come as a dict, by the recordings' names in
        alphabetical order; tables of the same groups come as they are.
    about : tuple of str
        Names among :data:`ABOUT`: columns of the catalog that stand behind the identity columns, null for an empty
        scene. A change of their values in the catalog is a reason to run the stage again.

    Raises
    ------
    StageError
        If ``per`` is none of these, the function takes no parameters, an output has a column that stands in the path
        or is put in front of every table, a stage of a group takes a bag, or no table, or ``about`` names no such
        column or is not of a recording.
    """

    sources: frozenset[str] = frozenset({"bag"})
    per: Per = "recording"
    about: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.about and (self.per != "recording" or not ABOUT.keys() >= {*self.about}):
            expected = f"of a stage per recording, among {', '.join(ABOUT)}"
            raise StageError("`about` is not understood", where=self.name, expected=expected, found=self.about)
        if self.per not in {"recording", "position"} and not isinstance(self.per, Group):
            raise StageError(
                "`per` is not understood", where=self.name, expected="recording, position or a Group", found=self.per
            )
        if "params" not in inspect.signature(self.function).parameters:
            raise StageError(
                "the function takes no `params`", where=self.name, hint="Every stage has parameters, if empty ones."
            )
        taken = {column.name for column in self.identity} | set(PARTITIONS)
        for output in self.outputs:
            if twice := sorted(taken & {column.name for column in output.columns}):
                raise StageError(
                    f"table {output.name!r} has columns that the product adds", where=self.name, found=", ".join(twice)
                )
        bags = self.sources.intersection(self.arguments)
        if isinstance(self.per, Group) and (bags or not self.inputs):
            found = f"argument {min(bags)!r}" if bags else "no table among its arguments"
            hint = "Read the bag in a stage of its own, per recording." if bags else None
            raise StageError("a stage of a group reads tables", where=self.name, found=found, hint=hint)

    @property
    def identity(self) -> tuple[Column, ...]:
        """The columns that say whose rows its tables hold."""
        return GROUP_IDENTITY if isinstance(self.per, Group) else (*IDENTITY, *(ABOUT[name] for name in self.about))

    @property
    def partitions(self) -> tuple[str, ...]:
        """Keys in the paths of its results."""
        return () if self.per == "position" else PARTITIONS
