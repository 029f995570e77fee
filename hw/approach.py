"""The way from where a robot is found to the posture in which a session begins: slow, smooth, all joints together."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from naoimitate.core.errors import DriverError
from naoimitate.core.frames import Array
from naoimitate.human.tracks import minimum_jerk

AWAY = 0.1
"""[rad] A joint further away from the posture is worth a word beforehand, and has not arrived afterwards."""
PEAK = 1.875
"""Highest speed of a minimum-jerk way over its mean one: the slope of 10 s^3 - 15 s^4 + 6 s^5 at 1/2."""


class Approach:
    """Joint angles (N,) rad from ``start`` to ``goal`` in ``duration`` s, with minimum jerk.

    All joints arrive together, none is ever faster than its speed (N,) rad/s, and each stays between its start and its
    goal: a joint that starts outside its range goes straight into it.
    """

    def __init__(self, start: Array, goal: Array, speed: Array) -> None:
        self._start, self._change = np.array(start), goal - start
        self.duration = PEAK * float(np.max(np.abs(self._change) / speed, initial=0.0))

    def at(self, time: float) -> Array:
        """The angles (N,) after so many s; the goal from ``duration`` on."""
        share = float(minimum_jerk(np.asarray(time / self.duration))) if time < self.duration else 1.0
        return np.asarray(self._start + share * self._change)

    @property
    def far(self) -> bool:
        """Whether a joint is more than ``AWAY`` from its goal at the start."""
        return bool(np.abs(self._change).max(initial=0.0) > AWAY)

    @property
    def notice(self) -> str:
        """What to tell the operator beforehand."""
        return f"moving to the stand posture within {math.ceil(self.duration)} s: hold the robot"


def check_arrival(names: Sequence[str], away: Array) -> None:
    """DriverError that names those of ``names`` (N) which are too far ``away`` (N,) rad from their goal, or unknown."""
    late = [f"{name} ({off:.2f} rad away)" for name, off in zip(names, away, strict=True) if not off <= AWAY]
    if late:
        raise DriverError(f"{', '.join(late)}: did not arrive at the stand posture; look for what blocks it")
