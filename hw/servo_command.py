"""From a command to servo angles: the one place where drivers add what servos need to end up where they should.

A driver asks its ``ServoCommand`` once every period, with what it was told last and what the robot measures then.
"""

from __future__ import annotations

from naoimitate.core.frames import Array
from naoimitate.hw.compensation import LoadCompensation
from naoimitate.hw.driver import RobotState
from naoimitate.hw.inertia import Inertia
from naoimitate.hw.target import ServoCommand, Target
from naoimitate.robot.model import RobotModel


def servo_command(robot: RobotModel, stiffness: Array | float | None, period: float) -> ServoCommand:
    """Load compensation for servos of a stiffness, (J,) or one for all, N m/rad; None: the posture as it is.

    period: s between two calls.
    """
    if stiffness is None:
        return lambda target, state: target.q
    load = LoadCompensation(robot)

    def compensated(target: Target, state: RobotState) -> Array:
        return load.command(target.q, target.base_quat, target.support, stiffness, target.acceleration)

    return Inertia(robot, compensated, period)
