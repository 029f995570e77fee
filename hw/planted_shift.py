"""A planned posture, moved: the body shifted over its planted soles, a sole a little higher or lower than planned."""

from __future__ import annotations

import numpy as np

from naoimitate.balance.leg_solver import solve_legs
from naoimitate.balance.legs import POSE, LegLimits, LegWeights, Stance, build_legs, free_goal
from naoimitate.balance.polygon import room_around, support_polygon
from naoimitate.balance.pose import Pose, PoseMaker
from naoimitate.balance.retarget import Reach
from naoimitate.core.frames import Array
from naoimitate.hw.target import Target
from naoimitate.robot.model import RobotModel

FARTHEST = 0.16
"""[rad] by which a joint may leave its plan: a shift of 2 cm turns the ankles by 0.12."""
ARRIVED = 0.003
"""[m] by which the CoM may be off its place after a solve: legs that twist for the last of it are at their limits."""
CLOSED = 1e-4
"""Sum of m and rad by which the other sole may be off after a solve."""
EXACT = LegWeights(iterations=3.0, level=0.0, rest=0.0)


class PlantedShift:
    """Moves planned postures of one robot. Shifts are forwards and to the left as the torso points."""

    def __init__(self, robot: RobotModel) -> None:
        self._tree, self._robot = robot.tree, robot
        self._legs = build_legs(robot, LegLimits(knee_min=0.0, range_reserve=0.0))
        self._maker = PoseMaker(robot, self._legs)
        self._rows = np.zeros((0, len(self._legs.joints))), np.zeros(0)
        self.hips = self._legs.hip

    def pose(self, q: Array, support: str) -> Pose:
        """The posture q (J,) rad, hung on its stance sole (the left one on both feet), which is flat at the origin."""
        return self._maker.hang(q, self.side(support), np.zeros((2, 3)), np.stack([np.eye(3), np.eye(3)]))

    @staticmethod
    def side(support: str) -> int:
        """The sole from which a posture is seen: 0 left, 1 right."""
        return 1 if support == "R" else 0

    def room(self, pose: Pose, support: str, margin: float) -> Array:
        """How far (4,) m the CoM may go forwards, backwards, to the left and right, ``margin`` m inside the soles."""
        polygon = support_polygon(self._legs, pose.sole_pos, pose.sole_rot, support != "R", support != "L")
        return np.asarray(room_around(polygon, pose.com[0], pose.com[1], _forward(pose), margin, 0.0))

    def moved(self, target: Target, shift: Array, raised: float, low: Array, high: Array) -> Array | None:
        """Joint angles (J,) rad of a target with its CoM shifted by (2,) m and its other sole raised by m.

        The soles keep their places and directions. low, high: (J,) rad, of the angles that may be asked for. None where
        the legs cannot do it.
        """
        side, pose = self.side(target.support), self.pose(target.q, target.support)
        sole_pos, sole_rot = pose.sole_pos.copy(), pose.sole_rot.copy()
        sole_pos[1 - side, 2] += raised
        x, y = _forward(pose)
        way = np.array([x * shift[0] - y * shift[1], y * shift[0] + x * shift[1], 0.0])
        feet = pose.soles_in_base - self.hips - way @ pose.base_rot
        goal = free_goal(feet, pose.com[:2] + way[:2], np.ones(2), np.array([0.5, 0.5]))
        goal = goal._replace(overload=np.inf)
        low, high = np.maximum(low, target.q - FARTHEST), np.minimum(high, target.q + FARTHEST)
        q = target.q.copy()
        stance = Stance(side, sole_pos, sole_rot, POSE, 0.0)
        reach = Reach(1.0, low, high, low, high)
        found = solve_legs(self._tree, self._legs, EXACT, stance, goal, q, reach, *self._rows)
        return q if found.iterations > 0 and found.closure < CLOSED and found.com_error < ARRIVED else None


def _forward(pose: Pose) -> Array:
    """Where the torso points over the floor, a unit vector (2,)."""
    return np.asarray(level(pose.base_rot[2])[0] @ pose.base_rot.T)[:2]


def level(up: Array) -> Array:
    """Rotation (3, 3) from the base to upright axes: x where the torso points, z along up (3,), given in the base."""
    x = np.array([1.0, 0.0, 0.0]) - up[0] * up
    x /= max(float(np.linalg.norm(x)), 1e-6)
    return np.stack([x, np.cross(up, x), up])
