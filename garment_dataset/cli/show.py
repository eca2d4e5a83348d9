"""``garment show``: all that is known of one recording, or one of its frames drawn."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from garment_dataset.cli import completion
from garment_dataset.cli.output import JsonOption, WorkspaceOption, print_json, say
from garment_dataset.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from garment_dataset.catalog import BackgroundSource, Catalog, CatalogRow
    from garment_dataset.catalog.columns import Column
    from garment_dataset.layout import Layout

_AXES = {"R": "R: along the optical axis", "B": "B: across the optical axis"}

_PICTURES = (".png", ".svg", ".pdf")


def show(
    recording: Annotated[
        str,
        typer.Argument(metavar="NAME", help="Name of a recording, or its file.", autocompletion=completion.recordings),
    ],
    frame: Annotated[
        int | None, typer.Option("--frame", min=0, help="Draw this image, with what was found in it.")
    ] = None,
    save: Annotated[Path | None, typer.Option("--save", help="Where to: a .png, .svg or .pdf file.")] = None,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show all that is known of one recording, or draw one of its frames."""
    from garment_dataset.workspace import Workspace

    place = Workspace.find(workspace)
    catalog = place.catalog()
    row = catalog.row(recording)
    if frame is not None or save is not None:
        _draw(place, row, frame, save)
        return
    topics = catalog.topics(row.topics_file)
    if as_json:
        background = catalog.background(row.topics_file).record()
        more = {"topics": topics, "background": background, "holding_description": _holding(catalog, row)}
        print_json({**row.record(), **more, "damage": [text for _, text in _damage(row)]})
        return
    facts = [*_facts(catalog, row), *_damage(row), *_topics(row, topics or ()), *_results(place, row)]
    width = max(len(label) for label, _ in facts)
    for label, value in facts:
        print(f"{label:{width}}  {'-' if value is None else value}")


def _draw(place: Layout, row: CatalogRow, frame: int | None, save: Path | None) -> None:
    from garment_dataset.view.frames import save_frame

    if frame is None or save is None:
        raise UsageError("a picture needs a frame and a file", expected="--frame N --save FILE.png")
    refuse_picture(save)
    save_frame(place, row, frame, save)
    say(f"wrote {save}")


def refuse_picture(path: Path) -> None:
    """Refuse a file that no picture can be written to, before there is one.

    Raises
    ------
    UsageError
        If it is of another kind, or its folder is not there.
    """
    if path.suffix not in _PICTURES:
        raise UsageError("not a kind of picture", where=path, expected=" ".join(_PICTURES), found=repr(path.suffix))
    if not path.parent.is_dir():
        raise UsageError("no folder for a picture", where=path, expected="one that is there", found=path.parent)


def _damage(row: CatalogRow) -> list[tuple[str, object]]:
    from garment_dataset.bags.condition import look

    if row.path is None or (condition := look(row.path)) is None:
        return []
    return [("damage", f"{condition.text}. {condition.hint}")]


def _topics(row: CatalogRow, expected: Sequence[str]) -> list[tuple[str, object]]:
    """Return the bag's own topics, and which of the topics file it lacks; only the latter where there is no bag."""
    from garment_dataset.bags import open_bag
    from garment_dataset.errors import BagError, SourceError

    if row.path is None:
        return _under("topics", [f"{name}  (expected)" for name in expected])
    try:
        with open_bag(row.path) as bag:
            found = dict(bag.topics)
    except (BagError, SourceError) as error:
        return [("topics", f"cannot be read: {error}")]
    texts = [f"{topic.name}  {topic.count} x {', '.join(topic.types)}" for topic in found.values()]
    return _under("topics", texts + [f"{name}  not in the bag" for name in expected if name not in found])


def _under(label: str, texts: Sequence[object]) -> list[tuple[str, object]]:
    return [("" if index else label, text) for index, text in enumerate(texts)]


def _results(place: Layout, row: CatalogRow) -> list[tuple[str, object]]:
    """Return what the results say of the recording, stage by stage, if it was built; or why it failed."""
    from garment_dataset.engine.store import Store
    from garment_dataset.features.reading import load_features, result_files

    store = Store(place.private_dir, place.features_dir)
    failures = [failure for failure in store.index.failures().values() if failure.subject == row.recording]
    store.close()
    facts: list[tuple[str, object]] = [(failure.stage, f"failed: {failure.message}") for failure in failures]
    if all(path.stem != row.recording for path in result_files(place.features_dir, "quality")):
        return facts
    for _, stage in load_features("quality", folder=place.features_dir, recording=row.recording).iterrows():
        texts = [f"{stage['verdict']}: {_described(stage)}", *stage["why"], *stage["notes"]]
        facts += _under(str(stage["stage"]), texts)
    return facts


def _described(stage: pd.Series[Any]) -> str:
    """Say in one line what a stage saw and found."""
    unit = {"decode": "images", "depth_points": "points", "kinematics": "velocities"}.get(stage["stage"], "frames")
    text = f"{stage['seen']} {stage['stream']} {unit}"
    if stage["stage"] == "decode":
        text += f", {stage['used']} used"
    elif stage["coverage"] == stage["coverage"]:
        text += f", {stage['coverage']:.0%} of them found"
    return "; ".join([text, *stage["faults"]])


def _facts(catalog: Catalog, row: CatalogRow) -> list[tuple[str, object]]:
    cloth = " ".join(filter(None, (row.color, row.garment_kind)))
    size = None if row.width_m is None or row.height_m is None else f"{row.width_m:g} × {row.height_m:g} m"
    weight = None if row.weight_kg is None else f"{row.weight_kg:g} kg"
    details = ", ".join(filter(None, (cloth, size, weight)))
    manner = _holding(catalog, row)
    partner = None if row.partner is None else f"{row.partner} ({catalog.row(row.partner).state})"
    return [
        ("recording", row.recording),
        ("state", row.state),
        ("file", row.path),
        ("table", row.table),
        ("dvd", {True: "yes", False: "no", None: None}[row.dvd]),
        ("garment", f"{row.garment} ({details})" if details else row.garment),
        ("holding", f"{row.holding} ({manner})" if manner else row.holding),
        ("repeat", row.repeat),
        ("swing", None if row.swing_rad is None else f"{row.swing_rad:.4g} rad"),
        ("speed", row.speed),
        ("axis", _AXES[row.axis]),
        ("partner", partner),
        ("background", _background(catalog.background(row.topics_file))),
        ("topics file", row.topics_file),
        *((column.name, _own(column, row)) for column in catalog.tables.columns),
    ]


def _own(column: Column, row: CatalogRow) -> str | None:
    """Return what a column of one's own says, with its unit and what it means."""
    value = row.own[column.name]
    if value is None:
        return None
    text = {True: "yes", False: "no"}[value] if isinstance(value, bool) else f"{value}"
    unit = "" if column.unit in (None, "1") else f" {column.unit}"
    return f"{text}{unit}" + ("" if column.description is None else f" ({column.description})")


def _background(background: BackgroundSource) -> str:
    return f"{background} ({'missing' if background.path is None else background.path})"


def _holding(catalog: Catalog, row: CatalogRow) -> str | None:
    """Return how the garment is held, in words: by the letter in the table, else by the word if only one has it."""
    from garment_dataset.catalog.own_values import holding_of

    letter = next((listed.holding for listed in catalog.tables.recordings if listed.recording == row.recording), None)
    found = holding_of(catalog.tables.holdings, letter, row.holding)
    return None if found is None else found.description
