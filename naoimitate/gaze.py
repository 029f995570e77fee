"""Where the head looks: at one of the robot's own hands (the camera rule of Koenemann 2014, section VI-D)."""

from __future__ import annotations

import math
from itertools import product
from typing import NamedTuple

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


class Neck(NamedTuple):
    """The head's joints, flat for compiled code.

    joints: (H,). lower, upper: (H,) rad. table: (K, 3) rad, rows of their coupling table, none without one; x, y: the
    joints that it couples.
    """

    joints: Indices
    lower: Array
    upper: Array
    table: Array
    x: int
    y: int


class Gaze:
    """Aims the optical axis of the robot's first camera at a hand; without cameras, the x axis of the head link.

    robot: whose. hand: name of a point. reserve: rad that the head keeps from its limits and from its coupling table.
    Raises RobotModelError where the camera is on a link that the robot does not have.
    """

    def __init__(self, robot: RobotModel, hand: str, reserve: float) -> None:
        self._tree, self._hand = robot.tree, robot.points[hand]
        self._eye, self.at, self.axis = _eye(robot)
        neck = self._neck = _neck(robot, reserve)
        stand = np.clip(robot.postures["stand"][neck.joints], neck.lower, neck.upper)
        self._starts = [stand, *map(np.array, product(*np.linspace(neck.lower, neck.upper, 3).T))]

    def angles(self, q: Array) -> Array:
        """Angles (H,) rad of the head's joints that look at the hand, for a robot at q (J,) rad.

        Where limits and table do not let the head look there: those whose axis comes nearest, but for ``TURN_BACK``.
        The search starts from where the head is, and then from the posture ``stand``, the middle, sides and corners of
        its range, for a table has narrow places and a range has ends behind which something nearer may be.
        """
        best, joints = q.copy(), self._neck.joints
        if not joints.size:
            return best[joints]
        least = self._search(best)
        for start in self._starts:
            if least < ON_IT:
                break
            other = q.copy()
            other[joints] = start
            miss = self._search(other)
            if miss < least - TURN_BACK:
                best, least = other, miss
        return best[joints]

    def _search(self, q: Array) -> float:
        """Turn the head of q (J,) rad to the nearest direction there is around; the angle (rad) that is left."""
        _aim(self._tree, self._neck, q, self._eye, self.at, self.axis, self._hand.joint, self._hand.offset)
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


def _neck(robot: RobotModel, reserve: float) -> Neck:
    """The head's joints, with their limits and their coupling table less the reserve."""
    joints = np.array(robot.chains.get("head", ()), dtype=np.int64)
    lower, upper = robot.lower[joints] + reserve, robot.upper[joints] - reserve
    table: CouplingTable | None = next((t for t in robot.tables if t.y in joints), None)
    if table is None:
        return Neck(joints, lower, upper, np.zeros((0, 3)), 0, 0)
    rows = np.ascontiguousarray(table.rows + np.array([0.0, reserve, -reserve]))
    return Neck(joints, lower, upper, rows, table.x, table.y)


@njit(cache=True)
def _aim(tree: Tree, neck: Neck, q: Array, eye: int, at: Array, axis: Array, hand: int, offset: Array) -> None:
    """Turn the head's joints of q (J,) rad until the axis a points along d, from the eye to the hand.

    Damped Gauss-Newton on |d - a|^2, with the limits, and the table linearised at every step; a step that leads away is
    taken again with more damping.
    """
    head, n, joints = neck.joints, neck.joints.shape[0], q.shape[0]
    pos, rot = np.empty((joints + 1, 3)), np.empty((joints + 1, 3, 3))
    J, step, best, least, damping = np.empty((3, n)), np.zeros(n), q[head], np.inf, DAMPING
    H, g, (C, b) = np.eye(n), np.zeros(n), _room(neck, q)
    for _ in range(STEPS):
        _move(neck, q, best, step)
        forward(tree, q, pos, rot)
        there = pos[hand + 1] + rot[hand + 1] @ offset
        error = _linearise(tree, head, pos, rot, eye, at, axis, there, J)
        damping *= LESS if (error**2).sum() < least else MORE
        if (error**2).sum() < least:
            least, best, damping = (error**2).sum(), q[head], max(damping, DAMPING)
            H, g, (C, b) = J.T @ J, J.T @ error, _room(neck, q)
        if bounded_step(H + damping * damping * np.eye(n), g, C, b, 0, step) != SOLVED or np.abs(step).max() < ENOUGH:
            break
    q[head] = best


@njit(cache=True)
def _move(neck: Neck, q: Array, here: Array, step: Array) -> None:
    """Put the head's joints of q (J,) rad a step (H,) rad from here (H,) rad, within limits and table."""
    for i in range(neck.joints.shape[0]):
        q[neck.joints[i]] = min(max(here[i] + step[i], neck.lower[i]), neck.upper[i])
    if neck.table.shape[0]:
        low, _, high, _ = table_bounds(neck.table, q[neck.x])
        q[neck.y] = min(max(q[neck.y], low), high)


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
def _room(neck: Neck, q: Array) -> tuple[Array, Array]:
    """Rows C (K, H) and b (K,) rad of C step >= b: the head's limits, and the table's edges at q (J,) rad."""
    n = neck.joints.shape[0]
    C, b = np.zeros((2 * n + 2, n)), np.zeros(2 * n + 2)
    for i in range(n):
        angle = q[neck.joints[i]]
        C[i, i], C[n + i, i] = 1.0, -1.0
        b[i], b[n + i] = min(neck.lower[i] - angle, 0.0), min(angle - neck.upper[i], 0.0)
    if neck.table.shape[0] == 0:
        return C[: 2 * n], b[: 2 * n]
    low, low_slope, high, high_slope = table_bounds(neck.table, q[neck.x])
    for i in range(n):
        if neck.joints[i] == neck.y:
            C[2 * n, i] += 1.0
            C[2 * n + 1, i] -= 1.0
        elif neck.joints[i] == neck.x:
            C[2 * n, i] -= low_slope
            C[2 * n + 1, i] += high_slope
    b[2 * n], b[2 * n + 1] = min(low - q[neck.y], 0.0), min(q[neck.y] - high, 0.0)
    return C, b
