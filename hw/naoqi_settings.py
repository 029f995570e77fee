"""How a NAO is reached and moved, and which loops are closed on the way from a target to its servos."""

from __future__ import annotations

from dataclasses import dataclass

from naoimitate.hw.feedback import feedback
from naoimitate.hw.target import ServoCommand
from naoimitate.robot.model import RobotModel


@dataclass(frozen=True)
class NaoqiSettings:
    """How to reach a NAO, and how to move it."""

    url: str = "tcp://nao.local:9559"
    """Address; robots with NAOqi 2.9 ask for tcps://HOST:9503, user and password."""
    user: str = ""
    password: str = ""
    patience: float = 5.0
    """[s] to wait for an answer before the start."""
    period: float = 0.02
    """[s] of ALMotion."""
    stiffness: float = 1.0
    """Share of the servos' stiffness while the robot imitates."""
    ramp: float = 1.5
    """[s] from no stiffness to the full one."""
    stand_speed: float = 0.5
    """Share of the speed with which it stands up."""
    approach: float = 0.3
    """[rad/s] Highest speed of the farthest joint on the way from NAOqi's stand to the model's posture ``stand``."""
    servo_stiffness: float | None = None
    """[N m/rad] of the servos, for load compensation; None = none, since nobody publishes it: measure it first."""
    learning: bool = False
    """Whether ``servo_stiffness`` is a guess that encoders and feet correct, see ``hw.learning``: tried in simulation
    only."""
    balance: bool = False
    """Whether the loops of ``hw.feedback`` are closed: balance, and learning where ``servo_stiffness`` is given. Tried
    in simulation only."""


def loops_of(robot: RobotModel, settings: NaoqiSettings) -> ServoCommand:
    """What load and balance add to a target, new for each connection: loops remember the robot's clock."""
    known = settings.servo_stiffness
    stiffness = None if known is None else known * settings.stiffness
    return feedback(robot, stiffness, settings.period, learning=settings.learning, balance=settings.balance)
