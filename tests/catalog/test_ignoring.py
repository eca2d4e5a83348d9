"""``.garmentignore``: what its patterns leave out is as if it were not there, as git would have it."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from garment_dataset.catalog.folder import scan
from garment_dataset.catalog.ignoring import Ignoring, compile_pattern, read_ignoring
from garment_dataset.cli import application
from garment_dataset.errors import CatalogError, DataWarning
from garment_dataset.workspace import Workspace

NAMES = ("A_0.5_R1.bag", "old/B_0.5_R1.bag", "old/deep/C_0.5_R1.bag", "new/D_0.5_R1.bag", "new/old/E_0.5_R1.bag")


@pytest.fixture
def bags(tmp_path: Path) -> Callable[..., list[str]]:
    """Return the letters of the recordings that are left by some patterns."""
    for name in NAMES:
        (path := tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        path.touch()

    def left(*patterns: str) -> list[str]:
        (tmp_path / ".garmentignore").write_text("\n".join(patterns), "utf-8")
        return [str(bag.name)[0] for bag in scan(tmp_path).bags]

    return left


@pytest.mark.parametrize(
    ("patterns", "left"),
    [
        ([], "ABCDE"),
        (["# all", "", "  "], "ABCDE"),
        (["old"], "AD"),
        (["old/"], "AD"),
        (["/old"], "ADE"),
        (["*.bag"], ""),
        (["/*.bag"], "BCDE"),
        (["old/*.bag"], "ACDE"),
        (["**/old/*.bag"], "ACD"),
        (["old/**"], "ADE"),
        (["new/**/E*"], "ABCD"),
        (["**/deep"], "ABDE"),
        (["[A-C]_*"], "DE"),
        (["[!A]_*"], "A"),
        (["?_0.5_R1.bag", "!D_*"], "D"),
        (["old", "!B_0.5_R1.bag"], "AD"),
        (["!A*", "A*"], "BCDE"),
        (["A_0.5_R1.bag/"], "ABCDE"),
        (["A_0.5_R1.bag   "], "BCDE"),
        (["a_*"], "ABCDE"),
    ],
)
def test_what_fits_is_left_out(bags: Callable[..., list[str]], patterns: list[str], left: str) -> None:
    assert bags(*patterns) == list(left)


letters = st.text("ab*?/!.", min_size=1, max_size=6)
paths = st.lists(st.text("ab.", min_size=1, max_size=2).filter(lambda part: part.strip(".")), min_size=1, max_size=3)


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not here")
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(letters, min_size=1, max_size=3), paths.map("/".join))
@example(["a", "!a"], "a")
@example(["**/a"], "b/a")
@example(["a/**/b"], "a/b")
@example(["/a"], "b/a")
def test_git_leaves_out_the_same(tmp_path: Path, patterns: list[str], path: str) -> None:
    try:
        rules = Ignoring(tuple(map(compile_pattern, patterns)))
    except ValueError:
        return
    if not (tmp_path / ".git").exists():
        subprocess.run(["git", "init", "-q", str(tmp_path)], check=True)
    (tmp_path / ".gitignore").write_text("\n".join(patterns))
    done = subprocess.run(["git", "-C", str(tmp_path), "check-ignore", "-q", "--no-index", path], check=False)
    parts = path.split("/")
    above = ["/".join(parts[:depth]) for depth in range(1, len(parts))]
    ours = any(rules.leaves_out(folder, is_folder=True) for folder in above) or rules.leaves_out(path, is_folder=False)
    assert ours == (done.returncode == 0)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("a[bc", r"line 2: a \[ that is not closed: found 'a\[bc'"),
        ("[]", r"a \[ that is not closed"),
        ("[c-a]*", "a range of letters backwards"),
        ("old\\B*", "a backslash.*Between folders stands /"),
        ("a**", r"\*\* beside other letters"),
        ("../other", "a pattern that nothing can fit"),
        ("./a", "a pattern that nothing can fit"),
        ("a//b", "a pattern that nothing can fit"),
        ("!", "a pattern that nothing can fit"),
        ("/", "a pattern that nothing can fit"),
    ],
)
def test_a_bad_pattern_is_one_error_with_its_line(tmp_path: Path, line: str, message: str) -> None:
    (tmp_path / ".garmentignore").write_text(f"# mine\n{line}\n")
    with pytest.raises(CatalogError, match=message):
        scan(tmp_path)


@given(st.text(max_size=12))
def test_any_text_is_read_or_refused_with_what_to_do(text: str) -> None:
    try:
        rule = compile_pattern(text)
    except ValueError as error:
        assert len(error.args) == 2  # noqa: PT017 - most texts raise none
        return
    Ignoring((rule,)).leaves_out("a/b.bag", is_folder=False)


def test_a_file_in_another_encoding_is_refused(tmp_path: Path) -> None:
    (tmp_path / ".garmentignore").write_bytes("old".encode("utf-16"))
    with pytest.raises(CatalogError, match=r"UTF-16: .*Save it as UTF-8"):
        read_ignoring(tmp_path)


def test_only_the_file_at_the_top_is_read(bags: Callable[..., list[str]], tmp_path: Path) -> None:
    (tmp_path / "old" / ".garmentignore").write_text("*")
    with pytest.warns(DataWarning, match=r"old/\.garmentignore: not read"):
        assert bags() == list("ABCDE")


def test_a_letter_composed_in_another_way_is_the_same(tmp_path: Path) -> None:
    (tmp_path / "ma\u0308rz").mkdir()
    (tmp_path / "ma\u0308rz" / "A_0.5_R1.bag").touch()
    (tmp_path / ".garmentignore").write_text("m\u00e4rz\n", "utf-8")
    assert scan(tmp_path).bags == ()


def test_a_folder_of_rosbag2_is_left_out_whole(tmp_path: Path) -> None:
    (tmp_path / "A_0.5_R1").mkdir()
    (tmp_path / "A_0.5_R1" / "metadata.yaml").touch()
    (tmp_path / "A_0.5_R1" / "A_0.db3").touch()
    (tmp_path / ".garmentignore").write_text("A_*/\n")
    found = scan(tmp_path)
    assert (found.bags, found.unfinished, found.ignored) == ((), (), (tmp_path / "A_0.5_R1",))


def test_no_verb_knows_what_is_left_out(tmp_path: Path) -> None:
    place = Workspace.create(tmp_path / "ws", empty=True)
    for name in ("A_0.5_R1.bag", "B 0.5 R1.bag", "C_0.5_R1.bag.active", "D_0.5_R1.salvaged.bag"):
        (place.recordings_dir / name).touch()
    (place.recordings_dir / ".garmentignore").write_text("*.bag*\n")

    def run(*arguments: str) -> Any:
        return CliRunner(env={"NO_COLOR": "1"}).invoke(application(), [*arguments, "-w", str(place.root)])

    listed = run("list")
    assert len(listed.stdout.splitlines()) == 1
    assert "4 bags or folders left out by" in listed.stderr
    assert run("lint").stdout == "names, tables and folder agree\n"
    assert "nothing to build" in str(run("build", "-j", "0").exception)
    assert "no such recording" in str(run("show", "A_0.5_R1").exception)
