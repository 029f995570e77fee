"""The fall latch: a robot that falls is made soft at once, then let go of; nothing that it senses leads out of that.

Pure and driven by its edge table: no arrays, no clock; one latch for each connection. A fall is told from how far the
torso leans away from where it was told to be, not from the vertical: a robot that bows on purpose does not fall. One
that measures neither its torso nor its fall is never seen to fall.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple


class Fall(enum.Enum):
    """What is known about the robot's balance."""

    UPRIGHT = "upright"
    LEANING = "leaning"
    """Away from its plan, but not for long enough to be believed."""
    FALLING = "falling"
    """Believed: the servos are soft, so that nothing breaks."""
    FALLEN = "fallen"
    """It lies, or has had the time to: let go of. No edge leads out."""


class Action(enum.Enum):
    """What an edge asks for."""

    NONE = "-"
    SOFTEN = "soften"
    """Lower the stiffness at once."""
    STOP = "stop"
    """End the motion and let go of the robot."""


@dataclass(frozen=True)
class FallLimits:
    """When a lean is a fall."""

    lean: float = math.radians(20.0)
    """[rad] of the torso away from where it was told to be."""
    quick_lean: float = math.radians(8.0)
    """The same, where the torso turns faster than ``quick_rate``."""
    quick_rate: float = 2.0
    """[rad/s]. A robot of half a metre that tips passes it at about 15 deg; planned motions of the torso stay under
    it."""
    patience: float = 0.06
    """[s] for which a lean must last: three readings of a slow robot, so that a single wrong one is no fall."""
    fall_time: float = 1.0
    """[s] after which a robot that falls lies, whatever its senses say: from half a metre it takes 0.7 s."""


@dataclass(frozen=True)
class Senses:
    """What the machine looks at.

    lean: rad of the torso away from its plan; NaN where it is not measured, which is no lean.
    rate: rad/s of the torso about horizontal axes; NaN likewise.
    fell: the robot itself says that it has fallen.
    lasted: s since the present state was entered.
    """

    lean: float = math.nan
    rate: float = math.nan
    fell: bool = False
    lasted: float = 0.0


Guard = Callable[[Senses, FallLimits], bool]


def fell(senses: Senses, limits: FallLimits) -> bool:
    """The robot says that it has fallen."""
    return senses.fell


def leans(senses: Senses, limits: FallLimits) -> bool:
    """The torso leans too far, or leans and turns too fast."""
    quickly = senses.lean > limits.quick_lean and senses.rate > limits.quick_rate
    return senses.lean > limits.lean or quickly


def leans_long(senses: Senses, limits: FallLimits) -> bool:
    """It has leaned for ``patience``."""
    return leans(senses, limits) and senses.lasted >= limits.patience


def upright(senses: Senses, limits: FallLimits) -> bool:
    """The torso is where it was told to be, or nobody can tell."""
    return not leans(senses, limits) and not senses.fell


def time_is_up(senses: Senses, limits: FallLimits) -> bool:
    """The fall has had its time."""
    return senses.lasted >= limits.fall_time


class Edge(NamedTuple):
    """One transition: in ``state``, where ``guard`` holds for what is sensed, do ``action`` and be in ``next``."""

    state: Fall
    guard: Guard
    action: Action
    next: Fall


EDGES = (
    Edge(Fall.UPRIGHT, fell, Action.SOFTEN, Fall.FALLING),
    Edge(Fall.UPRIGHT, leans, Action.NONE, Fall.LEANING),
    Edge(Fall.LEANING, fell, Action.SOFTEN, Fall.FALLING),
    Edge(Fall.LEANING, leans_long, Action.SOFTEN, Fall.FALLING),
    Edge(Fall.LEANING, upright, Action.NONE, Fall.UPRIGHT),
    Edge(Fall.FALLING, fell, Action.STOP, Fall.FALLEN),
    Edge(Fall.FALLING, time_is_up, Action.STOP, Fall.FALLEN),
)
"""The whole machine. The first edge that fits is taken; where none does, the state stays."""


def take(state: Fall, senses: Senses, limits: FallLimits) -> tuple[Fall, Action]:
    """One transition: the next state and what to do."""
    for edge in EDGES:
        if edge.state is state and edge.guard(senses, limits):
            return edge.next, edge.action
    return state, Action.NONE


class FallLatch:
    """The machine with its present state and for how long it has been in it."""

    def __init__(self, limits: FallLimits | None = None) -> None:
        self.limits = limits or FallLimits()
        self.state = Fall.UPRIGHT
        self._lasted = 0.0

    def sense(self, lean: float, rate: float, fell: bool, dt: float) -> Action:
        """Look at the senses dt s after the last time."""
        self._lasted += dt
        state, action = take(self.state, Senses(lean, rate, fell, self._lasted), self.limits)
        if state is not self.state:
            self.state, self._lasted = state, 0.0
        return action
