"""Bags that are cut or not indexed, by their first and last bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.bags.condition import look
from garment_dataset.catalog.lint import SEVERITIES, Code, Finding

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.catalog import Catalog


def damaged_bags(catalog: Catalog) -> Iterator[Finding]:
    """Yield what is wrong with the bags of a catalog's folder.

    Parameters
    ----------
    catalog : Catalog
        With what was found in the folder.
    """
    for bag in () if catalog.found is None else catalog.found.bags:
        if (condition := look(bag.path)) is not None:
            code: Code = "unindexed" if condition.kind == "unindexed" else "damaged"
            yield Finding(code, SEVERITIES[code], str(bag.name), str(bag.path), condition.text, condition.hint)
