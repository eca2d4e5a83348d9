"""The code of every stage, as part of its key: fingerprints remembered until a source file changes."""

from __future__ import annotations

import contextlib
import json
import os
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.codebase.libraries import library_versions

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from garment_dataset.engine.codebase.fingerprint import CodeBase, Fingerprint
    from garment_dataset.engine.stage import Stage

_DECIDES_NOTHING = frozenset({"pydantic"})
"""Libraries in reach whose version is no reason to build anew: the parameters that they check are in the key."""


@dataclass(frozen=True)
class Code:
    """What a stage's result depends on beside parameters and inputs.

    Parameters
    ----------
    digest : str
        Of all first-party code in the stage's reach.
    parts : mapping of str to str
        Digest of each function, class and constant in reach.
    libraries : mapping of str to str
        Versions of the third-party libraries in reach.
    archive_dir : Path
        Holds the parts of earlier digests, so that a change can be named.
    """

    digest: str
    parts: Mapping[str, str]
    libraries: Mapping[str, str]
    archive_dir: Path

    def changes_since(self, old_digest: str) -> list[tuple[str, str]]:
        """Return which functions, classes and constants differ from an earlier digest, and how."""
        from garment_dataset.engine.codebase.fingerprint import changed_parts

        try:
            old = json.loads((self.archive_dir / f"{old_digest}.json").read_text("utf-8"))
        except (OSError, ValueError):
            return [("code in reach", "changed")]
        return list(changed_parts(old, self.parts))


class CodeCache:
    """Fingerprints of stages, computed anew only when one of the files they rest on has changed.

    Parameters
    ----------
    folder : Path
        Keeps ``fingerprints.json``, and ``<digest>.json`` with the parts of every digest that was ever seen.
    roots : mapping of str to Path
        First-party packages by name.
    """

    def __init__(self, folder: Path, roots: Mapping[str, Path]) -> None:
        self._folder = folder
        self._roots = dict(roots)
        self._code_base: CodeBase | None = None
        try:
            self._remembered: dict[str, Any] = json.loads(self._file.read_text("utf-8"))
        except (OSError, ValueError):
            self._remembered = {}

    @property
    def _file(self) -> Path:
        return self._folder / "fingerprints.json"

    def codes(self, stages: Iterable[Stage]) -> dict[str, Code]:
        """Return the code of each stage by name.

        Raises
        ------
        UntraceableCodeError
            If a stage reaches code that cannot be followed.
        """
        before = json.dumps(self._remembered)
        entries = {stage.name: self._entry(stage) for stage in stages}
        if json.dumps(self._remembered) != before:
            self._save(entries.values())
        libraries = library_versions(sorted({name for entry in entries.values() for name in entry["libraries"]}))
        return {
            stage: Code(
                entry["digest"],
                entry["parts"],
                {name: libraries[name] for name in entry["libraries"]},
                self._folder,
            )
            for stage, entry in entries.items()
        }

    def is_as_read(self, stage: Stage) -> bool:
        """Say whether the files that a stage's fingerprint rests on are still those it was computed from."""
        return not self._is_outdated(self._remembered[_name(stage)])

    def _is_outdated(self, entry: Mapping[str, Any]) -> bool:
        """Say whether a file has changed, or what was a library has become first-party code."""
        if not self._roots.keys().isdisjoint(entry["libraries"]):
            return True
        return any(file_state(Path(path)) != (size, mtime) for path, size, mtime in entry["files"])

    def _entry(self, stage: Stage) -> dict[str, Any]:
        name = _name(stage)
        entry: dict[str, Any] | None = self._remembered.get(name)
        if entry is None or self._is_outdated(entry):
            from garment_dataset.engine.codebase.fingerprint import CodeBase

            if self._code_base is None:
                self._code_base = CodeBase(self._roots)
            params = f"{stage.params.__module__}:{stage.params.__qualname__}"
            entry = _to_json(self._code_base.fingerprint(name, fields_excluded=(params,)))
            self._remembered[name] = entry
        return entry

    def _save(self, entries: Iterable[Mapping[str, Any]]) -> None:
        # a reader without write permission computes its fingerprints anew each time
        with contextlib.suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            for entry in entries:
                _write(self._folder / f"{entry['digest']}.json", entry["parts"])
            _write(self._file, self._remembered)


def _name(stage: Stage) -> str:
    return f"{stage.module}:{stage.name}"


def file_state(path: Path) -> tuple[int, int] | None:
    """Return two numbers that change when a file's content or a folder's list of modules does; None when it is gone."""
    try:
        if path.is_dir():
            names = sorted(item.name for item in path.iterdir() if not item.name.startswith((".", "__pycache__")))
            return len(names), zlib.crc32("/".join(names).encode())
        stat = path.stat()
    except OSError:
        return None
    return stat.st_size, stat.st_mtime_ns


def _to_json(found: Fingerprint) -> dict[str, Any]:
    # what was found also rests on the code that found it
    files = (*found.files, *sorted((Path(__file__).parent / "codebase").glob("*.py")))
    states = [(str(path), file_state(path)) for path in files]
    return {
        "digest": found.digest,
        "parts": dict(found.parts),
        "libraries": [name for name in found.libraries if name not in _DECIDES_NOTHING],
        "files": [[path, *state] for path, state in states if state is not None],
    }


def _write(path: Path, value: object) -> None:
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.write_text(json.dumps(value, sort_keys=True), "utf-8")
    temporary.replace(path)
