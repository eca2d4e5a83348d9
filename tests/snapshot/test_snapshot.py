"""Snapshots: every reader finds the same rows, all is described, nothing is lost, equal results give equal bytes."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from garment_dataset import load_features
from garment_dataset.errors import StoreError, UsageError
from garment_dataset.features.reading import result_files, table_description, tables_in
from garment_dataset.snapshot.changes import changes
from garment_dataset.snapshot.contents import gather
from garment_dataset.snapshot.sums import compare, sums_of
from garment_dataset.snapshot.writing import read_manifest, write_snapshot
from garment_dataset.workspace import Workspace
from garment_dataset.workspace.session import Session
from tests.conftest import COLOR_RECORDINGS, write_color_recording

if TYPE_CHECKING:
    from collections.abc import Sequence

PAGE = Path(__file__).parents[2] / "docs" / "snapshots.md"
SNIPPETS = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
KEYS = ["recording", "frame", "point"]


def export(workspace: Workspace, folder: Path, filters: Sequence[str] = (), tables: Sequence[str] = ()) -> Path:
    with Session(workspace, filters) as session:
        write_snapshot(gather(session, tables), folder)
    return folder


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory, sample_bags: dict[str, Path]) -> Workspace:
    """A workspace of all stages: depth and colour, an empty scene, a garment that the catalog does not know."""
    made = Workspace.create(tmp_path_factory.mktemp("snapshot") / "ws")
    for name, path in sample_bags.items():
        (made.recordings_dir / f"{name}.bag").symlink_to(path)
    write_color_recording(made.recordings_dir / f"{COLOR_RECORDINGS[0]}.bag", seed=0)
    write_color_recording(made.recordings_dir / "camera_default_0.bag", empty_frames=6, seed=9)
    made.build(jobs=0)
    return made


@pytest.fixture(scope="module")
def snapshot(built: Workspace, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export(built, tmp_path_factory.mktemp("out") / "snapshot")


@pytest.fixture
def copied(snapshot: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(snapshot, tmp_path / "copied"))


def in_one_order(frame: pd.DataFrame) -> pd.DataFrame:
    texts = {"recording", "garment", "holding", "axis", "source", "time_reason", "reason"}
    kinds = {name: "object" if name in texts or name.endswith("reason") else "float64" for name in frame.columns}
    frame = frame.copy()
    for name in texts & set(frame.columns):
        frame[name] = [_text(each) for each in frame[name]]
    return frame.astype(kinds).sort_values(KEYS, ignore_index=True)


def _text(value: Any) -> str | None:
    return value.decode() if isinstance(value, bytes) else value if isinstance(value, str) else None


@pytest.mark.parametrize("snippet", SNIPPETS, ids=lambda text: re.sub(r"\W+", "-", text)[-50:])
def test_every_reader_of_the_page_finds_the_same_rows(
    built: Workspace, snapshot: Path, snippet: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for module in re.findall(r"^(?:import|from) (\w+)", snippet, re.MULTILINE):
        pytest.importorskip(module, reason=f"{module} is not installed")
    if "fastparquet" in snippet:
        pytest.importorskip("fastparquet")
    monkeypatch.chdir(snapshot)
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    if "datasets" in snippet:
        monkeypatch.setattr("datasets.config.HF_DATASETS_CACHE", str(tmp_path))
    names: dict[str, Any] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # those of other packages about themselves
        exec(compile(snippet, str(PAGE), "exec"), names)
    found = names["frame"]
    expected = load_features("kinematics", folder=built.features_dir)
    assert set(found.columns) == set(expected.columns)
    pd.testing.assert_frame_equal(
        in_one_order(found)[sorted(found.columns)],
        in_one_order(expected)[sorted(found.columns)],
        check_dtype=False,
        check_exact=True,
    )


def by_file(folder: Path, table: str) -> dict[str, int]:
    return {path.stem: pq.read_metadata(path).num_rows for path in result_files(folder, table)}


def test_a_file_without_rows_is_left_out_and_named(built: Workspace, snapshot: Path) -> None:
    """Hugging Face's reader refuses one: it takes its number of rows for the size of a batch."""
    left_out = read_manifest(snapshot)["left_out"]
    empty = [
        f"{table}/{name}.parquet"
        for table in tables_in(built.features_dir)
        for name, rows in by_file(built.features_dir, table).items()
        if not rows
    ]
    assert empty
    assert left_out.items() >= dict.fromkeys(empty, "no rows").items()
    assert not any((snapshot / name).exists() for name in empty)


def test_all_that_is_built_is_in_it_and_described(built: Workspace, snapshot: Path) -> None:
    tables = tables_in(snapshot)
    rows = {table: by_file(built.features_dir, table) for table in tables_in(built.features_dir)}
    assert tables == [table for table, files in rows.items() if any(files.values())]
    assert {"kinematics", "silhouettes", "background", "frames"} < set(tables)
    for table in tables:
        files = result_files(snapshot, table)
        assert {path.stem for path in files} == {name for name, count in rows[table].items() if count}
        columns = table_description(snapshot, table)["columns"]
        for path in files:
            schema = pq.read_schema(path)
            assert schema.names == [column["name"] for column in columns]
            for column in columns:
                metadata = schema.field(column["name"]).metadata or {}
                assert metadata[b"unit"].decode() == column["unit"]
                assert metadata[b"description"].decode() == column["description"]


def test_what_the_path_said_is_in_the_rows(snapshot: Path) -> None:
    frames = pd.read_parquet(snapshot / "frames")
    for recording, rows in frames.groupby("recording"):
        garment = "camera_default" if recording == "camera_default_0" else str(recording).split("_")[0]
        assert {_text(each) for each in rows["garment"].unique()} == {garment}
    assert "garment" not in pd.read_parquet(snapshot / "background").columns


def test_encodings_are_those_that_every_reader_knows(snapshot: Path) -> None:
    for path in snapshot.rglob("*.parquet"):
        found = pq.ParquetFile(path).metadata
        for group in range(found.num_row_groups):
            chunks = [found.row_group(group).column(number) for number in range(found.num_columns)]
            assert {name for chunk in chunks for name in chunk.encodings} <= {"PLAIN", "RLE", "RLE_DICTIONARY"}


def test_the_same_results_give_the_same_bytes(built: Workspace, snapshot: Path, tmp_path: Path) -> None:
    moved = Workspace.create(tmp_path / "elsewhere")
    for name in ("recordings", "features", ".garment"):
        shutil.rmtree(moved.root / name, ignore_errors=True)
        shutil.copytree(built.root / name, moved.root / name, symlinks=False)
    moved.build(jobs=0)
    again = export(moved, tmp_path / "again")
    assert sums_of(again) == sums_of(snapshot)
    text = b"".join(path.read_bytes() for path in again.rglob("*") if path.is_file())
    assert str(built.root).encode() not in text
    assert str(moved.root).encode() not in text


def test_sums_are_read_by_others(snapshot: Path) -> None:
    done = subprocess.run(
        ["sha256sum", "--check", "--strict", "SHA256SUMS"], cwd=snapshot, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout
    assert len(done.stdout.splitlines()) == len([path for path in snapshot.rglob("*") if path.is_file()]) - 1


@pytest.mark.parametrize("seed", range(5))
def test_any_flipped_bit_lost_or_added_file_is_found(copied: Path, seed: int) -> None:
    assert not compare(copied)
    rng = np.random.default_rng(seed)
    files = sorted(path for path in copied.rglob("*") if path.is_file() and path.name != "SHA256SUMS")
    flipped, lost = (files[number] for number in rng.choice(len(files), 2, replace=False))
    content = bytearray(flipped.read_bytes())
    content[rng.integers(len(content))] ^= 1 << rng.integers(8)
    flipped.write_bytes(content)
    lost.unlink()
    (copied / "kinematics" / "more.parquet").write_bytes(b"PAR1")
    found = compare(copied)
    assert found.changed == (flipped.relative_to(copied).as_posix(),)
    assert found.missing == (lost.relative_to(copied).as_posix(),)
    assert found.added == ("kinematics/more.parquet",)


@pytest.mark.parametrize(
    "line", ["", "no sum", f"{'0' * 64} one-blank", f"{'0' * 64}  ../out", f"{'0' * 64}  /etc/passwd"]
)
def test_sums_that_are_none_are_refused(copied: Path, line: str) -> None:
    (copied / "SHA256SUMS").write_text(f"{line}\n")
    with pytest.raises(StoreError, match="a line that is no sum"):
        compare(copied)


def test_what_is_no_snapshot_or_was_changed_is_never_replaced(built: Workspace, copied: Path, tmp_path: Path) -> None:
    (copied / "README.md").write_text("my own words")
    before = sums_of(copied)
    with pytest.raises(StoreError, match=r"then changed is not replaced: found README\.md"):
        export(built, copied)
    assert sums_of(copied) == before
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "thesis.txt").write_text("mine")
    for where in (foreign, foreign / "thesis.txt"):
        with pytest.raises(StoreError, match="in the way of what is exported"):
            export(built, where)
    assert (foreign / "thesis.txt").read_text() == "mine"


def test_a_failure_while_writing_leaves_the_old_one(
    built: Workspace, copied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> str:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("garment_dataset.snapshot.writing.card", fail)
    before = sums_of(copied)
    with pytest.raises(Exception, match="No space left"):
        export(built, copied)
    assert sums_of(copied) == before
    assert [path.name for path in copied.parent.iterdir()] == [copied.name]


def test_a_stale_result_is_refused_and_what_is_missing_is_named(built: Workspace, tmp_path: Path) -> None:
    pipeline = built.pipelines_dir / "depth.toml"
    before = pipeline.read_text()
    pipeline.write_text(before + "\n[params.kinematics]\npolynomial_frames = 9\n")
    try:
        with pytest.raises(StoreError, match=r"stale.*found \d+ of them, first kinematics:.*11 -> 9.*`garment build`"):
            export(built, tmp_path / "out")
        assert not (tmp_path / "out").exists()
        found = read_manifest(export(built, tmp_path / "out", tables=["points"]))
        assert set(found["tables"]) == {"points"}
    finally:
        pipeline.write_text(before)
    absent = [row.recording for row in built.catalog().rows if row.state == "missing"]
    assert absent
    assert found["left_out"].items() >= dict.fromkeys(absent, "there is no bag").items()


def test_an_unknown_table_or_variant_is_refused(built: Workspace, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no table 'pints': .*Did you mean points\?"):
        export(built, tmp_path / "out", tables=["pints"])
    with Session(built) as session, pytest.raises(UsageError, match="no variant 'wide': expected none"):
        gather(session, variant="wide")


def test_a_second_export_says_what_is_new_and_why(built: Workspace, snapshot: Path, tmp_path: Path) -> None:
    old = read_manifest(snapshot)
    assert changes(old, old) == []
    part = read_manifest(export(built, tmp_path / "part", ["GreenTowel_Ruler_*"], ["kinematics", "points"]))
    lines = changes(old, part)
    assert any(line.startswith("recordings: ") and "gone" in line and "MyScarf" in line for line in lines)
    assert any(line.startswith("tables: ") and "camera" in line for line in lines)
    pipeline = built.pipelines_dir / "depth.toml"
    before = pipeline.read_text()
    pipeline.write_text(before + "\n[params.kinematics]\npolynomial_frames = 9\n")
    try:
        built.build(jobs=0)
        new = read_manifest(export(built, tmp_path / "new"))
    finally:
        pipeline.write_text(before)
        built.build(jobs=0)
    lines = changes(old, new)
    assert "kinematics: 3 files made anew, values of 3 differ: parameter polynomial_frames: 11 -> 9" in lines
    assert not any(line.startswith("points") for line in lines)


def test_a_newer_layout_is_refused_with_what_to_do(copied: Path) -> None:
    manifest = json.loads((copied / "snapshot.json").read_text())
    (copied / "snapshot.json").write_text(json.dumps(manifest | {"format": 99}))
    with pytest.raises(StoreError, match=r"expected at most 1, found 99.*update this one"):
        read_manifest(copied)


def test_what_a_person_says_is_in_every_description(built: Workspace, tmp_path: Path) -> None:
    settings = built.root / "garment.toml"
    said = PAGE.read_text("utf-8").split("```toml\n")[1].split("```")[0]
    settings.write_text(said)
    try:
        folder = export(type(built).at(built.root), tmp_path / "out", tables=["points"])
    finally:
        settings.unlink()
    croissant, package = (json.loads((folder / f"{name}.json").read_text()) for name in ("croissant", "datapackage"))
    for found in (croissant, package):
        assert found["version"] == "1.0.0"
        assert "for the parameters of cloth" in found["description"]
    assert (croissant["license"], croissant["datePublished"]) == ("CC-BY-4.0", "2026-11-29")
    assert package["licenses"] == [{"name": "CC-BY-4.0"}]
    card = (folder / "README.md").read_text()
    for words in ("# Swung garments", "CC-BY-4.0", "Ada Weaver", "Weaver, A.: Swung garments. 2026.", "Neoral"):
        assert words in card


@pytest.mark.filterwarnings("ignore")  # of its libraries about themselves
def test_croissant_is_valid_and_tells_every_unit(snapshot: Path) -> None:
    mlcroissant = pytest.importorskip("mlcroissant", reason="mlcroissant is not installed")
    dataset = mlcroissant.Dataset(jsonld=str(snapshot / "croissant.json"))
    assert not dataset.metadata.issues.errors
    for records in json.loads((snapshot / "croissant.json").read_text())["recordSet"]:
        described = table_description(snapshot, records["name"])
        for field, column in zip(records["field"], described["columns"], strict=True):
            assert field["name"] == column["name"]
            assert not column["unit"] or f"Unit: {column['unit']}." in field["description"]


@pytest.mark.filterwarnings("ignore")  # of its libraries about themselves
def test_pictures_and_lists_come_out_of_croissant(snapshot: Path) -> None:
    mlcroissant = pytest.importorskip("mlcroissant", reason="mlcroissant is not installed")
    dataset = mlcroissant.Dataset(jsonld=str(snapshot / "croissant.json"))
    expected = pd.read_parquet(snapshot / "silhouettes")
    records = list(dataset.records("silhouettes"))
    assert len(records) == len(expected)
    seen = next(each for each in records if each["silhouettes/mask"] is not None)
    row = next(each for _, each in expected.iterrows() if each["mask"] is not None)
    assert int(np.asarray(seen["silhouettes/mask"]).astype(bool).sum()) == row["area_px2"]
    np.testing.assert_array_equal(seen["silhouettes/outline_u_px"], row["outline_u_px"])
