"""Filters take what people hold in their hands: arrays, Series, ranges, nothing; and refuse what cannot be meant."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

from garment_dataset import Catalog, load_features
from garment_dataset.errors import FilterError
from tests.conftest import RECORDINGS

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace


@pytest.mark.parametrize(
    ("wanted", "points"),
    [
        (5, {5}),
        (np.int64(5), {5}),
        (5.0, {5}),
        ((1, 2), {1, 2}),
        ({1, 2}, {1, 2}),
        (np.array([1, 5]), {1, 5}),
        (np.array([1.0, 5.0]), {1, 5}),
        (np.array(5), {5}),
        (pd.Series([1, 5]), {1, 5}),
        (pd.Series([1, None], dtype="Int64"), {1}),
        (pd.Index([1, 5]), {1, 5}),
        (pd.Categorical([1, 5]), {1, 5}),
        (pl.Series([1, 5]), {1, 5}),
        (pa.chunked_array([[1], [5]]), {1, 5}),
        (range(1, 4), {1, 2, 3}),
        ((number for number in (1, 2)), {1, 2}),
        (7, set()),
        ([], set()),
        (np.array([]), set()),
        (pd.Series([], dtype="float64"), set()),
        (None, set()),
    ],
)
def test_numbers(varied: Workspace, wanted: Any, points: set[int]) -> None:
    everything = load_features("points", folder=varied.features_dir)
    found = load_features("points", folder=varied.features_dir, point=wanted)
    assert set(found["point"]) == points
    assert len(found) == len(points) * 3 * 24
    assert list(found.columns) == list(everything.columns)
    assert list(found.dtypes) == list(everything.dtypes)
    assert found.attrs == everything.attrs


@pytest.mark.parametrize("filters", [{"garment": []}, {"recording": np.array([], dtype=object)}, {"garment": None}])
def test_no_text_at_all(varied: Workspace, filters: dict[str, Any]) -> None:
    found = load_features("points", folder=varied.features_dir, **filters)
    assert found.empty
    assert {"garment", "recording", "z_m"} <= set(found.columns)


def test_nulls_can_be_asked_for(varied: Workspace) -> None:
    points = load_features("points", folder=varied.features_dir)
    for wanted in (None, [None], np.array([None]), pd.Series([np.nan], dtype=object)):
        found = load_features("points", folder=varied.features_dir, repeat=wanted)
        assert set(found["recording"]) == {RECORDINGS[2]}
    both = load_features("points", folder=varied.features_dir, repeat=[1, None])
    assert set(both["recording"]) == {RECORDINGS[0], RECORDINGS[2]}
    assert len(load_features("points", folder=varied.features_dir, reason=None)) == points["reason"].isna().sum()


@pytest.mark.parametrize(
    ("filters", "message"),
    [
        ({"point": "1"}, "points.point: values of another type: expected int32, found '1'"),
        ({"point": ["a"]}, "points.point: values of another type: expected int32, found ['a']"),
        ({"point": [2**40]}, "points.point: values of another type: expected int32, found [1099511627776]"),
        ({"point": [1, 1.5]}, "points.point: values of another type: expected int32, found [1.5]"),
        ({"point": np.inf}, "points.point: values of another type: expected int32, found "),
        ({"point": True}, "points.point: values of another type: expected int32, found True"),
        ({"point": np.array([[1, 2]])}, "points.point: values of another type: expected int32, found [[1, 2]]"),
        ({"speed": False}, "points.speed: values of another type: expected double, found [False]"),
        ({"garment": 3}, "points.garment: values of another type: expected string, found 3"),
        ({"garment": b"GreenTowel"}, "points.garment: values of another type: expected string, found [b'GreenTowel']"),
        ({"recording": np.arange(9)}, "points.recording: values of another type: expected string, found [0, 1, 2, "),
    ],
)
def test_values_of_another_type_are_refused_in_one_line(
    varied: Workspace, filters: dict[str, Any], message: str
) -> None:
    with pytest.raises(FilterError) as caught:
        load_features("points", folder=varied.features_dir, **filters)
    text = str(caught.value)
    assert text.startswith(message)
    assert len(text) < 160
    assert "\n" not in text


def test_lists_and_bytes_are_no_filters(color_workspace: Workspace) -> None:
    color_workspace.build(jobs=0)
    for table, column in (("background", "mean"), ("silhouettes", "mask")):
        filters: dict[str, Any] = {column: None}
        with pytest.raises(FilterError, match=f"{table}.{column}: a column that is no filter: expected text or a num"):
            load_features(table, folder=color_workspace.features_dir, **filters)


def test_what_a_query_found_is_a_filter(varied: Workspace) -> None:
    catalog = varied.catalog()
    wanted = catalog.query(garment="GreenTowel", axis="R", state="present")
    assert len(wanted) == 2
    found = load_features("points", folder=varied.features_dir, recording=wanted["recording"])
    assert set(found["recording"]) == set(RECORDINGS[:2])
    again = load_features("points", folder=varied.features_dir, garment=wanted["garment"], repeat=wanted["repeat"])
    assert set(again["recording"]) == set(RECORDINGS[:2])


@pytest.mark.parametrize(
    ("filters", "same"),
    [
        ({"garment": pd.Series(["GreenTowel", "RedSkirt"])}, {"garment": ["GreenTowel", "RedSkirt"]}),
        ({"garment": np.array(["GreenTowel"])}, {"garment": "GreenTowel"}),
        ({"garment": pd.Categorical(["GreenTowel"])}, {"garment": "GreenTowel"}),
        ({"repeat": np.array([1, 2])}, {"repeat": [1, 2]}),
        ({"repeat": range(1, 3)}, {"repeat": [1, 2]}),
        ({"repeat": pd.Series([1, None], dtype="Int64")}, {"repeat": [1, None]}),
        ({"repeat": np.array([1.0, np.nan])}, {"repeat": [1, None]}),
        ({"speed": np.float64(0.5)}, {"speed": 0.5}),
        ({"swing_rad": np.array([np.pi / 16])}, {"swing_rad": "pi16"}),
        ({"dvd": np.True_}, {"dvd": True}),
        ({"garment": {"GreenTowel": 1}.keys()}, {"garment": "GreenTowel"}),
    ],
)
def test_the_catalog_takes_the_same(filters: dict[str, Any], same: dict[str, Any]) -> None:
    catalog = Catalog.load()
    found, expected = catalog.query(**filters), catalog.query(**same)
    assert len(expected) > 0
    pd.testing.assert_frame_equal(found, expected)


@pytest.mark.parametrize("key", ["recording", "garment", "repeat", "dvd", "speed"])
@pytest.mark.parametrize("nothing", [[], np.array([]), pd.Series([], dtype=object), range(0)])
def test_of_an_empty_list_the_catalog_has_nothing(key: str, nothing: Any) -> None:
    catalog = Catalog.load()
    found = catalog.query(**{key: nothing})
    assert found.empty
    assert list(found.dtypes) == list(catalog.query().dtypes)
