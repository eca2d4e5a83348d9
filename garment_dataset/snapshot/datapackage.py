"""``datapackage.json``: a snapshot in the words of Frictionless' Data Package 1."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from garment_dataset.layout import SnapshotSettings

_TYPES = {"string": "string", "bool": "boolean", "float64": "number", "float32": "number", "binary": "any"}


def datapackage(
    files: Mapping[str, Sequence[str]],
    schemas: Mapping[str, Mapping[str, Any]],
    settings: SnapshotSettings,
    *,
    version: str,
    description: str,
) -> dict[str, Any]:
    """Describe a snapshot.

    Parameters
    ----------
    files : mapping of str to sequence of str
        Names of the files of each table.
    schemas, settings, version, description
        As for :func:`.croissant`.
    """
    licence = {"path" if "/" in settings.license else "name": settings.license}
    of_person = {
        "licenses": [licence] if settings.license else [],
        "homepage": settings.url,
        "contributors": [{"title": name} for name in settings.creators],
        "created": f"{settings.published.isoformat()}T00:00:00Z" if settings.published else "",
    }
    return {
        "profile": "data-package",
        "name": re.sub(r"[^a-z0-9]+", "-", settings.title.lower()).strip("-") or "snapshot",
        "title": settings.title,
        "description": description,
        "version": version,
        **{key: value for key, value in of_person.items() if value},
        "resources": [_resource(table, files[table], schema) for table, schema in schemas.items()],
    }


def _resource(table: str, files: Sequence[str], schema: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "name": table.replace("_", "-"),
        "title": table,
        "description": f"A row is {schema['row']}.",
        "path": list(files),
        "format": "parquet",
        "mediatype": "application/vnd.apache.parquet",
        "schema": {"fields": [_field(column) for column in schema["columns"]]},
    }


def _field(column: Mapping[str, Any]) -> dict[str, Any]:
    kind = str(column["type"])
    word = "array" if kind.startswith("list<") else "integer" if "int" in kind else _TYPES[kind]
    constraints = {} if column["nullable"] else {"constraints": {"required": True}}
    return {
        "name": column["name"],
        "type": word,
        "description": column["description"],
        "unit": column["unit"],
        **constraints,
    }
