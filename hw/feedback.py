"""Every closed loop that a driver can run on top of load compensation, together."""

from __future__ import annotations

from naoimitate.core.frames import Array
from naoimitate.hw.inertia import Inertia
from naoimitate.hw.learning import LearningCompensation
from naoimitate.hw.pacing import Pacing
from naoimitate.hw.servo_command import servo_command
from naoimitate.hw.stabiliser import Stabiliser
from naoimitate.hw.target import ServoCommand
from naoimitate.robot.model import RobotModel


def feedback(
    robot: RobotModel,
    stiffness: Array | float | None,
    period: float,
    *,
    learning: bool = True,
    balance: bool = True,
) -> ServoCommand:
    """Load compensation that learns how soft the servos are, under balance from what the robot measures.

    stiffness: what the servos are taken for, (J,) or one for all, N m/rad; None: nobody knows, and balance is alone.
    period: s between two calls. Balance needs what learning finds, and brings it along; without ``balance`` nothing
    else is closed but ``learning``, where that is asked for.
    """
    if not balance:
        if learning and stiffness is not None:
            return Inertia(robot, LearningCompensation(robot, stiffness, period), period)
        return servo_command(robot, stiffness, period)
    if stiffness is None:
        return Stabiliser(robot, servo_command(robot, None, period), period)
    servos = LearningCompensation(robot, stiffness, period)
    body = Stabiliser(robot, servos, period, softness=lambda: servos.factor)
    return Pacing(robot, Inertia(robot, body, period), period)
