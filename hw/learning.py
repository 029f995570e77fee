"""Load compensation that learns how soft the servos really are, from how far the legs hang below their command.

Nobody publishes a servo's stiffness, it differs from robot to robot, and a wrong one makes a foot touch down where it
was planned in the air. A servo at rest hangs below its command by ``torque / stiffness``; with the torque u k that
gravity is expected to ask for, where u is the sag that the nominal stiffness k would give, the measured sags y of the
legs tell by least squares by which factor f the servos are softer: f = sum(u y) / sum(u^2).

This is no feedback of the posture, so that it cannot swing: what is measured changes one slow number, within bounds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from naoimitate.core.frames import SIDES, Array
from naoimitate.core.physics import GRAVITY
from naoimitate.hw.compensation import LoadCompensation
from naoimitate.hw.driver import RobotState
from naoimitate.hw.lean import lean, quat_from_angles
from naoimitate.hw.target import Target
from naoimitate.robot.model import RobotModel


@dataclass(frozen=True)
class LearningSettings:
    """What may be learned, from what, and how fast."""

    softest: float = 5.0
    """Largest factor: servos with a fifth of their nominal stiffness."""
    firmest: float = 0.5
    """Smallest factor."""
    usual: float = 0.15
    """A factor this close to 1 is 1: the nominal stiffness is believed."""
    most: float = math.radians(4.0)
    """[rad] Largest change of a servo's command by what was learned."""
    speed: float = math.radians(90.0)
    """[rad/s] of that change: a third of what a slow joint can do."""
    rate: float = 2.0
    """[1/s] Largest change of the factor."""
    memory: float = 1.0
    """[s] over which sags are averaged."""
    lag: float = 0.03
    """[s] by which servos follow their command: a sag is measured against the command of that time ago."""
    slow: float = 0.2
    """[rad/s] A leg with a faster joint tells nothing: its joints are behind for other reasons..."""
    settled: float = 0.15
    """...[s] over which that speed is averaged: balance that trembles with its sensors' noise is no motion."""
    telling: float = math.radians(0.1)
    """[rad] Norm of the legs' nominal sags under which they tell nothing, as with legs that are straight."""
    lost: float = 0.2
    """[rad] A joint farther away from its command is blocked or held."""
    leaning: float = math.radians(8.0)
    """[rad] A torso farther away from its plan carries other torques."""
    carrying: float = 0.2
    """Share of the weight by which a foot may carry more or less than planned."""


DEFAULT = LearningSettings()


class LearningCompensation:
    """A ``ServoCommand`` like load compensation of a nominal stiffness, (J,) or one for all, N m/rad; see above.

    period: s between two calls. Nothing is learned from a state that is not known (NaN, not newer than the last), nor
    where the feet do not carry as they should, or the robot is not in the posture that it is sent; what was learned
    stays, since servos do not become firmer by that.

    Whatever a state says: the servo angles differ from those of the nominal stiffness by ``most`` at most, by an offset
    that is never faster than ``speed``, and are no farther out of a joint's range than those.
    """

    def __init__(
        self, robot: RobotModel, stiffness: Array | float, period: float, settings: LearningSettings = DEFAULT
    ) -> None:
        self._load, self._robot, self._stiffness = LoadCompensation(robot), robot, stiffness
        self._period, self._s = period, settings
        self._legs = {side.upper(): np.array(robot.chains[f"{side}_leg"]) for side in SIDES}
        self._legs["D"] = np.concatenate([self._legs["L"], self._legs["R"]])
        self._weight = GRAVITY * robot.mass
        self.factor = 1.0
        """What is applied: how many times as far the servos hang as the nominal stiffness says."""
        self._offset = np.zeros(len(robot.joint_names))
        self._products = self._squares = self._time = 0.0
        self._learned = 1.0
        self._behind: Array | None = None
        self._settled: Array | None = None

    def __call__(self, target: Target, state: RobotState) -> Array:
        """Servo angles (J,) rad that end up at a target."""
        nominal = self._load.command(target.q, target.base_quat, target.support, self._stiffness, target.acceleration)
        sag = nominal - target.q
        self._look(target, state)
        command = self._offset_from(nominal, sag)
        behind = command if self._behind is None else self._behind
        self._behind = behind + self._period / (self._s.lag + self._period) * (command - behind)
        settled = target.q if self._settled is None else self._settled
        self._settled = settled + self._period / (self._s.settled + self._period) * (target.q - settled)
        return command

    def _offset_from(self, nominal: Array, sag: Array) -> Array:
        """Servo angles (J,) rad: what the nominal stiffness asks for and what was learned, within the bounds."""
        s, robot = self._s, self._robot
        step = s.speed * self._period
        wanted = np.clip((self.factor - 1.0) * sag, -s.most, s.most)
        self._offset = self._offset + np.clip(wanted - self._offset, -step, step)
        lowest, highest = np.minimum(robot.lower, nominal), np.maximum(robot.upper, nominal)
        return np.asarray(np.clip(nominal + self._offset, lowest, highest))

    def _look(self, target: Target, state: RobotState) -> None:
        """Learn from a state, where it tells anything: gravity pulls where it is measured to, on a tilted floor too."""
        new, self._time = state.time > self._time, state.time
        if not new or self._behind is None or not self._tells(target, state):
            return
        s, legs = self._s, self._legs[target.support]
        share = self._period / s.memory
        torso = quat_from_angles(state.angles)
        loaded = self._load.command(target.q, torso, target.support, self._stiffness, target.acceleration)
        nominal = (loaded - target.q)[legs]
        if nominal @ nominal < s.telling**2:
            return
        sag = (self._behind - state.q)[legs]
        self._products += share * (float(nominal @ sag) - self._products)
        self._squares += share * (float(nominal @ nominal) - self._squares)
        found = min(max(self._products / self._squares, s.firmest), s.softest)
        step = s.rate * self._period
        self._learned += min(max(found - self._learned, -step), step)
        off = self._learned - 1.0
        self.factor = 1.0 + math.copysign(max(abs(off) - s.usual, 0.0), off)

    def _tells(self, target: Target, state: RobotState) -> bool:
        """Whether the legs hang in the posture that they are sent, under the robot's weight, and nearly at rest."""
        s, legs = self._s, self._legs[target.support]
        assert self._behind is not None and self._settled is not None
        if np.abs(target.q - self._settled)[legs].max() > s.slow * s.settled:
            return False
        if not np.abs(self._behind - state.q)[legs].max() < s.lost:  # NaN is no
            return False
        if not lean(target.base_quat, state.angles) < s.leaning:
            return False
        loads = state.fsr.sum(axis=1) / self._weight
        return bool((np.abs(loads - self._load.share) < s.carrying).all())  # NaN is no
