"""Every verb with names and tables that hold anything, on terminals and pipes of any encoding and width."""

from __future__ import annotations

import fcntl
import gc
import io
import os
import re
import struct
import subprocess
import sys
import termios
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import pytest

from garment_dataset import cli
from garment_dataset.cli.fitting import cell_width
from tests.conftest import make_workspace

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace

ODD = "a\x1b[31mb\x07 é שלום 👕\u202ec\x9b2J"
UNDECODABLE = os.fsdecode(b"d\xe4\x1b[2J")
NAME = "GreenTowel_Ruler_01_pi16_0.5_R1"
NEW = "{new}"

LINES: dict[str, list[list[str]]] = {
    "init": [["init", NEW]],
    "list": [["list"], ["list", "--json"], ["list", "--csv"], ["list", f"garment={ODD}"]],
    "show": [["show", NAME], ["show", NAME, "--json"], ["show", NAME, "--save", f"{ODD}.gif"]],
    "lint": [["lint"], ["lint", "--json"], ["lint", "--rename"]],
    "check": [["check"], ["check", f"{ODD}.bag"]],
    "build": [["build", "-j", "0"], ["build", "--json"], ["build", "--dry-run"], ["build", "-s", ODD]],
    "status": [["status"], ["status", "-s", "decode"], ["status", "--json"]],
    "why": [["why", NAME], ["why", NAME, ODD]],
    "dag": [["dag"], ["dag", "--params"], ["dag", "--form", "mermaid"]],
    "verify": [["verify"], ["verify", "--recompute", "1"]],
    "gc": [["gc"]],
    "accept": [["accept", "all", "-m", ODD]],
    "log": [["log"], ["log", "--json"]],
    "diff": [["diff", "default", "default"], ["diff", "default", ODD]],
    "doctor": [["doctor"]],
    "salvage": [["salvage", "{bag}"]],
    "record-plan": [["record-plan", "GreenTowel_Free_pi16_0.5_R1"]],
    "watch": [["watch", "--once", "--settle-s", "0", "-j", "0"], ["watch", "--settle-s", "-1"]],
    "mask": [["mask"]],
    "simulate": [["simulate", ODD]],
    "score": [["score", ".", "recordings"], ["score", ".", ODD]],
    "plot": [["plot", NAME, "--save", "{new}.png"], ["plot", NAME, "--table", f"{ODD}.{ODD}", "--save", "a.png"]],
    "new": [["new", "stage", "mine"], ["new", "stage", ODD]],
}
"""Lines in an order in which each finds what it is about; those not named get something odd."""


class Mode(NamedTuple):
    """A terminal, or a pipe."""

    encoding: str
    is_terminal: bool
    columns: int = 80


MODES = [
    Mode("ascii", True, 20),
    *(pytest.param(mode, marks=pytest.mark.slow) for mode in (Mode("utf-8", False), Mode("utf-8", True))),
    pytest.param(Mode("latin-1", False), marks=pytest.mark.slow),
]


class Raw(io.BytesIO):
    """What stands behind a stream."""

    def __init__(self, is_terminal: bool) -> None:
        super().__init__()
        self.is_terminal = is_terminal

    def isatty(self) -> bool:
        return self.is_terminal


@pytest.fixture
def odd(tmp_path: Path, sample_bags: dict[str, Path]) -> Workspace:
    """A workspace whose folder, tables and bags have names that no terminal is to be given as they are."""
    try:
        place = make_workspace(tmp_path / ODD)
        folder = place.recordings_dir / UNDECODABLE
        folder.mkdir()
    except OSError:
        pytest.skip("this file system has no such names")
    (folder / f"{NAME}.bag").symlink_to(sample_bags[NAME])
    (place.recordings_dir / "FelShirt_Free_pi16_0.5_R1.bag").touch()
    for name in (f"{ODD}.bag", f"{UNDECODABLE}.bag", "bad\nname.bag"):
        (place.recordings_dir / name).touch()
    garments = place.catalog_dir / "garments.csv"
    head, *rows = garments.read_text().splitlines()
    lines = [f"{head},note", *(f"{row.replace('green', ODD)},\U0001f9e5 \x1b]0;title\x07" for row in rows)]
    garments.write_text("\n".join(lines) + "\n")
    return place


@pytest.fixture
def restored() -> Iterator[None]:
    """Leave the process as it was: ``main`` is made for one that ends."""
    thresholds, shown = gc.get_threshold(), warnings.showwarning
    yield
    gc.set_threshold(*thresholds)
    warnings.showwarning = shown


def run(mode: Mode, arguments: list[str], patch: pytest.MonkeyPatch) -> tuple[int, str]:
    """Return the exit code and all that was written."""
    raw = Raw(mode.is_terminal)
    stream = io.TextIOWrapper(raw, mode.encoding, errors="strict")
    with patch.context() as only:
        only.setattr(sys, "argv", ["garment", *arguments])
        only.setattr(sys, "stdout", stream)
        only.setattr(sys, "stderr", stream)
        only.setenv("COLUMNS", str(mode.columns))
        only.setenv("TERM", "dumb")
        only.setenv("NO_COLOR", "1")
        with warnings.catch_warnings():
            warnings.simplefilter("default")
            try:
                cli.main()
                code = 0
            except SystemExit as error:
                code = int(error.code or 0)
        sys.stdout.flush()
        sys.stderr.flush()
        return code, raw.getvalue().decode(mode.encoding)  # the streams close it when they go


@pytest.mark.usefixtures("restored")
@pytest.mark.parametrize("mode", MODES, ids=str)
def test_no_verb_writes_what_a_terminal_should_not_get(
    odd: Workspace, mode: Mode, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(odd.root)
    bag = str(odd.recordings_dir / "FelShirt_Free_pi16_0.5_R1.bag")
    unknown = [[verb, ODD] for verb in cli.VERBS if verb not in LINES]
    lines = [line for lines in LINES.values() for line in lines] + unknown + [[verb, "--help"] for verb in cli.VERBS]
    for line in [*lines, [ODD], ["list", f"--{ODD}"], ["--help"], ["--version"], ["list", "-w", ODD]]:
        arguments = [word.format(new=f"{ODD}-new", bag=bag) if "{" in word else word for word in line]
        code, text = run(mode, arguments, monkeypatch)
        assert code in (0, 1, 2), (line, text)
        assert "Traceback" not in text, (line, text)
        assert all(each in "\n\t" or each.isprintable() for each in text), (line, text)


def in_terminal(cwd: Path, columns: int, *arguments: str) -> str:
    """Return what a command writes to a terminal of its own."""
    ours, theirs = os.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    environment = {name: value for name, value in os.environ.items() if name not in {"COLUMNS", "CI"}}
    command = [sys.executable, "-m", "garment_dataset", *arguments]
    process = subprocess.Popen(
        command, cwd=cwd, stdout=theirs, stderr=theirs, stdin=subprocess.DEVNULL, env=environment | {"TERM": "xterm"}
    )
    os.close(theirs)
    written = b""
    while True:
        try:
            got = os.read(ours, 65536)
        except OSError:  # Linux says so when nobody has the other end any more
            break
        if not got:
            break
        written += got
    os.close(ours)
    assert process.wait() in (0, 1)
    return written.decode().replace("\r\n", "\n")


def test_nothing_of_typers_own_is_coloured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "1")
    text = in_terminal(tmp_path, 80, "--install-completion", "bash")
    assert text.startswith(f"bash completion installed in {tmp_path}/.bash_completions/garment.sh\n")


def test_a_terminal_of_80_columns_gets_whole_names(workspace: Workspace) -> None:
    names = [row.recording for row in workspace.catalog().rows]
    for arguments in (["list"], ["status"], ["build", "-j", "0"], ["status"], ["log"], ["verify"]):
        text = in_terminal(workspace.root, 80, *arguments)
        plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text)
        assert "\x1b" not in plain
        if arguments == ["list"]:
            assert text == plain  # nothing is coloured
            assert all(name in text for name in names)
            table = [line for line in text.splitlines() if not line.startswith(("backgrounds", "47 recordings"))]
            assert max(map(cell_width, table)) <= 80
        assert "Traceback" not in text
