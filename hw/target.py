"""What a servo command is made from, and into."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from naoimitate.core.frames import Array, RobotCommand
from naoimitate.hw.driver import RobotState


class Target(NamedTuple):
    """The part of a RobotCommand that a body can carry out.

    q: (J,) rad. base_pos: (3,) m, base_quat: (4,), torso in the world. support: ``D``, ``L`` or ``R``. hand_opening:
    (2,). time: s on the plan's clock, NaN where there is none. acceleration: (J + 1, 3) m/s^2 of the links' centres of
    mass along the torso's axes, None where nobody knows.
    """

    q: Array
    base_pos: Array
    base_quat: Array
    support: str
    hand_opening: Array | None = None
    time: float = math.nan
    acceleration: Array | None = None


ServoCommand = Callable[[Target, RobotState], Array]
"""Turns a target and the robot's newest state into the angles (J,) rad that its servos are sent."""


def target_of(command: RobotCommand) -> Target:
    """What is left of a command for the servos."""
    c = command
    return Target(c.q, c.base_pos, c.base_quat, c.support, c.hand_opening, c.time)
