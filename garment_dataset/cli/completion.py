"""What the shell offers when Tab is pressed: names of recordings, keys and words of filters, stages, tables, columns.

Typer asks in a process of its own at every Tab: nothing heavy is imported, and no stage of the workspace. Outside a
workspace, or in one that cannot be read, there is nothing to offer and nothing to say.
"""

from __future__ import annotations

import contextlib
import os
import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from typing import Any

    from garment_dataset.catalog import Catalog
    from garment_dataset.layout import Layout

    Complete = Callable[[typer.Context, str], list[str]]

_UNQUOTED = re.compile(r"[\w@%+=:,./*!-]+")
"""Words that no shell takes for anything but words."""


def _quietly(offer: Callable[[Layout, typer.Context, str], Iterable[str]]) -> Complete:
    """Have what is offered for a word be told to Typer, and nothing else, whatever is wrong."""

    def complete(ctx: typer.Context, incomplete: str) -> list[str]:
        from garment_dataset.layout import Layout

        with warnings.catch_warnings(), contextlib.suppress(Exception):
            warnings.simplefilter("ignore")
            given = ctx.params.get("workspace") or os.environ.get("GARMENT_WORKSPACE")
            found = offer(Layout.find(Path(given) if given else None), ctx, incomplete)
            return [word for word in dict.fromkeys(found) if _UNQUOTED.fullmatch(word) and word.isprintable()]
        return []

    complete.__doc__ = offer.__doc__
    return complete


@_quietly
def recordings(layout: Layout, _: typer.Context, incomplete: str) -> Iterable[str]:
    """Offer names of recordings."""
    return _beginning(incomplete, (row.recording for row in _catalog(layout).rows))


@_quietly
def recordings_and_scenes(layout: Layout, _: typer.Context, incomplete: str) -> Iterable[str]:
    """Offer names of recordings and of empty scenes."""
    catalog = _catalog(layout)
    scenes = (background.source for background in catalog.backgrounds.values())
    return _beginning(incomplete, [*(row.recording for row in catalog.rows), *scenes])


@_quietly
def filters(layout: Layout, _: typer.Context, incomplete: str) -> Iterable[str]:
    """Offer names of recordings, keys of filters, and behind a key its words."""
    return _terms(_catalog(layout), incomplete, {})


@_quietly
def list_filters(layout: Layout, _: typer.Context, incomplete: str) -> Iterable[str]:
    """Offer the same, with what is known of recordings once they are built."""
    from garment_dataset.features.quality import QUALITY_KEYS, QUALITY_WORDS

    return _terms(_catalog(layout), incomplete, {key: QUALITY_WORDS.get(key, ()) for key in QUALITY_KEYS})


@_quietly
def findings(_: Layout, __: typer.Context, incomplete: str) -> Iterable[str]:
    """Offer what findings of ``garment lint`` are filtered by."""
    from garment_dataset.catalog.lint import SEVERITIES

    return _assignments(incomplete, {"code": tuple(SEVERITIES), "severity": tuple(SEVERITIES.values())})


@_quietly
def stages(layout: Layout, ctx: typer.Context, incomplete: str) -> Iterable[str]:
    """Offer the stages that pipelines name; to ``accept``, all of them together."""
    named = [stage for pipeline in _pipelines(layout) for stage in pipeline.get("stages", ())]
    return _beginning(incomplete, [*named, *(["all"] if ctx.info_name == "accept" else [])])


@_quietly
def variants(layout: Layout, _: typer.Context, incomplete: str) -> Iterable[str]:
    """Offer the variants that pipelines name or that there are results of."""
    from garment_dataset.features.reading import variants_of

    named = [pipeline.get("variant", "") for pipeline in _pipelines(layout)]
    return _beginning(incomplete, filter(None, ["default", *named, *variants_of(layout.features_dir)]))


@_quietly
def tables(layout: Layout, _: typer.Context, incomplete: str) -> Iterable[str]:
    """Offer the tables of which there are results."""
    return _beginning(incomplete, _schemas(layout))


@_quietly
def columns(layout: Layout, _: typer.Context, incomplete: str) -> Iterable[str]:
    """Offer ``TABLE.COLUMN`` of what is a number."""
    schemas = _schemas(layout)
    return _two_parts(incomplete, ".", {name: _numbers(schema) for name, schema in schemas.items()})


def _catalog(layout: Layout) -> Catalog:
    from garment_dataset.catalog import Catalog

    return Catalog.of(layout)


def _pipelines(layout: Layout) -> Iterator[Mapping[str, Any]]:
    from garment_dataset.files import read_toml

    return (read_toml(path) for path in sorted(layout.pipelines_dir.glob("*.toml")))


def _schemas(layout: Layout) -> dict[str, Any]:
    """Return the descriptions of the tables that were built, in any variant."""
    from garment_dataset.engine.table import read_schemas

    found: dict[str, Any] = {}
    for folder in (layout.features_dir, *sorted(layout.features_dir.glob("variant=*"))):
        found |= read_schemas(folder)
    return dict(sorted(found.items()))


def _numbers(schema: Mapping[str, Any]) -> list[str]:
    return [column["name"] for column in schema["columns"] if re.match(r"u?int|float|double", column["type"])]


def _terms(catalog: Catalog, incomplete: str, more: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """Yield the names, keys and words that a term can go on with."""
    flags = {key: ("yes", "no") for key, kind in catalog.filter_keys.items() if kind is bool}
    known: dict[str, Sequence[str]] = {**dict.fromkeys(catalog.filter_keys, ()), **flags, **catalog.words, **more}
    names = [] if "=" in _term(incomplete) else _beginning(incomplete, known["recording"])
    yield from names
    if names and incomplete:
        yield from (f"{key}=" for key in _beginning(incomplete, known))
    else:
        yield from _assignments(incomplete, known)


def _assignments(incomplete: str, known: Mapping[str, Sequence[str]]) -> Iterable[str]:
    """Return the terms ``key=word`` that one can go on with; bash takes what stands behind the sign for a word."""
    whole = _term(incomplete)
    found = _two_parts(whole, "=", known)
    behind = whole.rfind("=") + 1 if whole != incomplete else 0
    return [term[behind:] for term in found]


def _two_parts(incomplete: str, sign: str, known: Mapping[str, Sequence[str]]) -> list[str]:
    """Return first parts with their sign; with what can follow, where only one is meant: shells add a space behind it.

    After a comma, the last of several second parts is meant.
    """
    first, is_behind, second = incomplete.partition(sign)
    key = first.removesuffix("!")
    if is_behind:
        before, comma, last = second.rpartition(",")
        return [f"{first}{sign}{before}{comma}{word}" for word in _beginning(last, known.get(key, ()))]
    meant = _beginning(first, known)
    if len(meant) == 1 and (words := known[meant[0]]):
        return [f"{meant[0]}{sign}{word}" for word in words]
    return [f"{name}{sign}" for name in meant]


def _term(incomplete: str) -> str:
    """Return the whole of the term that the cursor is in: bash hands over what stands behind the sign "=" alone."""
    words = os.environ.get("COMP_WORDS", "").split("\n")
    position = int(os.environ.get("COMP_CWORD", "0"))
    if not 2 <= position < len(words):
        return incomplete
    if words[position] == "=":
        return f"{words[position - 1]}="
    return f"{words[position - 2]}={incomplete}" if words[position - 1] == "=" else incomplete


def _beginning(incomplete: str, words: Iterable[str]) -> list[str]:
    return [word for word in words if word.startswith(incomplete)]
