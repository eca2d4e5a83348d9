"""The code of every stage, as part of its key: fingerprints remembered until the content of a source file changes."""

from __future__ import annotations

import contextlib
import functools
import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.canonical import digest
from garment_dataset.engine.codebase.libraries import library_versions
from garment_dataset.engine.loaded import ContentStates, content_state

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from garment_dataset.engine.codebase.fingerprint import CodeBase, Fingerprint
    from garment_dataset.engine.stage import Stage

_DECIDES_NOTHING = frozenset({"pydantic"})
"""Libraries in reach whose version is no reason to build anew: the parameters that they check are in the key."""

_WRITES = ("pyarrow",)
"""Libraries that decide about every file."""

_TAG = "fingerprints/2"


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
    files : mapping of str to str
        The source files that it was read from, and the state of their content.
    """

    digest: str
    parts: Mapping[str, str]
    libraries: Mapping[str, str]
    archive_dir: Path
    files: Mapping[str, str] = field(default_factory=dict)

    def changes_since(self, old_digest: str) -> list[tuple[str, str]]:
        """Return which functions, classes and constants differ from an earlier digest, and how."""
        from garment_dataset.engine.codebase.fingerprint import changed_parts

        try:
            old = json.loads((self.archive_dir / f"{old_digest}.json").read_text("utf-8"))
        except (OSError, ValueError):
            return [("code in reach", "changed")]
        return list(changed_parts(old, self.parts))


class CodeCache:
    """Fingerprints of stages, computed anew only when the content of a file that they rest on has changed.

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
        # two installations on one workspace must not take each other's code for their own
        self._place = digest("roots/1", {name: str(path) for name, path in roots.items()})
        self._code_base: CodeBase | None = None
        self._content_states = ContentStates()
        self._remembered = self._load()

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
        self._code_base = None  # it keeps what it has read
        state_of = functools.cache(self._content_states)  # asked once, whatever number of stages rests on a file
        entries = {stage.name: self._entry(stage, state_of) for stage in stages}
        if json.dumps(self._remembered) != before:
            self._save(entries.values())
        found = {name for entry in entries.values() for name in entry["libraries"]}
        libraries = library_versions(sorted({*found, *_WRITES}))
        return {
            stage: Code(
                entry["digest"],
                entry["parts"],
                {name: libraries[name] for name in sorted({*entry["libraries"], *_WRITES})},
                self._folder,
                {path: state for path, state in entry["files"] if path.endswith(".py")},
            )
            for stage, entry in entries.items()
        }

    def is_as_read(self, stage: Stage) -> bool:
        """Say whether the files that a stage's fingerprint rests on still have the content that it was read from."""
        return not self._is_outdated(self._remembered[self._name(stage)], self._content_states)

    def _is_outdated(self, entry: Mapping[str, Any], state_of: Callable[[str], str | None]) -> bool:
        """Say whether a file has changed, or what was a library has become first-party code."""
        if not self._roots.keys().isdisjoint(entry["libraries"]):
            return True
        return any(state_of(path) != state for path, state in entry["files"])

    def _entry(self, stage: Stage, state_of: Callable[[str], str | None]) -> dict[str, Any]:
        name = self._name(stage)
        entry: dict[str, Any] | None = self._remembered.get(name)
        if entry is None or self._is_outdated(entry, state_of):
            from garment_dataset.engine.codebase.fingerprint import CodeBase

            if self._code_base is None:
                self._code_base = CodeBase(self._roots)
            params = f"{stage.params.__module__}:{stage.params.__qualname__}"
            entry = _to_json(self._code_base.fingerprint(f"{stage.module}:{stage.name}", fields_excluded=(params,)))
            self._remembered[name] = entry
        return entry

    def _name(self, stage: Stage) -> str:
        return f"{stage.module}:{stage.name} in {self._place}"

    def _load(self) -> dict[str, Any]:
        """Return what was remembered; nothing of what does not read back as written."""
        try:
            kept = json.loads(self._file.read_text("utf-8"))
            remembered: dict[str, Any] = kept["entries"]
            return remembered if kept["check"] == digest(_TAG, remembered) else {}
        except (OSError, ValueError, KeyError, TypeError):
            return {}

    def _save(self, entries: Iterable[Mapping[str, Any]]) -> None:
        # a reader without write permission computes its fingerprints anew each time
        with contextlib.suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            for entry in entries:
                _write(self._folder / f"{entry['digest']}.json", entry["parts"])
            _write(self._file, {"check": digest(_TAG, self._remembered), "entries": self._remembered})


def _to_json(found: Fingerprint) -> dict[str, Any]:
    # what was found also rests on the code that found it
    files = (*found.files, *sorted((Path(__file__).parent / "codebase").glob("*.py")))
    states = [(str(path), found.states.get(path) or content_state(str(path))) for path in files]
    return {
        "digest": found.digest,
        "parts": dict(found.parts),
        "libraries": [name for name in found.libraries if name not in _DECIDES_NOTHING],
        "files": [[path, state] for path, state in states if state is not None],
    }


def _write(path: Path, value: object) -> None:
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.write_text(json.dumps(value, sort_keys=True), "utf-8")
    temporary.replace(path)
