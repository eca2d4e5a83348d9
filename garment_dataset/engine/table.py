"""What a table is: columns with a unit and a description, and the Arrow schema they make.

A specification is plain data, so that planning a build needs no Arrow; :meth:`TableSpec.schema` makes the Arrow schema
when a table is written or read.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from garment_dataset.engine.errors import TableError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import pyarrow as pa

SCHEMAS = "schemas.json"
"""File above the folders of all tables that says what their columns are: in one of them it would be taken for data."""

_LIST_TYPE = re.compile(r"list<(?P<item>\w+)>")


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table.

    Parameters
    ----------
    name : str
        Column name; a quantity carries its unit (``x_m``, ``stamp_ns``).
    type : str
        Arrow type: a primitive's name (``float64``, ``int32``, ``string``, ``binary``) or ``list<primitive>``.
    unit : str
        ``m``, ``s``, ``ns``, ``px``, ``m/s`` …; ``1`` for a number without dimension, empty for text and bytes.
    description : str
        What a reader who never saw this code needs to know.
    nullable : bool
        Whether a value may be missing; missing is always null, never 0 or NaN.
    uncertainty : str
        Name of the column with the standard uncertainty of this one, if there is one.
    """

    name: str
    type: str
    unit: str
    description: str
    nullable: bool = False
    uncertainty: str = ""

    def field(self) -> pa.Field[Any]:
        """Return the Arrow field, with unit and description in its metadata."""
        import pyarrow as pa

        metadata = {"unit": self.unit, "description": self.description}
        return pa.field(self.name, arrow_type(self.type), nullable=self.nullable, metadata=metadata)

    def describe(self) -> dict[str, object]:
        """Return the column as JSON."""
        return {
            "name": self.name,
            "type": self.type,
            "unit": self.unit,
            "nullable": self.nullable,
            "uncertainty": self.uncertainty or None,
            "description": self.description,
        }


def arrow_type(text: str) -> pa.DataType:
    """Return the Arrow type that ``text`` names.

    Raises
    ------
    TableError
        If no such type is known.
    """
    import pyarrow as pa

    if (found := _LIST_TYPE.fullmatch(text)) is not None:
        return pa.list_(pa.field("element", arrow_type(found["item"]), nullable=False))
    try:
        return pa.type_for_alias(text)  # type: ignore[call-overload,no-any-return]  # the stubs want literals
    except ValueError as error:
        raise TableError("not a column type", expected="a primitive or list<primitive>", found=text) from error


class Label(NamedTuple):
    """An identity column, and the one value that stands in every row of a result."""

    column: Column
    value: str | int | float | None


@dataclass(frozen=True)
class TableSpec:
    """One output table: its name, its version and its columns.

    Parameters
    ----------
    name : str
        Folder under the results and argument name in the stages that read it.
    version : int
        Raised when a column changes its meaning.
    row : str
        What one row stands for.
    columns : tuple of Column
        What a stage fills; :meth:`labelled` puts the identity columns in front.
    keys : tuple of str
        The columns that tell the rows of one file apart; none: their order does.
    """

    name: str
    version: int
    row: str
    columns: tuple[Column, ...]
    keys: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        names = [column.name for column in self.columns]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise TableError("column given twice", where=self.name, found=twice)
        named = {*self.keys, *(column.uncertainty for column in self.columns if column.uncertainty)}
        if missing := sorted(named - set(names)):
            raise TableError("no such column", where=self.name, expected=f"among {names}", found=missing)

    def schema(self, identity: Sequence[Column] = ()) -> pa.Schema:
        """Return the Arrow schema of a file whose rows carry these identity columns in front."""
        import pyarrow as pa

        metadata: dict[bytes | str, bytes | str] = {
            "table": self.name,
            "version": str(self.version),
            "row": self.row,
        }
        return pa.schema([column.field() for column in (*identity, *self.columns)], metadata=metadata)

    def table(self, columns: Mapping[str, Any]) -> pa.Table:
        """Make a table of arrays, one per declared column, in declared order; NaN becomes null.

        Parameters
        ----------
        columns : mapping of str to array-like, shape (n_rows,)
            Numpy arrays (masked ones too), Arrow arrays or sequences.

        Raises
        ------
        TableError
            If a column is missing, unknown, of another length or type, or null where it must not be.
        """
        import pyarrow as pa

        names = [column.name for column in self.columns]
        if set(columns) != set(names):
            missing, unknown = sorted(set(names) - set(columns)), sorted(set(columns) - set(names))
            raise TableError("wrong columns", where=self.name, found=f"missing {missing}, unknown {unknown}")
        fields = [column.field() for column in self.columns]
        arrays = [self._array(field, columns[field.name]) for field in fields]
        if len({len(array) for array in arrays}) > 1:
            lengths = {field.name: len(array) for field, array in zip(fields, arrays, strict=True)}
            raise TableError("columns of unequal length", where=self.name, found=lengths)
        return pa.Table.from_arrays(arrays, schema=pa.schema(fields))

    def _array(self, field: pa.Field[Any], values: Any) -> pa.Array[Any]:  # noqa: ANN401 - whatever Arrow takes
        import pyarrow as pa

        try:
            given = values if isinstance(values, pa.Array | pa.ChunkedArray) else pa.array(values, from_pandas=True)
            array = given.combine_chunks() if isinstance(given, pa.ChunkedArray) else given
            array = array.cast(field.type)
        except (pa.ArrowInvalid, pa.ArrowTypeError, pa.ArrowNotImplementedError) as error:
            where = f"{self.name}.{field.name}"
            raise TableError("values that do not fit", where=where, expected=field.type, found=error) from error
        if array.null_count and not field.nullable:
            where = f"{self.name}.{field.name}"
            raise TableError("null in a column without nulls", where=where, found=f"{array.null_count} nulls")
        return array

    def labelled(self, table: pa.Table, labels: Sequence[Label]) -> pa.Table:
        """Put identity columns in front of what a stage made, the same value in every row.

        Parameters
        ----------
        table : pyarrow.Table
            As :meth:`table` returned it.
        labels : sequence of Label
            The columns and their values, in order.

        Raises
        ------
        TableError
            If the table is not of this specification.
        """
        import pyarrow as pa

        own = pa.schema([column.field() for column in self.columns])
        if not table.schema.equals(own):
            raise TableError("not a table of this schema", where=self.name, expected=own.names, found=table.schema)
        constant = [pa.array([label.value] * table.num_rows, type=arrow_type(label.column.type)) for label in labels]
        columns = [*constant, *(column.combine_chunks() for column in table.columns)]
        return pa.Table.from_arrays(columns, schema=self.schema([label.column for label in labels]))

    def describe(self, identity: Sequence[Column] = (), partitions: Sequence[str] = ()) -> dict[str, object]:
        """Return the schema as JSON, for readers that drop Arrow's metadata.

        Parameters
        ----------
        identity : sequence of Column
            The columns in front of this table's own.
        partitions : sequence of str
            Keys in the paths of its files.
        """
        return {
            "table": self.name,
            "version": self.version,
            "row": self.row,
            "partitions": list(partitions),
            "keys": list(self.keys),
            "columns": [column.describe() for column in (*identity, *self.columns)],
        }


def read_schemas(folder: Path) -> dict[str, Any]:
    """Return what :data:`SCHEMAS` in a folder says, by table; nothing where there is none.

    Raises
    ------
    OSError, ValueError
        If it cannot be read.
    """
    path = folder / SCHEMAS
    if not path.is_file():
        return {}
    found = json.loads(path.read_text("utf-8"))
    if not isinstance(found, dict) or not all(isinstance(each, dict) for each in found.values()):
        raise ValueError("no description by table")
    return found
