"""``garment report``: what it says, and that it says in one line what stands in the way."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest


def run(*arguments: str, before: str = "", code: int = 0) -> tuple[str, str]:
    script = f"import sys\n{before}\nfrom garment_dataset.cli import main; main()"
    command = [sys.executable, "-c", script, "report", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == code, done
    return done.stdout, done.stderr


def test_it_ends_with_the_path_of_the_first_page(own: Path) -> None:
    out, said = run("-w", str(own))
    assert out == f"{own}/report/index.html\n"
    assert "unchanged" in said


@pytest.mark.parametrize("name", ["jinja2", "plotly", "matplotlib"])
def test_without_the_extra_it_says_what_to_install(reported: Path, tmp_path: Path, name: str) -> None:
    hide = (
        "import importlib.util as u; find = u.find_spec\n"
        f"u.find_spec = lambda n, *a: None if n == {name!r} else find(n, *a)"
    )
    out, said = run("-w", str(reported), "--out", str(tmp_path / "site"), before=hide, code=2)
    assert out == ""
    assert said == f"garment: a report needs {name}. Install it with: pip install 'garment-dataset[report]'\n"
    assert not (tmp_path / "site").exists()


def test_a_file_in_the_way_is_said(reported: Path, tmp_path: Path) -> None:
    (tmp_path / "site").write_text("")
    _, said = run("-w", str(reported), "--out", str(tmp_path / "site"), code=2)
    assert said == f"garment: {tmp_path}/site: no folder for a report: found a file\n"


def test_a_filter_that_finds_nothing_is_said(reported: Path, tmp_path: Path) -> None:
    _, said = run("GreenTowl*", "-w", str(reported), "--out", str(tmp_path / "site"), code=2)
    assert "GreenTowl" in said
    assert not (tmp_path / "site").exists()
