"""What runs on a worker of a cluster: first it is compared with the coordinating process, then the task.

Parameters, inputs, code and versions are in the key of a result, as the coordinating process sees them. A worker may
have other code or other libraries; what it would make must never be stored under that key.
"""

from __future__ import annotations

import hashlib
import importlib.machinery
import importlib.util
import os
import pickle
import platform
import socket
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.codebase.libraries import library_versions
from garment_dataset.engine.loading import HOMES
from garment_dataset.engine.sources import stat_source
from garment_dataset.engine.threads import VARIABLES
from garment_dataset.engine.worker import Reading, Task, Trouble

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

_ONE_AT_A_TIME = threading.Lock()
"""Tasks record warnings and choose what is on Python's path: both belong to the process, not to a thread."""

_FIRST_SEEN: dict[str, str] = {}
"""What this process found when it was first asked: it is what it has loaded, whatever lies on disk since then."""


@dataclass(frozen=True)
class Expected:
    """What a worker must agree with, in values that cross a process boundary.

    Parameters
    ----------
    python : str
        Version, ``major.minor``.
    libraries : mapping of str to str
        Version by import name of all third-party libraries in the reach of a stage.
    installed : mapping of str to str
        Digest of the source of all first-party code that is imported from where it is installed, by import name.
    shared : mapping of Path to str
        Digest of the source of all first-party code that is imported from a folder on the shared file system.
    probe : Path
        A file there.
    token : str
        What is in it.
    """

    python: str
    libraries: Mapping[str, str]
    installed: Mapping[str, str]
    shared: Mapping[Path, str]
    probe: Path
    token: str


def python_version() -> str:
    """Return the version of Python, ``major.minor``."""
    return ".".join(platform.python_version_tuple()[:2])


def digest_code(place: Path) -> str:
    """Return the sha256 of a module's source, or of all modules in a package; of nothing when it is not there."""
    state = hashlib.sha256()
    for file in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
        content = file.read_bytes() if file.is_file() else b""
        state.update(f"{file.relative_to(place).as_posix()} {len(content)}\n".encode() + content)
    return state.hexdigest()


def find_fault(expected: Expected) -> str | None:
    """Return in what this process does not fit the coordinating one, in one line; None when nothing is wrong."""
    return next(_faults(expected), None)


def run_call(call: bytes, expected: Expected) -> Any:  # noqa: ANN401 - whatever the task returns
    """Run a pickled pair of function and work here, unless this process does not fit; then return a passing trouble."""
    with _ONE_AT_A_TIME:
        if (fault := find_fault(expected)) is not None:
            return refusal(f"{socket.gethostname()}, process {os.getpid()}: {fault}")
        function: Callable[[Task | Reading], Any]
        function, work = pickle.loads(call)  # noqa: S301 - from our own client
        if (fault := _fault_of(work)) is not None:
            return refusal(f"{socket.gethostname()}, process {os.getpid()}: {fault}")
        return function(work)


def refusal(message: str) -> Trouble:
    """Return a trouble that is no fault of the subject: nothing was made, and the next build tries again."""
    return Trouble("ClusterError", message, is_passing=True)


def _faults(expected: Expected) -> Iterator[str]:
    if not _holds(expected.probe, expected.token):
        yield f"{expected.probe.parent} is another folder here, or none: it must be on a file system that is shared"
    if python_version() != expected.python:
        yield f"another version of Python: expected {expected.python}, found {python_version()}"
    versions = library_versions(expected.libraries)
    codes = {name: digest_code(place) for name in expected.installed for place in [_place_of(name)]}
    for name, found in {**versions, **codes}.items():
        if _FIRST_SEEN.setdefault(name, found) != found:
            yield f"{name} was changed since this worker loaded it: restart the worker"
    for name, version in expected.libraries.items():
        if versions[name] != version:
            yield f"another version of {name}: expected {version}, found {versions[name]}"
    for name, digest in expected.installed.items():
        if codes[name] != digest:
            yield f"other code in {name}, here {_place_of(name)}: install the same, and restart the worker"
    yield from _shared_faults(expected.shared)
    yield from _threading_faults()


def _shared_faults(shared: Mapping[Path, str]) -> Iterator[str]:
    elsewhere = [folder for folder in sys.path if folder not in HOMES]
    for place, digest in shared.items():
        if digest_code(place) != digest:
            yield f"other code in {place}: is that folder on a file system that is shared?"
        other = importlib.machinery.PathFinder.find_spec(place.stem, elsewhere)
        if other is not None and other.origin is not None:
            yield f"another module is called {place.stem} here: {other.origin}"


def _holds(path: Path, text: str) -> bool:
    try:
        return path.read_text("utf-8") == text
    except OSError:
        return False


def _place_of(name: str) -> Path:
    """Return the folder of a package or the file of a module; for one that cannot be had, a place that is nowhere."""
    spec = importlib.util.find_spec(name)
    if spec is None or spec.origin is None:
        return Path(os.devnull) / name
    origin = Path(spec.origin)
    return origin.parent if origin.name == "__init__.py" else origin


def _threading_faults() -> Iterator[str]:
    """Give the process one thread for numerics, as local workers have; numpy reads the variables when it is loaded."""
    if (opencv := sys.modules.get("cv2")) is not None and opencv.getNumThreads() != 1:
        opencv.setNumThreads(1)
    for name in VARIABLES:
        if os.environ.get(name) != "1":
            if "numpy" in sys.modules and not name.startswith("OPENCV"):
                yield f"numpy was loaded without {name}=1: start workers with a nanny, or with that variable set"
            os.environ[name] = "1"


def _fault_of(work: Task | Reading) -> str | None:
    """Say what of a task's own surroundings is other than where it was made."""
    sources = [work.path] if isinstance(work, Reading) else [path for path, _ in work.sources.values()]
    for path in sources:
        if stat_source(path) is None:
            return f"{path} is not there: sources, too, must be on a file system that is shared"
    return None
