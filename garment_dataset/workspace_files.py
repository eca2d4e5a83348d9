"""Where a catalog lies when nobody says: in the nearest workspace, else in the copy that the package carries."""

from __future__ import annotations

import tomllib
from pathlib import Path

from garment_dataset.errors import WorkspaceError


def packaged_workspace() -> Path:
    """Return the folder that holds the packaged ``catalog/`` and ``pipelines/``.

    A wheel carries them inside the package; in a checkout they are the repository's own.
    """
    package = Path(__file__).resolve().parent
    installed = package / "_workspace"
    return installed if installed.is_dir() else package.parent


def nearest_catalog(start: Path) -> Path:
    """Return the catalog of the workspace at or above ``start``, or the packaged one where there is none.

    Raises
    ------
    WorkspaceError
        If the garment.toml of that workspace cannot be read.
    """
    for folder in (start, *start.parents):
        if (settings := folder / "garment.toml").is_file():
            return folder / _moved_catalog(settings)
        if (folder / "catalog").is_dir() and (folder / "pipelines").is_dir():
            return folder / "catalog"
    return packaged_workspace() / "catalog"


def _moved_catalog(settings: Path) -> str:
    try:
        paths = tomllib.loads(settings.read_text("utf-8")).get("paths", {})
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise WorkspaceError("not TOML", where=settings, found=error) from error
    catalog = paths.get("catalog", "catalog") if isinstance(paths, dict) else None
    if not isinstance(catalog, str):
        raise WorkspaceError("setting 'paths.catalog' is not understood", where=settings, expected="a folder")
    return catalog
