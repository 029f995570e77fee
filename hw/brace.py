"""A robot that falls: limp at once, or once into a posture that protects its head, then soft.

The postures are the robot's data: ``brace_front``, ``brace_back``, ``brace_left`` and ``brace_right`` of robot.yaml,
for a fall to that side. A robot without the one that it needs goes limp.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from naoimitate.core.frames import Array, RobotCommand
from naoimitate.hw.condition import GuardSettings
from naoimitate.hw.driver import Driver
from naoimitate.hw.lean import up_from_angles, up_from_quat


def side_of_fall(planned_quat: Array, angles: Array) -> str | None:
    """``front``, ``back``, ``left`` or ``right``: whither a torso leans from its plan, as itself sees it.

    planned_quat: (4,) (w, x, y, z). angles: (2,) rad, measured roll and pitch; None where they are not.
    """
    planned, measured = up_from_quat(planned_quat), up_from_angles(angles)
    x, y = planned[0] - measured[0], planned[1] - measured[1]
    if not math.isfinite(x + y):
        return None
    if abs(x) >= abs(y):
        return "front" if x > 0.0 else "back"
    return "left" if y > 0.0 else "right"


def braced(command: RobotCommand | None, postures: Mapping[str, Array], angles: Array) -> RobotCommand | None:
    """The command in force with the protective posture in place of its own; None where there is none.

    postures: of the robot, (J,) rad by name. angles: (2,) rad, measured roll and pitch of the torso.
    """
    if command is None:
        return None
    q = postures.get(f"brace_{side_of_fall(command.base_quat, angles)}")
    return None if q is None else replace(command, q=q.copy())


def give_way(driver: Driver, settings: GuardSettings, brace: RobotCommand | None) -> None:
    """Soften a robot that falls, after the protective posture where there is one; whatever fails, it gets soft."""
    if brace is None:
        driver.soften(settings.fall_stiffness)
        return
    try:
        driver.write(brace)
    except BaseException:
        driver.soften(settings.fall_stiffness)
        raise
    driver.soften(settings.brace_stiffness)
