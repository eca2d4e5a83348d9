"""Renames: no two bags ever get one name, whatever is proposed, and every order of steps ends where it should."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.catalog.lint import Finding
from garment_dataset.catalog.renaming import Rename, plan_renames, proposals, steps_of

NAMES = [f"T_H_0{number}_pi16_0.5_{axis}1.bag" for number in range(1, 4) for axis in "RB"]
FOLDER = Path("recordings")


def at(name: str) -> Path:
    return FOLDER / name


def after(names: set[str], renames: tuple[Rename, ...]) -> dict[Path, str]:
    """Do the steps on names alone; return who each bag was, by where it is."""
    held = {at(name): name for name in names}
    for old, new in steps_of(renames):
        assert old in held
        assert new not in held
        held[new] = held.pop(old)
    return held


@given(st.dictionaries(st.sampled_from(NAMES), st.sampled_from(NAMES), max_size=6), st.sets(st.sampled_from(NAMES)))
def test_every_plan_keeps_all_bags_and_gives_each_the_name_it_says(wanted: dict[str, str], others: set[str]) -> None:
    wanted = {old: new for old, new in wanted.items() if old != new}
    bags = others | wanted.keys()
    plan = plan_renames({at(old): (new,) for old, new in wanted.items()}, [at(name) for name in bags], {})
    held = after(bags, plan.renames)
    assert sorted(held.values()) == sorted(bags)
    for rename in plan.renames:
        assert held[rename.target] == rename.path.name
    assert {rename.path for rename in plan.renames} | {each.path for each in plan.refused} == {
        at(old) for old in wanted
    }


def test_two_bags_swap_their_names() -> None:
    first, second, *_ = NAMES
    plan = plan_renames({at(first): (second,), at(second): (first,)}, [at(first), at(second)], {})
    assert not plan.refused
    assert after({first, second}, plan.renames) == {at(first): second, at(second): first}


def test_a_name_that_a_bag_of_another_folder_keeps_is_refused() -> None:
    first, second, *_ = NAMES
    other = Path("recordings/more") / second
    plan = plan_renames({at(first): (second,)}, [at(first), other], {})
    assert plan.refused[0].reason == f"{other} has that name already"


def test_one_refusal_refuses_whoever_would_have_taken_its_name() -> None:
    first, second, third, *_ = NAMES
    proposed = {at(first): (second,), at(second): (third,)}
    plan = plan_renames(proposed, [at(first), at(second)], {at(second): "a link into somewhere else"})
    assert {each.path.name for each in plan.refused} == {first, second}
    assert plan.renames == ()


def test_two_to_one_name_are_both_refused_also_when_case_alone_tells_them_apart() -> None:
    proposed = {at("a.bag"): ("Towel_Free_0.5_R1.bag",), at("b.bag"): ("towel_Free_0.5_R1.bag",)}
    plan = plan_renames(proposed, list(proposed), {})
    assert {each.reason for each in plan.refused} == {"another bag would get that name, too"}


def test_a_change_of_case_is_one_step() -> None:
    rename = Rename(at("towel_Free_0.5_r1.bag"), "Towel_Free_0.5_R1.bag")
    plan = plan_renames({rename.path: (rename.name,)}, [rename.path], {})
    assert plan.renames == (rename,)
    assert steps_of(plan.renames) == ((rename.path, rename.target),)


@pytest.mark.parametrize("reverse", [False, True])
def test_what_the_content_says_goes_before_how_the_name_is_written(*, reverse: bool) -> None:
    path = at("FelShirt_Free_pi16.0.5_B1.bag")
    written, said = "FelShirt_Free_pi16_0.5_B1.bag", "FelShirt_Free_pi16_0.5_R1.bag"
    findings = [Finding("misnamed", "error", "x", str(path), "m", None, target) for target in (written, said)]
    found = proposals(findings[::-1] if reverse else findings, {str(path): path})
    assert found == {path: (said,)}


def test_findings_that_disagree_rename_nothing() -> None:
    first, second, third, *_ = NAMES
    plan = plan_renames({at(first): (second, third)}, [at(first)], {})
    assert plan.refused[0].reason == f"findings disagree: {second} or {third}"
