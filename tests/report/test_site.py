"""Laws of a report: the same results give the same bytes, what changed is made again, nobody else's file is touched."""

from __future__ import annotations

import re
import shutil
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote

import pytest

from garment_dataset.errors import UsageError
from garment_dataset.report.site import CAP_BYTES, Site
from tests.conftest import make_workspace
from tests.report.conftest import ABSENT, COLOR, CUT, DEPTH, FAILED, REPEAT, fill, report

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace


def files_of(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def page(root: Path, recording: str) -> str:
    return (root / "report" / "recordings" / f"{recording}.html").read_text("utf-8")


class Links(HTMLParser):
    """Everything that a page refers to, and the ids that it has."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[str] = []
        self.ids: list[str] = []
        self.feed(text)

    def handle_starttag(self, _: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in {"href", "src", "action", "srcset", "poster", "data"} and value:
                self.found.append(value)
            if name == "id" and value:
                self.ids.append(value)


def test_the_same_results_give_the_same_bytes_in_another_folder(reported: Path, tmp_path: Path) -> None:
    place = make_workspace(tmp_path / "somewhere" / "else")
    fill(place)
    place.build(jobs=0)
    report(place.root)
    assert files_of(place.root / "report") == files_of(reported / "report")


def test_nothing_of_this_machine_is_in_it(reported: Path) -> None:
    for name, data in files_of(reported / "report").items():
        if not name.startswith("assets/"):
            text = data.decode()
            assert str(reported) not in text, name
            assert str(Path.home()) + "/" not in text, name
            assert str(reported.parent) not in text, name


def test_a_report_of_the_same_makes_nothing(own: Path) -> None:
    first = report(own)
    before = {path: path.stat().st_mtime_ns for path in (own / "report").rglob("*")}
    again = report(own)
    assert not again.made
    assert not again.removed
    assert set(again.kept) == {*first.kept, *first.made}
    assert {path: path.stat().st_mtime_ns for path in (own / "report").rglob("*")} == before


def test_only_what_changed_is_made_again(own: Path) -> None:
    report(own)
    pipeline = own / "pipelines" / "colour.toml"
    pipeline.write_text(pipeline.read_text() + "[params.silhouette]\nmin_area_px2 = 77\n")
    assert sorted(report(own).made) == ["index.html", f"recordings/{COLOR}.html"]


def test_a_page_that_someone_changed_is_made_anew(own: Path) -> None:
    report(own)
    changed = own / "report" / "recordings" / f"{DEPTH}.html"
    right = changed.read_bytes()
    changed.write_bytes(b"")
    assert report(own).made == [f"recordings/{DEPTH}.html"]
    assert changed.read_bytes() == right


def test_pages_of_what_is_gone_are_removed_and_nobody_elses(own: Path) -> None:
    report(own)
    stranger = own / "report" / "recordings" / "mine.html"
    stranger.write_text("mine")
    edited = own / "report" / "recordings" / f"{CUT}.html"
    edited.write_text("I have written into this page")
    table = own / "catalog" / "recordings.csv"
    kept = [line for line in table.read_text().splitlines() if COLOR not in line and CUT not in line]
    table.write_text("\n".join(kept) + "\n")
    (own / "recordings" / f"{COLOR}.bag").unlink()
    (own / "recordings" / f"{CUT}.bag").unlink()
    written = report(own)
    assert written.removed == [f"recordings/{COLOR}.html"]
    assert stranger.read_text() == "mine"
    assert edited.exists()
    assert f"{COLOR}.html" not in (own / "report" / "index.html").read_text()


def test_a_folder_with_someones_own_index_is_refused(own: Path, tmp_path: Path) -> None:
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "index.html").write_text("mine")
    with pytest.raises(UsageError, match="no report made"):
        Site(tmp_path / "site")
    (tmp_path / "other" / "assets").mkdir(parents=True)
    (tmp_path / "other" / "assets" / "report.js").write_text("mine")
    with pytest.raises(UsageError, match="in the way"):
        report(own, tmp_path / "other")


def test_a_manifest_that_names_files_outside_removes_none(own: Path) -> None:
    import hashlib
    import json

    victim = own / "victim.txt"
    victim.write_text("mine")
    path = own / "report" / "report.json"
    manifest = json.loads(path.read_text())
    content = hashlib.sha256(victim.read_bytes()).hexdigest()
    for name in ("../victim.txt", "recordings/../../victim.txt", str(victim)):
        manifest["files"][name] = {"key": "", "content": content}
    path.write_text(json.dumps(manifest))
    assert not report(own).removed
    assert victim.exists()


def test_every_page_is_within_the_cap(reported: Path) -> None:
    pages = list((reported / "report").rglob("*.html"))
    assert len(pages) == 7
    assert all(path.stat().st_size <= CAP_BYTES for path in pages)


def test_a_page_beyond_the_cap_is_made_with_fewer_pictures(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = len(page(own, DEPTH).encode())
    for cap in (whole // 4, 60_000):
        monkeypatch.setattr("garment_dataset.report.writing.CAP_BYTES", cap)
        shutil.rmtree(own / "report")
        report(own, None, DEPTH)
        assert len(page(own, DEPTH).encode()) <= cap
    assert "the page would be larger" in page(own, DEPTH)


def test_every_link_leads_somewhere_and_nothing_to_a_network(reported: Path) -> None:
    for path in (reported / "report").rglob("*.html"):
        links = Links(path.read_text("utf-8"))
        assert len(set(links.ids)) == len(links.ids), path
        for link in links.found:
            if link.startswith("data:"):
                continue
            target, _, fragment = link.partition("#")
            assert "://" not in target, link
            assert not target or (path.parent / unquote(target)).is_file(), f"{path.name}: {link}"
            assert not fragment or target or fragment in links.ids, f"{path.name}: {link}"


def test_own_scripts_and_styles_ask_for_nothing(reported: Path) -> None:
    for name in ("report.js", "report.css"):
        text = (reported / "report" / "assets" / name).read_text()
        assert not re.search(r"https?:|fetch\(|XMLHttpRequest|@import|url\(|innerHTML|eval\(", text), name


def test_what_cannot_be_shown_says_why(reported: Path) -> None:
    for recording, words in (
        (FAILED, ["failed", "camera is not calibrated: found K that is all zero", "No curves"]),
        (CUT, ["damaged", "No curves"]),
        (ABSENT, ["no bag here", "There are no results"]),
    ):
        text = page(reported, recording)
        for word in words:
            assert word in text, (recording, word)
        assert "Traceback" not in text
        assert ">None<" not in text
        assert ">nan<" not in text


def test_before_a_build_pages_say_to_build(workspace: Workspace) -> None:
    report(workspace.root)
    text = page(workspace.root, DEPTH)
    assert "garment build" in text
    assert "missing" in text


def test_a_bag_that_was_changed_since_the_build_is_not_drawn_beside_its_old_results(own: Path) -> None:
    from tests.conftest import write_recording

    assert "data:image/jpeg" in page(own, DEPTH)
    (own / "recordings" / f"{DEPTH}.bag").unlink()
    write_recording(own / "recordings" / f"{DEPTH}.bag", shift_m=0.02)
    report(own)
    text = page(own, DEPTH)
    assert "data:image/jpeg" not in text
    assert "not the one that the results were made from" in text


def test_results_that_cannot_be_read_are_said_and_stop_no_other_page(own: Path) -> None:
    (broken,) = own.glob(f"features/kinematics/**/{DEPTH}.parquet")
    broken.unlink()  # it may be a link to the store
    broken.write_bytes(b"no Parquet")
    written = report(own)
    text = page(own, DEPTH)
    assert "Traceback" not in text
    assert "kinematics.dz_m: cannot be read" in text
    assert "points.garment_length_m" in text
    assert "kinematics.dz_m" in page(own, REPEAT)
    assert not written.faults


def test_a_page_that_cannot_be_made_is_tried_again(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def explode(*_: object) -> None:
        raise RuntimeError("<b>no</b>")

    with monkeypatch.context() as patch:
        patch.setattr("garment_dataset.report.writing.curves_of", explode)
        written = report(own, own / "other")
    assert len(written.faults) == 6
    text = (own / "other" / "recordings" / f"{DEPTH}.html").read_text()
    assert "the page is not whole: RuntimeError: &lt;b&gt;no&lt;/b&gt;" in text
    report(own)
    report(own, own / "other")
    assert files_of(own / "other") == files_of(own / "report")


def test_a_report_that_was_interrupted_is_finished_by_the_next(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    report(own)

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    for where in ("writing.summary", "writing.index_page", "site.Site.finish"):
        with monkeypatch.context() as patch:
            patch.setattr(f"garment_dataset.report.{where}", interrupt)
            with pytest.raises(KeyboardInterrupt):
                report(own, own / "other")
        assert (own / "other" / "report.json").is_file()
    table = own / "catalog" / "garments.csv"  # what was written meanwhile is no stranger's, though it is of yesterday
    table.write_text(table.read_text().replace("45", "46"))
    report(own)
    report(own, own / "other")
    assert files_of(own / "other") == files_of(own / "report")


def test_empty_scenes_are_checked_as_well(reported: Path) -> None:
    text = (reported / "report" / "index.html").read_text()
    assert "camera_default_0" in text


def test_filters_choose_the_recordings(own: Path) -> None:
    written = report(own, own / "some", DEPTH)
    assert [name for name in written.made if name.startswith("recordings/")] == [f"recordings/{DEPTH}.html"]
    assert COLOR not in (own / "some" / "index.html").read_text()
