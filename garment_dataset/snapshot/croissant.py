"""``croissant.json``: a snapshot in the words of MLCommons' Croissant 1.1, with units and descriptions of every column.

The files are described in place: each table is a set of files beside the description, a record set and its fields.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from garment_dataset.errors import TableError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from garment_dataset.layout import SnapshotSettings

CONTEXT: dict[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    **{
        name: f"cr:{name}"
        for name in (
            *("arrayShape", "citeAs", "column", "containedIn", "equivalentProperty", "extract", "field"),
            *("fileProperty", "fileObject", "fileSet", "format", "includes", "isArray", "isLiveDataset", "jsonPath"),
            *("key", "md5", "parentField", "path", "recordSet", "references", "regex", "repeated", "replace"),
            *("samplingRate", "separator", "source", "subField", "transform"),
        )
    },
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "description": {"@container": "@language"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "name": {"@container": "@language"},
    "sc": "https://schema.org/",
}
"""The context of version 1.1, as its specification gives it."""

_TYPES = {
    "string": "sc:Text",
    "bool": "sc:Boolean",
    "float64": "cr:Float64",
    "float32": "cr:Float32",
    **{f"{sign}int{bits}": f"cr:{sign.upper()}Int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)},
    "binary": "sc:ImageObject",  # all that is kept so are PNG images
}


def croissant(
    schemas: Mapping[str, Mapping[str, Any]], settings: SnapshotSettings, *, version: str, description: str
) -> dict[str, Any]:
    """Describe a snapshot.

    Parameters
    ----------
    schemas : mapping of str to mapping
        Descriptions of its tables, as :meth:`.TableSpec.describe` returns them.
    settings : SnapshotSettings
        What a person says of the data set.
    version : str
        Of the snapshot.
    description : str
        A paragraph.

    Raises
    ------
    TableError
        If a column is of a type that Croissant has no word for.
    """
    of_person = {
        "license": settings.license,
        "url": settings.url,
        "citeAs": settings.citation,
        "datePublished": settings.published.isoformat() if settings.published else "",
        "creator": [{"@type": "sc:Person", "name": name} for name in settings.creators],
    }
    return {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.1",
        "name": settings.title,
        "description": description,
        "version": version,
        **{key: value for key, value in of_person.items() if value},
        "distribution": [_files(table) for table in schemas],
        "recordSet": [_records(table, schema) for table, schema in schemas.items()],
    }


def _files(table: str) -> dict[str, Any]:
    return {
        "@type": "cr:FileSet",
        "@id": f"{table}-files",
        "name": f"{table}-files",
        "description": f"One Parquet file per subject of the table {table}.",
        "encodingFormat": "application/x-parquet",
        "includes": f"{table}/*.parquet",
    }


def _records(table: str, schema: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "@type": "cr:RecordSet",
        "@id": table,
        "name": table,
        "description": f"A row is {schema['row']}.",
        "field": [_field(table, column) for column in schema["columns"]],
    }


def _field(table: str, column: Mapping[str, Any]) -> dict[str, Any]:
    kind = str(column["type"]).removeprefix("list<").removesuffix(">")
    if kind not in _TYPES:
        where = f"{table}.{column['name']}"
        raise TableError("a type that Croissant has no word for", where=where, found=column["type"])
    unit = f" Unit: {column['unit']}." if column["unit"] else ""
    std = f" Standard uncertainty: {column['uncertainty']}." if column.get("uncertainty") else ""
    is_array = {"isArray": True, "arrayShape": "-1"} if kind != column["type"] else {}
    return {
        "@type": "cr:Field",
        "@id": f"{table}/{column['name']}",
        "name": column["name"],
        "description": f"{column['description'].rstrip('.')}.{unit}{std}",
        "dataType": _TYPES[kind],
        **is_array,
        "source": {"fileSet": {"@id": f"{table}-files"}, "extract": {"column": column["name"]}},
    }
