"""A workspace: its folders, its catalog, and builds of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from garment_dataset.engine.showing import html_table, html_text
from garment_dataset.errors import GarmentError, printable
from garment_dataset.layout import Layout

if TYPE_CHECKING:
    from garment_dataset.catalog import Catalog
    from garment_dataset.engine.events import Report

__all__ = ["Workspace"]


@dataclass(frozen=True, repr=False)
class Workspace(Layout):
    """The folders of one data set, and what is done with them; see :class:`~garment_dataset.layout.Layout`."""

    def __repr__(self) -> str:
        return f"<Workspace {printable(str(self.root))}>"

    def _repr_html_(self) -> str:
        """Return its folders, and the catalog or what is wrong with it."""
        names = ("catalog", "pipelines", "recordings", "features", "stages")
        paths = {name: getattr(self, f"{name}_dir") for name in names}
        rows = [[name, path, "yes" if path.is_dir() else "no"] for name, path in paths.items()]
        folders = html_table(["folder", "path", "there"], rows, title=f"Workspace {self.root}")
        try:
            return folders + self.catalog()._repr_html_()
        except GarmentError as error:
            return f"{folders}<p>{html_text(error)}</p>"

    def catalog(self) -> Catalog:
        """Load the catalog, with the state of every recording in the recordings folder."""
        from garment_dataset.catalog import Catalog

        return Catalog.of(self)

    def build(self, *filters: str, jobs: int | None = None, retry_failed: bool = False, forced: bool = False) -> Report:
        """Build what is missing or stale, and return what became of every node.

        Parameters
        ----------
        *filters : str
            Which recordings, as on the command line; none for all.
        jobs, retry_failed, forced
            See :func:`garment_dataset.workspace.building.build`.

        Raises
        ------
        FilterError
            If no recording matches the filters.
        StoreError
            If the workspace cannot be written.
        """
        from garment_dataset.workspace import building
        from garment_dataset.workspace.session import Session

        with Session(self, filters) as session:
            return building.build(session, jobs=jobs, retry_failed=retry_failed, forced=forced)
