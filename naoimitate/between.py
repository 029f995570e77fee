"""Poses between two commands that stand on the same feet: joints in between, the stance sole where it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from naoimitate.balance.legs import LegLimits, build_legs
from naoimitate.collision import distances, shape_arrays
from naoimitate.core.frames import Array, RobotCommand
from naoimitate.core.geometry import matrix_from_quat, quat_from_matrix
from naoimitate.robot.kernel import forward
from naoimitate.robot.model import RobotModel

NEAR = 0.03
"""[m] beyond which the distance of two shapes does not matter."""


class Between:
    """The way from one command of a robot to another, and how near the body comes to itself on it."""

    def __init__(self, robot: RobotModel) -> None:
        joints, pairs = len(robot.joint_names), len(robot.pairs)
        self._tree, self._legs = robot.tree, build_legs(robot, LegLimits())
        self._shapes, self._pairs = shape_arrays(robot), np.ascontiguousarray(robot.pairs)
        self._pos, self._rot = np.empty((joints + 1, 3)), np.empty((joints + 1, 3, 3))
        self._distance, self._points = np.empty(pairs), np.empty((3, pairs, 3))

    def pose(self, a: RobotCommand, b: RobotCommand, share: float) -> RobotCommand:
        """Command ``b`` with a pose on the way: joints at ``share`` of the way from ``a``, its stance sole that of a.

        On both feet it is the left sole that stays; by how much the right one is off then, whoever uses it must look.
        What ``b`` says of itself beyond its pose (com, soles) stays as it is and does not belong to this pose.
        """
        side = 1 if a.support == "R" else 0
        sole_pos, sole_rot = self._sole(a.q, side)
        torso = matrix_from_quat(a.base_quat)
        stance_pos, stance_rot = a.base_pos + torso @ sole_pos, torso @ sole_rot
        q = a.q + share * (b.q - a.q)
        sole_pos, sole_rot = self._sole(q, side)
        torso = stance_rot @ sole_rot.T
        return replace(b, q=q, base_pos=stance_pos - torso @ sole_pos, base_quat=quat_from_matrix(torso))

    def nearest(self, q: Array) -> float:
        """Smallest distance of two shapes of the body at q (J,) rad, m; negative = overlap, ``NEAR`` at most."""
        forward(self._tree, q, self._pos, self._rot)
        distances(self._shapes, self._pairs, self._pos, self._rot, NEAR, self._distance, *self._points)
        return min(NEAR, float(self._distance.min(initial=np.inf)))

    def _sole(self, q: Array, side: int) -> tuple[Array, Array]:
        """Place (3,) m and axes (3, 3) of a sole in the torso frame."""
        forward(self._tree, q, self._pos, self._rot)
        row = self._legs.sole_joint[side] + 1
        return self._pos[row] + self._rot[row] @ self._legs.sole_point[side], self._rot[row].copy()
