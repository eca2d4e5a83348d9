"""All stages that a pipeline can name: the package's, the workspace's own, and those of installed packages.

Nothing is imported until a pipeline names it.
"""

from __future__ import annotations

import contextlib
import importlib.machinery
import importlib.util
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from garment_dataset.engine.loading import HOMES, load_module, modules_of
from garment_dataset.errors import GarmentError, StageError, did_you_mean
from garment_dataset.stages import STAGES, Stage

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from garment_dataset.layout import Layout

PACKAGE = Path(__file__).parents[1]
ENTRY_POINTS = "garment_dataset.stages"
"""Group of entry points by which installed packages bring stages: ``name = "package.module"``."""


@dataclass(frozen=True, slots=True)
class StagePlace:
    """Where a stage comes from.

    Parameters
    ----------
    name : str
        Its name, and the last part of its module's.
    module : str
        Holds it as ``STAGE``.
    where : str
        The file or the distribution, for messages.
    home : Path or None
        Folder to import it from, where it is not installed.
    """

    name: str
    module: str
    where: str
    home: Path | None = None


class KnownStages:
    """Stages by name, imported when asked for.

    Parameters
    ----------
    places : iterable of StagePlace
        Where they are.

    Raises
    ------
    StageError
        If two have one name.
    """

    def __init__(self, places: Iterable[StagePlace]) -> None:
        self._places: dict[str, StagePlace] = {}
        self._loaded: dict[str, Stage] = {}
        for place in places:
            other = self._places.setdefault(place.name, place)
            if other != place:
                found = f"{other.where} and {place.where}"
                raise StageError(f"two stages are called {place.name!r}", found=found, hint="Rename one of them.")

    @classmethod
    def of(cls, layout: Layout) -> KnownStages:
        """Return the stages that the pipelines of a workspace can name."""
        return cls([*_packaged(), *_of_workspace(layout), *_installed()])

    @classmethod
    def of_every_workspace(cls) -> KnownStages:
        """Return the stages that the pipelines of any workspace can name."""
        return cls([*_packaged(), *_installed()])

    @property
    def names(self) -> list[str]:
        """All names, the package's own first."""
        return list(self._places)

    def __contains__(self, name: object) -> bool:
        return name in self._places

    def __getitem__(self, name: str) -> Stage:
        """Import a stage.

        Raises
        ------
        StageError
            If its module cannot be imported, or holds no stage of this name.
        """
        if name not in self._loaded:
            self._loaded[name] = _load(self._places[name])
        return self._loaded[name]

    def makers_of(self, table: str) -> list[str]:
        """Return the stages that make a table; those that cannot be imported are passed over."""
        found = []
        for name in self._places:
            with contextlib.suppress(GarmentError):
                found += [name for output in self[name].outputs if output.name == table]
        return found

    def roots(self) -> dict[str, Path]:
        """Return the packages and modules, by import name, in which stages are followed.

        Those of every stage that is known, named by a pipeline or not: a stage may import the module of another, and
        what is followed must not depend on other pipelines.
        """
        found = {PACKAGE.name: PACKAGE}
        for place in self._places.values():
            top = place.module.partition(".")[0]
            if place.home is not None:
                found |= modules_of(place.home)
            elif top not in found and (folder := _folder_of(top)) is not None:
                found[top] = folder
        return found


def _packaged() -> Iterator[StagePlace]:
    for name in STAGES:
        yield StagePlace(name, f"garment_dataset.stages.{name}", "garment_dataset")


def _of_workspace(layout: Layout) -> Iterator[StagePlace]:
    if not layout.stage_modules:
        return
    found = modules_of(layout.stages_dir)
    for name in layout.stage_modules:
        if name not in found:
            raise StageError(
                f"no module {name!r} for a stage",
                where=layout.stages_dir,
                expected=f"{name}.py, as garment.toml says",
                found=", ".join(found) or "no modules",
                hint=did_you_mean(name, found) or f"`garment new stage {name}` writes one.",
            )
    for name, path in found.items():
        refuse_shadow(name, path)
    for name in layout.stage_modules:
        yield StagePlace(name, name, str(found[name]), layout.stages_dir)


def refuse_shadow(name: str, path: Path) -> None:
    """Refuse a module that is called as another one that Python finds: one of the two would be taken for the other."""
    own = {*HOMES, str(path.parent), str(path.parent.resolve())}
    elsewhere = [folder for folder in sys.path if folder not in own and str(Path(folder).resolve()) not in own]
    spec = None if name in sys.stdlib_module_names else importlib.machinery.PathFinder.find_spec(name, elsewhere)
    if name in sys.stdlib_module_names or (spec is not None and spec.origin is not None):
        found = "a module of Python's own" if spec is None else spec.origin
        raise StageError("a module's name is taken", where=path, found=found, hint="Rename the file.")


def _installed() -> Iterator[StagePlace]:
    from importlib import metadata

    for point in sorted(metadata.entry_points(group=ENTRY_POINTS), key=lambda point: point.name):
        where = "an installed package" if point.dist is None else f"{point.dist.name} {point.dist.version}"
        yield StagePlace(point.name, point.module, f"{point.value} of {where}")


def _load(place: StagePlace) -> Stage:
    try:
        module = load_module(place.module, place.home)
    except GarmentError:
        raise
    except Exception as error:
        text = f"{type(error).__name__}: {error}"
        raise StageError("the module of a stage cannot be imported", where=place.where, found=text) from error
    stage = getattr(module, "STAGE", None)
    if stage is None:
        raise StageError("a module without STAGE", where=place.where, hint="`garment new stage` shows the form.")
    if not isinstance(stage, Stage):
        raise StageError("STAGE is no Stage", where=place.where, found=type(stage).__name__)
    if stage.name != place.name:
        hint = "File, function and stage have one name."
        raise StageError("another stage", where=place.where, expected=place.name, found=stage.name, hint=hint)
    beside: object = getattr(sys.modules.get(stage.module), "STAGE", None)
    if beside is not stage:  # a worker looks for the stage where its function is
        raise StageError(
            "STAGE stands in another module than its function",
            where=place.where,
            found=f"{stage.name}() in module {stage.module}",
            hint="Define it here, and call what you import.",
        )
    return replace(stage, home=place.home)


def _folder_of(package: str) -> Path | None:
    """Return the folder of an installed package, or the file of a module; None when there is none."""
    spec = importlib.util.find_spec(package)
    if spec is None:
        return None
    folders = spec.submodule_search_locations
    return Path(next(iter(folders)) if folders else str(spec.origin))
