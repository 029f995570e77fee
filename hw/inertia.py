"""How a plan's links accelerate: what servos have to give beside what gravity asks for.

A soft servo that is told of gravity alone swings after every shift of weight, as a mass on a spring does when its other
end is moved; told of the plan's accelerations, it is pushed and braked by just what the motion takes.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from naoimitate.core.frames import Array
from naoimitate.core.geometry import matrix_from_quat
from naoimitate.hw.driver import RobotState
from naoimitate.hw.target import ServoCommand, Target
from naoimitate.robot.kernel import forward
from naoimitate.robot.model import RobotModel

APART = 0.02
"""[s] of the plan's time between the postures that tell an acceleration, at least: they are late by so much, and a
plan's second differences are rough."""
LATE, LONGEST = 2.5, 0.2
"""Times as long as usual, and [s] as usual at most, without a new posture after which the plan stands still."""
MOST = 5.0
"""[m/s^2] of the centre of mass, beyond which a plan has jumped: none that a robot can follow goes on like that."""


class Inertia:
    """A ``ServoCommand`` around another one, which it tells the accelerations of its targets.

    period: s between two calls. The plan's own clock counts, so that it does not matter when a target is taken up. A
    target without a time has no acceleration, nor has one whose plan has stopped, jumped, or gone back in time.
    """

    def __init__(self, robot: RobotModel, inner: ServoCommand, period: float) -> None:
        self._tree, self.inner, self._period = robot.tree, inner, period
        joints = len(robot.joint_names)
        self._pos, self._rot = np.zeros((joints + 1, 3)), np.zeros((joints + 1, 3, 3))
        self._share = robot.tree.mass / robot.tree.mass.sum()
        self._seen: deque[tuple[float, Array]] = deque()
        self._still = np.zeros((joints + 1, 3))
        self._acceleration = self._still
        self._newest, self._since, self._apart = math.nan, 0.0, 0.0

    def __call__(self, target: Target, state: RobotState) -> Array:
        """Servo angles (J,) rad for a target."""
        torso = matrix_from_quat(target.base_quat)
        if target.time == self._newest:
            self._since += self._period
            if self._since > LATE * max(self._apart, self._period):
                self._begin()
        else:
            self._see(target, torso)
        return self.inner(target._replace(acceleration=self._acceleration @ torso), state)

    def _see(self, target: Target, torso: Array) -> None:
        """Take up a new posture of the plan."""
        if target.time > self._newest:
            self._apart = min(target.time - self._newest, LONGEST)
        else:  # NaN, or back in time
            self._begin()
        self._newest, self._since = target.time, 0.0
        forward(self._tree, target.q, self._pos, self._rot)
        local = self._pos + np.einsum("kij,kj->ki", self._rot, self._tree.com)
        here = (target.time, target.base_pos + local @ torso.T)
        self._seen.appendleft(here)
        self._acceleration = self._differences()
        if np.linalg.norm(self._share @ self._acceleration) > MOST:
            self._begin()
            self._seen.appendleft(here)

    def _begin(self) -> None:
        """The plan starts from rest."""
        self._seen.clear()
        self._acceleration = self._still

    def _differences(self) -> Array:
        """Acceleration (J + 1, 3) m/s^2 in the world: divided differences of the newest posture and two before it."""
        now, here = self._seen[0]
        middle = self._before(now)
        oldest = None if middle is None else self._before(middle[0])
        if middle is None or oldest is None:
            return self._still
        while self._seen[-1][0] < oldest[0]:
            self._seen.pop()
        last, first = (here - middle[1]) / (now - middle[0]), (middle[1] - oldest[1]) / (middle[0] - oldest[0])
        return np.asarray(2.0 * (last - first) / (now - oldest[0]))

    def _before(self, time: float) -> tuple[float, Array] | None:
        """The newest posture that is at least ``APART`` older than a time (s)."""
        return next((seen for seen in self._seen if seen[0] <= time - APART + 1e-6), None)
