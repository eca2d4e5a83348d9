"""Pages: nothing that comes from data is run, and every table can be read by a screen reader."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from garment_dataset.features.quality import RecordingQuality
from garment_dataset.layout import Layout
from garment_dataset.report.drawings import pipeline_picture, sparkline
from garment_dataset.report.facts import FindingFact, NodeFact, RecordingFacts, SiteFacts, StageFact
from garment_dataset.report.frames import Pictures
from garment_dataset.report.gathering import page_of, without_paths
from garment_dataset.report.pages import index_page, recording_page, script_json

EVIL = "</script><script>alert(1)</script>\"'><img src=x onerror=alert(2)>\u2028&amp;"


def evil_recording() -> RecordingFacts:
    made_from: dict[str, Any] = {
        "code": EVIL,
        "inputs": {EVIL: EVIL},
        "params": {EVIL: EVIL},
        "libraries": {EVIL: EVIL},
    }
    node = NodeFact(EVIL, EVIL, EVIL, "stale", True, (EVIL,), (EVIL,), EVIL, made_from, (EVIL,))
    row = dict.fromkeys(("garment", "holding", "axis", "state", "color", "garment_kind", "own"), EVIL)
    finding = FindingFact("lint", "error", EVIL, EVIL, EVIL, EVIL)
    quality = RecordingQuality("look", 0.5, 0.1, 0.001, (EVIL,))
    return RecordingFacts(EVIL, page_of(EVIL), row, (node,), (finding,), quality, EVIL, Path("bag"))


def evil_pages() -> list[str]:
    facts = evil_recording()
    trace = {"name": EVIL, "colors": None, "time": 0, "value": [1.0], "std": None}
    curves = {"quantities": [{"label": EVIL, "unit": EVIL, "traces": [trace]}], "times": [[0.0]], "time": EVIL}
    table = [{"label": EVIL, "unit": EVIL, "name": EVIL, "count": 1, "least": (0.0, 0.0), "most": (1.0, 1.0)}]
    frames = [{"frame": 0, "time_s": 0.0, "src": "data:,"}]
    figures = [{"src": "data:,", "title": EVIL}]
    pictures = Pictures({"depth": frames}, [{"cloud": EVIL}], figures, [EVIL])
    quality = dict.fromkeys(("coverage", "bridged", "seen", "used"))
    rows = [
        {**quality, "stage": EVIL, "stream": EVIL, "verdict": "ok", "why": [EVIL], "faults": [EVIL], "notes": [EVIL]}
    ]
    results = {"quality": rows, "motion": {EVIL: EVIL}}
    stages = [StageFact(EVIL, (EVIL,), (EVIL,), EVIL, (EVIL,), {"stale": 1})]
    site = SiteFacts(EVIL, [facts], facts.nodes, facts.findings, stages, {"own": EVIL}, Path("f"), Path("r"))
    cell = dict.fromkeys(("rms", "rms_low", "rms_high", "max", "stated_rms"))
    points = [{"point": 0, "cells": {"x": {**cell, "reason": EVIL}}}]
    repeats = [{"name": EVIL, "repeats": 2, "points": points}]
    return [
        recording_page(facts, curves, table, pictures, results, [EVIL]),
        index_page(site, {EVIL: (EVIL, EVIL, [0.0, 1.0])}, repeats, [EVIL]),
    ]


@pytest.mark.parametrize("number", [0, 1])
def test_what_comes_from_data_is_never_run(number: int) -> None:
    text = evil_pages()[number]
    assert "<img src=x" not in text
    assert "<script>" not in text
    assert text.count("alert(1)") == text.count("alert(2)") > 20


def test_data_in_a_script_reads_back_as_it_was() -> None:
    text = str(script_json({"a": EVIL, "b": [1.5, None]}))
    assert not {"<", ">", "&", "\u2028"} & set(text)
    assert json.loads(text) == {"a": EVIL, "b": [1.5, None]}
    with pytest.raises(ValueError, match="Out of range"):
        script_json(float("nan"))


def test_every_name_has_a_page_of_its_own() -> None:
    names = ["a", "A b", "A-b", "../../x", "..", ".hidden", "x/y", EVIL, "naïve", "a\udcff", "n" * 300]
    pages = [page_of(name) for name in names]
    assert len({page.casefold() for page in pages}) == len(names)
    assert pages[0] == "a.html"
    for page in pages:
        assert "/" not in page
        assert not page.startswith(".")
        assert len(page) < 130
        page.encode("ascii")


def test_paths_of_this_machine_are_taken_out_of_texts(tmp_path: Path) -> None:
    root = tmp_path / "ws"
    layout = Layout.create(root)
    (root / "garment.toml").write_text('[paths]\nrecordings = "/bags"\nfeatures = "../results"\n')
    layout = Layout.at(root)
    plain = without_paths(layout)
    text = f"{root}/catalog/garments.csv: 1/2 of {root}, /bags/a.bag, {layout.features_dir}/points, /tf/x"
    assert plain(text) == "catalog/garments.csv: 1/2 of ., bags/a.bag, ../results/points, /tf/x"


def test_a_sparkline_is_broken_where_values_are_missing() -> None:
    drawn = sparkline([0.0, 1.0, None, 1.0, 0.0], "a < b")
    assert drawn.count("<polyline") == 2
    assert 'role="img" aria-label="a &lt; b"' in drawn
    assert sparkline([None, 1.0], "one value is no line") == ""


def test_the_picture_of_the_pipeline_runs_from_left_to_right() -> None:
    stages = [
        StageFact("decode", ("bag",), ("frames",), "recording", ("depth",), {"fresh": 2, "failed": 1}),
        StageFact("points", ("frames",), ("points",), "recording", ("depth",), {}),
        StageFact("late", ("frames", "points"), ("end",), "recording", ("depth",), {}),
    ]
    drawn = pipeline_picture(stages)
    places = [drawn.index(f">{name}</text>") for name in ("bag", "decode", "points", "late")]
    assert places == sorted(places)
    assert "2 fresh · 1 failed" in drawn
    for title in ("(bag) to decode: bag", "decode to points: frames", "points to late: points"):
        assert f"<title>{title}</title>" in drawn


@pytest.mark.parametrize("name", ["index.html", "recordings/GreenTowel_Ruler_01_pi16_0.5_R1.html"])
def test_a_page_can_be_read_by_a_screen_reader(reported: Path, name: str) -> None:
    import re

    text = (reported / "report" / name).read_text()
    assert '<html lang="en">' in text
    assert 'class="skip" href="#main"' in text
    assert text.count("<h1") == 1
    tables = re.findall(r"<table.*?</table>", text, re.DOTALL)
    assert tables
    for table in tables:
        assert "<caption" in table
        assert "<th scope=" in table
        assert "<th>" not in table
    assert all("alt=" in image for image in re.findall(r"<img [^>]*>", text))
    for region in re.findall(r'<[^>]*role="(?:region|group|search|img)"[^>]*>', text):
        assert "aria-label=" in region, region
    for field in re.findall(r"<(?:input|select)[^>]*>", text):
        before = text[: text.index(field)]
        assert before.rindex("<label") > before.rindex("</label>") if "</label>" in before else True, field
