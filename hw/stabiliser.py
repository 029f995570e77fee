"""Closed-loop balance on top of any ``ServoCommand``, from what a robot like NAO really measures.

Three loops, each bounded, and nothing else. They move the target, not the servos: what they ask for is a posture with
planted soles, so that ankles and hips turn together.

- The centre of mass, told from the encoders and the direction of gravity, is brought back over the place of the plan by
  an integral: a tilted floor and servos that sag push it away. That loop is slower than the robot sways.
- The velocity of the centre of mass, told from the gyro and the encoders, moves the body against its sway at once. A
  servo of stiffness k that is sent ``-d v / k`` away gives the torque ``-d v``: the body is damped alike on servos of
  any stiffness when it is moved in proportion to their softness.
- The force sensors say which sole carries (``sole_heights``).

Nothing is done from a state that is not known (NaN, not newer than the last, too far from the plan to be believed):
the corrections fade.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from naoimitate.core.frames import Array
from naoimitate.core.physics import GRAVITY
from naoimitate.hw.compensation import share_of_weight
from naoimitate.hw.driver import RobotState
from naoimitate.hw.lean import lean
from naoimitate.hw.planted_shift import PlantedShift
from naoimitate.hw.sole_heights import HEIGHTS, HeightSettings, SoleHeights
from naoimitate.hw.sway import Sway, SwayMeter
from naoimitate.hw.target import ServoCommand, Target
from naoimitate.robot.model import RobotModel

PARTS = (1.0, 0.8, 0.6, 0.4, 0.2, 0.0)
"""Of the corrections that are tried, in this order, until the legs can do it."""


@dataclass(frozen=True)
class StabiliserSettings:
    """How far, how fast and from what the target is moved."""

    gain: float = 1.5
    """[1/s] of the integral of the CoM's error: a quarter of the frequency at which a body of 0.26 m topples."""
    most: tuple[float, float] = (0.018, 0.008)
    """[m] of shift, forwards or backwards, and to a side, where ankles end sooner."""
    speed: float = 0.03
    """[m/s] of shift."""
    margin: float = 0.015
    """[m] by which the CoM of what is commanded stays inside the stance soles."""
    damping: tuple[float, float] = (0.004, 0.004)
    """[s], forwards or backwards and to a side, times the CoM's error of velocity and the servos' softness: how far the
    body is moved against its sway: a fifth of the damping that simulated servos of 300 N m/rad have of themselves. On
    one foot the robot sways with a tenth of critical damping on servos of 60 N m/rad, at 8 rad/s, and with a quarter
    at 300, at 19 rad/s; with twice as much from here a line that is 20 ms late makes soft servos tremble, forwards and
    backwards, where the torso also nods at 25 rad/s, with less."""
    on_both: float = 0.25
    """Share of that on both feet, where twice as many joints hold the body, each with half as much."""
    most_damping: float = 0.008
    """[m] by which, and..."""
    damping_speed: float = 0.2
    """...[m/s] at which the body is moved against its sway, at most."""
    lag: float = 0.03
    """[s] by which servos follow their command: measurements are compared with the plan of that time ago."""
    joint_speed: float = 4.0
    """[rad/s] of a joint beside its plan."""
    heights: HeightSettings = HEIGHTS
    """Of soles that carry too much or too little."""
    steady: float = 0.015
    """[m] of the CoM's error within which the plan's feet do."""
    believed: float = 0.06
    """[m] of the CoM's error, and..."""
    leaning: float = 0.35
    """[rad] of the torso away from its plan, beyond which the robot falls or its senses are wrong."""


DEFAULT = StabiliserSettings()


class Stabiliser:
    """A ``ServoCommand`` around another one. period: s between two calls; softness: how many times as soft as nominal
    ones the servos are.

    Whatever a state says: the target stays in the joints' ranges, its soles keep their places on the floor but for the
    heights of ``HeightSettings``, its CoM stays ``margin`` inside the stance, and it moves no faster than ``speed`` and
    ``damping_speed``, and its soles no faster than theirs, beside the plan.
    """

    def __init__(
        self,
        robot: RobotModel,
        inner: ServoCommand,
        period: float,
        settings: StabiliserSettings = DEFAULT,
        softness: Callable[[], float] = lambda: 1.0,
    ) -> None:
        self._inner, self._period, self._s, self._softness = inner, period, settings, softness
        self._planted, self._robot = PlantedShift(robot), robot
        self._weight = GRAVITY * robot.mass
        self.shift = np.zeros(2)
        """[m] of the CoM now, forwards and to the left as the torso points."""
        self.damped = np.zeros(2)
        """[m] of the CoM now beside ``shift``, against the sway."""
        self._heights = SoleHeights(period, settings.heights)
        self._sway = SwayMeter(self._planted, period, settings.lag)
        self._time, self._offset = -np.inf, np.zeros(len(robot.joint_names))
        self.target: Target | None = None
        """What was asked of the servos last."""
        stand = robot.postures["stand"]
        upright = Target(stand, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), "D")
        self._planted.moved(upright, np.full(2, 1e-3), 1e-3, stand - 1.0, stand + 1.0)  # compiles

    def __call__(self, target: Target, state: RobotState) -> Array:
        """Servo angles (J,) rad for a target, moved as far as the state asks for."""
        self._look(target, state)
        self._offset = self._wanted(target)
        q = np.clip(target.q + self._offset, self._robot.lower, self._robot.upper)
        self.target = target._replace(q=q if self._offset.any() else target.q)
        return self._inner(self.target, state)

    @property
    def raised(self) -> Array:
        """Heights (2,) m of the left and the right sole beside the plan."""
        return self._heights.raised

    def _look(self, target: Target, state: RobotState) -> None:
        """Let the corrections go on, or fade where the state says nothing."""
        s, period = self._s, self._period
        self._sway.follow(target)
        sway = self._error(target, state)
        self._time = max(self._time, state.time) if np.isfinite(state.time) else self._time
        pose = self._planted.pose(target.q, target.support)
        share = share_of_weight(pose.com, pose.sole_pos, np.array([0.0, 0.0, 1.0]), target.support)
        front, back, left, right = self._planted.room(pose, target.support, s.margin)
        least, most = np.array([-back, -right]), np.array([front, left])
        wish = -self.shift / period if sway is None else s.gain * sway.place
        step = np.clip(wish, -s.speed, s.speed) * period
        self.shift = np.clip(np.clip(self.shift + step, -np.array(s.most), s.most), least, most)
        damped = self._against(sway, alone=bool(share.min() < s.heights.idle))
        self.damped = np.clip(self.shift + damped, least, most) - self.shift
        load = state.fsr.sum(axis=1) / self._weight
        known = sway is not None and bool(np.isfinite(load).all())
        steady = sway is not None and bool(np.abs(sway.place).max() < s.steady)
        self._heights.update(target.support, share, load if known else None, steady, self._softness())

    def _error(self, target: Target, state: RobotState) -> Sway | None:
        """How far the CoM is from where it should be; None where that is not known."""
        s = self._s
        known = state.time > self._time and np.isfinite(state.q).all() and np.isfinite(state.angles).all()
        if known and not state.fell and lean(target.base_quat, state.angles) < s.leaning:
            sway = self._sway.measure(target, state)
            if np.abs(sway.place).max() < s.believed:
                return sway
        self._sway.lose()
        return None

    def _against(self, sway: Sway | None, alone: bool) -> Array:
        """How far (2,) m to move the body against its sway; alone: whether one foot has the whole weight."""
        s, wish = self._s, np.zeros(2)
        if sway is not None and np.isfinite(sway.velocity).all():
            damping = np.array(s.damping) * self._softness() * (1.0 if alone else s.on_both)
            wish = np.clip(damping * sway.velocity, -s.most_damping, s.most_damping)
        step = s.damping_speed * self._period
        return np.asarray(self.damped + np.clip(wish - self.damped, -step, step))

    def _wanted(self, target: Target) -> Array:
        """How far (J,) rad the joints are to be beside the target; what the legs cannot do is given up."""
        side = self._planted.side(target.support)
        raised = float(self.raised[1 - side] - self.raised[side])
        shift = self.shift + self.damped
        if not shift.any() and raised == 0.0 and not self._offset.any():
            return self._offset
        step = self._s.joint_speed * self._period
        near = target.q + self._offset
        for part in PARTS:
            q = self._planted.moved(target, part * shift, part * raised, near - step, near + step)
            if q is not None:
                self._keep(part)
                return q - target.q
        self._keep(0.0)
        return np.clip(np.zeros_like(self._offset), self._offset - step, self._offset + step)

    def _keep(self, part: float) -> None:
        """Keep a part of all corrections."""
        self.shift, self.damped = part * self.shift, part * self.damped
        self._heights.raised = part * self._heights.raised
