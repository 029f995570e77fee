"""What motors are asked for: what they can carry out of a command, and the angles that they are sent for it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from naoimitate.core.frames import Array
from naoimitate.hw.can.joints import HAND, JointMap
from naoimitate.hw.compensation import GravityCompensation


class Target(NamedTuple):
    """The part of a RobotCommand that motors can carry out."""

    q: Array
    base_quat: Array
    support: str
    opening: Array


class Servos:
    """Joint angles for the N servos of a joint map, with what gravity takes from them where that is compensated."""

    def __init__(self, joint_map: JointMap, compensation: GravityCompensation | None) -> None:
        self._map, self._compensation = joint_map, compensation

    def angles(self, target: Target, now: Array) -> Array:
        """Joint angles (N,) rad that servos must be sent to end up at a target; now: (N,) where they are sent now."""
        joints = self._map
        opening = joints.gather(target.q, target.opening)
        angles = np.where(np.isnan(opening), now, opening)  # a hand without a command stays
        if self._compensation is not None:
            torque = self._compensation.torque(target.q, target.base_quat, target.support)
            angles = angles + np.where(joints.joint == HAND, 0.0, torque[joints.joint] / joints.stiffness)
        return np.asarray(angles)
