"""What every page says can be done can be done: commands, options, make targets, imports, links and pictures."""

from __future__ import annotations

import ast
import importlib
import re
import shlex
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import typer.main

from garment_dataset.cli import application

if TYPE_CHECKING:
    from collections.abc import Callable

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
CODE = re.compile(r"^```(?P<kind>\w*)\n(?P<text>.*?)^```", re.DOTALL | re.MULTILINE)
INLINE = re.compile(r"`([^`\n]+)`")
LINK = re.compile(r"\]\((?P<path>[^)#\s]*)(?:#(?P<anchor>[^)\s]+))?\)")
COMMAND = re.compile(r"^(?:\$ )?garment (?P<rest>.+)$")


def lines_of(page: Path) -> list[str]:
    """Return every line of code on a page, in blocks or within text."""
    text = page.read_text("utf-8")
    blocks = [line for found in CODE.finditer(text) if found["kind"] != "python" for line in found["text"].splitlines()]
    return blocks + INLINE.findall(CODE.sub("", text))


def commands_of(page: Path) -> list[str]:
    return [found["rest"] for line in lines_of(page) if (found := COMMAND.match(line.strip())) is not None]


@cache
def root() -> Any:
    return typer.main.get_command(application())


def slugs_of(page: Path) -> set[str]:
    """Return the anchors that GitHub gives to the headings of a page."""
    text = CODE.sub("", page.read_text("utf-8"))
    heads = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", re.sub(r"[`*]", "", head).lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_pictures_lead_somewhere(page: Path) -> None:
    for found in LINK.finditer(CODE.sub("", page.read_text("utf-8"))):
        if found["path"].startswith(("http://", "https://", "mailto:")):
            continue
        target = (page.parent / found["path"]).resolve() if found["path"] else page
        assert target.exists(), f"{page.name}: {found[0]}"
        if found["anchor"] and target.suffix == ".md":
            assert found["anchor"] in slugs_of(target), f"{page.name}: {found[0]}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_and_option_on_a_page_exists(page: Path) -> None:
    for line in commands_of(page):
        words = shlex.split(re.sub(r"\s{2,}.*| [|>#].*|\.\.\.$", "", line), posix=False)
        if not re.fullmatch(r"[a-z-]+", words[0]) or words[0].startswith("-"):
            continue
        command = root().commands.get(words[0])
        assert command is not None, f"{page.name}: garment {line}"
        if hasattr(command, "commands"):
            command = command.commands.get(
                words[1] if len(words) > 1 else "", command.commands.get("snapshot", command)
            )
        known = {option for each in command.params for option in (*each.opts, *each.secondary_opts)} | {"--help"}
        asked = {word.partition("=")[0] for word in words if word.startswith("--") and len(word) > 2}
        assert asked <= known, f"{page.name}: garment {line}: {sorted(asked - known)}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_make_target_on_a_page_exists(page: Path) -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    for line in lines_of(page):
        found = re.match(r"(?:\$ )?make ([a-z][a-z-]*)\b", line.strip())
        assert found is None or found[1] in targets, f"{page.name}: {line}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_python_on_a_page_is_python_and_what_it_imports_of_ours_exists(page: Path) -> None:
    for found in CODE.finditer(page.read_text("utf-8")):
        if found["kind"] != "python":
            continue
        for node in ast.walk(ast.parse(found["text"], str(page))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "garment_dataset":
                module = importlib.import_module(str(node.module))
                for name in node.names:
                    assert hasattr(module, name.name), f"{page.name}: from {node.module} import {name.name}"


@pytest.mark.parametrize(
    ("check", "text"),
    [
        (test_links_and_pictures_lead_somewhere, "[x](nowhere.md)"),
        (test_links_and_pictures_lead_somewhere, "# Head\n[x](#heads)"),
        (test_every_command_and_option_on_a_page_exists, "`garment biuld`"),
        (test_every_command_and_option_on_a_page_exists, "```console\n$ garment build --jbos 2   # fast\n```"),
        (test_every_command_and_option_on_a_page_exists, "`garment export clouds OUT --evry 3`"),
        (test_every_make_target_on_a_page_exists, "`make demos`"),
        (
            test_python_on_a_page_is_python_and_what_it_imports_of_ours_exists,
            "```python\nfrom garment_dataset import no\n```",
        ),
    ],
)
def test_a_fault_on_a_page_is_found(tmp_path: Path, check: Callable[[Path], None], text: str) -> None:
    page = tmp_path / "page.md"
    page.write_text(text)
    with pytest.raises(AssertionError):
        check(page)
