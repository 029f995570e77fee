"""From a command to servo angles: the one place where drivers add what servos need to end up where they should.

A driver asks its ``ServoCommand`` once every period, with what it was told last and what the robot measures then.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from naoimitate.core.frames import Array, RobotCommand
from naoimitate.hw.compensation import GravityCompensation
from naoimitate.hw.driver import RobotState
from naoimitate.robot.model import RobotModel


class Target(NamedTuple):
    """The part of a RobotCommand that a body can carry out: q (J,) rad, torso (3,) m and (4,), support, hands (2,)."""

    q: Array
    base_pos: Array
    base_quat: Array
    support: str
    hand_opening: Array | None = None


ServoCommand = Callable[[Target, RobotState], Array]
"""Turns a target and the robot's newest state into the angles (J,) rad that its servos are sent."""


def target_of(command: RobotCommand) -> Target:
    """What is left of a command for the servos."""
    return Target(command.q, command.base_pos, command.base_quat, command.support, command.hand_opening)


def servo_command(robot: RobotModel, stiffness: Array | float | None) -> ServoCommand:
    """Gravity compensation for servos of a stiffness, (J,) or one for all, N m/rad; None: the posture as it is."""
    if stiffness is None:
        return lambda target, state: target.q
    gravity = GravityCompensation(robot)
    return lambda target, state: gravity.command(target.q, target.base_quat, target.support, stiffness)
