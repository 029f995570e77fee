"""What every robot offers, simulated or real: connect, read its state, take a command, stop.

A driver takes the newest command at its own period and never waits for one, so that a slow sender cannot freeze the
robot mid-step. Times are seconds on the driver's own monotonic clock, starting with ``connect``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from naoimitate.core.frames import Array, RobotCommand

FSR_NAMES = ("front_left", "front_right", "rear_left", "rear_right")
"""Columns of ``RobotState.fsr``, seen from above with the toes up; rows are the left and the right foot."""
INTERRUPTED = "stopped while the robot was being connected"
"""What a start says that somebody has ended."""


@dataclass(frozen=True)
class RobotState:
    """What a robot measures at one moment.

    time: s on the driver's clock.
    q: (J,) rad, joint encoders in the model's joint order.
    torque: (J,) N m that the servos give; the torque of a shared motor stands at its leading joint.
    angles: (2,) rad, roll and pitch of the torso from the inertial board.
    gyro: (3,) rad/s and accelerometer: (3,) m/s^2 in the torso frame; an upright robot at rest reads (0, 0, +9.81).
    fsr: (2, 4) N, force sensors of the left and right foot, columns as ``FSR_NAMES``.
    fell: the torso leans over 45 deg away from its commanded direction, or has sunk under 60 % of its commanded height;
    False where neither is measured.
    base_pos: (3,) m and base_quat: (4,) torso in the world, where the driver knows them (simulation), else None.
    alarms: what the robot complains about while it still obeys, a short sentence each: a warm motor, a low battery, a
    damaged frame. faults: why it cannot be commanded any more, likewise: a motor that is off, silent or blocked.
    What a robot does not measure is NaN.
    """

    time: float
    q: Array
    torque: Array
    angles: Array
    gyro: Array
    accelerometer: Array
    fsr: Array
    fell: bool
    base_pos: Array | None = None
    base_quat: Array | None = None
    alarms: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()


@runtime_checkable
class Driver(Protocol):
    """A robot that can be commanded. Adding one is one file and one entry in the table of drivers."""

    @property
    def period(self) -> float:
        """Time between two uses of the newest command, s."""

    def connect(self) -> None:
        """Find the robot, switch its servos on where it is, and bring it to its posture ``stand``; returns there.

        A session begins from that posture. Takes as long as it needs; NaoimitateError says what to do if it cannot be
        done.
        """

    def read(self) -> RobotState:
        """Return the newest state; never blocks."""

    def write(self, command: RobotCommand) -> None:
        """Replace the command that the servos follow; never blocks."""

    def soften(self, share: float) -> None:
        """Turn the servos' stiffness down to a share, 0 to 1, of its normal value: after a fall, in an emergency."""

    def emergency_stop(self) -> None:
        """End all motion at once, by the fastest safe means that the robot has, and obey no command until ``connect``.

        The robot stays where it is, stiff: ``soften`` and ``stop`` let go of it. Never waits; may be called at any
        time, twice, from any thread and from a signal handler.
        """

    def stop(self) -> None:
        """End the motion safely and let go of the robot: afterwards nothing holds it up. May be called twice.

        May take seconds; where it is interrupted, a second call or the driver itself brings it to its end.
        """
