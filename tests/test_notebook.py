"""What the public objects show of themselves, in a line and in a notebook: short, escaped, and bounded."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from garment_dataset import Catalog, load_features
from garment_dataset.engine.events import Ending, Event, Report
from garment_dataset.engine.graph import NodeId
from garment_dataset.engine.showing import MOST_ROWS, html_table
from garment_dataset.features.frame import FeatureFrame
from garment_dataset.workspace.session import Session
from tests.conftest import RECORDINGS

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace

NASTY = "<script>alert('x')</script>\x1b[31m & \"q\""

CELL = """
from IPython.core.interactiveshell import InteractiveShell
from traitlets.config import Config
import json, sys

shell = InteractiveShell(config=Config({"HistoryManager": {"enabled": False}}))
shown = {}
for name, source in json.loads(sys.argv[1]).items():
    done = shell.run_cell(source, store_history=False)
    done.raise_error()
    data, _ = shell.display_formatter.format(done.result)
    shown[name] = data
print(json.dumps(shown))
"""


class Rows(HTMLParser):
    """Counts rows and takes down the tags."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.open: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: object) -> None:  # noqa: ARG002
        self.tags.append(tag)
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture
def built(workspace: Workspace) -> Workspace:
    workspace.build(jobs=0)
    return workspace


def test_cells_of_a_notebook_show_them(built: Workspace, tmp_path: Path) -> None:
    prelude = "from garment_dataset.workspace.session import Session; from pathlib import Path; "
    prelude += f"import garment_dataset as g; place = g.Workspace.find(Path({str(built.root)!r}))"
    name = min(RECORDINGS)
    cells = {
        "prelude": f"{prelude}\n0",
        "workspace": "place",
        "catalog": "place.catalog()",
        "report": "place.build(jobs=0)",
        "plan": "Session(place).plan()",
        "features": f"g.load_features('kinematics', folder=place.features_dir, recording={name!r})",
        "query": "place.catalog().query(axis='R')",
    }
    done = subprocess.run(
        [sys.executable, "-c", CELL, json.dumps(cells)],
        env=os.environ | {"IPYTHONDIR": str(tmp_path / "ipython")},
        capture_output=True,
        text=True,
        check=True,
        cwd=built.root,
    )
    shown = json.loads(done.stdout.splitlines()[-1])
    for name in cells.keys() - {"prelude"}:
        assert "text/html" in shown[name], name
        Rows(re.sub(r"<style.*?</style>", "", shown[name]["text/html"], flags=re.DOTALL))
    for name in ("workspace", "catalog", "report", "plan"):
        assert len(shown[name]["text/plain"]) < 200
        assert "\n" not in shown[name]["text/plain"]
    assert "9 results: 9 fresh" in shown["report"]["text/html"]
    assert "the first 20 of 47 recordings" in shown["catalog"]["text/html"]
    assert "[m/s]" in shown["features"]["text/html"]
    assert re.search(r"\d+ rows × \d+ columns", shown["features"]["text/html"])


def test_the_cells_of_the_page_run(built: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    page = Path(__file__).parents[1] / "docs" / "terminal.md"
    monkeypatch.chdir(built.root)
    for code in re.findall(r"```python\n(.*?)```", page.read_text("utf-8"), re.DOTALL):
        exec(code, {})


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # of time on a busy machine nothing is meant
@given(st.lists(st.lists(st.text(), min_size=2, max_size=2), max_size=30), st.text())
def test_a_table_is_escaped_and_bounded(rows: list[list[str]], title: str) -> None:
    text = html_table(["a", "<b>"], rows, title=title, more="things")
    found = Rows(text)
    assert set(found.tags) <= {"div", "p", "table", "thead", "tbody", "tr", "th", "td"}
    assert found.tags.count("tr") == 1 + min(len(rows), MOST_ROWS)
    assert (f"the first {MOST_ROWS} of {len(rows)} things" in text) == (len(rows) > MOST_ROWS)
    text.encode()  # no half of a letter, which no page can hold


def test_a_report_says_what_failed() -> None:
    events = {NodeId("decode", f"r{number}"): Ending.FAILED for number in range(50)}
    report = Report({node: Event(node, ending, message=NASTY) for node, ending in events.items()})
    assert repr(report) == "<Report of 50 results: 50 failed>"
    text = report._repr_html_()
    assert "<script" not in text
    assert "\x1b" not in text
    assert "&lt;script&gt;" in text
    assert "the first 20 of 50 remarks" in text


def test_a_workspace_with_a_broken_catalog_says_so(workspace: Workspace) -> None:
    (workspace.catalog_dir / "garments.csv").write_text(f"letter,{NASTY}\n")
    text = workspace._repr_html_()
    assert repr(workspace) == f"<Workspace {workspace.root}>"
    assert "garments.csv" in text
    assert "<script" not in text


def test_a_plan_says_why(workspace: Workspace) -> None:
    with Session(workspace) as session:
        plan = session.plan()
    assert repr(plan) == "<Plan of 9 results: 9 missing>"
    assert "new bag" in plan._repr_html_()


def test_a_catalog_is_a_line(tmp_path: Path) -> None:
    assert repr(Catalog.load()).endswith("catalog: 46 recordings>")
    assert re.search(r": 46 recordings: 46 missing>$", repr(Catalog.load().with_folder(tmp_path)))


def test_features_are_a_frame_like_any_other(built: Workspace) -> None:
    frame = load_features("kinematics", folder=built.features_dir)
    assert isinstance(frame, FeatureFrame)
    assert type(frame[frame["point"] == 1]) is pd.DataFrame
    text = frame._repr_html_()
    assert text is not None
    assert f"{len(frame)} rows × {len(frame.columns)} columns" in text
    assert text.count("<tr") < 30
    before = frame.copy()
    with pd.option_context("display.notebook_repr_html", False):
        assert frame._repr_html_() is None
    pd.testing.assert_frame_equal(pd.DataFrame(frame), pd.DataFrame(before))
