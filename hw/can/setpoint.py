"""Where the motors are sent next: from the last setpoint towards the newest command, never faster than allowed."""

from __future__ import annotations

import numpy as np

from naoimitate.core.frames import Array


class Setpoint:
    """Joint angles (N,) rad that walk towards a target within speed (N,) rad/s and the range lower to upper (N,) rad.

    It may start outside the range, where a robot happens to stand: then it walks into it.
    """

    def __init__(self, start: Array, lower: Array, upper: Array, speed: Array) -> None:
        self.angles = np.array(start)
        self._lower, self._upper, self._speed = lower, upper, speed

    def step(self, target: Array, dt: float) -> Array:
        """The angles (N,) after dt s on the way to the target (N,), which is clipped to the range."""
        reach = self._speed * max(dt, 0.0)
        goal = np.clip(target, self._lower, self._upper)
        self.angles = self.angles + np.clip(goal - self.angles, -reach, reach)
        return self.angles
