"""What a NAO is sent every period: servo angles as fast as their step needs, and hands when they have moved enough."""

from __future__ import annotations

import numpy as np

from naoimitate.calib.zeros import JointZeros
from naoimitate.core.frames import SIDES, Array
from naoimitate.hw.driver import RobotState
from naoimitate.hw.naoqi_link import NaoqiLink
from naoimitate.hw.target import ServoCommand, Target
from naoimitate.robot.model import RobotModel

HEADROOM = 1.2
"""The step is done in 1 / HEADROOM of the period: room for a tick that comes early."""

MIN_FRACTION, MAX_FRACTION = 0.01, 1.0
"""Of the maximum speed; ALMotion refuses 0."""

HAND_STEP, HAND_FRACTION = 0.05, 0.5
"""A hand is moved when its opening (0 to 1) has changed by so much, at this fraction of its speed."""


class NaoqiSender:
    """One connection's commands. period: s between two of them."""

    def __init__(
        self, link: NaoqiLink, robot: RobotModel, zeros: JointZeros, command: ServoCommand, period: float
    ) -> None:
        self._link, self._robot, self._zeros, self._command, self._period = link, robot, zeros, command, period
        self._names = list(robot.joint_names)
        self._hands = [robot.data["hands"][side] for side in SIDES] if "hands" in robot.data else []
        limits = link.call("ALMotion", "getLimits", "Body")
        by_name = dict(zip(link.call("ALMotion", "getBodyNames", "Body"), limits, strict=True))
        self._speed = np.array([by_name[name][2] for name in self._names], dtype=np.float64)
        self._sent = np.array(link.call("ALMotion", "getAngles", self._names, True), dtype=np.float64)
        self._opening = np.full(2, np.nan)

    def send(self, target: Target, state: RobotState) -> None:
        """What a target asks of the servos in the robot's newest state, if there is something new in it."""
        servos = self._servos(target, state)
        step = np.abs(servos - self._sent)
        if step.any():
            self._link.ask("ALMotion", "setAngles", self._names, servos.tolist(), self._fraction(step))
            self._sent = servos
        if target.hand_opening is not None:
            self._send_hands(target.hand_opening)

    def _servos(self, target: Target, state: RobotState) -> Array:
        """Servo angles (J,) rad: the servos' command with the specimen's zeros; in range."""
        q = self._command(target, state)
        return np.clip(self._zeros.to_servos(q), self._robot.lower, self._robot.upper)

    def _fraction(self, step: Array) -> float:
        """Fraction of the maximum speed with which the largest step (J,) rad takes a period."""
        needed = HEADROOM * float((step / self._speed).max()) / self._period
        return min(max(needed, MIN_FRACTION), MAX_FRACTION)

    def _send_hands(self, openings: Array) -> None:
        for side, name in enumerate(self._hands):
            opening, was = float(openings[side]), float(self._opening[side])
            if opening == opening and not abs(opening - was) < HAND_STEP:
                self._link.ask("ALMotion", "setAngles", [name], [opening], HAND_FRACTION)
                self._opening[side] = opening
