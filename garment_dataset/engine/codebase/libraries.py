"""Versions of third-party libraries, found without importing them."""

from __future__ import annotations

import functools
import importlib.util
from typing import TYPE_CHECKING

from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

_PROVIDERS = {
    "cv2": (
        "opencv-python-headless",
        "opencv-python",
        "opencv-contrib-python-headless",
        "opencv-contrib-python",
    ),
}
"""Distributions of the libraries that are not called what they are imported as; others are searched for, slowly."""


def library_versions(names: Iterable[str]) -> dict[str, str]:
    """Return the installed versions of libraries.

    Parameters
    ----------
    names : iterable of str
        Top-level import names, such as ``cv2``.

    Returns
    -------
    dict of str to str
        Version of the distribution that provides each, by import name, sorted; several joined by `` + `` when several
        provide it; ``not installed`` when there is none.

    Raises
    ------
    UntraceableCodeError
        If a name is importable but belongs to no distribution: then nothing tells when its code changes.
    """
    return {name: _version(name) for name in sorted(set(names))}


def _version(name: str) -> str:
    if versions := _versions_of(_PROVIDERS.get(name, (name,))):
        return " + ".join(versions)
    if importlib.util.find_spec(name) is None:
        return "not installed"
    if versions := _versions_of(_all_providers().get(name, ())):
        return " + ".join(versions)
    raise UntraceableCodeError(
        "belongs to no installed distribution, so that nothing tells its version",
        where=name,
        hint="Install it as a distribution, or declare its folder as first-party code",
    )


def _versions_of(distributions: Iterable[str]) -> list[str]:
    from importlib import metadata

    versions = set()
    for distribution in distributions:
        try:
            versions.add(metadata.version(distribution))
        except metadata.PackageNotFoundError:
            continue
    return sorted(versions)


@functools.cache
def _all_providers() -> Mapping[str, list[str]]:
    from importlib import metadata

    return metadata.packages_distributions()
