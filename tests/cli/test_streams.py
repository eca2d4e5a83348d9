"""What reaches stdout: no control letters, no error of encoding, and an end without a word when nobody reads."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from garment_dataset.cli.output import print_json
from garment_dataset.cli.streams import REPLACING, SafeStream, legible

GARMENT = [sys.executable, "-m", "garment_dataset"]


def written(text: str, encoding: str) -> bytes:
    raw = io.BytesIO()
    stream = SafeStream(raw, encoding, errors=REPLACING)
    stream.write(text)
    stream.flush()
    return raw.getvalue()


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # of time on a busy machine nothing is meant
@given(st.text(), st.sampled_from(["utf-8", "ascii", "latin-1", "cp1252", "utf-16"]))
def test_any_text_is_written_and_no_control_letter(text: str, encoding: str) -> None:
    shown = written(text, encoding).decode(encoding)
    assert all(each in "\n\t" or each.isprintable() for each in shown)
    if text.isascii() and text.isprintable():
        assert shown == text


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.text(st.characters(), max_size=30), st.sampled_from(["utf-8", "ascii", "latin-1"]))
def test_json_says_the_same_in_every_encoding(text: str, encoding: str) -> None:
    raw = io.BytesIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdout", SafeStream(raw, encoding, errors=REPLACING))
        print_json({"name": text})
        sys.stdout.flush()
        shown = raw.getvalue().decode(encoding)
    assert json.loads(shown) == {"name": text}
    assert all(each == "\n" or each.isprintable() for each in shown)


def test_our_own_signs_have_letters_everywhere() -> None:
    ascii_only = SafeStream(io.BytesIO(), "ascii")
    assert legible("60×36 (error/std)² [°] naïve", ascii_only) == r"60x36 (error/std)^2 [deg] na\xefve"
    assert legible("a\x1b[31mb\nc", ascii_only) == r"a\x1b[31mb\nc"


@pytest.mark.parametrize("arguments", [["list"], ["list", "--json"], ["--help"], ["dag", "--params"]])
def test_a_reader_that_goes_ends_it_without_a_word(tmp_path: Path, arguments: list[str]) -> None:
    subprocess.run([*GARMENT, "init", "ws"], cwd=tmp_path, check=True, capture_output=True)
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [*GARMENT, *arguments], cwd=tmp_path / "ws", stdout=writer, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(writer)
    assert done.returncode == 141
    assert [line for line in done.stderr.splitlines() if "recordings" not in line] == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
def test_a_full_disk_is_one_line() -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([*GARMENT, "--help"], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == "garment: <stdout>: No space left on device\n"


@pytest.mark.parametrize("redirection", [">&-", "2>&-", ">&- 2>&-"])
def test_closed_streams_are_no_error(tmp_path: Path, redirection: str) -> None:
    shell = f"'{sys.executable}' -m garment_dataset init ws {redirection} && cd ws"
    shell += f" && '{sys.executable}' -m garment_dataset list {redirection}"
    done = subprocess.run(["sh", "-c", shell], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False)
