"""Arms and head: to their targets in the torso frame, within limits and clear of the body."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from naoimitate.balance.legs import table_bounds
from naoimitate.balance.stabiliser import Pose
from naoimitate.core.geometry import yaw_matrix
from naoimitate.human.observer import Observation
from naoimitate.limb import LimbWeights, build_limb, solve_limb
from naoimitate.robot.model import RobotModel

Array = npt.NDArray[np.float64]

_ORIENTATION_ROWS = {"free": 0, "upright": 2, "follow": 3}
_PALM = (yaw_matrix(np.pi / 2), yaw_matrix(-np.pi / 2))
"""Torso from hand link in a T-pose: the links point along x, the human's arms along +-y."""


class Arms:
    """Both arms and the head of a robot."""

    def __init__(self, robot: RobotModel, weights: LimbWeights, reserve: float, orientation: str) -> None:
        self._robot, self._weights, self._orientation = robot, weights, orientation
        self._limbs = [build_limb(robot, f"{s}_arm", reserve) for s in "lr"]
        self._no_rows = [(np.zeros((0, len(limb.joints))), np.zeros(0)) for limb in self._limbs]
        self._reserve = reserve
        self._head = robot.chains["head"]
        self._table = next((t for t in robot.tables if t.y in self._head), None)

    def reset(self) -> None:
        """Forget the past."""

    def hands(self, pose: Pose) -> Array:
        """Hands from the shoulders in the torso frame, (2, 3) m."""
        return np.array([
            pose.link_pos[limb.tip_joint + 1] + pose.link_rot[limb.tip_joint + 1] @ limb.tip - limb.root for limb in self._limbs
        ])

    def solve(self, pose: Pose, targets: Array, seen: Observation, low: Array, high: Array) -> tuple[Array, int]:
        """Joint angles (J,) with both arms moved towards targets (2, 3) m, and the iterations it took."""
        q, iterations = pose.q.copy(), 0
        for side, limb in enumerate(self._limbs):
            rotation, rows = self._tip(pose, seen, side)
            done, _ = solve_limb(
                self._robot.tree, limb, self._weights, targets[side], seen.body.elbows[side], rotation, rows, q, low, high, *self._no_rows[side]
            )
            iterations += done
        return q, iterations

    def _tip(self, pose: Pose, seen: Observation, side: int) -> tuple[Array, int]:
        """Orientation asked of a hand in the base frame, and how many of its rows count."""
        if self._orientation == "upright":
            return np.ascontiguousarray(pose.base_rot.T), 2
        if self._orientation == "follow" and seen.hands is not None:
            return seen.hands[side] @ _PALM[side], 3
        return np.eye(3), 0

    def head(self, q: Array, wanted: tuple[float, float], step: float, low: Array, high: Array) -> None:
        """Turn the head of q (J,) towards yaw and pitch (rad), at most ``step`` rad, within its coupling table."""
        for joint, angle in zip(self._head, wanted, strict=False):
            near, far = max(low[joint], q[joint] - step), min(high[joint], q[joint] + step)
            lower, upper = self._robot.lower[joint] + self._reserve, self._robot.upper[joint] - self._reserve
            if self._table is not None and self._table.y == joint:
                table_low, _, table_high, _ = table_bounds(self._table.rows, q[self._table.x])
                lower, upper = max(lower, table_low + self._reserve), min(upper, table_high - self._reserve)
            q[joint] = min(max(min(max(angle, lower), upper), near), far)
