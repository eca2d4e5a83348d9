"""Versions, by metadata alone: nothing is imported to be looked at."""

from __future__ import annotations

import os
import re
import sys
from importlib import metadata
from importlib.util import find_spec
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.doctor.check import Check

if TYPE_CHECKING:
    from collections.abc import Iterator

DISTRIBUTION = "garment-dataset"
OPENCV_BUILDS = (
    "opencv-python-headless",
    "opencv-python",
    "opencv-contrib-python-headless",
    "opencv-contrib-python",
)
"""They all bring one module ``cv2``, and write over each other."""

_REQUIREMENT = re.compile(
    r"(?P<name>[A-Za-z0-9._-]+)\s*(?:\[[^\]]*\])?\s*\(?(?P<bounds>[^;()]*)\)?(?:;(?P<marker>.*))?"
)
_BOUND = re.compile(r"(?P<sign>>=|>|==|~=)\s*(?P<version>[0-9]+(?:\.[0-9]+)*)")
_EXTRA = re.compile(r"""extra\s*==\s*['"](?P<extra>[^'"]+)['"]""")
_RELEASE = re.compile(r"v?(?:[0-9]+!)?(?P<release>[0-9]+(?:\.[0-9]+)*)")


class Requirement(NamedTuple):
    """A distribution that another one needs, its lowest version, and the extra that asks for it, if one does."""

    name: str
    lowest: str | None
    extra: str | None


def parse_requirement(text: str) -> Requirement | None:
    """Read one line of a distribution's requirements; None when it has a form that is not known here."""
    if (found := _REQUIREMENT.fullmatch(text.strip())) is None:
        return None
    bound, extra = _BOUND.search(found["bounds"]), _EXTRA.search(found["marker"] or "")
    return Requirement(found["name"], bound and bound["version"], extra and extra["extra"])


def release(version: str) -> tuple[int, ...]:
    """Return the numbers of a version, without zeros behind: ``2.0rc1`` is (2,).

    Raises
    ------
    ValueError
        If it begins with no number.
    """
    if (found := _RELEASE.match(version.strip())) is None:
        raise ValueError(f"no version: {version!r}")
    numbers = [int(part) for part in found["release"].split(".")]
    while numbers and not numbers[-1]:
        numbers.pop()
    return tuple(numbers)


def is_older(version: str, lowest: str | None) -> bool:
    """Say whether a version is below a bound."""
    return lowest is not None and release(version) < release(lowest)


def installed(name: str) -> str | None:
    """Return the version of a distribution, or None where it is not installed."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def python() -> Iterator[Check]:
    """Compare Python with what the package asks for."""
    version = ".".join(map(str, sys.version_info[:3]))
    asked = str(metadata.metadata(DISTRIBUTION).json.get("requires_python", ""))
    bound = _BOUND.search(asked)
    old = is_older(version, bound and bound["version"])
    yield Check("python", "fault" if old else "ok", f"{version} (needs {asked or 'any'}), {sys.executable}")


def package() -> Iterator[Check]:
    """Say which version of the package is installed, and from where it is imported."""
    folder = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120 - as Python finds it
    yield Check("package", "ok", f"{DISTRIBUTION} {metadata.version(DISTRIBUTION)}, {folder}")


def requirements() -> list[Requirement]:
    """Return what the installed package says that it needs."""
    return [found for text in metadata.requires(DISTRIBUTION) or () if (found := parse_requirement(text)) is not None]


def dependencies() -> Iterator[Check]:
    """Compare the version of each dependency with its lower bound."""
    for name, lowest, extra in requirements():
        if extra is not None:
            continue
        version, bound = installed(name), "" if lowest is None else f" (needs >= {lowest})"
        if version is None and name in OPENCV_BUILDS and any(map(installed, OPENCV_BUILDS)):
            continue  # another build does the same: the check of OpenCV says so
        if version is None:
            yield Check(name, "fault", f"not installed{bound}", f"pip install '{name}>={lowest}'.")
        elif is_older(version, lowest):
            yield Check(name, "fault", f"{version}{bound}", f"pip install --upgrade '{name}>={lowest}'.")
        else:
            yield Check(name, "ok", f"{version}{bound}")


def extras() -> Iterator[Check]:
    """Say which optional parts are there: what is not is no fault, what is too old is."""
    by_extra: dict[str, list[Requirement]] = {}
    for requirement in requirements():
        if requirement.extra is not None:
            by_extra.setdefault(requirement.extra, []).append(requirement)
    for extra, parts in by_extra.items():
        versions = {part.name: installed(part.name) for part in parts}
        old = [part.name for part in parts if (version := versions[part.name]) and is_older(version, part.lowest)]
        absent = [name for name, version in versions.items() if version is None]
        texts = [f"too old: {', '.join(old)}"] * bool(old) + [f"not installed: {', '.join(absent)}"] * bool(absent)
        hint = f"pip install --upgrade '{DISTRIBUTION}[{extra}]' brings it." if old or absent else None
        there = ", ".join(f"{name} {version}" for name, version in versions.items())
        yield Check(f"extra {extra}", "warning" if old else "ok", "; ".join(texts) or there, hint)


def opencv() -> Iterator[Check]:
    """Say which build of OpenCV there is: of two, nobody knows which is imported."""
    builds = {name: version for name in OPENCV_BUILDS if (version := installed(name)) is not None}
    text = ", ".join(f"{name} {version}" for name, version in builds.items())
    if len(builds) > 1:
        hint = f"pip uninstall {' '.join(builds)}, then pip install {OPENCV_BUILDS[0]}: each writes over the other."
        yield Check("opencv", "fault", f"{len(builds)} builds at once: {text}", hint)
    elif find_spec("cv2") is None:
        yield Check("opencv", "fault", f"no module cv2{text and f', although there is {text}'}", "pip install it anew.")
    elif not builds:
        yield Check("opencv", "warning", "a module cv2 that no package of OpenCV brought, perhaps the system's own")
    elif "headless" not in text:
        yield Check("opencv", "warning", f"{text}: not the headless build", "It needs the system's graphics libraries.")
    else:
        yield Check("opencv", "ok", text)


def ros() -> Iterator[Check]:
    """Say that ROS is not needed; where its Python packages are on the path, they may stand before ours."""
    folders = [folder for folder in sys.path if folder.startswith("/opt/ros/")]
    if folders:
        hint = "Unset PYTHONPATH, or do not source its setup file: nothing of it is needed."
        yield Check("ros", "warning", f"its packages are on Python's path: {folders[0]}", hint)
    else:
        distribution = os.environ.get("ROS_DISTRO")
        yield Check("ros", "ok", "not needed" + (f"; {distribution} is set up" if distribution else ", and not set up"))
