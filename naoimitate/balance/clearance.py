"""Distances of the body to itself and to the floor as linear rows for the solvers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.balance.legs import Legs, add_cross, reduce_columns
from naoimitate.balance.pose import Pose
from naoimitate.collision import BOX, ShapeArrays, distances, lowest_points, shape_arrays
from naoimitate.robot.kernel import angular_jacobian, point_jacobian
from naoimitate.robot.model import RobotModel, Tree

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

CORNER_REACH = 0.012
"""[m] from the plane between two boxes within which their corners are watched."""
MOST_CORNERS = 64
"""Room for rows of corners; in the unlikely case of more, further pairs are left to the gate."""


@dataclass(frozen=True)
class ClearanceSettings:
    """How far the body stays from itself and from the floor."""

    safe: float = 0.002
    """[m] to keep between shapes, and between the floor and all but the feet."""
    reach: float = 0.03
    """[m] below which a pair is watched."""
    push: float = 0.0005
    """[m] by which shapes that are too near are parted in one frame."""
    arms: float = 0.002
    """[m] that arms keep beyond ``safe``, and by which they are parted in one frame: legs come before hands, and hands
    that stay as near as they may would leave the legs no way."""


class Clearance:
    """The distances in one pose of a robot, and what they allow a step to do."""

    def __init__(self, robot: RobotModel, settings: ClearanceSettings) -> None:
        self._tree, self._settings = robot.tree, settings
        self._shapes = shape_arrays(robot)
        self._pairs = np.ascontiguousarray(robot.pairs)
        self._looked_at: Pose | None = None
        count = len(robot.pairs)
        self._d, self._normal = np.empty(count), np.empty((count, 3))
        self._a, self._b = np.empty((count, 3)), np.empty((count, 3))
        self._lowest = np.empty((len(robot.shapes), 3))
        feet = [robot.points[f"{s}_sole"].joint for s in "lr"]
        self._not_foot = np.array([shape.joint not in feet for shape in robot.shapes])
        self._not_stance = np.array([[shape.joint != foot for shape in robot.shapes] for foot in feet])

    def look(self, pose: Pose) -> None:
        """Measure a pose, if it is another one than before."""
        if pose is self._looked_at:
            return
        self._looked_at = pose
        distances(
            self._shapes,
            self._pairs,
            pose.link_pos,
            pose.link_rot,
            self._settings.reach,
            self._d,
            self._a,
            self._b,
            self._normal,
        )
        lowest_points(self._shapes, pose.link_pos, pose.link_rot, pose.base_pos, pose.base_rot, self._lowest)

    @property
    def nearest(self) -> float:
        """The smallest distance of the pose last looked at, floor included, m; negative = overlap."""
        floor = float(self._lowest[self._not_foot, 2].min()) if self._not_foot.any() else np.inf
        return min(float(self._d.min()) if len(self._d) else np.inf, floor)

    def touching(self, joints: Ints) -> bool:
        """Whether a link of these joints is as near to another shape or the floor as it may come."""
        mine = np.isin(self._shapes.link - 1, joints)
        pairs = mine[self._pairs].any(axis=1) if len(self._pairs) else np.zeros(0, dtype=bool)
        close = self._settings.safe + self._settings.arms + self._settings.push
        return bool((self._d[pairs] < close).any() or (self._lowest[mine, 2] < close).any())

    def limb_rows(self, pose: Pose, joints: Ints) -> tuple[Array, Array]:
        """Rows (C, n) and bounds (C,) m for a limb whose joints (n,) move while the base stays."""
        return _limb_rows(
            self._tree, joints, self._pairs, self._shapes, self._d, self._a, self._b, self._normal, self._lowest,
            self._not_foot, pose.link_pos, pose.link_rot, pose.base_pos, pose.base_rot, *self._arm_numbers,
        )  # fmt: skip

    def leg_rows(self, pose: Pose, legs: Legs, side: int, free: bool = False) -> tuple[Array, Array]:
        """Rows (C, n) and bounds (C,) m for the legs, with the base hung on sole ``side``.

        free: the other foot swings freely, and must not touch the floor with any part.
        """
        above = self._not_stance[side] if free else self._not_foot
        return _leg_rows(
            self._tree, legs, side, self._pairs, self._shapes, self._d, self._a, self._b, self._normal, self._lowest,
            above, pose.link_pos, pose.link_rot, pose.base_pos, pose.base_rot, *self._numbers,
        )  # fmt: skip

    @property
    def _numbers(self) -> tuple[float, float, float]:
        return self._settings.safe, self._settings.reach, self._settings.push

    @property
    def _arm_numbers(self) -> tuple[float, float, float]:
        return self._settings.safe + self._settings.arms, self._settings.reach, self._settings.arms


@njit(cache=True)
def _bound(distance: float, safe: float, push: float) -> float:
    """Least change of a distance in a step: it may shrink to ``safe``; below, it must grow, gently."""
    return min(safe - distance, push)


@njit(cache=True)
def _contact_points(
    shapes: ShapeArrays,
    pair: Ints,
    d: float,
    a: Array,
    b: Array,
    normal: Array,
    pos: Array,
    rot: Array,
    points: Array,
    gaps: Array,
) -> int:
    """Points (17, 3) m at which two shapes must not come nearer, their gaps (17,) m along the normal, and their number.

    One point is enough for round shapes. Two boxes that turn against each other would meet at corners far from it:
    their corners near the plane between them are watched as well.
    """
    points[0], gaps[0], count = 0.5 * (a + b), d, 1
    if shapes.kind[pair[0]] != BOX or shapes.kind[pair[1]] != BOX:
        return count
    for end in range(2):
        s = pair[end]
        row = shapes.link[s]
        for corner in range(8):
            local = shapes.p0[s].copy()
            for k in range(3):
                local[k] += shapes.half[s, k] * (1.0 if (corner >> k) & 1 else -1.0)
            point = pos[row] + rot[row] @ local
            gap = np.dot(normal, b - point) if end == 0 else np.dot(normal, point - a)
            if gap < CORNER_REACH:
                points[count], gaps[count] = point, gap
                count += 1
    return count


@njit(cache=True)
def _limb_rows(
    tree: Tree, joints: Ints, pairs: Ints, shapes: ShapeArrays, d: Array, a: Array, b: Array, normal: Array,
    lowest: Array, not_foot: Array, pos: Array, rot: Array, base_pos: Array, base_rot: Array, safe: float, reach: float,
    push: float,
) -> tuple[Array, Array]:  # fmt: skip
    n, J = joints.shape[0], np.empty((3, tree.parent.shape[0]))
    link, most = shapes.link, pairs.shape[0] + lowest.shape[0] + MOST_CORNERS
    rows, bounds = np.zeros((most, n)), np.empty(most)
    points, gaps = np.empty((17, 3)), np.empty(17)
    count = 0
    for p in range(pairs.shape[0]):
        if d[p] > reach or count + 17 + lowest.shape[0] > most:
            continue
        for k in range(_contact_points(shapes, pairs[p], d[p], a[p], b[p], normal[p], pos, rot, points, gaps)):
            for end in range(2):
                point_jacobian(tree, pos, rot, link[pairs[p, end]] - 1, points[k], J)
                for i in range(n):
                    for axis in range(3):
                        rows[count, i] += (2.0 * end - 1.0) * normal[p, axis] * J[axis, joints[i]]
            count = _keep(rows, bounds, count, _bound(gaps[k], safe, push))
    up = np.ascontiguousarray(base_rot[2])
    for s in range(lowest.shape[0]):
        if not not_foot[s] or lowest[s, 2] > reach:
            continue
        point_jacobian(tree, pos, rot, link[s] - 1, base_rot.T @ (lowest[s] - base_pos), J)
        for i in range(n):
            for axis in range(3):
                rows[count, i] += up[axis] * J[axis, joints[i]]
        count = _keep(rows, bounds, count, _bound(lowest[s, 2], safe, push))
    return rows[:count], bounds[:count]


@njit(cache=True)
def _keep(rows: Array, bounds: Array, count: int, bound: float) -> int:
    """Keep row ``count`` when these joints can do something about its distance."""
    if np.abs(rows[count]).max() < 1e-9:
        rows[count] = 0.0
        return count
    bounds[count] = bound
    return count + 1


@njit(cache=True)
def _leg_rows(
    tree: Tree, legs: Legs, side: int, pairs: Ints, shapes: ShapeArrays, d: Array, a: Array, b: Array, normal: Array,
    lowest: Array, not_foot: Array, pos: Array, rot: Array, base_pos: Array, base_rot: Array, safe: float, reach: float,
    push: float,
) -> tuple[Array, Array]:  # fmt: skip
    n, J = legs.joints.shape[0], np.empty((3, tree.parent.shape[0]))
    link, most = shapes.link, pairs.shape[0] + lowest.shape[0] + MOST_CORNERS
    rows, bounds = np.zeros((most, n)), np.empty(most)
    points, gaps = np.empty((17, 3)), np.empty(17)
    Jp, Js, Ws = np.empty((3, n)), np.empty((3, n)), np.empty((3, n))
    count = 0
    for p in range(pairs.shape[0]):
        if d[p] > reach or count + 17 + lowest.shape[0] > most:
            continue
        for k in range(_contact_points(shapes, pairs[p], d[p], a[p], b[p], normal[p], pos, rot, points, gaps)):
            for end in range(2):
                point_jacobian(tree, pos, rot, link[pairs[p, end]] - 1, points[k], J)
                reduce_columns(J, legs, Jp)
                rows[count] += (2.0 * end - 1.0) * (np.ascontiguousarray(Jp.T) @ normal[p])
            count = _keep(rows, bounds, count, _bound(gaps[k], safe, push))
    sole_row = legs.sole_joint[side] + 1
    sole = pos[sole_row] + rot[sole_row] @ legs.sole_point[side]
    point_jacobian(tree, pos, rot, legs.sole_joint[side], sole, J)
    reduce_columns(J, legs, Js)
    angular_jacobian(tree, pos, rot, legs.sole_joint[side], J)
    reduce_columns(J, legs, Ws)
    up = np.ascontiguousarray(base_rot[2])
    for s in range(lowest.shape[0]):
        if not not_foot[s] or lowest[s, 2] > reach:
            continue
        point = base_rot.T @ (lowest[s] - base_pos)
        point_jacobian(tree, pos, rot, link[s] - 1, point, J)
        reduce_columns(J, legs, Jp)
        Jp -= Js
        add_cross(point - sole, Ws, Jp)
        rows[count] = np.ascontiguousarray(Jp.T) @ up
        count = _keep(rows, bounds, count, _bound(lowest[s, 2], safe, push))
    return rows[:count], bounds[:count]
