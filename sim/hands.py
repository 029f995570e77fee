"""The simulated robot's hands while time passes: what they are asked for, and how far they are open."""

from __future__ import annotations

import mujoco
import numpy as np

from naoimitate.core.frames import SIDES, Array
from naoimitate.robot.model import RobotModel
from naoimitate.sim.fingers import joint_name, read_hands, servo_name

CLOSED = np.zeros(2)


class Hands:
    """Left and right hand of a model; openings (2,) from 0 closed to 1 open, NaN for a hand that is not there."""

    def __init__(self, model: mujoco.MjModel, robot: RobotModel) -> None:
        hands = read_hands(robot)
        self._sides = np.array([side for side, name in enumerate(SIDES) if name in hands], dtype=int)
        self._angle = np.array([hand.opening_angle for hand in hands.values()])
        self._time = np.array([hand.opening_time for hand in hands.values()])
        joints = [[model.joint(joint_name(side, digit)) for digit in hand.digits] for side, hand in hands.items()]
        self._digits = [np.array([joint.qposadr[0] for joint in digits]) for digits in joints]
        self.servos = np.array([model.actuator(servo_name(side)).id for side in hands], dtype=int)
        """(H,) actuators of the hands that are there."""
        self._asked = CLOSED.copy()

    def place(self, data: mujoco.MjData, opening: Array) -> None:
        """Put the hands at openings (2,); closed where that is NaN."""
        self._asked = np.nan_to_num(opening)
        angles = self._asked[self._sides] * self._angle
        data.ctrl[self.servos] = angles
        for digits, angle in zip(self._digits, angles, strict=True):
            data.qpos[digits] = angle

    def ask(self, opening: Array | None) -> None:
        """Ask for openings (2,) from now on; NaN keeps what was asked for before."""
        if opening is not None:
            self._asked = np.where(np.isnan(opening), self._asked, np.clip(opening, 0.0, 1.0))

    def command(self, before: Array, duration: float) -> Array:
        """Servo angles (H,) rad after ``duration`` (s) on the way from ``before`` to what is asked for."""
        step = duration * self._angle / self._time
        return np.asarray(np.clip(self._asked[self._sides] * self._angle, before - step, before + step))

    def opening(self, data: mujoco.MjData) -> Array:
        """How far the hands are open, (2,), measured: what they hold keeps them from closing."""
        opening = np.full(2, np.nan)
        opening[self._sides] = [data.qpos[digits[0]] for digits in self._digits] / self._angle
        return opening
