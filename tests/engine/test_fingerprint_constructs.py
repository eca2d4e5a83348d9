"""The fingerprint against an oracle: where a module, run before and after an edit, gives another result, it changes.

``constructs.txt`` holds edits, each of its own kind. ``holders.txt`` and ``edits.txt`` are two halves of a module: ways
in which ``A`` is, or is in, or leads to what ``X`` holds, and ways to change ``A``; every one of the first with every
one of the second is a module in which ``X`` changes.
"""

from __future__ import annotations

import ast
import contextlib
import importlib
import io
import random
import re
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tests.engine.test_fingerprint import edits, laws, of, write

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

SHORT = 200
BEFORE = """
import functools, itertools, operator, copy, contextlib, collections, random
from dataclasses import dataclass, field
from typing import NamedTuple
"""
AFTER = """
def f(): return SHOW(X)
def SHOW(x):
    x = x() if callable(x) and not isinstance(x, type) else x
    return repr(x if isinstance(x, (list, dict, tuple, collections.deque)) else getattr(x, "t", x))
"""


def outcome(folder: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> str:
    """Run ``f`` of a package written from ``text``, all of it imported anew, and return what it gives as text."""
    write(folder, text)
    with monkeypatch.context() as patch, contextlib.redirect_stdout(io.StringIO()), np.errstate(all="raise"):
        patch.syspath_prepend(str(folder))
        patch.setattr(sys, "dont_write_bytecode", True)
        importlib.invalidate_caches()
        try:
            return _addressless(repr(importlib.import_module("pkg.m").f()))
        finally:
            for name in [name for name in sys.modules if name.partition(".")[0] == "pkg"]:
                del sys.modules[name]


def _addressless(text: str) -> str:
    return re.sub("0x[0-9a-f]+", "", text)


@pytest.mark.parametrize(("before", "after"), edits("constructs"))
def test_an_edit_that_changes_the_result_changes_the_fingerprint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, before: str, after: str
) -> None:
    assert outcome(tmp_path, monkeypatch, before) != outcome(tmp_path, monkeypatch, after)
    assert of(tmp_path, before).digest != of(tmp_path, after).digest


def pairs() -> list[tuple[str, str, str, str]]:
    """Return every holder with every edit: two names, and two texts."""
    every = [
        (holder, edit, one, other) for holder, one in laws("holders").items() for edit, other in laws("edits").items()
    ]
    random.Random(3).shuffle(every)
    return every


def modules_of(holder: str, edit: str) -> Iterator[str]:
    """Yield a module without the edit, one with it, and others: with another value, and half of it, if that is code."""
    yield BEFORE + holder + AFTER
    yield f"{BEFORE}{holder}\n{edit}{AFTER}"
    yield f"{BEFORE}{holder}\n{edit.replace('9', '8')}{AFTER}"
    half = f"{BEFORE}{holder}\n{edit.rpartition(chr(10))[0]}{AFTER}"
    with contextlib.suppress(SyntaxError):
        ast.parse(half)
        yield half


@pytest.mark.parametrize(
    ("start", "stop"), [(0, SHORT), pytest.param(SHORT, None, marks=pytest.mark.slow)], ids=["some", "all others"]
)
def test_whatever_leads_to_a_variable_may_change_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, start: int, stop: int | None
) -> None:
    missed, compared = [], 0
    for holder, edit, one, other in pairs()[start:stop]:
        found = [(outcome(tmp_path, monkeypatch, text), of(tmp_path, text).digest) for text in modules_of(one, other)]
        results, digests = [result for result, _ in found], [digest for _, digest in found]
        assert results[0] != results[1], f"{holder} / {edit}: no change at all"
        compared += 1
        if any(results[1] != result and digests[1] == digest for result, digest in found):
            missed.append(f"{holder} / {edit}")
    assert not missed
    assert compared >= min(SHORT, len(pairs()) - start)
