"""Write a new stage into a workspace: its file, a test that runs, and its name in garment.toml."""

from __future__ import annotations

import keyword
import re
from typing import TYPE_CHECKING, Literal

from garment_dataset.errors import UsageError
from garment_dataset.layout import SETTINGS, Layout, read_toml
from garment_dataset.workspace.known_stages import KnownStages, refuse_shadow

if TYPE_CHECKING:
    from pathlib import Path

Covering = Literal["recording", "repeats"]
"""What one run of the new stage covers."""

_MODULES = re.compile(r"^modules\s*=\s*\[(?P<names>[^\]]*)\]", re.MULTILINE)

_RECORDING = '''"""Stage ``{name}``: how far the last point is from the gripper in every depth frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from garment_dataset.stages import FRAME, STAMP, Column, Stage, StageParams, TableSpec

if TYPE_CHECKING:
    import pyarrow as pa

{upper} = TableSpec(
    "{name}",
    1,
    "one depth frame",
    (FRAME, STAMP, Column("reach_m", "float64", "m", "from the gripper to the last point", nullable=True)),
    keys=("frame",),
)


class {camel}Params(StageParams):
    """Knobs of the stage."""

    longest_m: float = Field(default=2.0, gt=0, description="what seems longer is null: no garment is")


def {name}(kinematics: pa.Table, params: {camel}Params) -> dict[str, pa.Table]:
    """Measure the distance between the gripper, point 0, and the last point."""
    import numpy as np  # heavy libraries are imported where they are used: `garment --help` stays light

    point = kinematics["point"].to_numpy()
    at = np.stack([kinematics[name].to_numpy() for name in ("x_m", "y_m", "z_m")])
    first, last = point == 0, point == point.max(initial=0)
    reach_m = np.linalg.norm(at[:, last] - at[:, first], axis=0)
    reach_m[reach_m > params.longest_m] = np.nan
    columns = {{name: kinematics[name].to_numpy()[first] for name in ("frame", "stamp_ns")}}
    return {{"{name}": {upper}.table({{**columns, "reach_m": reach_m}})}}


STAGE = Stage({name}, params={camel}Params, outputs=({upper},))
'''

_RECORDING_TEST = '''"""A known answer: a point 3 m to the side of and 4 m below the gripper is 5 m away."""

import pyarrow as pa

from {name} import {camel}Params, {name}


def test_the_reach_is_the_distance_to_the_last_point() -> None:
    kinematics = pa.table(
        {{
            "frame": [0, 0, 1, 1],
            "stamp_ns": [10, 10, 20, 20],
            "point": [0, 1, 0, 1],
            "x_m": [0.0, 3.0, 0.0, None],
            "y_m": [0.0, 4.0, 0.0, None],
            "z_m": [1.0, 1.0, 1.0, None],
        }}
    )
    table = {name}(kinematics, {camel}Params(longest_m=9.0))["{name}"]
    assert table["reach_m"].to_pylist() == [5.0, None]
    assert {name}(kinematics, {camel}Params())["{name}"]["reach_m"].to_pylist() == [None, None]
'''

_REPEATS = '''"""Stage ``{name}``: how far the repeats of one movement take the last point."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.stages import REPEATS, Column, Stage, StageParams, TableSpec

if TYPE_CHECKING:
    import pyarrow as pa

{upper} = TableSpec(
    "{name}",
    1,
    "one repeat",
    (
        Column("recording", "string", "", "name of the repeat"),
        Column("farthest_m", "float64", "m", "largest displacement of the last point along z", nullable=True),
    ),
    keys=("recording",),
)


class {camel}Params(StageParams):
    """No knobs yet."""


def {name}(kinematics: dict[str, pa.Table], params: {camel}Params) -> dict[str, pa.Table]:
    """Take the largest displacement of the last point, repeat by repeat."""
    import numpy as np

    farthest_m = []
    for table in kinematics.values():
        point = table["point"].to_numpy()
        dz_m = np.abs(table["dz_m"].to_numpy()[point == point.max(initial=0)])
        farthest_m.append(np.nanmax(dz_m) if np.isfinite(dz_m).any() else None)
    return {{"{name}": {upper}.table({{"recording": list(kinematics), "farthest_m": farthest_m}})}}


STAGE = Stage({name}, params={camel}Params, outputs=({upper},), per=REPEATS)
'''

_REPEATS_TEST = '''"""A known answer: of -3, 2 and nothing the farthest is 3."""

import pyarrow as pa

from {name} import {camel}Params, {name}


def test_the_farthest_displacement_of_each_repeat_is_taken() -> None:
    repeats = {{
        "first": pa.table({{"point": [0, 1, 1, 1], "dz_m": [9.0, -3.0, 2.0, None]}}),
        "second": pa.table({{"point": [0, 1], "dz_m": [9.0, None]}}),
    }}
    table = {name}(repeats, {camel}Params())["{name}"]
    assert table.to_pydict() == {{"recording": ["first", "second"], "farthest_m": [3.0, None]}}
'''

_FORMS: dict[Covering, tuple[str, str]] = {
    "recording": (_RECORDING, _RECORDING_TEST),
    "repeats": (_REPEATS, _REPEATS_TEST),
}


def write_stage(layout: Layout, name: str, covering: Covering) -> tuple[list[Path], str | None]:
    """Write a stage, its test, and its name in garment.toml.

    Parameters
    ----------
    layout : Layout
        The workspace.
    name : str
        Of the stage, its module and its table.
    covering : {"recording", "repeats"}
        What one run covers.

    Returns
    -------
    written : list of Path
        The files.
    to_add : str or None
        What a person must add to garment.toml, when it has a form that is not edited here.

    Raises
    ------
    UsageError
        If the name cannot be that of a module or is taken, or a file is in the way: nothing is ever overwritten.
    StageError
        If Python knows another module of that name.
    """
    if not name.isidentifier() or keyword.iskeyword(name) or name != name.lower() or name.startswith(("_", "test_")):
        raise UsageError("not a name for a stage", expected="lower-case letters, digits and _", found=repr(name))
    if name in KnownStages.of(layout):
        raise UsageError(f"there is a stage {name!r} already", where=layout.root, hint="Choose another name.")
    file, test = layout.stages_dir / f"{name}.py", layout.stages_dir / f"test_{name}.py"
    refuse_shadow(name, file)
    for path in (file, test):
        if path.exists():
            raise UsageError("in the way of a new stage", where=path, hint="Nothing was written.")
    layout.stages_dir.mkdir(parents=True, exist_ok=True)
    words = {"name": name, "upper": name.upper(), "camel": "".join(word.capitalize() for word in name.split("_"))}
    for path, form in zip((file, test), _FORMS[covering], strict=True):
        path.write_text(form.format(**words), "utf-8")
    return [file, test], _name_in_settings(layout.root / SETTINGS, name)


def _name_in_settings(path: Path, name: str) -> str | None:
    """Add a module to garment.toml; return what to add by hand when the file is not in one of the usual forms."""
    text = path.read_text("utf-8-sig") if path.is_file() else ""
    if "stages" not in (read_toml(path) if text else {}):
        changed = f'{text.rstrip()}\n\n[stages]\nmodules = ["{name}"]\n'.lstrip()
    elif (found := _MODULES.search(text)) is not None:
        names = found["names"].rstrip().rstrip(",")
        changed = text[: found.start("names")] + (f'{names}, "{name}"' if names.strip() else f'"{name}"')
        changed += text[found.end("names") :]
    else:
        return f'{path}: under [stages], modules = ["{name}"]'
    path.write_text(changed, "utf-8")
    return None
