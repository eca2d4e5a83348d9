"""Where things are: a workspace is a folder with ``catalog/`` and ``pipelines/``, or with a garment.toml.

The rule by which one is found stands here, once. Nothing is global: commands look upward from the current folder, or
are told where.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import BaseModel, ConfigDict, NonNegativeFloat, ValidationError

from garment_dataset.errors import WorkspaceError, as_path
from garment_dataset.files import first_fault, hint_of, read_toml

if TYPE_CHECKING:
    from typing import Self

SETTINGS = "garment.toml"
ORPHANS = "_orphans.json"
"""File in the features folder that names what nothing asks for any more; a build writes it, readers leave that out."""


class _Paths(BaseModel):
    """The table ``[paths]`` of garment.toml, relative to the workspace."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    catalog: Path = Path("catalog")
    pipelines: Path = Path("pipelines")
    recordings: Path = Path("recordings")
    features: Path = Path("features")
    stages: Path = Path("stages")
    private: Path = Path(".garment")


class _Stages(BaseModel):
    """The table ``[stages]`` of garment.toml."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    modules: tuple[str, ...] = ()


class NamesSettings(BaseModel):
    """The table ``[names]`` of garment.toml: another scheme than the thesis' (:mod:`garment_dataset.catalog.schemes`).

    Parameters
    ----------
    pattern : str
        Regular expression with named groups.
    axis : {"R", "B"} or dict of str to {"R", "B"}, optional
        What the words of the group ``axis`` mean, or the axis of all where there is no such group.
    speed : float, optional
        Speed of all where there is no such group.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    pattern: str
    axis: Literal["R", "B"] | dict[str, Literal["R", "B"]] | None = None
    speed: NonNegativeFloat | None = None


class SnapshotSettings(BaseModel):
    """The table ``[snapshot]`` of garment.toml: what only a person can say of a data set that is handed on.

    Parameters
    ----------
    title, description : str
        A line, and a paragraph.
    version : str
        A number of one's own, such as 1.2.0.
    license : str
        SPDX identifier or address.
    url : str
        Where it can be had.
    creators : tuple of str
        Names.
    citation : str
        How to cite it.
    published : date, optional
        When.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    title: str = "Features of moving garments"
    description: str = ""
    version: str = ""
    license: str = ""
    url: str = ""
    creators: tuple[str, ...] = ()
    citation: str = ""
    published: date | None = None


_NOTHING_SAID = SnapshotSettings()


class _Settings(BaseModel):
    """All of garment.toml."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    paths: _Paths = _Paths()
    stages: _Stages = _Stages()
    names: NamesSettings | None = None
    snapshot: SnapshotSettings = SnapshotSettings()


@dataclass(frozen=True)
class Layout:
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
    stages_dir : Path
        Stages of the data set's own, if it has any.
    private_dir : Path
        Store, index and scratch space; safe to delete, at the cost of building again.
    stage_modules : tuple of str
        Which modules of ``stages_dir`` hold a stage.
    names : NamesSettings or None
        How bags are named, if otherwise than in the thesis.
    snapshot : SnapshotSettings
        What is said of the data set where it is handed on.
    """

    root: Path
    catalog_dir: Path
    pipelines_dir: Path
    recordings_dir: Path
    features_dir: Path
    stages_dir: Path
    private_dir: Path
    stage_modules: tuple[str, ...] = ()
    names: NamesSettings | None = None
    snapshot: SnapshotSettings = _NOTHING_SAID

    @classmethod
    def find(cls, path: Path | str | None = None) -> Self:
        """Return the workspace at ``path``, or the nearest one at or above the current folder.

        Raises
        ------
        WorkspaceError
            If there is none, or its garment.toml cannot be read.
        """
        if path is not None:
            path = as_path(path)
            if not is_workspace(path):
                raise WorkspaceError(
                    "not a workspace",
                    where=path,
                    expected=f"catalog/ and pipelines/, or {SETTINGS}",
                    hint=f"Make one with `garment init {path}`.",
                )
            return cls.at(path.resolve())
        if (root := workspace_above(Path.cwd())) is None:
            raise WorkspaceError(
                "no workspace at or above this folder",
                where=Path.cwd(),
                hint="Make one with `garment init DIR`, or name one with --workspace.",
            )
        return cls.at(root)

    @classmethod
    def at(cls, root: Path | str) -> Self:
        """Return the workspace whose root is known, wherever its garment.toml puts the folders.

        Raises
        ------
        WorkspaceError
            If its garment.toml cannot be read, or names a path that cannot be one.
        """
        root = as_path(root)
        settings = _read_settings(root / SETTINGS)
        paths = settings.paths
        _refuse_paths(root, paths)
        return cls(
            root=root,
            catalog_dir=root / paths.catalog,
            pipelines_dir=root / paths.pipelines,
            recordings_dir=root / paths.recordings,
            features_dir=root / paths.features,
            stages_dir=root / paths.stages,
            private_dir=root / paths.private,
            stage_modules=settings.stages.modules,
            names=settings.names,
            snapshot=settings.snapshot,
        )

    @classmethod
    def create(cls, root: Path | str, *, empty: bool = False) -> Self:
        """Write a new workspace with the thesis' catalog and pipelines.

        Parameters
        ----------
        root : Path
            Folder to make.
        empty : bool
            Whether the tables have only their headers, for a data set of one's own.

        Raises
        ------
        WorkspaceError
            If ``root`` already is one, as nothing is ever overwritten; or its name is no UTF-8.
        """
        root = as_path(root)
        refuse_bytes("root", root.absolute(), root)
        if is_workspace(root):
            raise WorkspaceError("already a workspace", where=root, hint="Nothing was written.")
        source = packaged_workspace()
        for name in ("catalog", "pipelines"):
            if (root / name).exists():
                raise WorkspaceError(
                    "in the way of a new workspace", where=root / name, hint="Move it, or choose another folder."
                )
        root.mkdir(parents=True, exist_ok=True)
        for name in ("catalog", "pipelines"):
            # the topics are those of the thesis' recorder
            omitted = shutil.ignore_patterns("topics") if empty else None
            shutil.copytree(source / name, root / name, ignore=omitted)
        for table in sorted((root / "catalog").glob("*.csv")) if empty else ():
            table.write_text(table.read_text("utf-8").partition("\n")[0] + "\n", "utf-8")
        (root / "recordings").mkdir(exist_ok=True)
        return cls.find(root)


def is_workspace(folder: Path) -> bool:
    """Say whether a folder is the root of a workspace."""
    both = (folder / "catalog").is_dir() and (folder / "pipelines").is_dir()
    return both or (folder / SETTINGS).is_file()


def workspace_above(start: Path) -> Path | None:
    """Return the root of the nearest workspace at or above ``start``, or None where there is none."""
    return next((folder for folder in (start, *start.parents) if is_workspace(folder)), None)


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
    root = workspace_above(start)
    return packaged_workspace() / "catalog" if root is None else Layout.at(root).catalog_dir


def _refuse_paths(root: Path, paths: _Paths) -> None:
    """Refuse a path that cannot be that of a folder, whether or not there is one."""
    for name, path in paths:
        try:
            (root / path).stat()
        except (FileNotFoundError, NotADirectoryError, PermissionError):
            pass  # who needs it says so
        except (OSError, ValueError) as error:
            found = error.strerror if isinstance(error, OSError) else error
            raise WorkspaceError(f"no path for {name!r}", where=root / SETTINGS, found=f"{path}: {found}") from error
    for name in ("features", "private"):
        refuse_bytes(name, (root / getattr(paths, name)).absolute(), root / SETTINGS)


def refuse_bytes(name: str, path: Path, where: Path) -> None:
    """Refuse a folder of Parquet files whose name is no UTF-8, for Arrow can neither write nor read there.

    Raises
    ------
    WorkspaceError
        If it is one; ``name`` says what the folder is for, and ``where`` who says so.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        hint = "Rename that folder, or have the workspace elsewhere; bags may lie in folders of any name."
        raise WorkspaceError(
            f"no path for {name!r}", where=where, expected="names in UTF-8", found=path, hint=hint
        ) from error


def _read_settings(path: Path) -> _Settings:
    if not os.path.lexists(path):
        return _Settings()
    try:
        return _Settings.model_validate(read_toml(path))
    except ValidationError as error:
        entry, expected, found, hint = first_fault(error, _Settings)
        raise WorkspaceError(
            f"setting {entry!r} is not understood", where=path, expected=expected, found=found, hint=hint
        ) from error
    except (OSError, ValueError) as error:
        raise WorkspaceError("not TOML", where=path, found=error, hint=hint_of(error)) from error
