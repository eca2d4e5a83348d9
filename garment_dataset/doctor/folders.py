"""Disks and folders of a workspace: space, permissions, links, time stamps, letter case."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import time
import warnings
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from garment_dataset.catalog.folder import scan
from garment_dataset.doctor.check import Check, size_text

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.layout import Layout

_MIN_FREE_BYTES = 1e9
_NO_FREE_BYTES = 50e6
_SHARE_OF_BAGS = 0.1
"""Of the bags' size: a rule of thumb, for results hold positions and outlines, and no images."""
_MAX_FILES = 20_000
"""Among how many files the newest is looked for, folder by folder: some tenths of a second's worth."""
_FICLONE = 0x40049409


def nearest_folder(path: Path) -> Path:
    """Return a folder, or the nearest one above it that is there."""
    return next((folder for folder in (path, *path.absolute().parents) if folder.is_dir()), Path("/"))


def space(layout: Layout | None) -> Iterator[Check]:
    """Compare the space that is free where something is written with the size of the bags."""
    bags_bytes = 0 if layout is None else sum(size for _, size in _bags(layout.recordings_dir)[0])
    places = {"temporary folder": Path(tempfile.gettempdir())}
    if layout is not None:
        own = {"workspace": layout.root, "private folder": layout.private_dir, "features folder": layout.features_dir}
        places = {**own, **places}
    for name, path in places.items():
        free = shutil.disk_usage(nearest_folder(path)).free
        wanted = _MIN_FREE_BYTES if name == "temporary folder" else max(_MIN_FREE_BYTES, _SHARE_OF_BAGS * bags_bytes)
        text = f"{size_text(free)} free at {path}"
        text += f" (the bags have {size_text(bags_bytes)})" if bags_bytes and name != "temporary folder" else ""
        if free < _NO_FREE_BYTES:
            yield Check(f"space, {name}", "fault", text, "A build will fail.")
        elif free < wanted:
            yield Check(f"space, {name}", "warning", text, f"A build may need {size_text(wanted)}.")
        else:
            yield Check(f"space, {name}", "ok", text)


def permissions(layout: Layout) -> Iterator[Check]:
    """Try to read what is read, and to write where something is written."""
    readable = {"catalog": layout.catalog_dir, "pipelines": layout.pipelines_dir, "recordings": layout.recordings_dir}
    for name, path in readable.items():
        try:
            count = sum(1 for _ in path.iterdir())
        except FileNotFoundError:
            state: Literal["warning", "fault"] = "warning" if name == "recordings" else "fault"
            yield Check(f"{name} folder", state, f"{path} is not there")
        except OSError as error:
            yield Check(f"{name} folder", "fault", f"{path} cannot be read: {error.strerror}")
        else:
            yield Check(f"{name} folder", "ok", f"{path}, {count} entries")
    for name, path in {"private": layout.private_dir, "features": layout.features_dir}.items():
        folder = nearest_folder(path)
        try:
            with tempfile.NamedTemporaryFile(dir=folder, prefix=".garment-doctor-") as file:
                file.write(b"x")
        except OSError as error:
            yield Check(f"{name} folder", "fault", f"{folder} cannot be written to: {error.strerror}")
        else:
            made = "" if folder == path else ", which a build makes"
            yield Check(f"{name} folder", "ok", f"{path}{made}: can be written to")
    yield from _published(layout)


def _published(layout: Layout) -> Iterator[Check]:
    """Say whether results are guarded against being written over: they may be links to what is in the store."""
    files = [path for path in islice(layout.features_dir.glob("**/*.parquet"), _MAX_FILES) if path.is_file()]
    loose = [path for path in files if path.stat().st_mode & 0o222]
    if loose:
        hint = "chmod a-w it: a program that writes to it may change the store, too."
        yield Check("published files", "warning", f"{len(loose)} of {len(files)} are not read-only: {loose[0]}", hint)
    elif files:
        yield Check("published files", "ok", f"{len(files)}, all read-only")
    else:
        yield Check("published files", "ok", "none yet")


def bags(layout: Layout) -> Iterator[Check]:
    """Say how many bags there are, of what size, and which cannot be read."""
    found, noticed = _bags(layout.recordings_dir)
    refused = [path for path, _ in found if not os.access(path, os.R_OK)]
    text = f"{len(found)} bags, {size_text(sum(size for _, size in found))}"
    if refused:
        yield Check("recordings", "fault", f"{text}; {len(refused)} cannot be read: {refused[0]}")
    elif noticed:
        yield Check("recordings", "warning", f"{text}; {noticed[0]}")
    else:
        yield Check("recordings", "ok", text)


def links(layout: Layout) -> Iterator[Check]:
    """Try how a result gets from the store to the features folder: as shared blocks, a hard link, or a copy."""
    source, target = nearest_folder(layout.private_dir), nearest_folder(layout.features_dir)
    one = source.stat().st_dev == target.stat().st_dev
    kind = linked_by(source, target)
    text = {"reflink": "shared blocks", "hard link": "hard links", "copy": "copies"}[kind]
    where = "on one file system" if one else "on two file systems"
    if kind == "copy":
        hint = "Results take twice the space; put both on one file system that has links."
        yield Check("links", "warning", f"private and features folder, {where}: {text}", hint)
    else:
        yield Check("links", "ok", f"private and features folder, {where}: {text}")


def linked_by(source: Path, target: Path) -> Literal["reflink", "hard link", "copy"]:
    """Try which kind of link there is between two folders; what is made is removed."""
    with (
        tempfile.TemporaryDirectory(dir=source, prefix=".garment-doctor-") as here,
        tempfile.TemporaryDirectory(dir=target, prefix=".garment-doctor-") as there,
    ):
        old, new = Path(here) / "old", Path(there) / "new"
        old.write_bytes(b"x" * 8192)
        with contextlib.suppress(ImportError, OSError):
            import fcntl

            with old.open("rb") as reading, new.open("xb") as writing:
                fcntl.ioctl(writing.fileno(), _FICLONE, reading.fileno())
            return "reflink"
        new.unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            new.hardlink_to(old)
            return "hard link"
        shutil.copy2(old, new)
    return "copy"


def stamps(layout: Layout) -> Iterator[Check]:
    """Say how finely the file system of the recordings keeps times: bags are told apart by size and time."""
    kept = {}
    for name, folder in {"recordings": layout.recordings_dir, "private": layout.private_dir}.items():
        with contextlib.suppress(OSError):  # recordings may be on a disk that is read-only, and rightly so
            kept[name] = kept_ns(nearest_folder(folder))
    text = ", ".join(f"{name} folder {resolution_ns / 1e9:g} s" for name, resolution_ns in kept.items())
    if any(resolution_ns >= 1e9 for resolution_ns in kept.values()):
        hint = "`garment build --rehash` after a bag was written twice within that."
        yield Check("time stamps", "warning", f"coarse: {text}", hint)
    else:
        yield Check("time stamps", "ok", text or "not tried: no folder can be written to")


def kept_ns(folder: Path) -> int:
    """Return to what multiple, in ns, a folder's file system rounds the time of a file."""
    given_ns = 1_600_000_001_123_456_789
    with tempfile.NamedTemporaryFile(dir=folder, prefix=".garment-doctor-") as file:
        os.utime(file.name, ns=(given_ns, given_ns))
        off_ns = abs(os.stat(file.name).st_mtime_ns - given_ns)  # noqa: PTH116 - beside os.utime
    return next((step for step in (10**power for power in range(11)) if off_ns < step), off_ns)


def case(layout: Layout) -> Iterator[Check]:
    """Try whether names that differ in case are one file: recordings and tables would be."""
    with tempfile.NamedTemporaryFile(dir=nearest_folder(layout.private_dir), prefix=".garment-doctor-a") as file:
        path = Path(file.name)
        same = path.with_name(path.name.replace("doctor-a", "doctor-A")).exists()
    if same:
        yield Check("letter case", "warning", "names that differ in case are one file", "Name recordings otherwise.")
    else:
        yield Check("letter case", "ok", "names that differ in case are two files")


def clock(layout: Layout, now_s: float | None = None) -> Iterator[Check]:
    """Compare the system's time with the newest file of the workspace."""
    now_s = time.time() if now_s is None else now_s
    folders = (layout.catalog_dir, layout.pipelines_dir, layout.features_dir, layout.recordings_dir)
    newest_s, newest = 0.0, layout.root
    for path in islice((path for folder in folders for path in folder.glob("**/*")), _MAX_FILES):
        with contextlib.suppress(OSError):
            if (changed_s := path.stat().st_mtime) > newest_s:
                newest_s, newest = changed_s, path
    ahead_s = newest_s - now_s
    if ahead_s > 2:
        text = f"{newest} is of {_duration(ahead_s)} from now"
        yield Check("clock", "warning", text, "Set the clock, or touch the file: what changes may be overlooked.")
    else:
        yield Check("clock", "ok", "later than every file of the workspace")


def _duration(seconds: float) -> str:
    return f"{seconds / 86400:.0f} days" if seconds > 172800 else f"{seconds:.0f} s"


def _bags(folder: Path) -> tuple[list[tuple[Path, int]], list[str]]:
    """Return all bags with their sizes in bytes, and what could not be looked at."""
    with warnings.catch_warnings(record=True) as noticed:
        warnings.simplefilter("always")
        found = scan(folder)
    paths = [bag.path for bag in found.bags] + [path for path, _ in found.refused] + list(found.unfinished)
    return [(path, _size(path)) for path in paths], [str(each.message) for each in noticed]


def _size(path: Path) -> int:
    files = path.iterdir() if path.is_dir() else [path]
    size = 0
    for file in files:
        with contextlib.suppress(OSError):
            size += file.stat().st_size
    return size
