"""What `garment new stage` writes: Python as it stands, with the name ``example`` to be replaced."""

from __future__ import annotations

from typing import Literal, NamedTuple

Covering = Literal["recording", "position", "repeats"]
"""What one run of a new stage covers."""


class Form(NamedTuple):
    """The text of a stage and of its test, and the stages that feed it."""

    stage: str
    test: str
    feeders: tuple[str, ...]


_RECORDING = '''"""Stage ``example``: how far the last point is from the gripper in every depth frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.stages import FRAME, STAMP, Column, Field, Stage, StageParams, TableSpec

if TYPE_CHECKING:
    import pyarrow as pa

EXAMPLE = TableSpec(
    "example",
    1,
    "one depth frame",
    (FRAME, STAMP, Column("reach_m", "float64", "m", "from the gripper to the last point", nullable=True)),
    keys=("frame",),
)


class ExampleParams(StageParams):
    """Knobs of the stage."""

    longest_m: float = Field(default=2.0, gt=0, description="what seems longer is null: no garment is")


def example(kinematics: pa.Table, params: ExampleParams) -> dict[str, pa.Table]:
    """Measure the distance between the gripper, which is point 0, and the last point."""
    import numpy as np  # here, not above: `garment --help` stays light

    point = kinematics["point"].to_numpy()
    first, last = point == 0, point == point.max(initial=0)
    at_m = np.stack([kinematics[name].to_numpy() for name in ("x_m", "y_m", "z_m")])
    reach_m = np.linalg.norm(at_m[:, last] - at_m[:, first], axis=0)
    reach_m[reach_m > params.longest_m] = np.nan
    columns = {name: kinematics[name].to_numpy()[first] for name in ("frame", "stamp_ns")}
    return {"example": EXAMPLE.table({**columns, "reach_m": reach_m})}


STAGE = Stage(example, params=ExampleParams, outputs=(EXAMPLE,))
'''

_RECORDING_TEST = '''"""A known answer: a point 3 m to the side of the gripper and 4 m below it is 5 m away."""

import pyarrow as pa
from example import ExampleParams, example


def test_the_reach_is_the_distance_to_the_last_point() -> None:
    kinematics = pa.table(
        {
            "frame": [0, 0, 1, 1],
            "stamp_ns": [10, 10, 20, 20],
            "point": [0, 1, 0, 1],
            "x_m": [0.0, 3.0, 0.0, None],
            "y_m": [0.0, 4.0, 0.0, None],
            "z_m": [1.0, 1.0, 1.0, None],
        }
    )
    for longest_m, reach_m in ((9.0, [5.0, None]), (4.0, [None, None])):
        table = example(kinematics, ExampleParams(longest_m=longest_m))["example"]
        assert table["reach_m"].to_pylist() == reach_m
'''

_POSITION = '''"""Stage ``example``: how bright the empty scene is, and how much its pixels scatter."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.stages import Column, Field, Stage, StageParams, TableSpec

if TYPE_CHECKING:
    import pyarrow as pa

EXAMPLE = TableSpec(
    "example",
    1,
    "one colour channel",
    (
        Column("channel", "string", "", "r, g or b"),
        Column("mean_level", "float64", "level", "mean over all pixels"),
        Column("std_level", "float64", "level", "standard deviation in time, of a pixel that stands for all"),
    ),
    keys=("channel",),
)


class ExampleParams(StageParams):
    """Knobs of the stage."""

    quantile: float = Field(default=0.5, ge=0, le=1, description="of the pixels' deviations; 0.5: the median")


def example(background: pa.Table, params: ExampleParams) -> dict[str, pa.Table]:
    """Summarise mean and standard deviation over the pixels, channel by channel."""
    import numpy as np  # here, not above: `garment --help` stays light
    import pyarrow.compute as pc

    mean, std = (pc.list_flatten(background[name]).to_numpy().reshape(-1, 3) for name in ("mean", "std"))
    columns = {"mean_level": mean.mean(axis=0), "std_level": np.quantile(std, params.quantile, axis=0)}
    return {"example": EXAMPLE.table({"channel": ["r", "g", "b"], **columns})}


STAGE = Stage(example, params=ExampleParams, outputs=(EXAMPLE,), per="position")
'''

_POSITION_TEST = '''"""A known answer: three pixels in one row of the image."""

import pyarrow as pa
from example import ExampleParams, example


def test_each_channel_is_summarised_over_the_pixels() -> None:
    mean, std = [1.0, 10.0, 7.0, 2.0, 20.0, 7.0, 3.0, 30.0, 7.0], [0.0, 1.0, 5.0, 1.0, 2.0, 5.0, 8.0, 6.0, 5.0]
    background = pa.table({"mean": [mean], "std": [std]})
    for quantile, std_level in ((0.5, [1, 2, 5]), (1.0, [8, 6, 5])):
        table = example(background, ExampleParams(quantile=quantile))["example"]
        assert table.to_pydict() == {"channel": ["r", "g", "b"], "mean_level": [2, 20, 7], "std_level": std_level}
'''

_REPEATS = '''"""Stage ``example``: how far the last point moves in each repeat of a movement."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.stages import REPEATS, Column, Field, Stage, StageParams, TableSpec

if TYPE_CHECKING:
    import pyarrow as pa

EXAMPLE = TableSpec(
    "example",
    1,
    "one repeat",
    (
        Column("recording", "string", "", "name of the repeat"),
        Column("farthest_m", "float64", "m", "how far the last point goes along z", nullable=True),
    ),
    keys=("recording",),
)


class ExampleParams(StageParams):
    """Knobs of the stage."""

    quantile: float = Field(default=1.0, ge=0, le=1, description="of the displacements in time; 1: the largest")


def example(kinematics: dict[str, pa.Table], params: ExampleParams) -> dict[str, pa.Table]:
    """Take the displacement of the last point when it is farthest, repeat by repeat."""
    import numpy as np  # here, not above: `garment --help` stays light

    farthest_m = []
    for table in kinematics.values():
        point = table["point"].to_numpy()
        dz_m = np.abs(table["dz_m"].to_numpy()[point == point.max(initial=0)])
        farthest_m.append(np.nanquantile(dz_m, params.quantile) if np.isfinite(dz_m).any() else None)
    return {"example": EXAMPLE.table({"recording": list(kinematics), "farthest_m": farthest_m})}


STAGE = Stage(example, params=ExampleParams, outputs=(EXAMPLE,), per=REPEATS)
'''

_REPEATS_TEST = '''"""A known answer: of -3 m, 2 m and nothing the farthest is 3 m."""

import pyarrow as pa
from example import ExampleParams, example


def test_the_farthest_displacement_of_each_repeat_is_taken() -> None:
    repeats = {
        "first": pa.table({"point": [0, 1, 1, 1], "dz_m": [9.0, -3.0, 2.0, None]}),
        "second": pa.table({"point": [0, 1], "dz_m": [9.0, None]}),
    }
    for quantile, farthest_m in ((1.0, [3.0, None]), (0.0, [2.0, None])):
        table = example(repeats, ExampleParams(quantile=quantile))["example"]
        assert table.to_pydict() == {"recording": ["first", "second"], "farthest_m": farthest_m}
'''

_DEPTH, _COLOR = ("decode", "depth_points", "kinematics"), ("decode", "background")

FORMS: dict[Covering, Form] = {
    "recording": Form(_RECORDING, _RECORDING_TEST, _DEPTH),
    "position": Form(_POSITION, _POSITION_TEST, _COLOR),
    "repeats": Form(_REPEATS, _REPEATS_TEST, _DEPTH),
}
