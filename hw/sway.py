"""Where the centre of mass of a robot is beside its stance soles, how fast it moves, and how far both are off the plan.

All of it from what a robot like NAO measures: r, from the soles to the CoM in torso axes, by the encoders; which way is
up by the inertial board; how the torso turns by its gyro, so that ``v = w x r + dr/dt``. Both parts are smoothed alike:
a torso that nods on its hips turns a lot and moves the CoM little, which shows only where they cancel.

Lengths are horizontal, forwards and to the left as the torso points, from the middle of the stance soles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from naoimitate.core.frames import SIDES, Array
from naoimitate.hw.driver import RobotState
from naoimitate.hw.lean import up_from_angles
from naoimitate.hw.planted_shift import PlantedShift, level
from naoimitate.hw.target import Target

SMOOTHING = 0.03
"""[s] over which the velocity is smoothed: a count of 0.1 deg in 10 ms looks like 0.17 rad/s."""


class Sway(NamedTuple):
    """How far (2,) m and by which velocity (2,) m/s the CoM is short of its plan."""

    place: Array
    velocity: Array


class SwayMeter:
    """Compares the CoM with the plan of ``lag`` s ago: servos follow their command so late. period: s between calls."""

    def __init__(self, planted: PlantedShift, period: float, lag: float) -> None:
        self._planted, self._period, self._lag = planted, period, lag
        self._support, self._place, self._velocity = "", np.zeros(2), np.zeros(2)
        self._seen: Array | None = None
        self._turning = np.zeros(3)
        self._slip, self._share = np.zeros(2), period / (SMOOTHING + period)

    def follow(self, target: Target) -> None:
        """Take up the next target of the plan."""
        planned, _ = self._centre(target, None)
        if target.support != self._support:
            self._support, self._seen = target.support, None
            self._place = planned - self._lag * self._velocity  # the soles are others, the velocity goes on
        self._velocity = (planned - self._place) / (self._lag + self._period)
        self._place = self._place + self._period * self._velocity

    def measure(self, target: Target, state: RobotState) -> Sway:
        """What a state whose angles and joints are known says; without a gyro the velocity is NaN."""
        up = np.array(up_from_angles(state.angles))
        place, way = self._centre(target._replace(q=state.q), up)
        turning = state.gyro - up * (up @ state.gyro)
        if self._seen is not None:
            turned = np.cross(0.5 * (turning + self._turning), 0.5 * (way + self._seen))
            velocity = (level(up) @ (turned + (way - self._seen) / self._period))[:2]
            steadied = np.where(np.isfinite(self._slip), self._slip, 0.0)
            self._slip = steadied + self._share * (self._velocity - velocity - steadied)
        self._seen, self._turning = way, turning
        return Sway(self._place - place, self._slip)

    def lose(self) -> None:
        """What was seen last is too old to tell a velocity."""
        self._seen, self._slip = None, np.zeros(2)

    def _centre(self, target: Target, up: Array | None) -> tuple[Array, Array]:
        """The CoM (2,) m, and the way (3,) m to it in torso axes; up: (3,) in the base, None if the soles are level."""
        pose = self._planted.pose(target.q, target.support)
        axes = level(pose.base_rot[2] if up is None else up)
        soles = [pose.sole_pos[i] for i, side in enumerate(SIDES) if target.support in ("D", side.upper())]
        way = np.asarray(pose.base_rot.T @ (pose.com - np.mean(soles, axis=0)))
        return np.asarray((axes @ way)[:2]), way
