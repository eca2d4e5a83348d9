"""What nodes of one bag share: where it is, whose rows their tables hold, and where these are published."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from garment_dataset.engine.table import Label
from garment_dataset.stages.stage import ABOUT

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from garment_dataset.catalog import CatalogRow
    from garment_dataset.stages import Stage

    LabelValues = Mapping[str, str | int | float | None]


@dataclass(frozen=True, slots=True)
class Bag:
    """A bag that nodes read, and whose rows their tables hold."""

    name: str
    path: Path | None
    topics_file: int
    labels: LabelValues
    partition: str
    made_labels: dict[tuple[str, ...], tuple[Label, ...]] = field(default_factory=dict)

    def labels_for(self, stage: Stage) -> tuple[Label, ...]:
        """Return the labels of a result; those that stages share are made once."""
        if stage.about not in self.made_labels:
            self.made_labels[stage.about] = labels_of(stage, self.labels)
        return self.made_labels[stage.about]

    def sources(self, stage: Stage) -> dict[str, Path]:
        """Return what a stage takes of it."""
        return {name: self.path for name in stage.arguments if name in stage.sources and self.path is not None}


def values_of(row: CatalogRow) -> LabelValues:
    """Return what a row says for any stage's identity columns."""
    return {**row.labels, **{name: getattr(row, name) for name in ABOUT}}


def labels_of(stage: Stage, values: LabelValues) -> tuple[Label, ...]:
    """Return the labels of a result; an empty scene has nothing to say about a garment."""
    return tuple(
        Label(column, values.get(column.name) if column.name in ABOUT else values[column.name])
        for column in stage.identity
    )


def path_of(partition: Mapping[str, str]) -> str:
    """Return a hive partition as it stands in paths."""
    return "/".join(f"{key}={value}" for key, value in partition.items())
