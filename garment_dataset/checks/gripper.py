"""Whether the gripper is known, in view, and moving as an arm can."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.checks.finding import Found

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.bags import Camera
    from garment_dataset.checks.contract import Contract, GripperRule
    from garment_dataset.checks.facts import Facts, GripperFacts


def check_gripper(facts: Facts, contract: Contract) -> Iterator[Found]:
    """Yield ``gripper-missing``, ``-partial``, ``-outside``, ``-still`` and ``-jump``."""
    rule, gripper = contract.gripper, facts.gripper
    if rule is None or gripper is None or not len(gripper.times_ns):
        return
    if not gripper.known.any():
        text = f"not known at any of {len(gripper.times_ns)} images: {gripper.track.reason[0]}"
        hint = f"Record {rule.topic}, or /tf with the frames of the arm and of the camera."
        yield Found("gripper-missing", text, rule.topic, hint=hint)
        return
    yield from _partial(gripper, rule, facts)
    camera = facts.cameras["depth"].camera if "depth" in facts.images else None
    if camera is not None:
        yield from _outside(gripper, rule, facts, camera)
    yield from _motion(gripper, rule, facts)


def check_background(facts: Facts, contract: Contract) -> Iterator[Found]:
    """Yield ``background-missing``."""
    if facts.axis in contract.background.axes and facts.background is not None:
        yield Found("background-missing", f"no image of the empty scene: expected {facts.background}")


def _partial(gripper: GripperFacts, rule: GripperRule, facts: Facts) -> Iterator[Found]:
    known = gripper.known
    if known.mean() < rule.least_known:
        first = int((~known).argmax())
        text = f"known at {100 * known.mean():.0f} % of the images, expected {100 * rule.least_known:g} %"
        why = gripper.track.reason[first]
        yield Found("gripper-partial", f"{text}; {why}", rule.topic, facts.time_s(gripper.times_ns[first]))


def _outside(gripper: GripperFacts, rule: GripperRule, facts: Facts, camera: Camera) -> Iterator[Found]:
    seen = gripper.in_view(camera)
    if seen.mean() < rule.least_in_view:
        first_ns = gripper.times_ns[gripper.known][~seen][0]
        text = f"in view at {100 * seen.mean():.0f} % of the images, expected {100 * rule.least_in_view:g} %"
        hint = "Is the camera where the transforms say it is?"
        yield Found("gripper-outside", text, rule.topic, facts.time_s(first_ns), hint)


def _motion(gripper: GripperFacts, rule: GripperRule, facts: Facts) -> Iterator[Found]:
    if gripper.travel_m < rule.least_travel_m:
        text = f"it moves by {1e3 * gripper.travel_m:.1f} mm, expected {1e3 * rule.least_travel_m:g} mm"
        yield Found("gripper-still", text, rule.topic, hint="Did the arm run when the recording was made?")
    speed_m_s = gripper.speed_m_s
    if len(speed_m_s) and speed_m_s.max() > rule.max_speed_m_s:
        at = int(speed_m_s.argmax())
        text = f"it moves at {speed_m_s[at]:.1f} m/s, expected at most {rule.max_speed_m_s:g} m/s"
        time_s = facts.time_s(gripper.times_ns[gripper.known][at])
        yield Found("gripper-jump", text, rule.topic, time_s, "No arm does; its transforms are wrong, or their stamps.")
