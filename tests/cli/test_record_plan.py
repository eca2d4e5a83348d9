"""``garment record-plan`` as an operator meets it."""

from __future__ import annotations

import json
import shlex
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace
    from tests.cli.conftest import Garment

NAME = "GreenTowel_Free_pi16_0.5_R1"


def test_what_is_printed_can_be_pasted(workspace: Workspace, garment: Garment) -> None:
    text = garment("record-plan", NAME, cwd=workspace.root).out
    told = json.loads(garment("record-plan", NAME, "--json", cwd=workspace.root).out)["commands"]
    begin = text.index("  rosbag record")
    pasted = text[begin : text.index("\n\n", begin)].replace("\\\n", "")
    assert shlex.split(pasted) == shlex.split(told["ros1"])
    assert str(workspace.recordings_dir / f"{NAME}.bag") in told["ros1"]
    assert "garment check" in text
    assert "overwrites" in text


def test_what_is_there_is_said_and_gets_no_command(workspace: Workspace, garment: Garment) -> None:
    ran = garment("record-plan", "GreenTowel_Ruler_01_pi16_0.5_R1", cwd=workspace.root, code=1)
    assert "already there" in ran.out
    assert "rosbag record" not in ran.out


def test_a_name_that_is_not_known_is_one_line(workspace: Workspace, garment: Garment) -> None:
    ran = garment("record-plan", "GreenTowel_Fre_pi16_0.5_R1", cwd=workspace.root, code=2)
    assert ran.out == ""
    assert len(ran.err.splitlines()) == 1
    assert NAME in ran.err
