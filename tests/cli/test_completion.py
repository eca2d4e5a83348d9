"""Tab: what is offered, in the words of each shell; nothing heavy is imported, and nothing said where there is none."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from garment_dataset.cli import VERBS
from garment_dataset.workspace import Workspace
from tests.test_layers import HEAVY

GARMENT = [sys.executable, "-m", "garment_dataset"]


def asked(shell: str, words: list[str]) -> dict[str, str]:
    """Return what a shell sets for the last word to be completed."""
    if shell == "bash":
        split = [part for word in words for part in (re.split("(=)", word) if word else [""]) if part or not word]
        return {"COMP_WORDS": "\n".join(split), "COMP_CWORD": str(len(split) - 1)}
    return {"_TYPER_COMPLETE_ARGS": " ".join(words), "_TYPER_COMPLETE_FISH_ACTION": "get-args"}


def offered(cwd: Path, *words: str, shell: str = "fish") -> list[str]:
    """Return the words that a shell is offered, having seen that nothing was said and nothing heavy imported."""
    setting = asked(shell, ["garment", *words]) | {"_GARMENT_COMPLETE": f"complete_{shell}"}
    code = "import atexit, sys; from garment_dataset.cli import main\n"
    code += "atexit.register(lambda: print(*sys.modules, file=sys.stderr)); main()"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=cwd, env=os.environ | setting, capture_output=True, text=True, check=False
    )
    *said, modules = done.stderr.splitlines()
    assert said == []
    # Typer has Rich draw the descriptions of verbs, where the verb itself is completed
    assert not set(modules.split()) & (HEAVY - ({"rich.console"} if len(words) == 1 else set()))
    # fish has the description of a verb behind it
    return [line.partition("\t")[0] for line in done.stdout.splitlines() if line]


@pytest.fixture
def towels(tmp_path: Path) -> Path:
    """A workspace with a variant, and the description of one table of results."""
    place = Workspace.create(tmp_path / "ws")
    (place.pipelines_dir / "wide.toml").write_text('variant = "wide"\nstages = ["decode"]\n')
    place.features_dir.mkdir()
    columns = [("recording", "string"), ("frame", "int64"), ("vz_m_s", "float64"), ("vz_std_m_s", "float64")]
    listed = ", ".join(f'{{"name": "{name}", "type": "{kind}"}}' for name, kind in columns)
    described = f'{{"kinematics": {{"table": "kinematics", "columns": [{listed}]}}}}'
    (place.features_dir / "schemas.json").write_text(described)
    return place.root


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["sta"], ["status"]),
        (["show", "GreenTowel_F"], ["GreenTowel_Free_pi16_0.5_R1", "GreenTowel_Free_pi16_0.5_B1"]),
        (["why", "GreenTowel_Free_pi16_0.5_R1", "kin"], ["kinematics"]),
        (["build", "--stage", "depth"], ["depth_points"]),
        (["accept", "al"], ["all"]),
        (["list", "garm"], ["garment=", "garment_kind="]),
        (["list", "quality=u"], ["quality=unusable"]),
        (["list", "qual"], ["quality=ok", "quality=look", "quality=unusable"]),
        (["build", "state=pr"], ["state=present"]),
        (["check", "garment=GreenTowel,RedS"], ["garment=GreenTowel,RedSkirt"]),
        (["lint", "severity=e"], ["severity=error"]),
        (["diff", "default", "w"], ["wide"]),
        (["diff", "default", "wide", "--table", "k"], ["kinematics"]),
        (["plot", "--table", "kinematics.v"], ["kinematics.vz_m_s", "kinematics.vz_std_m_s"]),
        (["plot", "--table", "kin"], ["kinematics.frame", "kinematics.vz_m_s", "kinematics.vz_std_m_s"]),
        (["record-plan", "camera"], ["camera_default_0"]),
        (["simulate", "GreenTowel_Free_pi16_0.5_B"], ["GreenTowel_Free_pi16_0.5_B1"]),
        (["list", "no-such"], []),
    ],
)
def test_what_is_offered(towels: Path, words: list[str], expected: list[str]) -> None:
    assert offered(towels, *words) == expected


def test_bash_takes_what_stands_behind_the_sign_for_the_word(towels: Path) -> None:
    assert offered(towels, "list", "garment=Gr", shell="bash") == ["GreenTowel"]
    assert offered(towels, "list", "garment=", shell="bash")[:2] == ["BlueShirt", "FelShirt"]
    assert offered(towels, "list", "axis=R", "garment=GreenTowel,Gr", shell="bash") == ["GreenTowel,GreenTowel"]
    assert offered(towels, "list", "", shell="bash")[0] == "BlackShorts_Belt_pi16_0.5_R1"


def test_zsh_is_answered(towels: Path) -> None:
    assert '"garment=GreenTowel"' in " ".join(offered(towels, "list", "garment=Gr", shell="zsh"))


def test_another_workspace_may_be_named(towels: Path) -> None:
    words = ["-w", str(towels), "GreenTowel_Free_pi16_0.5_R"]
    assert offered(towels.parent, "list", *words) == ["GreenTowel_Free_pi16_0.5_R1"]


@pytest.mark.parametrize("words", [["list", ""], ["show", "G"], ["build", "-s", ""], ["plot", "--table", "k"]])
def test_outside_a_workspace_or_in_a_broken_one_there_is_nothing(
    tmp_path: Path, towels: Path, words: list[str]
) -> None:
    (tmp_path / "empty").mkdir()
    assert offered(tmp_path / "empty", *words) == []
    for path in (towels / "catalog" / "recordings.csv", towels / "pipelines" / "depth.toml"):
        path.write_bytes(b"\xff\x00 = [")
    (towels / "features" / "schemas.json").write_text("{")
    assert offered(towels, *words) == []


def test_no_word_that_a_shell_would_run_is_offered(towels: Path) -> None:
    garments = towels / "catalog" / "garments.csv"
    garments.write_text(garments.read_text().replace("green", "$(id)").replace("black&white", "bl`a;ck"))
    found = offered(towels, "list", "color=", shell="zsh")
    assert "blue" in " ".join(found)
    assert not re.search(r"id|`|;", " ".join(found).partition("((")[2])


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash here")
def test_the_script_works_in_bash(towels: Path) -> None:
    script = subprocess.run(
        GARMENT, env=os.environ | {"_GARMENT_COMPLETE": "source_bash"}, capture_output=True, text=True, check=True
    ).stdout
    # `env` runs a file, so the command has to be one
    (towels / "garment").write_text(f"#!/bin/sh\nexec {sys.executable} -m garment_dataset\n")
    (towels / "garment").chmod(0o755)
    shell = script + "\nCOMP_WORDS=(garment list garment = Gr)\nCOMP_CWORD=4\n_garment_completion ./garment\n"
    done = subprocess.run(
        ["bash", "-c", shell + 'echo "${COMPREPLY[@]}"'], cwd=towels, capture_output=True, text=True, check=True
    )
    assert (done.stdout, done.stderr) == ("GreenTowel\n", "")


@pytest.mark.parametrize("verb", [verb for verb in VERBS if verb not in {"init", "doctor"}])
def test_no_verb_imports_what_is_heavy_to_complete(towels: Path, verb: str) -> None:
    offered(towels, verb, "")


def test_completion_is_installed_where_the_shell_looks(tmp_path: Path) -> None:
    setting = {"HOME": str(tmp_path), "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    for shell, file in (("bash", ".bash_completions/garment.sh"), ("fish", ".config/fish/completions/garment.fish")):
        subprocess.run(
            [*GARMENT, "--install-completion", shell], env=os.environ | setting, check=True, capture_output=True
        )
        assert "_GARMENT_COMPLETE" in (tmp_path / file).read_text()


@pytest.mark.parametrize("started", [GARMENT, [str(Path(sys.executable).with_name("garment"))]])
def test_it_has_one_name_and_says_its_version(started: list[str]) -> None:
    if not Path(started[0]).exists():
        pytest.skip("the command is not installed")
    version = subprocess.run([*started, "--version"], capture_output=True, text=True, check=True).stdout
    assert re.fullmatch(r"garment-dataset \d+\.\d+\.\S+, Python 3\.\d+\.\d+, /.*garment_dataset\n", version)
    usage = subprocess.run([*started, "list", "--foo"], capture_output=True, text=True, check=False)
    assert usage.returncode == 2
    assert usage.stderr == "garment list: no such option: --foo. `garment list --help` says what there is.\n"
    shown = subprocess.run([*started, "list", "--help"], capture_output=True, text=True, check=True).stdout
    assert shown.startswith("Usage: garment list [OPTIONS]")


@pytest.mark.parametrize(
    "line",
    ["lst", "list --jsn", "show", "build -j x", "build -j -1", "build --engine foo", "gc x", "new stag", "score . /x"],
)
def test_a_wrong_command_is_one_line(line: str) -> None:
    done = subprocess.run([*GARMENT, *line.split()], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(r"garment( \w+)?: .*[.?] `garment.* --help` says what there is\.\n", done.stderr)
    if line.startswith("build -j"):
        assert f"found '{line.rsplit(maxsplit=1)[-1]}'" in done.stderr


def test_the_list_of_verbs_is_whole_in_80_columns() -> None:
    done = subprocess.run(
        [*GARMENT, "--help"], env=os.environ | {"COLUMNS": "80"}, capture_output=True, text=True, check=True
    )
    assert "..." not in done.stdout.partition("Commands:")[2]
