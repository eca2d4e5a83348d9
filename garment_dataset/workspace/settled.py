"""What was said when everything was fresh, remembered until anything changes that it rested on.

A plan of thousands of recordings costs seconds, and most builds find nothing to do. So what such a build found is kept
with a digest of the states (size, inode, times of content and of change) of all files that it rested on: all that a
person edits, bags, results, store and index, the package, stages of one's own, what is installed. While that digest is
the same, the plan would be, too. A file that was written at most two seconds before the plan is too young: it could be
written again without a trace. Then, and where the clock was set back, nothing is remembered.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from stat import S_ISDIR
from typing import TYPE_CHECKING

from garment_dataset.engine.canonical import digest
from garment_dataset.layout import SETTINGS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from garment_dataset.layout import Layout

_PACKAGE = Path(__file__).parents[1]
_FILE = "settled.json"
_TAG = "settled/1"
_YOUNG_NS = 2_000_000_000


@dataclass(frozen=True)
class Settled:
    """What a build of everything found, all of it fresh.

    Parameters
    ----------
    results, recordings, absent : int
        How many there are; absent recordings have no bag.
    said : tuple of str
        What is to be said beside: bags left out, orphaned files, recordings that are not ok.
    """

    results: int
    recordings: int
    absent: int
    said: tuple[str, ...]


class _TooYoungError(Exception):
    """A file may have been written again within the tick of the clock in which it was looked at."""


def recall(layout: Layout) -> Settled | None:
    """Return what was found last time, if nothing has changed since; None when a plan has to be made."""
    try:
        kept = json.loads((layout.private_dir / _FILE).read_text("utf-8"))
        if kept["check"] != digest(_TAG, kept["body"]):
            return None
        body = kept["body"]
        # one by one: the first that differs spares the others
        if any(old != new for old, new in zip(body["stamps"], _stamps(layout, body["code"]), strict=True)):
            return None
        return Settled(**{**body["settled"], "said": tuple(body["settled"]["said"])})
    except (OSError, ValueError, KeyError, TypeError):
        return None


def remember(layout: Layout, settled: Settled, code: Iterable[str], began_ns: int) -> None:
    """Keep what was found, where the workspace may be written.

    Parameters
    ----------
    layout : Layout
        The workspace.
    settled : Settled
        What was found.
    code : iterable of str
        The source files that the stages' fingerprints rest on.
    began_ns : int
        When the workspace began to be read, ns since the Unix epoch: whatever is younger may have been missed.
    """
    files = sorted(code)
    try:
        stamps = list(_stamps(layout, files, youngest_ns=began_ns - _YOUNG_NS))
    except _TooYoungError:
        return
    body = {"stamps": stamps, "code": files, "settled": {**asdict(settled), "said": list(settled.said)}}
    path = layout.private_dir / _FILE
    temporary = path.with_name(f".{_FILE}.{os.getpid()}")
    with contextlib.suppress(OSError):
        temporary.write_text(json.dumps({"check": digest(_TAG, body), "body": body}), "utf-8")
        temporary.replace(path)


def _stamps(layout: Layout, code: Iterable[str], youngest_ns: int | None = None) -> Iterator[str]:
    """Yield digests of the states of all that a plan rests on: of what is few, or often changed, first."""
    states = _States(youngest_ns)
    # stages of one's own have their folder put there when they are imported
    places = [folder for folder in sys.path if folder != str(layout.stages_dir)]
    states.add_text(f"{sys.version}\n{places}\n{layout.root}")
    private = layout.private_dir
    for path in (layout.root / SETTINGS, private / "index.sqlite", *code):
        states.add(str(path))
    for folder in (layout.catalog_dir, layout.pipelines_dir, layout.stages_dir, _PACKAGE):
        states.add_below(str(folder))
    for place in places:
        states.add_installed(place or ".")
    yield states.digest()
    for folder in (layout.recordings_dir, layout.features_dir):
        states.add_below(str(folder))
        yield states.digest()
    for name in ("scratch", "code", "objects"):
        states.add_below(str(private / name))
    yield states.digest()


class _States:
    """A digest of the names and states of files.

    Parameters
    ----------
    youngest_ns : int or None
        The last time of change that is old enough; None: any is.
    """

    def __init__(self, youngest_ns: int | None) -> None:
        self._youngest_ns = youngest_ns
        self._hash = hashlib.blake2b(digest_size=20)
        self._folders: set[tuple[int, int]] = set()

    def digest(self) -> str:
        return self._hash.hexdigest()

    def add_text(self, text: str) -> None:
        self._hash.update(text.encode("utf-8", "surrogatepass") + b"\0")

    def add(self, path: str) -> os.stat_result | None:
        """Add a file, or the name of a folder; links are followed."""
        try:
            stat = os.stat(path)  # noqa: PTH116 - there are tens of thousands of them
        except OSError:
            self.add_text(f"{path} is not there")
            return None
        if self._youngest_ns is not None and stat.st_ctime_ns > self._youngest_ns:
            raise _TooYoungError
        if S_ISDIR(stat.st_mode):
            self.add_text(path)
        else:
            state = f"{path} {stat.st_size} {stat.st_mtime_ns} {stat.st_ino} {stat.st_ctime_ns} {stat.st_mode}"
            self.add_text(state)
        return stat

    def add_below(self, folder: str) -> None:
        """Add all that lies in a folder, each folder once, in whatever way it is reached."""
        stat = self.add(folder)
        if stat is None or (stat.st_dev, stat.st_ino) in self._folders:
            return
        self._folders.add((stat.st_dev, stat.st_ino))
        try:
            with os.scandir(folder) as entries:
                found = sorted((entry.path, entry.is_file(follow_symlinks=False)) for entry in entries)
        except OSError as error:
            self.add_text(f"{folder}: {error.errno}")
            return
        for path, is_file in found:
            if path.endswith(_COMPILED):
                continue
            if is_file:
                self.add(path)
            elif os.path.isdir(path):  # noqa: PTH112
                self.add_below(path)
            else:
                self.add(path)

    def add_installed(self, folder: str) -> None:
        """Add what says which distributions are installed in a folder of Python's path, and in which versions."""
        try:
            names = sorted(os.listdir(folder))  # noqa: PTH208
        except OSError:
            return
        for name in names:
            if name.endswith((".dist-info", ".egg-info")):
                for file in ("METADATA", "entry_points.txt"):
                    self.add(f"{folder}/{name}/{file}")


_COMPILED = ("__pycache__", ".pyc")
