"""Poses between two commands that stand on the same feet: joints in between, the stance sole where it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from naoimitate.balance.legs import LegLimits, build_legs
from naoimitate.collision import distances, shape_arrays
from naoimitate.core.frames import Array, RobotCommand
from naoimitate.core.geometry import matrix_from_quat, quat_from_matrix, rotation_vector
from naoimitate.robot.kernel import forward
from naoimitate.robot.model import RobotModel

NEWTON_STEPS = 2
"""From half a millimetre the first one leaves micrometres."""
PROBE = 1e-5
"""[rad] by which a joint is turned to see what it does to the sole."""
NEAR = 0.03
"""[m] beyond which the distance of two shapes does not matter."""


class Between:
    """The way from one command of a robot to another, and how near the body comes to itself on it."""

    def __init__(self, robot: RobotModel) -> None:
        joints, pairs = len(robot.joint_names), len(robot.pairs)
        self._tree, self._legs = robot.tree, build_legs(robot, LegLimits())
        self._shapes, self._pairs = shape_arrays(robot), np.ascontiguousarray(robot.pairs)
        self._pos, self._rot = np.empty((joints + 1, 3)), np.empty((joints + 1, 3, 3))
        self._motors = _leg_motors(robot)
        self._distance, self._points = np.empty(pairs), np.empty((3, pairs, 3))

    def step(self, a: RobotCommand, b: RobotCommand, most: Array) -> RobotCommand:
        """The pose on the way from ``a`` to ``b`` as far as no joint turns by more than ``most`` (J,) rad, positive."""
        share = _share(b.q - a.q, most)
        pose = self.pose(a, b, share)
        again = _share(pose.q - a.q, most)
        return pose if again >= 1.0 else self.pose(a, b, again * share)

    def pose(self, a: RobotCommand, b: RobotCommand, share: float) -> RobotCommand:
        """Command ``b`` with a pose on the way: joints at ``share`` of the way from ``a``, feet and stance sole of a.

        On both feet the legs are corrected so that the soles stay as they are to each other. What ``b`` says of
        itself beyond its pose (com, soles) stays as it is and does not belong to this pose.
        """
        side = 1 if a.support == "R" else 0
        sole_pos, sole_rot = self._sole(a.q, side)
        torso = matrix_from_quat(a.base_quat)
        stance_pos, stance_rot = a.base_pos + torso @ sole_pos, torso @ sole_rot
        q = a.q + share * (b.q - a.q)
        if a.support == "D":
            self._close(q, *self._apart(a.q))
        sole_pos, sole_rot = self._sole(q, side)
        torso = stance_rot @ sole_rot.T
        pose = {"q": q, "base_pos": stance_pos - torso @ sole_pos, "base_quat": quat_from_matrix(torso)}
        return replace(b, support=a.support, **pose)

    def nearest(self, q: Array) -> float:
        """Smallest distance of two shapes of the body at q (J,) rad, m; negative = overlap, ``NEAR`` at most."""
        forward(self._tree, q, self._pos, self._rot)
        distances(self._shapes, self._pairs, self._pos, self._rot, NEAR, self._distance, *self._points)
        return min(NEAR, float(self._distance.min(initial=np.inf)))

    def _apart(self, q: Array) -> tuple[Array, Array]:
        """Place (3,) m and axes (3, 3) of the right sole, seen from the left one."""
        (left, left_rot), (right, right_rot) = self._sole(q, 0), self._sole(q, 1)
        return left_rot.T @ (right - left), left_rot.T @ right_rot

    def _close(self, q: Array, place: Array, axes: Array) -> None:
        """Correct the legs of q (J,) by Newton steps of least change until the right sole is where it should be."""

        def error(q: Array) -> Array:
            pos, rot = self._apart(q)
            return np.concatenate([pos - place, rotation_vector(rot @ axes.T)])

        for _ in range(NEWTON_STEPS):
            off = error(q)
            slope = np.array([(error(q + PROBE * motor) - off) / PROBE for motor in self._motors])
            q += np.linalg.lstsq(slope.T, -off, rcond=None)[0] @ self._motors

    def _sole(self, q: Array, side: int) -> tuple[Array, Array]:
        """Place (3,) m and axes (3, 3) of a sole in the torso frame."""
        forward(self._tree, q, self._pos, self._rot)
        row = self._legs.sole_joint[side] + 1
        return self._pos[row] + self._rot[row] @ self._legs.sole_point[side], self._rot[row].copy()


def _share(change: Array, most: Array) -> float:
    """How much of a change (J,) stays within its bounds (J,), 1 at most."""
    return float((most / np.maximum(np.abs(change), most)).min())


def _leg_motors(robot: RobotModel) -> Array:
    """Which joints each motor of the legs turns: (M, J), 1 where it does."""
    turns = np.eye(len(robot.joint_names))
    for leader, follower in robot.coupled:
        turns[leader, follower] = 1.0
    followers = {follower for _, follower in robot.coupled}
    return turns[[j for leg in ("l_leg", "r_leg") for j in robot.chains[leg] if j not in followers]]
