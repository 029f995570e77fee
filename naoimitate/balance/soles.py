"""Damped least squares that put both soles where they belong in the torso frame (Koenemann 2014, section V-C).

Each foot is a problem of 5 degrees of freedom, a place and the sole's normal. One row more, the angle between the
headings of the feet, settles what a joint is for that the legs share: without it bent hips would turn the toes against
each other. The iteration runs until the published tolerance is met. It knows the coupling tables as limits of the
present moment, so that Chang and Dubey's weights keep it from pushing against them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.balance.legs import Legs, reduce_columns, table_bounds
from naoimitate.ik import damped_step, limit_avoiding_weights
from naoimitate.limb import Limb, build_limb
from naoimitate.robot.kernel import angular_jacobian, center_of_mass, forward, point_jacobian
from naoimitate.robot.model import RobotModel, Tree

Array = npt.NDArray[np.float64]

ROWS = 13
"""Of the problem: place and normal of two soles (in three rows each), and the angle between their headings."""
STALLED = 1e-5
"""[rad] of the largest joint movement in an iteration below which a solve has come as near as it can."""


class Soles(NamedTuple):
    """Both soles in the torso frame: centres of their outlines (2, 3) m, frames (2, 3, 3); and the CoM (3,) m there."""

    centres: Array
    frames: Array
    com: Array


class SoleGoal(NamedTuple):
    """What is asked of both soles, in the torso frame.

    places: (2, 3) m of their centres. normals: (2, 3). up: (3,), off the floor. between: rad about ``up``, the left
    sole's heading from the right one's.
    """

    places: Array
    normals: Array
    up: Array
    between: float


def uncoupled_leg(robot: RobotModel, legs: Legs, side: str) -> Limb:
    """A leg within the limits of ``legs``, its shared joints held, so that its solution does not move the other one."""
    limb = build_limb(robot, f"{side}_leg", 0.0)
    joints = limb.joints[~np.isin(limb.joints, robot.coupled)]
    return limb._replace(joints=joints, lower=legs.lower[joints], upper=legs.upper[joints], rest=legs.rest[joints])


def leg_joints(legs: Legs) -> npt.NDArray[np.int64]:
    """Indices of all joints of both legs."""
    return np.flatnonzero(legs.variable >= 0)


def shortened(before: Array, q: Array, joints: npt.NDArray[np.int64], low: Array, high: Array) -> Array:
    """q (J,) rad with the longest part of the step of ``joints`` that stays between low and high, all slowed alike."""
    step = (q - before)[joints]
    room = np.where(step > 0.0, (high - before)[joints], (before - low)[joints])
    part = float(np.min(np.where(np.abs(step) > room, room / np.maximum(np.abs(step), 1e-12), 1.0)))
    short = q.copy()
    short[joints] = before[joints] + part * step
    return short


@njit(cache=True)
def soles_at(tree: Tree, legs: Legs, q: Array) -> Soles:
    """The soles and the CoM at q (J,) rad."""
    count = q.shape[0]
    pos, rot = np.empty((count + 1, 3)), np.empty((count + 1, 3, 3))
    soles = Soles(np.empty((2, 3)), np.empty((2, 3, 3)), np.empty(3))
    forward(tree, q, pos, rot)
    center_of_mass(tree, pos, rot, soles.com)
    for k in range(2):
        soles.centres[k] = sole_centre(legs, k, pos, rot)
        soles.frames[k] = rot[legs.sole_joint[k] + 1]
    return soles


@njit(cache=True)
def sole_centre(legs: Legs, side: int, pos: Array, rot: Array) -> Array:
    """Centre of a sole's outline (3,) m in the torso frame; pos, rot from ``forward``."""
    row = legs.sole_joint[side] + 1
    local = legs.sole_point[side] + np.array([legs.centre[side, 0], legs.centre[side, 1], 0.0])
    return pos[row] + rot[row] @ local


@njit(cache=True)
def solve_soles(
    tree: Tree, legs: Legs, goal: SoleGoal, q: Array, damping: float, near: float, angle: float, limit: int
) -> tuple[int, bool]:
    """Move both legs of q (J,) rad until every sole's centre is within ``near`` m and ``angle`` rad of its goal.

    Returns the iterations, at most ``limit``, and whether it arrived.
    """
    n = legs.joints.shape[0]
    pos, rot = np.empty((q.shape[0] + 1, 3)), np.empty((q.shape[0] + 1, 3, 3))
    A, e = np.empty((ROWS, n)), np.empty(ROWS)
    angles, lower, upper = np.empty(n), np.empty(n), np.empty(n)
    weights, step = np.ones(n), np.zeros(n)
    for iteration in range(limit):
        forward(tree, q, pos, rot)
        if _errors(tree, legs, goal, pos, rot, A, e, near, angle):
            return iteration, True
        present_limits(legs, q, angles, lower, upper)
        limit_avoiding_weights(angles, step, lower, upper, weights)
        step[:] = damped_step(A, e, weights, damping)
        moved = 0.0
        for j in range(q.shape[0]):
            v = legs.variable[j]
            if v >= 0:
                q[j] = min(max(q[j] + step[v], lower[v]), upper[v])
                moved = max(moved, abs(q[j] - angles[v]))
        into_tables(legs, q)
        if moved < STALLED:
            return iteration + 1, False
    return limit, False


@njit(cache=True)
def _errors(
    tree: Tree, legs: Legs, goal: SoleGoal, pos: Array, rot: Array, A: Array, e: Array, near: float, angle: float
) -> bool:
    """Fill the rows A (13, n) and errors e (13,): place and normal of each sole, headings; whether all are small."""
    n, J = A.shape[1], np.empty((3, tree.parent.shape[0]))
    W = np.empty((2, 3, n))
    A[:], e[:], arrived = 0.0, 0.0, True
    for k in range(2):
        row = legs.sole_joint[k] + 1
        centre = sole_centre(legs, k, pos, rot)
        place, turn = slice(6 * k, 6 * k + 3), slice(6 * k + 3, 6 * k + 6)
        point_jacobian(tree, pos, rot, row - 1, centre, J)
        reduce_columns(J, legs, A[place])
        angular_jacobian(tree, pos, rot, row - 1, J)
        reduce_columns(J, legs, W[k])
        e[place] = goal.places[k] - centre
        A[turn] = W[k]
        e[turn] = np.cross(rot[row][:, 2], goal.normals[k])
        arrived = bool(arrived and np.linalg.norm(e[place]) < near and np.linalg.norm(e[turn]) < angle)
    level, turn = headings(legs, rot, goal.up)
    A[12] = level * (goal.up @ (W[0] - W[1]))
    e[12] = level * (goal.between - turn)
    return bool(arrived and abs(e[12]) < angle)


@njit(cache=True)
def headings(legs: Legs, rot: Array, up: Array) -> tuple[float, float]:
    """How much of both headings lies across ``up`` (3,), 0 to 1, and the left sole's from the right one's, rad."""
    left, right = rot[legs.sole_joint[0] + 1][:, 0], rot[legs.sole_joint[1] + 1][:, 0]
    left, right = left - (left * up).sum() * up, right - (right * up).sum() * up
    sine, cosine = (np.cross(right, left) * up).sum(), (right * left).sum()
    return np.hypot(sine, cosine), np.arctan2(sine, cosine)


@njit(cache=True)
def present_limits(legs: Legs, q: Array, angles: Array, lower: Array, upper: Array) -> None:
    """Angles and limits (n,) rad of the free variables at q (J,), the coupling tables at q included."""
    for i in range(angles.shape[0]):
        j = legs.joints[i]
        angles[i], lower[i], upper[i] = q[j], legs.lower[j], legs.upper[j]
    for t in range(legs.table_x.shape[0]):
        low, _, high, _ = table_bounds(legs.table_rows[t], q[legs.table_x[t]])
        v = legs.variable[legs.table_y[t]]
        lower[v], upper[v] = max(lower[v], low), min(upper[v], high)


@njit(cache=True)
def into_tables(legs: Legs, q: Array) -> None:
    """Move the joints of q (J,) rad that a coupling table bounds to the nearest angle it allows."""
    for t in range(legs.table_x.shape[0]):
        low, _, high, _ = table_bounds(legs.table_rows[t], q[legs.table_x[t]])
        y = legs.table_y[t]
        q[y] = min(max(q[y], low), high)
