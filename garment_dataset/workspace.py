"""Where things are: a workspace is a folder with ``catalog/`` and ``pipelines/``; nothing is global."""

from __future__ import annotations

import shutil
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict, ValidationError

from garment_dataset.errors import WorkspaceError
from garment_dataset.workspace_files import packaged_workspace

if TYPE_CHECKING:
    from garment_dataset.catalog import Catalog
    from garment_dataset.engine.run import Report

SETTINGS = "garment.toml"


class _Paths(BaseModel):
    """The table ``[paths]`` of garment.toml, relative to the workspace."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    catalog: Path = Path("catalog")
    pipelines: Path = Path("pipelines")
    recordings: Path = Path("recordings")
    features: Path = Path("features")
    private: Path = Path(".garment")


class _Settings(BaseModel):
    """All of garment.toml."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    paths: _Paths = _Paths()


@dataclass(frozen=True)
class Workspace:
    """The folders of one data set.

    Parameters
    ----------
    root : Path
        The folder that holds the others unless garment.toml moves them.
    catalog_dir, pipelines_dir : Path
        The tables and the pipeline files: what a person edits.
    recordings_dir : Path
        The bags; never written to by a build.
    features_dir : Path
        The Parquet results.
    private_dir : Path
        Store, index and scratch space; safe to delete, at the cost of building again.
    """

    root: Path
    catalog_dir: Path
    pipelines_dir: Path
    recordings_dir: Path
    features_dir: Path
    private_dir: Path

    @classmethod
    def find(cls, path: Path | None = None) -> Workspace:
        """Return the workspace at ``path``, or the nearest one at or above the current folder.

        Raises
        ------
        WorkspaceError
            If there is none, or its garment.toml cannot be read.
        """
        if path is not None:
            if not _is_workspace(path):
                raise WorkspaceError(
                    "not a workspace",
                    where=path,
                    expected=f"catalog/ and pipelines/, or {SETTINGS}",
                    hint=f"Make one with `garment init {path}`.",
                )
            return cls._at(path.resolve())
        here = Path.cwd()
        for folder in (here, *here.parents):
            if _is_workspace(folder):
                return cls._at(folder)
        raise WorkspaceError(
            "no workspace at or above this folder",
            where=here,
            hint="Make one with `garment init DIR`, or name one with --workspace.",
        )

    @classmethod
    def _at(cls, root: Path) -> Workspace:
        paths = _read_settings(root / SETTINGS).paths
        return cls(
            root=root,
            catalog_dir=root / paths.catalog,
            pipelines_dir=root / paths.pipelines,
            recordings_dir=root / paths.recordings,
            features_dir=root / paths.features,
            private_dir=root / paths.private,
        )

    @classmethod
    def create(cls, root: Path) -> Workspace:
        """Write a new workspace with the thesis' catalog and pipelines.

        Raises
        ------
        WorkspaceError
            If ``root`` already is one: nothing is ever overwritten.
        """
        if _is_workspace(root):
            raise WorkspaceError("already a workspace", where=root, hint="Nothing was written.")
        source = packaged_workspace()
        for name in ("catalog", "pipelines"):
            if (root / name).exists():
                raise WorkspaceError(
                    "in the way of a new workspace", where=root / name, hint="Move it, or choose another folder."
                )
        root.mkdir(parents=True, exist_ok=True)
        for name in ("catalog", "pipelines"):
            shutil.copytree(source / name, root / name)
        (root / "recordings").mkdir(exist_ok=True)
        return cls.find(root)

    def catalog(self) -> Catalog:
        """Load the catalog, with the state of every recording in the recordings folder."""
        from garment_dataset.catalog import Catalog

        return Catalog.load(self.catalog_dir).with_folder(self.recordings_dir)

    def build(self, *filters: str, jobs: int | None = None, retry_failed: bool = False, forced: bool = False) -> Report:
        """Build what is missing or stale, and return what became of every node.

        Parameters
        ----------
        *filters : str
            Which recordings, as on the command line; none for all.
        jobs, retry_failed, forced
            See :meth:`garment_dataset.building.Session.build`.
        """
        from garment_dataset.building import Session

        with Session(self, filters) as session:
            return session.build(session.plan(), jobs=jobs, retry_failed=retry_failed, forced=forced)


def _is_workspace(folder: Path) -> bool:
    both = (folder / "catalog").is_dir() and (folder / "pipelines").is_dir()
    return both or (folder / SETTINGS).is_file()


def _read_settings(path: Path) -> _Settings:
    if not path.is_file():
        return _Settings()
    try:
        return _Settings.model_validate(tomllib.loads(path.read_text("utf-8")))
    except tomllib.TOMLDecodeError as error:
        raise WorkspaceError("not TOML", where=path, found=error) from error
    except ValidationError as error:
        first = error.errors()[0]
        setting = ".".join(str(part) for part in first["loc"])
        raise WorkspaceError(
            f"setting {setting!r} is not understood",
            where=path,
            expected=f"[paths] with {', '.join(_Paths.model_fields)}",
            found=first["msg"],
        ) from error
