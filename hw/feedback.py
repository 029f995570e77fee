"""Every closed loop that a driver can run on top of gravity compensation, together."""

from __future__ import annotations

from naoimitate.core.frames import Array
from naoimitate.hw.learning import LearningCompensation
from naoimitate.hw.pacing import Pacing
from naoimitate.hw.servo_command import ServoCommand, servo_command
from naoimitate.hw.stabiliser import Stabiliser
from naoimitate.robot.model import RobotModel


def feedback(robot: RobotModel, stiffness: Array | float | None, period: float) -> ServoCommand:
    """Gravity compensation that learns how soft the servos are, under balance from what the robot measures.

    stiffness: what the servos are taken for, (J,) or one for all, N m/rad; None: nobody knows, balance alone. period:
    s between two calls.
    """
    if stiffness is None:
        return Stabiliser(robot, servo_command(robot, None), period)
    learning = LearningCompensation(robot, stiffness, period)
    balance = Stabiliser(robot, learning, period, softness=lambda: learning.factor)
    return Pacing(robot, balance, period)
