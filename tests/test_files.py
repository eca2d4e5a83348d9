"""Files that a person writes, as editors and spreadsheets save them: read, or refused with what they are."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.catalog import Catalog
from garment_dataset.errors import CatalogError, PipelineError, WorkspaceError
from garment_dataset.files import EncodingError, hint_of, read_text, read_toml, whole_file
from garment_dataset.workspace import Workspace
from garment_dataset.workspace.pipelines import read_pipeline

TEXT = '[paths]\nfeatures = "merkmäler"\n'


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_marks_and_ends_of_lines_make_no_difference(tmp_path: Path, encoding: str, newline: str) -> None:
    path = tmp_path / "garment.toml"
    path.write_bytes(TEXT.replace("\n", newline).encode(encoding))
    assert read_text(path) == TEXT
    assert read_toml(path) == {"paths": {"features": "merkmäler"}}


@pytest.mark.parametrize(
    ("encoding", "found"),
    [
        ("utf-16", "UTF-16: it begins with the bytes ff fe"),
        ("utf-32", "UTF-32: it begins with the bytes ff fe 00 00"),
        ("utf-16-le", "a zero byte in line 1: UTF-16 without its mark, or no text"),
        ("utf-16-be", "a zero byte in line 1: UTF-16 without its mark, or no text"),
        ("latin-1", "byte 0xe4 in line 2: no UTF-8; in Windows-1252 it is 'ä'"),
    ],
)
def test_another_encoding_is_named_with_how_to_save_it(tmp_path: Path, encoding: str, found: str) -> None:
    path = tmp_path / "garment.toml"
    path.write_bytes(TEXT.encode(encoding))
    with pytest.raises(EncodingError) as caught:
        read_text(path)
    assert str(caught.value) == found
    assert "Save it as UTF-8" in str(hint_of(caught.value))


def test_a_single_zero_byte_is_no_other_encoding(tmp_path: Path) -> None:
    (path := tmp_path / "a.csv").write_bytes(b"letter,garment\na,b\0c\n")
    with pytest.raises(EncodingError, match="a zero byte in line 2: a character that no text has"):
        read_text(path)


@given(st.binary(max_size=60))
def test_any_bytes_are_text_without_zeros_or_refused(tmp_path_factory: pytest.TempPathFactory, raw: bytes) -> None:
    (path := tmp_path_factory.mktemp("files") / "any").write_bytes(raw)
    try:
        text = read_text(path)
    except EncodingError:
        return
    assert "\0" not in text
    assert "\r" not in text


def test_every_reader_hands_the_hint_on(tmp_path: Path) -> None:
    place = Workspace.create(tmp_path / "ws")
    for path in (
        place.catalog_dir / "garments.csv",
        place.catalog_dir / "topics/1.txt",
        place.pipelines_dir / "depth.toml",
    ):
        path.write_bytes(path.read_text("utf-8").encode("utf-16"))
    with pytest.raises(CatalogError, match=r"UTF-16: .*Save it as UTF-8"):
        Catalog.load(place.catalog_dir)
    with pytest.raises(CatalogError, match=r"UTF-16: .*Save it as UTF-8"):
        Catalog.load(place.catalog_dir, strict=False).topics(1)
    with pytest.raises(PipelineError, match=r"UTF-16: .*Save it as UTF-8"):
        read_pipeline(place.pipelines_dir / "depth.toml")
    (place.root / "garment.toml").write_bytes(TEXT.encode("utf-16"))
    with pytest.raises(WorkspaceError, match=r"UTF-16: .*Save it as UTF-8"):
        Workspace.find(place.root)


def test_a_whole_file_takes_the_place_of_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "out.bin"
    path.write_bytes(b"before")
    with whole_file(path) as part:
        part.write_bytes(b"after")
        assert path.read_bytes() == b"before"
    assert [each.read_bytes() for each in tmp_path.iterdir()] == [b"after"]


@pytest.mark.parametrize("failure", [ValueError("bad"), KeyboardInterrupt(), OSError(28, "No space left on device")])
def test_half_a_file_is_none(tmp_path: Path, failure: BaseException) -> None:
    path = tmp_path / "out.bin"
    path.write_bytes(b"before")

    def fail() -> None:
        with whole_file(path) as part:
            part.write_bytes(b"half")
            raise failure

    with pytest.raises(type(failure)) as caught:
        fail()
    assert [each.read_bytes() for each in tmp_path.iterdir()] == [b"before"]
    if isinstance(caught.value, OSError):
        assert caught.value.filename == str(path)
