"""Tables of one's own against truth of the same name: errors planted, errors found."""

from __future__ import annotations

import json
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.errors import DataWarning, StoreError, TableError, WorkspaceError
from garment_dataset.score.recordings import score
from garment_dataset.score.tables import ColumnScore, column_errors, score_column, uncertainty_column

if TYPE_CHECKING:
    from pathlib import Path

LENGTHS = TableSpec(
    "lengths",
    1,
    "one point of one frame",
    (
        Column("frame", "int32", "1", "index"),
        Column("point", "int32", "1", "number"),
        Column("length_m", "float64", "m", "a length", True, "doubt_m"),
        Column("doubt_m", "float64", "m", "how well it is known", True),
        Column("reason", "string", "", "why there is none", True),
    ),
    keys=("frame", "point"),
)
DESCRIBED = LENGTHS.describe()
FRAMES, POINTS = 10, 2


def truth_table() -> pd.DataFrame:
    frame, point = np.repeat(np.arange(FRAMES), POINTS), np.tile(np.arange(1, POINTS + 1), FRAMES)
    return pd.DataFrame({"frame": frame, "point": point, "length_m": 0.5 + 0.01 * frame, "vz_m_s": 0.1 * point})


def features_table(*, shift_m: float = 0.0) -> pd.DataFrame:
    found = truth_table()
    return found.assign(length_m=found["length_m"] + shift_m, doubt_m=0.002, vz_std_m_s=0.05, reason="none")


def scores_of(features: pd.DataFrame, truth: pd.DataFrame, described: Any = DESCRIBED) -> dict[str, ColumnScore]:
    return {one.column: score_column(one, "r", "lengths") for one in column_errors(features, truth, described)}


def test_a_shift_is_found_in_every_figure() -> None:
    scores = scores_of(features_table(shift_m=-0.004), truth_table())
    assert list(scores) == ["length_m", "vz_m_s"]
    length = scores["length_m"]
    assert (length.recording, length.table, length.expected, length.coverage) == ("r", "lengths", 20, 1.0)
    assert [length.rms, length.median, length.p95, length.variance] == pytest.approx([0.004, 0.004, 0.004, 4.0])
    speed = scores["vz_m_s"]
    assert (speed.rms, speed.median, speed.p95, speed.variance) == (0.0, 0.0, 0.0, 0.0)


def test_the_figures_are_told_apart() -> None:
    features = features_table()
    features.loc[features["frame"] == 9, "length_m"] += 0.004
    length = scores_of(features, truth_table())["length_m"]
    assert [length.rms, length.median, length.p95] == pytest.approx([0.004 / np.sqrt(10), 0.0, 0.004])


def test_rows_are_matched_whatever_their_order_and_the_text_beside_them() -> None:
    truth = truth_table().sample(frac=1, random_state=1).assign(reason="other")
    assert scores_of(features_table(shift_m=0.01), truth)["length_m"].rms == pytest.approx(0.01)


def test_missing_values_lower_coverage_and_nothing_else() -> None:
    features = features_table(shift_m=0.001)
    features.loc[features["frame"] == 0, "length_m"] = np.nan
    some = features[features["frame"] < 5]
    length = scores_of(some, truth_table())["length_m"]
    assert [length.coverage, length.rms] == pytest.approx([0.4, 0.001])
    truth = truth_table()
    truth.loc[truth["frame"] < 5, "length_m"] = np.nan
    assert scores_of(features, truth)["length_m"].expected == 10
    nothing = scores_of(features[:0], truth_table())["length_m"]
    assert (nothing.coverage, nothing.rms, nothing.median, nothing.p95, nothing.variance) == (
        0.0,
        None,
        None,
        None,
        None,
    )
    assert scores_of(features, truth_table().assign(length_m=np.nan))["length_m"].coverage is None


def test_rows_that_the_truth_has_not_are_left_out() -> None:
    length = scores_of(features_table(shift_m=0.001), truth_table()[:4])["length_m"]
    assert (length.expected, length.coverage) == (4, 1.0)


def test_an_uncertainty_is_the_declared_one_or_found_by_its_name() -> None:
    features = features_table(shift_m=0.004).assign(length_std_m=0.004)
    assert scores_of(features, truth_table())["length_m"].variance == pytest.approx(4.0)
    assert scores_of(features, truth_table(), {})["length_m"].variance == pytest.approx(1.0)
    older = features.drop(columns="doubt_m")
    assert scores_of(older, truth_table())["length_m"].variance == pytest.approx(1.0)
    assert scores_of(older.drop(columns="length_std_m"), truth_table())["length_m"].variance is None
    assert scores_of(features.assign(doubt_m=0.0), truth_table())["length_m"].variance is None


@pytest.mark.parametrize(
    ("column", "std"),
    [
        ("length_m", "length_std_m"),
        ("vz_m_s", "vz_std_m_s"),
        ("share", "share_std"),
        ("angle_rad", "angle_rad_std"),
        ("force_N", "force_std_N"),
        ("other_m", None),
    ],
)
def test_names_of_uncertainties(column: str, std: str | None) -> None:
    names = ["length_std_m", "vz_std_m_s", "share_std", "angle_rad_std", "force_std_N", "std", "std_other_m"]
    assert uncertainty_column(column, names) == std


def test_without_a_description_all_labels_in_common_are_keys() -> None:
    truth = truth_table()
    assert scores_of(features_table(shift_m=0.1), truth, {})["length_m"].rms == pytest.approx(0.1)
    lists = pd.Series([[0.0, 1.0]] * 20, dtype=object)
    whole = truth.assign(length_m=1, recording="r")
    features = features_table().assign(length_m=1.5, recording="r", shape=lists)
    assert scores_of(features, whole, {})["length_m"].rms == pytest.approx(0.5), "whole numbers are a truth as well"
    same = whole.assign(shape=lists)
    assert scores_of(features, same, {})["length_m"].rms == pytest.approx(0.5), "lists tell no rows apart"


@pytest.mark.parametrize(
    ("truth", "message"),
    [
        (truth_table()[["length_m"]], r"nothing to match rows by: expected columns of \['frame', 'point'\], found"),
        (truth_table()[["frame", "length_m"]], "rows of the features are not told apart: expected one row for each f"),
        (pd.concat([truth_table()] * 2), "rows of the truth are not told apart: .* frame, point, found 20 more"),
        (truth_table()[["frame", "point"]], r"no quantity to compare: expected one of \['length_m'"),
        (truth_table().astype({"frame": "str"}), "keys of another type"),
        (truth_table().astype({"length_m": "str"}), "length_m: a quantity that is no number"),
    ],
)
def test_truth_that_does_not_fit_is_refused(truth: pd.DataFrame, message: str) -> None:
    with pytest.raises(TableError, match=message):
        column_errors(features_table(), truth, DESCRIBED)


def place(root: Path, table: str, name: str, variant: str = "") -> Path:
    folder = root / "features" / (f"variant={variant}" if variant else "") / table / "garment=G" / "holding=R"
    folder.mkdir(parents=True, exist_ok=True)
    return folder / f"{name}.parquet"


@pytest.fixture
def built(tmp_path: Path) -> Path:
    """Write a table of one's own and its truth, of two recordings and in a variant, off by 1, 2 and 10 mm."""
    for name, shift_m in (("one", 0.001), ("two", 0.002)):
        truth = tmp_path / "recordings" / f"{name}.truth"
        truth.mkdir(parents=True)
        truth_table().to_parquet(truth / "lengths.parquet")
        features_table(shift_m=shift_m).assign(recording=name).to_parquet(place(tmp_path, "lengths", name))
    features_table(shift_m=0.01).assign(recording="one").to_parquet(place(tmp_path, "lengths", "one", "wide"))
    return tmp_path


def rms_of(root: Path, variant: str = "") -> dict[str, float | None]:
    scores = score(root / "features", root / "recordings", variant)
    assert (scores.points, scores.silhouettes) == ((), ())
    return {row.recording: row.rms for row in scores.tables if row.column == "length_m"}


def test_recordings_one_by_one_and_pooled(built: Path) -> None:
    found = rms_of(built)
    assert list(found) == ["one", "two", "all"]
    assert list(found.values()) == pytest.approx([0.001, 0.002, np.sqrt(2.5e-6)])


def test_a_variant_is_scored_by_its_own_files(built: Path) -> None:
    assert rms_of(built, "wide") == {"one": pytest.approx(0.01)}
    with pytest.raises(StoreError, match=r"no variant 'wid': expected one of wide. Did you mean wide"):
        score(built / "features", built / "recordings", "wid")


def test_a_folder_of_variants_alone_is_a_features_folder(built: Path) -> None:
    (built / "features" / "lengths").rename(built / "elsewhere")
    assert rms_of(built, "wide") == {"one": pytest.approx(0.01)}
    with pytest.raises(StoreError, match="no features of a recording with truth"):
        score(built / "features", built / "recordings")
    (built / "empty").mkdir()
    with pytest.raises(WorkspaceError, match="not a workspace"):
        score(built / "empty", built / "recordings")


def test_keys_are_those_that_lie_beside_the_files(built: Path) -> None:
    for name in ("one", "two"):
        path = built / "recordings" / f"{name}.truth" / "lengths.parquet"
        truth_table().assign(reason="not that of the features").to_parquet(path)
    assert rms_of(built) == {"one": None, "two": None, "all": None}, "the text is taken for a key"
    (built / "features" / "schemas.json").write_text(json.dumps({"lengths": DESCRIBED}))
    assert rms_of(built) == {
        name: pytest.approx(value)
        for name, value in zip(("one", "two", "all"), (0.001, 0.002, np.sqrt(2.5e-6)), strict=True)
    }


def test_truth_that_does_not_fit_is_said_and_the_rest_is_scored(built: Path) -> None:
    path = built / "recordings" / "one.truth" / "lengths.parquet"
    truth_table()[["length_m"]].to_parquet(path)
    with pytest.warns(DataWarning, match="not scored: .*one.truth/lengths.parquet: nothing to match rows by"):
        assert rms_of(built) == {"two": pytest.approx(0.002)}
    path.write_bytes(b"no Parquet")
    with pytest.warns(DataWarning, match="not scored: .*one.truth/lengths.parquet: cannot be read as Parquet"):
        assert rms_of(built) == {"two": pytest.approx(0.002)}


def test_truth_of_what_was_not_built_is_passed_over(built: Path) -> None:
    truth = built / "recordings" / "three.truth"
    truth.mkdir()
    truth_table().to_parquet(truth / "lengths.parquet")
    truth_table().to_parquet(truth / "widths.parquet")
    features_table().assign(group="all").to_parquet(place(built, "widths", "all"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert list(rms_of(built)) == ["one", "two", "all"]


@pytest.mark.parametrize("source", ["points", "tracks"])
def test_kinematics_of_tracks_are_compared_with_the_material(tmp_path: Path, source: str) -> None:
    """And those of points are not: these are compared with what is seen, beside the points."""
    truth = tmp_path / "recordings" / "one.truth"
    truth.mkdir(parents=True)
    truth_table().to_parquet(truth / "tracks.parquet")
    own = features_table(shift_m=0.001).assign(recording="one", source=source)
    own.to_parquet(place(tmp_path, "kinematics", "one"))
    features_table().assign(recording="one").to_parquet(place(tmp_path, "tracks", "one"))
    scores = score(tmp_path / "features", tmp_path / "recordings")
    assert scores.points == ()
    found = {row.table: row.rms for row in scores.tables if row.column == "length_m"}
    assert found.pop("tracks") == pytest.approx(0)
    assert found == ({"kinematics": pytest.approx(0.001)} if source == "tracks" else {})
