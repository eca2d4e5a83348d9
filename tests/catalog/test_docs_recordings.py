"""The page about data sets of one's own: what stands there is what the package takes."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from garment_dataset.catalog.columns import ColumnEntry
from garment_dataset.catalog.ignoring import Ignoring, compile_pattern
from garment_dataset.catalog.names import repair_name
from garment_dataset.catalog.schemes import compile_scheme
from garment_dataset.layout import NamesSettings

PAGE = (Path(__file__).parents[2] / "docs" / "recordings.md").read_text("utf-8")
SECTION = PAGE.partition("## Data sets of your own")[2].partition("\n## ")[0]
TABLES = [tomllib.loads(text) for text in re.findall(r"```toml\n(.*?)```", SECTION, re.DOTALL)]


def test_the_columns_of_the_page_are_taken() -> None:
    entries = {name: ColumnEntry.model_validate(entry) for name, entry in TABLES[0].items()}
    assert {name: entry.type for name, entry in entries.items()} == {"operator": "text", "mass_kg": "number"}


def test_the_pattern_of_the_page_is_taken() -> None:
    name = compile_scheme(NamesSettings.model_validate(TABLES[1]["names"])).parse("scarf-corner-v0p5-across-002.bag")
    assert str(name) == "scarf-corner-v0p5-across-002"


def test_the_patterns_of_the_page_leave_out_what_it_says() -> None:
    lines = re.findall(r"```\n(# trials.*?)```", SECTION, re.DOTALL)[0].splitlines()
    rules = Ignoring(tuple(compile_pattern(line) for line in lines if line and not line.startswith("#")))
    assert rules.leaves_out("trial_6_0.5_R1.bag", is_folder=False)
    assert rules.leaves_out("2025/old", is_folder=True)
    assert not rules.leaves_out("trial_7_0.5_R1.bag", is_folder=False)
    assert not rules.leaves_out("old", is_folder=False)


def test_what_the_page_says_was_appended_was() -> None:
    names = re.findall(r"`(towel_0\.5_R1_[-0-9]+\.bag)`", SECTION)
    assert len(names) == 2
    assert {repair_name(name) for name in names} == {"towel_0.5_R1"}
