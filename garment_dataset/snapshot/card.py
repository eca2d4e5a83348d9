"""``README.md`` of a snapshot: the data card that a person reads first, with the settings that Hugging Face reads."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from garment_dataset.snapshot.sums import SUMS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from garment_dataset.snapshot.contents import Contents
    from garment_dataset.snapshot.tally import Certainty, Tally

THESIS = (
    "Michal Neoral: *Extraction of Features from Moving Garment*. Bachelor's thesis, Czech Technical University in "
    "Prague, Faculty of Electrical Engineering, Department of Cybernetics."
)
"""Where the recordings are defined, and the two extractions."""

_COUNTED = (
    "{recordings} recordings of garments that a robot arm swings, seen by an RGB-D camera: {tables} tables of "
    "features, with units, timestamps, standard uncertainties and reasons for what is missing."
)

_READING = """\
## Reading it

Each table is a folder of Parquet files, one per recording (camera position, group of repeats), all columns in each.

```python
import pandas as pd

frame = pd.read_parquet("{table}")
```

`polars.read_parquet("{table}")`, `duckdb.sql("from '{table}/*.parquet'")`, `pyarrow.dataset.dataset("{table}")`,
`datasets.load_dataset("./{table}")` and R's `arrow::open_dataset("{table}")` find the same rows.
`sha256sum --check {sums}` says whether all is as it was written."""

_CONVENTIONS = """\
`schemas.json` (also `croissant.json`, `datapackage.json`) gives unit and description of every column, and which column
holds the standard uncertainty of which. Lengths are in metres, times in nanoseconds since the Unix epoch (when the
camera saw it), positions in the camera's optical frame: x right, y down, z forward. Pixels count from 0, at the centre
of the upper left one. What is missing is null, with a reason in a column beside it.

`catalog/recordings.csv` says what is known of each recording: garment, holding, speed, size and weight. The tables
beside it are those of whoever recorded: all garments and ways of holding them."""

_TESTED = """\
How true the uncertainties are, and how large errors are where truth is known, was measured on simulated recordings,
many of which nothing was tuned on: `docs/accuracy.md` of garment-dataset. How far repeats of one movement are apart
stands in the table `repeatability`, where it is among the tables."""

_MADE = """\
Depth and colour of each bag are followed separately, stage by stage. Every file says in its footer (`provenance`) from
which inputs, with which parameters and with which code it was made; `snapshot.json` has the same of all files, and the
key of each result."""

_MOST_LEFT_OUT = 20
_FIRST = ("kinematics", "points", "central_curves")
"""Tables that most readers want, best first."""


def paragraph(contents: Contents, tally: Tally) -> str:
    """Return what a snapshot is, in a paragraph."""
    said = contents.settings.description
    counted = _COUNTED.format(recordings=len(contents.recordings), tables=len(tally.files))
    return f"{said.strip()} {counted}" if said.strip() else counted


def card(contents: Contents, tally: Tally, *, version: str, made_with: Mapping[str, str]) -> str:
    """Return the data card as Markdown.

    Parameters
    ----------
    contents, tally : Contents, Tally
        What the snapshot holds.
    version : str
        Of the snapshot.
    made_with : mapping of str to str
        Versions of the package and of libraries.
    """
    parts = [
        _front(contents, tally),
        f"# {contents.settings.title}\n\n{paragraph(contents, tally)}\n\nVersion {version}.",
        _reading(next((name for name in _FIRST if name in tally.files), next(iter(tally.files)))),
        _tables(contents, tally),
        _quality(contents, tally),
        _uncertainty(tally),
        _making(contents, tally, made_with),
        _rights(contents),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _front(contents: Contents, tally: Tally) -> str:
    """Return the settings by which ``datasets.load_dataset(folder, table)`` finds each table."""
    lines = ["---", f"pretty_name: {json.dumps(contents.settings.title)}"]
    if contents.settings.license:
        lines += [f"license: {json.dumps(contents.settings.license)}"]
    lines += ["configs:"]
    for table in tally.files:
        lines += [f"- config_name: {table}", f"  data_files: {table}/*.parquet"]
    return "\n".join([*lines, "---"])


def _reading(table: str) -> str:
    return _READING.format(table=table, sums=SUMS)


def _tables(contents: Contents, tally: Tally) -> str:
    lines = ["## Tables", "", "| table | a row is | rows | files | version |", "|---|---|---|---|---|"]
    for table, files in tally.files.items():
        schema = contents.schemas[table]
        lines.append(f"| `{table}` | {schema['row']} | {tally.rows[table]} | {len(files)} | {schema['version']} |")
    return "\n".join([*lines, "", _CONVENTIONS])


def _quality(contents: Contents, tally: Tally) -> str:
    lines = ["## Quality", ""]
    words = {"ok": "nothing to remark", "look": "worth a look", "unusable": "unusable"}
    for word, said in words.items():
        if names := [name for name, verdict in tally.verdicts.items() if verdict == word]:
            named = "" if word == "ok" else f": {', '.join(f'`{name}`' for name in names)}"
            lines.append(f"- {len(names)} recordings: {said}{named}")
    if contents.left_out:
        lines.append(f"- left out: {len(contents.left_out)}")
        shown = list(contents.left_out.items())[:_MOST_LEFT_OUT]
        lines += [f"  - `{name}`: {_plain(why)}" for name, why in shown]
        if (more := len(contents.left_out) - len(shown)) > 0:
            lines.append(f"  - and {more} more, named in `snapshot.json`")
    return "\n".join(lines) if len(lines) > 2 else ""  # more than heading and blank line


def _plain(text: str) -> str:
    """Return a text on one line, in which Markdown sees nothing but text."""
    return "".join(f"\\{letter}" if letter in "\\`*_<>[]|" else letter for letter in " ".join(text.split()))


def _uncertainty(tally: Tally) -> str:
    rows = [
        f"| `{table}.{each.column}` | {_stated(each)} | {each.null_share:.1%} |"
        for table in tally.files
        for each in tally.certainties(table)
    ]
    if not rows:
        return ""
    head = [
        "## How certain it says it is",
        "",
        "Median of the stated standard uncertainties, and how many rows have no value:",
        "",
        "| column | median standard uncertainty | without value |",
        "|---|---|---|",
    ]
    return "\n".join([*head, *rows, "", _TESTED])


def _stated(found: Certainty) -> str:
    return "unknown" if found.median_std is None else f"{found.median_std:.3g} {found.unit}"


def _making(contents: Contents, tally: Tally, made_with: Mapping[str, str]) -> str:
    libraries = ", ".join(f"{name} {version}" for name, version in made_with.items())
    lines = [f"## How it was made\n\nBy {libraries}.\n\n{_MADE}"]
    if contents.variant:
        lines += ["", f"These are the results of the variant `{contents.variant}`."]
    for stage, ways in tally.settings().items():
        lines += ["", f"**{stage}**" + ("" if len(ways) == 1 else f", in {len(ways)} ways")]
        lines += list(_ways(ways))
    return "\n".join(lines)


def _ways(ways: list[dict[str, Any]]) -> Iterator[str]:
    for way in ways:
        params = ", ".join(f"{name} = {json.dumps(value)}" for name, value in sorted(way["params"].items()))
        yield f"- code `{way['code'][:12]}`, {way['files']} files" + (f": `{params}`" if params else "")


def _rights(contents: Contents) -> str:
    settings = contents.settings
    creators = f"\n\nBy {', '.join(settings.creators)}." if settings.creators else ""
    url = f"\n\n<{settings.url}>" if settings.url else ""
    licence = settings.license or "Not stated: ask whoever gave you this before you hand it on."
    cited = f"{settings.citation.strip()}\n\n" if settings.citation.strip() else ""
    return f"## Licence\n\n{licence}{creators}{url}\n\n## To cite\n\n{cited}{THESIS}"
