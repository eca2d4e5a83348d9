"""The code of every stage, as part of its key: fingerprints remembered until the content of a source file changes."""

from __future__ import annotations

import contextlib
import functools
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from garment_dataset.engine.canonical import digest
from garment_dataset.engine.code_memory import CodeMemory, write_json
from garment_dataset.engine.codebase.libraries import library_versions
from garment_dataset.engine.loaded import ContentStates, content_state

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from garment_dataset.engine.code_memory import Entry
    from garment_dataset.engine.codebase.fingerprint import CodeBase, Fingerprint
    from garment_dataset.engine.stage import Stage

_DECIDES_NOTHING = frozenset({"pydantic"})
"""Libraries in reach whose version is no reason to build anew: the parameters that they check are in the key."""

_WRITES = ("pyarrow",)
"""Libraries that decide about every file."""


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
    shared_folder : Path, optional
        Keeps what other workspaces of the same installation have computed.
    """

    def __init__(self, folder: Path, roots: Mapping[str, Path], shared_folder: Path | None = None) -> None:
        self._folder = folder
        self._roots = dict(roots)
        # two installations on one workspace must not take each other's code for their own
        self._place = digest("roots/1", {name: str(path) for name, path in roots.items()})
        self._code_base: CodeBase | None = None
        self._content_states = ContentStates()
        self._own = CodeMemory(folder / "fingerprints.json")
        self._shared = None if shared_folder is None else CodeMemory(shared_folder / f"{self._place}.json")

    def codes(self, stages: Iterable[Stage]) -> dict[str, Code]:
        """Return the code of each stage by name.

        Raises
        ------
        UntraceableCodeError
            If a stage reaches code that cannot be followed.
        """
        self._code_base = None  # it keeps what it has read
        state_of = functools.cache(self._content_states)  # asked once, whatever number of stages rests on a file
        before = dict(self._own.entries)
        computed: dict[str, Entry] = {}
        entries = {stage.name: self._entry(stage, state_of, computed) for stage in stages}
        if self._own.entries != before:
            self._save(entries.values())
        if computed and self._shared is not None:
            self._shared.share(computed)
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
        return self._is_current(self._own.entries[self._name(stage)], self._content_states)

    def _is_current(self, entry: Entry, state_of: Callable[[str], str | None]) -> bool:
        """Say whether no file has changed, and nothing that was a library has become first-party code."""
        if not self._roots.keys().isdisjoint(entry["libraries"]):
            return False
        return all(state_of(path) == state for path, state in entry["files"])

    def _entry(self, stage: Stage, state_of: Callable[[str], str | None], computed: dict[str, Entry]) -> Entry:
        name = self._name(stage)
        for memory in (self._own, self._shared):
            entry = None if memory is None else memory.entries.get(name)
            if entry is not None and self._is_current(entry, state_of):
                break
        else:
            entry = computed[name] = self._compute(stage)
        self._own.entries[name] = entry
        return entry

    def _compute(self, stage: Stage) -> Entry:
        from garment_dataset.engine.codebase.fingerprint import CodeBase

        if self._code_base is None:
            self._code_base = CodeBase(self._roots)
        params = f"{stage.params.__module__}:{stage.params.__qualname__}"
        return _to_json(self._code_base.fingerprint(f"{stage.module}:{stage.name}", fields_excluded=(params,)))

    def _name(self, stage: Stage) -> str:
        return f"{stage.module}:{stage.name} in {self._place}"

    def _save(self, entries: Iterable[Entry]) -> None:
        # a reader without write permission looks for its fingerprints anew each time
        with contextlib.suppress(OSError):
            self._own.save()
            for entry in entries:
                write_json(self._folder / f"{entry['digest']}.json", entry["parts"])


def _to_json(found: Fingerprint) -> Entry:
    # what was found also rests on the code that found it
    files = (*found.files, *sorted((Path(__file__).parent / "codebase").glob("*.py")))
    states = [(str(path), found.states.get(path) or content_state(str(path))) for path in files]
    return {
        "digest": found.digest,
        "parts": dict(found.parts),
        "libraries": [name for name in found.libraries if name not in _DECIDES_NOTHING],
        "files": [[path, state] for path, state in states if state is not None],
    }
