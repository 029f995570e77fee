"""Where the head looks: at one of the robot's own hands (the camera rule of Koenemann 2014, section VI-D)."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.balance.legs import table_bounds
from naoimitate.core.errors import RobotModelError
from naoimitate.ik import SOLVED, bounded_step
from naoimitate.robot.kernel import angular_jacobian, forward, point_jacobian
from naoimitate.robot.model import CouplingTable, RobotModel, Tree
from naoimitate.robot.urdf import read_mechanism

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

HANDS = {"left-hand": "l_hand", "right-hand": "r_hand"}
"""The point that each choice of ``Settings.head`` looks at; ``follow`` looks at none."""
DAMPING = 0.03
"""[1/rad] of a step, where a joint hardly turns the axis."""
LESS, MORE = 0.3, 4.0
"""Factors of the damping after a step that led nearer, and after one that led away."""
STEPS, ENOUGH = 40, 1e-6
"""Gauss-Newton steps at most, and the step in rad after which there is no further one."""
ON_IT = 1e-3
"""[rad] from the hand, within which the axis is on it."""
TURN_BACK = 0.02
"""[rad] by which another direction must be nearer for the head to turn there, lest it swings between two like ones."""
NEAREST = 1e-3
"""[m] of a hand from the eye, below which its direction means nothing."""


class Gaze:
    """Aims the optical axis of the robot's first camera at a hand; without cameras, the x axis of the head link.

    robot: whose. hand: name of a point. reserve: rad that the head keeps from its limits and from its coupling table.
    Raises RobotModelError where the camera is on a link that the robot does not have.
    """

    def __init__(self, robot: RobotModel, hand: str, reserve: float) -> None:
        self._tree, self._hand = robot.tree, robot.points[hand]
        self._head = np.array(robot.chains.get("head", ()), dtype=np.int64)
        self._eye, self.at, self.axis = _eye(robot)
        self._lower, self._upper = robot.lower[self._head] + reserve, robot.upper[self._head] - reserve
        stand = np.clip(robot.postures["stand"][self._head], self._lower, self._upper)
        self._starts = [stand, *map(np.array, product(*np.linspace(self._lower, self._upper, 3).T))]
        self._table = _table(robot, self._head, reserve)

    def angles(self, q: Array) -> Array:
        """Angles (H,) rad of the head's joints that look at the hand, for a robot at q (J,) rad.

        Where limits and table do not let the head look there: those whose axis comes nearest, but for ``TURN_BACK``.
        The search starts from where the head is, and then from the posture ``stand``, the middle, sides and corners of
        its range, for a table has narrow places and a range has ends behind which something nearer may be.
        """
        best = q.copy()
        if not self._head.size:
            return best[self._head]
        least = self._search(best)
        for start in self._starts:
            if least < ON_IT:
                break
            other = q.copy()
            other[self._head] = start
            miss = self._search(other)
            if miss < least - TURN_BACK:
                best, least = other, miss
        return best[self._head]

    def _search(self, q: Array) -> float:
        """Turn the head of q (J,) rad to the nearest direction there is around; the angle (rad) that is left."""
        hand, eye = (self._hand.joint, self._hand.offset), (self._eye, self.at, self.axis)
        _aim(self._tree, self._head, q, *eye, *hand, self._lower, self._upper, *self._table)
        return self.miss(q)

    def miss(self, q: Array) -> float:
        """Angle (rad) between the optical axis and the direction to the hand, for a robot at q (J,) rad."""
        pos, rot = np.empty((len(q) + 1, 3)), np.empty((len(q) + 1, 3, 3))
        forward(self._tree, q, pos, rot)
        eye, hand = self._eye + 1, self._hand.joint + 1
        there = pos[hand] + rot[hand] @ self._hand.offset - pos[eye] - rot[eye] @ self.at
        axis = rot[eye] @ self.axis
        return math.atan2(float(np.linalg.norm(np.cross(axis, there))), float(axis @ there))


def build_gaze(robot: RobotModel, choice: str, reserve: float) -> Gaze | None:
    """The gaze of a choice of ``Settings.head``; None where the head follows the person's."""
    return None if choice == "follow" else Gaze(robot, HANDS[choice], reserve)


def _eye(robot: RobotModel) -> tuple[int, Array, Array]:
    """Joint behind which the eye is (-1 = base), its place (3,) m and its optical axis (3,) in the link's frame."""
    camera = next(iter(robot.data.get("cameras", {}).values()), robot.data["points"]["head"])
    frames = read_mechanism(robot.urdf).frames
    if camera["link"] not in frames:
        raise RobotModelError(f"a camera is on link {camera['link']!r}, which robot.urdf does not have: correct it")
    frame, pitch = frames[camera["link"]], float(camera.get("pitch", 0.0))
    place = frame.pos + frame.rot @ np.array(camera.get("at", (0.0, 0.0, 0.0)), dtype=float)
    axis = frame.rot @ np.array([math.cos(pitch), 0.0, -math.sin(pitch)])
    return frame.joint, np.ascontiguousarray(place), np.ascontiguousarray(axis)


def _table(robot: RobotModel, head: Indices, reserve: float) -> tuple[Array, int, int]:
    """Rows (K, 3) rad of the head's coupling table less the reserve, and which joints are x and y; no rows for none."""
    table: CouplingTable | None = next((t for t in robot.tables if t.y in head), None)
    if table is None:
        return np.zeros((0, 3)), 0, 0
    return np.ascontiguousarray(table.rows + np.array([0.0, reserve, -reserve])), table.x, table.y


@njit(cache=True)
def _aim(
    tree: Tree,
    head: Indices,
    q: Array,
    eye: int,
    at: Array,
    axis: Array,
    hand: int,
    offset: Array,
    lower: Array,
    upper: Array,
    table: Array,
    table_x: int,
    table_y: int,
) -> None:
    """Turn the head's joints of q (J,) rad until the axis a points along d, from the eye to the hand.

    Damped Gauss-Newton on |d - a|^2, with limits (H,) rad and the table linearised at every step; a step that leads
    away is taken again with more damping.
    """
    n, joints = head.shape[0], q.shape[0]
    pos, rot = np.empty((joints + 1, 3)), np.empty((joints + 1, 3, 3))
    J, step, best, least, damping = np.empty((3, n)), np.zeros(n), q[head], np.inf, DAMPING
    H, g, (C, b) = np.eye(n), np.zeros(n), _room(head, q, lower, upper, table, table_x, table_y)
    for _ in range(STEPS):
        _move(head, q, best, step, lower, upper, table, table_x, table_y)
        forward(tree, q, pos, rot)
        there = pos[hand + 1] + rot[hand + 1] @ offset
        error = _linearise(tree, head, pos, rot, eye, at, axis, there, J)
        damping *= LESS if (error**2).sum() < least else MORE
        if (error**2).sum() < least:
            least, best, damping = (error**2).sum(), q[head], max(damping, DAMPING)
            H, g, (C, b) = J.T @ J, J.T @ error, _room(head, q, lower, upper, table, table_x, table_y)
        if bounded_step(H + damping * damping * np.eye(n), g, C, b, 0, step) != SOLVED or np.abs(step).max() < ENOUGH:
            break
    q[head] = best


@njit(cache=True)
def _move(
    head: Indices,
    q: Array,
    here: Array,
    step: Array,
    lower: Array,
    upper: Array,
    table: Array,
    table_x: int,
    table_y: int,
) -> None:
    """Put the head's joints of q (J,) rad a step (H,) rad from here (H,) rad, within limits and table."""
    for i in range(head.shape[0]):
        q[head[i]] = min(max(here[i] + step[i], lower[i]), upper[i])
    if table.shape[0]:
        low, _, high, _ = table_bounds(table, q[table_x])
        q[table_y] = min(max(q[table_y], low), high)


@njit(cache=True)
def _linearise(
    tree: Tree, head: Indices, pos: Array, rot: Array, eye: int, at: Array, axis: Array, there: Array, J: Array
) -> Array:
    """d - a (3,), and its change per rad of the head's joints, reversed, in J (3, H); there: (3,) m, the hand.

    da/dq = w x a, dd/dq = -(E - d d^T) v / |hand - eye|, with w and v the angular and linear velocities of the eye.
    """
    turning, moving = np.empty((3, pos.shape[0] - 1)), np.empty((3, pos.shape[0] - 1))
    a, place = rot[eye + 1] @ axis, pos[eye + 1] + rot[eye + 1] @ at
    angular_jacobian(tree, pos, rot, eye, turning)
    point_jacobian(tree, pos, rot, eye, place, moving)
    far = max(math.sqrt(((there - place) ** 2).sum()), NEAREST)
    d = (there - place) / far
    for i in range(head.shape[0]):
        v, w = moving[:, head[i]].copy(), turning[:, head[i]].copy()
        J[:, i] = np.cross(w, a) + (v - d * (d * v).sum()) / far
    return d - a


@njit(cache=True)
def _room(
    head: Indices, q: Array, lower: Array, upper: Array, table: Array, table_x: int, table_y: int
) -> tuple[Array, Array]:
    """Rows C (K, H) and b (K,) rad of C step >= b: the head's limits, and the table's edges at q (J,) rad."""
    n = head.shape[0]
    C, b = np.zeros((2 * n + 2, n)), np.zeros(2 * n + 2)
    for i in range(n):
        C[i, i], C[n + i, i] = 1.0, -1.0
        b[i], b[n + i] = min(lower[i] - q[head[i]], 0.0), min(q[head[i]] - upper[i], 0.0)
    if table.shape[0] == 0:
        return C[: 2 * n], b[: 2 * n]
    low, low_slope, high, high_slope = table_bounds(table, q[table_x])
    for i in range(n):
        if head[i] == table_y:
            C[2 * n, i] += 1.0
            C[2 * n + 1, i] -= 1.0
        elif head[i] == table_x:
            C[2 * n, i] -= low_slope
            C[2 * n + 1, i] += high_slope
    b[2 * n], b[2 * n + 1] = min(low - q[table_y], 0.0), min(q[table_y] - high, 0.0)
    return C, b
