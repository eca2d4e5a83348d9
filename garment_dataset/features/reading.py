"""Reading results back: a DataFrame with units, or an Arrow dataset."""

from __future__ import annotations

import json
import warnings
from typing import TYPE_CHECKING, Any

from garment_dataset.errors import DataWarning, FilterError, StoreError, as_path, did_you_mean, one_of
from garment_dataset.features.versions import whole_schema
from garment_dataset.features.wanted import refuse_unknown_words, wanted_values
from garment_dataset.layout import ORPHANS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import pandas as pd
    import pyarrow as pa
    import pyarrow.dataset as ds

PARTITIONS = ("garment", "holding")
_VARIANT = "variant="


def variants_of(folder: Path) -> list[str]:
    """Return the names of the variants whose results lie in a features folder; the usual one has none."""
    return sorted(path.name.removeprefix(_VARIANT) for path in folder.glob(f"{_VARIANT}*") if path.is_dir())


def variant_folder(folder: Path, variant: str) -> Path:
    """Return where the tables of a variant lie in a features folder.

    Raises
    ------
    StoreError
        If there is no such variant.
    """
    if not variant:
        return folder
    if variant not in (known := variants_of(folder)):
        raise StoreError(
            f"no variant {variant!r}",
            where=folder,
            expected=one_of(known) if known else "none: there is only the usual one, without a name",
            hint=did_you_mean(variant, known) or "`garment build` makes those that pipelines name.",
        )
    return folder / f"{_VARIANT}{variant}"


def tables_in(folder: Path) -> list[str]:
    """Return the tables of which there are results in the folder of a variant."""
    folders = (path for path in folder.glob("*") if path.is_dir() and not path.name.startswith((_VARIANT, ".")))
    return sorted(path.name for path in folders if any(True for _ in path.glob("**/*.parquet")))


def result_files(folder: Path, table: str) -> list[Path]:
    """Return the files of a table in the folder of a variant; each is called after what it is about.

    Those that the last build found orphaned are left out: nothing asks for them any more.

    Warns
    -----
    DataWarning
        If there are such files.
    """
    found = sorted(path for path in (folder / table).glob("**/*.parquet") if not path.name.startswith("."))
    gone = orphans_in(folder.parent if folder.name.startswith(_VARIANT) else folder)
    if left_out := [path for path in found if path in gone]:
        names = ", ".join(path.stem for path in left_out[:3]) + (", ..." if len(left_out) > 3 else "")
        text = f"{len(left_out)} orphaned files of {table} are left out ({names}): {gone[left_out[0]]} (`garment gc`)"
        warnings.warn(text, DataWarning, stacklevel=3)
    return [path for path in found if path not in gone]


def orphans_in(folder: Path) -> dict[Path, str]:
    """Return the files of a features folder that nothing asks for any more, as the last build found, and why."""
    path = folder / ORPHANS
    if not path.is_file():
        return {}
    try:
        listed: dict[str, str] = json.loads(path.read_text("utf-8"))
        return {folder / name: why for name, why in listed.items()}
    except (OSError, ValueError, AttributeError) as error:
        raise StoreError("the list of orphaned files cannot be read", where=path, found=error) from error


def read_result(path: Path) -> pd.DataFrame:
    """Return the rows of one file, without what its path says."""
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        return _to_frame(file.read())


def table_description(folder: Path, table: str) -> dict[str, Any]:
    """Return what was written about a table above its files; nothing where another program made them.

    Raises
    ------
    StoreError
        If it cannot be read.
    """
    from garment_dataset.engine.table import SCHEMAS, read_schemas

    try:
        found: dict[str, Any] = read_schemas(folder).get(table, {})
    except (OSError, ValueError) as error:
        hint = "`garment build` writes it anew."
        raise StoreError("schemas cannot be read", where=folder / SCHEMAS, found=error, hint=hint) from error
    return found


def declared_uncertainties(described: Mapping[str, Any]) -> dict[str, str | None]:
    """Return the column of the standard uncertainty by column, of what :func:`table_description` says; None: none."""
    return {column["name"]: column.get("uncertainty") for column in described.get("columns", ())}


def open_features(
    table: str, *, folder: Path | str | None = None, variant: str = "", about: Sequence[str] = ()
) -> ds.Dataset:
    """Return the files of a table as one Arrow dataset, the partition keys, if it has any, as text columns.

    Parameters
    ----------
    table : str
        Name of the table, such as ``points``.
    folder : Path or str, optional
        The features folder, or a snapshot; by default that of the workspace at or above the current folder.
    variant : str
        Whose results; by default those of the pipelines without a variant.
    about : sequence of str
        Only files of these names are opened, whatever the others are like; all, where there is none of them.

    Raises
    ------
    StoreError
        If nothing was built for this table, or there is no such variant.
    """
    import pyarrow as pa
    import pyarrow.dataset as ds

    root = variant_folder(_features_folder(folder), variant)
    found = result_files(root, table)
    files = [str(path) for path in [path for path in found if path.stem in about] or found]
    if not files:
        built = tables_in(root)
        raise StoreError(
            f"no files of table {table!r}",
            where=root,
            expected=one_of(built) if built else "some results",
            hint=did_you_mean(table, built) or "`garment build` makes them.",
        )
    keys = [name for name in PARTITIONS if f"/{name}=" in files[0].removeprefix(str(root / table))]
    schema = _full_schema(files, table, keys)
    partitioning = ds.partitioning(pa.schema([(name, pa.string()) for name in keys]), flavor="hive")
    return ds.dataset(files, schema=schema, partitioning=partitioning, partition_base_dir=str(root / table))


def load_features(
    table: str,
    *,
    folder: Path | str | None = None,
    variant: str = "",
    **filters: Any,  # noqa: ANN401
) -> pd.DataFrame:
    """Return a table as a DataFrame; ``frame.attrs["units"]`` says the unit of every column.

    Parameters
    ----------
    table : str
        Name of the table, such as ``kinematics``.
    folder : Path or str, optional
        The features folder, or a snapshot; by default that of the workspace at or above the current folder.
    variant : str
        Whose results; by default those of the pipelines without a variant.
    **filters : value or sequence of values
        Columns and what they must equal: ``garment="GreenTowel"``, ``recording=[...]``, ``point=[1, 2]``, also as an
        array, a Series or a range; None asks for nulls, and of an empty list nothing is wanted.

    Raises
    ------
    StoreError
        If nothing was built for this table, or there is no such variant.
    FilterError
        If a filter names no column, its values are of another type than the column, or it finds nothing and names what
        is not there: a recording, a garment, a word that the column cannot have; of several, none is there.
    """
    import pyarrow.dataset as ds

    from garment_dataset.features.frame import FeatureFrame

    named = filters.get("recording", ())
    about = [named] if isinstance(named, str) else named if isinstance(named, list | tuple) else ()
    dataset = open_features(table, folder=folder, variant=variant, about=about)
    condition, asked = None, {}
    for name, wanted in filters.items():
        if name not in dataset.schema.names:
            names = dataset.schema.names
            hint = did_you_mean(name, names)
            raise FilterError(f"{name!r} is no column", where=table, expected=one_of(names), hint=hint)
        values = asked[name] = wanted_values(wanted, dataset.schema.field(name), table)
        term = ds.field(name).isin(values)
        condition = term if condition is None else condition & term
    found = dataset.to_table(filter=condition)
    if not found.num_rows:
        refuse_unknown_words(dataset, asked, table)
    frame = FeatureFrame(_to_frame(found))
    frame.attrs["units"] = {field.name: unit for field in found.schema if (unit := _metadata(field, b"unit"))}
    frame.attrs["descriptions"] = {
        field.name: text for field in found.schema if (text := _metadata(field, b"description"))
    }
    return frame


def result_params(table: str, recording: str, *, folder: Path | str | None = None, variant: str = "") -> dict[str, Any]:
    """Return the parameters that a recording's result was made with, defaults filled in.

    Raises
    ------
    StoreError
        If there is no such result.
    """
    from garment_dataset.engine.artifacts import read_provenance

    root = variant_folder(_features_folder(folder), variant)
    files = {path.stem: path for path in result_files(root, table)}
    if recording not in files:
        nearest = did_you_mean(recording, files) if files else did_you_mean(table, tables_in(root))
        hint = nearest or "`garment build` makes it."
        raise StoreError(f"no {table!r} of {recording}", where=root / table, hint=hint)
    params: dict[str, Any] = read_provenance(files[recording])["facts"]["params"]
    return params


def _to_frame(table: pa.Table) -> pd.DataFrame:
    """Convert to pandas; whole numbers that may be missing stay whole: a float holds no stamp in ns."""
    import pandas as pd
    import pyarrow as pa

    frame = table.to_pandas()
    integers: dict[pa.DataType, Any] = {pa.int32(): pd.Int32Dtype(), pa.int64(): pd.Int64Dtype()}
    for field in table.schema:
        if field.nullable and field.type in integers:
            frame[field.name] = table[field.name].to_pandas(types_mapper=integers.get).array
    return frame


def _features_folder(folder: Path | str | None) -> Path:
    if folder is not None:
        folder = as_path(folder)
        if not folder.is_dir():
            raise StoreError(
                "no such folder",
                where=folder,
                expected="a features folder, or a snapshot",
                hint="`garment build` makes it.",
            )
        return folder
    from garment_dataset.layout import Layout

    return Layout.find().features_dir


def _full_schema(files: Sequence[str], table: str, partitions: Sequence[str]) -> pa.Schema:
    import pyarrow as pa

    own = whole_schema(files, table)
    keys = [pa.field(name, pa.string(), metadata={"description": f"{name}, from the path"}) for name in partitions]
    return pa.schema([*own, *(key for key in keys if key.name not in own.names)])


def _metadata(field: pa.Field[Any], key: bytes) -> str:
    return (field.metadata or {}).get(key, b"").decode()
