"""Colours that the colour-blind tell apart (Okabe and Ito), the same in every viewer."""

from __future__ import annotations

POINTS = ((213, 94, 0), (0, 114, 178), (0, 158, 115), (204, 121, 167), (230, 159, 0), (86, 180, 233), (240, 228, 66))
GRIPPER = (160, 160, 160)
CHAIN = (220, 50, 47)
OUTLINE = (240, 228, 66)
CURVE = (255, 255, 255)


def point_color(number: int) -> tuple[int, int, int]:
    """Return the colour of a point, 0: the gripper's, as red, green, blue of 255."""
    return GRIPPER if number == 0 else POINTS[(number - 1) % len(POINTS)]
