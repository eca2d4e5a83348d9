"""What one snapshot has that another has not, and why."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

_MOST_NAMED = 5


def changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """Return the differences between two snapshots, a line each; none where they hold the same.

    Parameters
    ----------
    old, new : mapping
        What :func:`.read_manifest` says of them.
    """
    lines = [
        f"{name}: {old[name] or 'none'} -> {new[name] or 'none'}"
        for name in ("version", "title", "variant")
        if old[name] != new[name]
    ]
    lines += _tables(old["tables"], new["tables"])
    lines += _named("recordings", set(old["recordings"]), set(new["recordings"]))
    lines += _named("left out", set(old["left_out"]), set(new["left_out"]))
    lines += _files(old["files"], new["files"])
    said = old["described_by"], new["described_by"]
    lines += [f"{name}: changed" for name in sorted({*said[0], *said[1]}) if said[0].get(name) != said[1].get(name)]
    lines += [
        f"{name}: {old['made_with'].get(name)} -> {new['made_with'].get(name)}"
        for name in sorted({*old["made_with"], *new["made_with"]})
        if old["made_with"].get(name) != new["made_with"].get(name)
    ]
    return lines


def _tables(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    yield from _named("tables", set(old), set(new))
    for name in sorted({*old} & {*new}):
        if old[name]["version"] != new[name]["version"]:
            yield f"{name}: version {old[name]['version']} -> {new[name]['version']}, see the changelog"


def _named(what: str, old: set[str], new: set[str]) -> Iterator[str]:
    for word, names in (("added", sorted(new - old)), ("gone", sorted(old - new))):
        if names:
            more = "" if len(names) <= _MOST_NAMED else f" and {len(names) - _MOST_NAMED} more"
            yield f"{what}: {len(names)} {word}: {', '.join(names[:_MOST_NAMED])}{more}"


def _files(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    """Yield what became of files that both have, by table: how many, whether in values, and for which reasons."""
    by_table: dict[str, list[str]] = defaultdict(list)
    for name in sorted({*old} & {*new}):
        if old[name]["key"] != new[name]["key"]:
            by_table[name.partition("/")[0]].append(name)
    for table, names in by_table.items():
        values = sum(old[name]["content"] != new[name]["content"] for name in names)
        reasons = dict.fromkeys(reason for name in names for reason in _reasons(old[name], new[name]))
        yield f"{table}: {len(names)} files made anew, values of {values} differ: {'; '.join(reasons)}"


def _reasons(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    found = [
        f"{kind} {name}: {old[part].get(name)} -> {new[part].get(name)}"
        for part, kind in (("params", "parameter"), ("libraries", "library"))
        for name in sorted({*old[part], *new[part]})
        if old[part].get(name) != new[part].get(name)
    ]
    if old["code"] != new["code"]:
        found.append(f"code of {new['stage']}")
    return found or ["its inputs"]
