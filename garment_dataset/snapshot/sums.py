"""``SHA256SUMS``: what every file of a snapshot must be, in the form that ``sha256sum --check`` reads."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from garment_dataset.engine.objects import file_digest
from garment_dataset.errors import StoreError

if TYPE_CHECKING:
    from collections.abc import Mapping

SUMS = "SHA256SUMS"
_LINE = re.compile(r"(?P<digest>[0-9a-f]{64})  (?P<name>.+)")


@dataclass(frozen=True)
class Differences:
    """How a folder differs from its sums, by name of file; all empty where it does not."""

    changed: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    added: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.changed or self.missing or self.added)


def sums_of(folder: Path) -> dict[str, str]:
    """Return the sha256 of every file in a folder, by path relative to it, sorted; without the sums themselves."""
    paths = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if not path.is_dir()}
    return {name: file_digest(path) for name, path in sorted(paths.items()) if name != SUMS}


def sums_text(sums: Mapping[str, str]) -> str:
    """Return the text of :data:`SUMS`."""
    return "".join(f"{digest}  {name}\n" for name, digest in sums.items())


def read_sums(folder: Path) -> dict[str, str]:
    """Return what the sums of a folder say, by name of file.

    Raises
    ------
    StoreError
        If there are none, or they cannot be read.
    """
    path = folder / SUMS
    try:
        lines = path.read_text("utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise StoreError("not a snapshot", where=folder, expected=f"a file {SUMS}", found=why) from error
    sums = {}
    for number, line in enumerate(lines, start=1):
        found = _LINE.fullmatch(line)
        if found is None or found["name"] in sums or not _is_inside(found["name"]):
            raise StoreError("a line that is no sum", where=f"{path}, line {number}", found=repr(line))
        sums[found["name"]] = found["digest"]
    return sums


def _is_inside(name: str) -> bool:
    path = Path(name)
    return not path.is_absolute() and ".." not in path.parts


def compare(folder: Path) -> Differences:
    """Compare the files of a folder with its sums.

    Raises
    ------
    StoreError
        If it has none.
    """
    said, found = read_sums(folder), sums_of(folder)
    return Differences(
        tuple(name for name in said if name in found and found[name] != said[name]),
        tuple(name for name in said if name not in found),
        tuple(name for name in found if name not in said),
    )
