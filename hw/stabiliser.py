"""Closed-loop balance on top of any ``ServoCommand``, from what a robot like NAO really measures.

Two slow loops, each bounded, and nothing else. They move the target, not the servos: what they ask for is a posture
with planted soles, so that ankles and hips turn together.

- The centre of mass, told from the encoders and the direction of gravity, is brought back over the place of the plan by
  an integral: a tilted floor and servos that sag push it away. A loop that is slower than the robot sways does not
  make it sway.
- The force sensors say which sole carries. One that carries and should not is raised; one that should and does not is
  lowered until it does: early and late contact, on a floor that is not where the plan has it.

Nothing is done from a state that is not known (NaN, not newer than the last, too far from the plan to be believed):
the corrections fade.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from naoimitate.core.frames import SIDES, Array
from naoimitate.core.physics import GRAVITY
from naoimitate.hw.compensation import share_of_weight
from naoimitate.hw.driver import RobotState
from naoimitate.hw.lean import lean, up_from_angles
from naoimitate.hw.planted_shift import PlantedShift, level
from naoimitate.hw.servo_command import ServoCommand, Target
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
    lag: float = 0.03
    """[s] by which servos follow their command: measurements are compared with the plan of that time ago."""
    joint_speed: float = 4.0
    """[rad/s] of a joint beside its plan."""
    step_height: float = 0.008
    """[m] by which a sole may be raised or lowered."""
    raising: float = 0.04
    """[m/s] at which a sole is raised that carries and should not."""
    lowering: float = 0.01
    """[m/s] at which a sole is lowered that should carry and does not, and at which a raised one comes back."""
    loaded: float = 0.06
    """Share of the weight from which a sole carries..."""
    unloaded: float = 0.01
    """...and under which it does not."""
    due: float = 0.10
    """Share of the weight that a sole should carry before it is missed."""
    believed: float = 0.06
    """[m] of the CoM's error, and..."""
    leaning: float = 0.35
    """[rad] of the torso away from its plan, beyond which the robot falls or its senses are wrong."""


DEFAULT = StabiliserSettings()


class Stabiliser:
    """A ``ServoCommand`` around another one. period: s between two calls.

    Whatever a state says: the target stays in the joints' ranges, its soles keep their places on the floor but for
    ``step_height`` of one of them, its CoM stays ``margin`` inside the stance, and it moves no faster than ``speed``,
    ``raising`` and ``lowering`` beside the plan.
    """

    def __init__(
        self, robot: RobotModel, inner: ServoCommand, period: float, settings: StabiliserSettings = DEFAULT
    ) -> None:
        self._inner, self._period, self._s = inner, period, settings
        self._planted, self._robot = PlantedShift(robot), robot
        self._weight = GRAVITY * robot.mass
        self.shift = np.zeros(2)
        """[m] of the CoM now, forwards and to the left as the torso points."""
        self.raised = np.zeros(2)
        """[m] of the left and the right sole now."""
        self._time, self._behind = -np.inf, np.zeros(2)
        self._support, self._offset = "", np.zeros(len(robot.joint_names))
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

    def _look(self, target: Target, state: RobotState) -> None:
        """Let the corrections go on, or fade where the state says nothing."""
        s, period = self._s, self._period
        planned = self._centre(target, None)
        if target.support != self._support:
            self._support, self._behind = target.support, planned
        self._behind = self._behind + period / (s.lag + period) * (planned - self._behind)
        error = self._error(target, state)
        self._time = max(self._time, state.time) if np.isfinite(state.time) else self._time
        wish = -self.shift / period if error is None else s.gain * error
        step = np.clip(wish, -s.speed, s.speed) * period
        self.shift = self._inside(target, np.clip(self.shift + step, -np.array(s.most), s.most))
        self.raised = self.raised + self._heights(target, state, error is not None) * period
        self.raised = np.clip(self.raised, -s.step_height, s.step_height)

    def _error(self, target: Target, state: RobotState) -> Array | None:
        """How far (2,) m the CoM is from where it should be; None where that is not known."""
        s = self._s
        known = state.time > self._time and np.isfinite(state.q).all() and np.isfinite(state.angles).all()
        if not known or state.fell or not lean(target.base_quat, state.angles) < s.leaning:
            return None
        error = self._behind - self._centre(target._replace(q=state.q), np.array(up_from_angles(state.angles)))
        return error if np.abs(error).max() < s.believed else None

    def _centre(self, target: Target, up: Array | None) -> Array:
        """The CoM (2,) m beside the middle of the stance soles, horizontally; up: (3,) in the base, None if level."""
        pose = self._planted.pose(target.q, target.support)
        axes = level(pose.base_rot[2] if up is None else up)
        soles = [pose.sole_pos[i] for i, side in enumerate("LR") if target.support in ("D", side)]
        way = pose.base_rot.T @ (pose.com - np.mean(soles, axis=0))
        return np.asarray((axes @ way)[:2])

    def _inside(self, target: Target, shift: Array) -> Array:
        """As much of a shift (2,) m as the stance has room for."""
        front, back, left, right = self._planted.room(
            self._planted.pose(target.q, target.support), target.support, self._s.margin
        )
        return np.clip(shift, [-back, -right], [front, left])

    def _heights(self, target: Target, state: RobotState, known: bool) -> Array:
        """How fast (2,) m/s the left and the right sole are to go up."""
        s = self._s
        back = np.clip(-self.raised / self._period, -s.lowering, s.lowering)
        loads = state.fsr.sum(axis=1) / self._weight
        if not known or not np.isfinite(loads).all():
            return np.asarray(back)
        share = self._share(target)
        for i, side in enumerate(SIDES):
            if target.support not in ("D", side.upper()) and loads[i] > s.loaded:
                back[i] = s.raising
            elif share[i] > s.due and loads[i] < s.unloaded:
                back[i] = -s.lowering
        return np.asarray(back)

    def _share(self, target: Target) -> Array:
        """Share (2,) of the weight that the plan puts on the left and the right sole."""
        pose = self._planted.pose(target.q, target.support)
        return share_of_weight(pose.com, pose.sole_pos, np.array([0.0, 0.0, 1.0]), target.support)

    def _wanted(self, target: Target) -> Array:
        """How far (J,) rad the joints are to be beside the target; what the legs cannot do is given up."""
        side = self._planted.side(target.support)
        raised = float(self.raised[1 - side] - self.raised[side])
        if not self.shift.any() and raised == 0.0 and not self._offset.any():
            return self._offset
        step = self._s.joint_speed * self._period
        near = target.q + self._offset
        for part in PARTS:
            q = self._planted.moved(target, part * self.shift, part * raised, near - step, near + step)
            if q is not None:
                self.shift, self.raised = part * self.shift, part * self.raised
                return q - target.q
        self.shift, self.raised = np.zeros(2), np.zeros(2)
        return np.clip(np.zeros_like(self._offset), self._offset - step, self._offset + step)
