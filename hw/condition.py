"""What a guarded robot is in, and what is shown of it to an operator."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from naoimitate.core.errors import NaoimitateError
from naoimitate.fsm.fall_latch import FallLimits

RESPONSES = ("limp", "brace")
"""What a robot can do about a fall: give way, or take a protective posture first."""


class Condition(enum.Enum):
    """What a guarded robot is in; the value is a word for people."""

    OFF = "off"
    """Not connected yet."""
    CONNECTING = "connecting"
    LIVE = "live"
    """Commands pass."""
    FAULT = "fault: it holds its pose"
    """The robot does not obey as it should: no command passes, and the last one stays in force, until ``stop``.

    Nothing is softened: that command is a balanced pose, and a robot that has lost one motor of a leg stands in it as
    long as all others stay stiff, while a limp one falls for sure. Whether the robot can be let go of, a person sees
    best: take hold of it, then stop. Should it fall after all, and can it tell, the fall latch softens it as ever."""
    FALLING = "falling"
    """Soft, on its way into a protective posture where that is wished; no command passes. A robot that measures neither
    its torso nor a fall never gets here, however it lies."""
    FALLEN = "fallen"
    """Let go of after a fall, until ``reset``."""
    EMERGENCY = "emergency stop"
    """Let go of by ``emergency_stop``, until ``reset``: stopped, softened, then limp (a simulated robot stays soft)."""
    STOPPED = "stopped"
    """Let go of in peace."""


WATCHED = (Condition.LIVE, Condition.FAULT, Condition.FALLING)
"""Conditions in which the robot may still fall."""


@dataclass(frozen=True)
class GuardSettings:
    """What the guard does when something is wrong."""

    fall: FallLimits = field(default_factory=FallLimits)
    fall_response: str = "limp"
    """One of ``RESPONSES``. A robot that braces is written one protective posture, once, when its fall is believed; one
    that has none, does not measure how it leans, or is in fault already goes limp."""
    fall_stiffness: float = 0.1
    """Share of the servos' stiffness while the robot falls: soft joints give way, and gears survive."""
    brace_stiffness: float = 0.3
    """The same of a robot that braces: enough to get into its posture, and to give way there."""
    emergency_stiffness: float = 0.6
    """The same in an emergency stop: people caught get loose, and a robot on both feet still stands."""
    fault_patience: float = 0.3
    """[s] for which a fault of the driver must last to end the motion: a motor that missed a few frames may come back.
    Alarms are only shown."""

    def __post_init__(self) -> None:
        """Raise ValueError for a response that nobody knows."""
        if self.fall_response not in RESPONSES:
            raise ValueError(f"fall_response {self.fall_response!r}: choose {' or '.join(RESPONSES)}")


@dataclass(frozen=True)
class GuardStatus:
    """What to show to an operator.

    condition: see ``Condition``. accepted: commands that reached the robot. refused: how many did not, by reason (one
    command may have several). refusing: why the newest command was refused; empty when it passed. held: s since the
    robot was last given a command, or a step towards one. lean: rad of the torso away from its plan at the last
    reading, NaN where nobody measures it. alarms: all that the robot complains about, its faults first. problem: what
    ended the motion, or what a driver complained about when it was last used, or empty. catching_up: the newest command
    was too far away, and the robot took a step towards it.
    """

    condition: Condition
    accepted: int
    refused: Mapping[str, int]
    refusing: tuple[str, ...]
    held: float
    lean: float
    alarms: tuple[str, ...]
    problem: str
    catching_up: bool = False


class Delays(NamedTuple):
    """What one ``write`` took, s of a clock of its own: the gate, and the driver to take what passed (about 0 where
    nothing did)."""

    gate: float = 0.0
    hand_over: float = 0.0


def one_line(error: Exception) -> str:
    """What to tell an operator: an error that was meant for people as it is."""
    if isinstance(error, NaoimitateError):
        return str(error)
    return f"the driver failed ({type(error).__name__}: {' '.join(str(error).split())})"
