"""What the driver wants to tell motors and hear from them, whatever their protocol: the small interface of a codec.

Everything here is in the motor's own units and sign; sign, gear and zero of the joints are in ``joints.py``. Motors
are counted as in the joint map: N motors, joints and hands.
"""

from __future__ import annotations

import enum
from typing import NamedTuple, Protocol

import can

from naoimitate.core.errors import DriverError
from naoimitate.core.frames import Array


class MotorStatus(enum.Enum):
    """What a motor says about itself."""

    OFF = "off"
    FOLLOWING = "following"
    HOLDING = "holding"
    """It stopped by itself, because no commands came."""
    STOPPED = "stopped"
    """After an emergency stop; it holds until it is switched off."""
    HOT = "hot"
    OVERLOADED = "overloaded"
    FAULT = "fault"


FAULTS = (MotorStatus.HOT, MotorStatus.OVERLOADED, MotorStatus.FAULT)


class Targets(NamedTuple):
    """What N motors shall do: position (N,) rad, speed (N,) rad/s at most, stiffness (N,) 0 to 1 of the full gain."""

    position: Array
    speed: Array
    stiffness: Array


class Feedback(NamedTuple):
    """What one motor answers: its index, position (rad), speed (rad/s), current (A), temperature (deg C), status.

    counter: of this motor's frames, None where the protocol has none; counters: how many values it has. What is not
    measured is NaN.
    """

    motor: int
    position: float
    speed: float
    current: float
    temperature: float
    status: MotorStatus
    counter: int | None = None
    counters: int = 1


class Traffic(NamedTuple):
    """A cyclic frame on the bus: data bytes, 29-bit identifier or not, Hz."""

    length: int
    extended: bool
    rate: float


class CorruptFrame(DriverError):
    """A frame of a motor arrived damaged; ``motor`` is its index."""

    def __init__(self, motor: int, what: str) -> None:
        super().__init__(what)
        self.motor = motor


class Codec(Protocol):
    """Commands to frames and frames to feedback, for all motors of one bus."""

    @property
    def period(self) -> float:
        """Time between two commands that the motors expect, s."""

    def traffic(self, period: float) -> list[Traffic]:
        """All cyclic frames, answers included, when commands go out every ``period`` s; for the bus load."""

    def ask(self) -> list[can.Message]:
        """Frames that make every motor answer and change nothing."""

    def enable(self, targets: Targets) -> list[can.Message]:
        """Frames that switch the motors on, or take the next step to it, with their first targets.

        The driver sends them every period, with stiffness 0 and the present positions, until all motors follow.
        """

    def command(self, targets: Targets) -> list[can.Message]:
        """Frames that make the motors go to their targets."""

    def disable(self) -> list[can.Message]:
        """Frames that switch the motors off, and end an emergency stop or a fault that is over."""

    def heartbeat(self) -> list[can.Message]:
        """Frames that tell the motors every period that the host lives; often empty."""

    def emergency_stop(self) -> list[can.Message]:
        """Frames that stop all motors where they are."""

    def decode(self, message: can.Message) -> Feedback | None:
        """What a motor says; None for a frame that is not from a motor. Raises CorruptFrame for a damaged one."""
