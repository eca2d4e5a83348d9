"""Processors, memory, clock and encodings of this machine."""

from __future__ import annotations

import locale
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from garment_dataset.doctor.check import Check, size_text
from garment_dataset.engine.executors import usable_cpus

if TYPE_CHECKING:
    from collections.abc import Iterator

FIRST_YEAR, LAST_YEAR = 2025, 2100
"""Between which a clock is believed: the package is no older, and a battery that failed says 1970."""

_MIN_BYTES_PER_CPU = 500e6
"""A rule of thumb: a worker holds its libraries, and the tables and some images of one recording."""
_CGROUP = Path("/sys/fs/cgroup")


def processors(cgroup: Path = _CGROUP) -> Iterator[Check]:
    """Say how many processors a build may use: affinity counts, a quota of a container does not yet."""
    usable, there = usable_cpus(), os.cpu_count() or 1
    text = f"{usable} usable" + (f" of {there}" if there != usable else "")
    quota = _cpu_quota(cgroup)
    if quota is not None and quota < usable:
        hint = f"`garment build --jobs {max(1, round(quota))}`."
        yield Check("processors", "warning", f"{text}, but the container may use {quota:g} at a time", hint)
    else:
        yield Check("processors", "ok", text)


def memory(cgroup: Path = _CGROUP, meminfo: Path = Path("/proc/meminfo")) -> Iterator[Check]:
    """Compare the memory that is free with the workers that a build would start."""
    limit = _memory_limit(cgroup)
    known = _meminfo(meminfo)
    total = known.get("MemTotal") or os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    free = known.get("MemAvailable", total)
    limited = limit is not None and limit < total
    text = f"{size_text(free)} free of {size_text(total)}"
    text += f", the container may use {size_text(limit)}" if limited and limit is not None else ""
    usable = min(free, limit) if limit is not None else free
    if usable < _MIN_BYTES_PER_CPU * usable_cpus():
        hint = f"`garment build --jobs {max(1, int(usable / _MIN_BYTES_PER_CPU))}` if it is killed."
        yield Check("memory", "warning", f"{text}: little for {usable_cpus()} workers", hint)
    else:
        yield Check("memory", "ok", text)


def year(now_s: float | None = None) -> Iterator[Check]:
    """Say whether the system's time can be true."""
    now_s = time.time() if now_s is None else now_s
    text = time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(now_s))
    if FIRST_YEAR <= time.gmtime(now_s).tm_year <= LAST_YEAR:
        yield Check("year", "ok", text)
    else:
        yield Check("year", "fault", f"{text} cannot be", "Set the clock: results are dated by it.")


def encoding() -> Iterator[Check]:
    """Say how text is read and written; the package names UTF-8 itself, a terminal may not know it."""
    names = {
        "text": locale.getpreferredencoding(do_setlocale=False),
        "file names": sys.getfilesystemencoding(),
        "output": getattr(sys.stdout, "encoding", None) or "unknown",
    }
    mode = "on" if sys.flags.utf8_mode else "off"
    text = f"{', '.join(f'{what} {name}' for what, name in names.items())}; UTF-8 mode {mode}, LANG {_language()}"
    odd = [what for what, name in names.items() if name.lower().replace("-", "").replace("_", "") != "utf8"]
    if odd:
        yield Check("encoding", "warning", f"{text}: {', '.join(odd)} not UTF-8", "Set PYTHONUTF8=1.")
    else:
        yield Check("encoding", "ok", text)


def file_names(folder: Path | None = None) -> Iterator[Check]:
    """Try whether a name with letters beyond ASCII comes back as it was given."""
    with tempfile.TemporaryDirectory(dir=folder) as place:
        wanted = "ä-雨.bag"
        try:
            (Path(place) / wanted).touch()
        except (OSError, UnicodeError) as error:
            yield Check("file names", "warning", f"letters beyond ASCII are refused: {error}")
            return
        found = [path.name for path in Path(place).iterdir()]
    if found == [wanted]:
        yield Check("file names", "ok", "letters beyond ASCII come back as they were given")
    else:
        yield Check("file names", "warning", f"{wanted!r} comes back as {found!r}")


def _language() -> str:
    return next((f"{os.environ[name]}" for name in ("LC_ALL", "LC_CTYPE", "LANG") if os.environ.get(name)), "not set")


def _cpu_quota(cgroup: Path) -> float | None:
    """Return how many processors a container may use at a time, by either version of cgroups; None: no limit."""
    if (text := _text(cgroup / "cpu.max")) is not None:
        quota, period = text.split()[:2]
        return None if quota == "max" else int(quota) / int(period)
    quota_us, period_us = _text(cgroup / "cpu/cpu.cfs_quota_us"), _text(cgroup / "cpu/cpu.cfs_period_us")
    if quota_us is None or period_us is None or int(quota_us) < 0:
        return None
    return int(quota_us) / int(period_us)


def _memory_limit(cgroup: Path) -> int | None:
    """Return how much memory a container may use; None: no limit."""
    found = [_text(cgroup / "memory.max"), _text(cgroup / "memory/memory.limit_in_bytes")]
    return next((int(text) for text in found if text is not None and text != "max"), None)


def _meminfo(path: Path) -> dict[str, int]:
    """Return the sizes that Linux states, in bytes; nothing on another system."""
    lines = (_text(path) or "").splitlines()
    parts = (line.split() for line in lines if line.endswith(" kB"))
    return {name.rstrip(":"): int(number) * 1024 for name, number, _ in parts}


def _text(path: Path) -> str | None:
    try:
        return path.read_text("utf-8").strip() or None
    except OSError:
        return None
