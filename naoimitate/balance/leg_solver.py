"""The torso over planted soles (Koenemann 2014, section V-C, on feet that do not slide).

The paper shifts one foot in double support; on the floor that drags it. Here the soles are fixed in the world and the
torso moves: over all leg joints minimise the squared distance of both feet to their targets in the torso frame, with
the CoM over p_L + o' (p_R - p_L) in both horizontal directions (the up-vector rule (7)), the soles where they are,
coupled joints equal, and joint, speed, torque, table, clearance and collision bounds inside the solve.

The base hangs on the stance sole: ``T_world_base = T_world_sole T_base_sole^-1``, so the stance foot is fixed exactly;
the other foot is a constraint (planted, lifting, landing) or a task (swinging).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.balance.leg_rows import (
    SLACKS,
    com_rows,
    count_rows,
    extra_rows,
    joint_rows,
    load_rows,
    sole_rows,
    sway_rows,
    table_rows,
)
from naoimitate.balance.legs import DOWN, FREE, POSE, REACH, LegGoal, Legs, LegWeights, Stance
from naoimitate.balance.retarget import Reach
from naoimitate.balance.tangent import Tangent, add_turned, differentiate, make_tangent, place
from naoimitate.core.geometry import rotation_vector
from naoimitate.ik import SOLVED, bounded_step, priced_step
from naoimitate.robot.model import Tree

Array = npt.NDArray[np.float64]


class Solution(NamedTuple):
    """What came of a solve.

    iterations: 0 where the first step is infeasible. closure: how far the other sole is from where it must be, in m and
    rad, summed. com_error: m. load: largest torque of a joint that holds the body up, as a share of its bound.
    """

    iterations: int
    closure: float
    com_error: float
    load: float


CONVERGED = 3e-4
"""[rad] of a step, below which the next one would be as small as its square."""
CLOSED = 1e-8
"""Sum of m and rad of the other sole's error, below which the loop is closed."""


@njit(cache=True)
def solve_legs(
    tree: Tree,
    legs: Legs,
    weights: LegWeights,
    stance: Stance,
    goal: LegGoal,
    q: Array,
    reach: Reach,
    rows: Array,
    bounds: Array,
) -> Solution:
    """Move the leg joints of q (J,) rad towards the goal; the rest of q is given.

    rows: (C, n), bounds: (C,): extra rows ``rows (x - x0) >= bounds`` on the change of the free variables since the
    call (collisions).
    q is left at the best feasible point; where the first step is infeasible it is unchanged.
    """
    n, count = legs.joints.shape[0], q.shape[0]
    t, x = make_tangent(count, n), np.empty(n + SLACKS)
    start, moved = np.array([q[j] for j in legs.joints]), np.zeros(n)
    e_pos, e_rot, e_com, slack, most = np.empty(3), np.empty(3), np.empty(2), np.empty(2), np.zeros(legs.holds.shape)
    H, g = np.empty((n + SLACKS, n + SLACKS)), np.empty(n + SLACKS)
    C = np.zeros((count_rows(legs, rows.shape[0]), n + SLACKS))
    b = np.empty(C.shape[0])
    closure, com_error, load = 0.0, 0.0, 0.0
    limit, damping, done = int(weights.iterations), weights.damping, 0
    for iteration in range(limit + 1):
        place(tree, legs, stance, q, t)
        _errors(stance, goal, t, e_pos, e_rot, e_com)
        com_error = np.sqrt(e_com[0] ** 2 + e_com[1] ** 2)
        closure = _closure(stance, e_pos, e_rot)
        if iteration == limit or (iteration > 0 and np.abs(x[:n]).max() < CONVERGED and closure < CLOSED):
            break
        if iteration == 0:
            ex, ey = goal.along
            slack[0] = max(weights.com_slack, abs(ex * e_com[0] + ey * e_com[1]))
            slack[1] = max(weights.com_slack_across, abs(ex * e_com[1] - ey * e_com[0]))
        differentiate(tree, legs, stance, goal.about, t)
        _tasks(legs, weights, stance, goal, t, q, e_pos, e_rot, e_com, damping, H, g)
        C[:] = 0.0
        row, equalities = sole_rows(legs, stance, t, e_pos, e_rot, C, b)
        row = com_rows(t, goal.along, e_com, slack, C, b, row)
        row, load = load_rows(tree, legs, goal, t, reach.dt, most, C, b, row)
        row = sway_rows(legs, goal, t, moved, C, b, row)
        row = joint_rows(legs, q, start, reach, C, b, row)
        row = table_rows(legs, q, reach.dt, C, b, row)
        row = extra_rows(rows, bounds, moved, C, b, row)
        if _step(H, g, C[:row], b[:row], equalities, x) != SOLVED:
            break
        done += 1
        damping *= weights.damping_growth
        moved += x[:n]
        for j in range(count):
            if legs.variable[j] >= 0:
                q[j] += x[legs.variable[j]]
    return Solution(done, closure, com_error, load)


@njit(cache=True)
def _step(H: Array, g: Array, C: Array, b: Array, equalities: int, x: Array) -> int:
    """The bounded step x (n + SLACKS,), first without slacks: most often nothing has to give.

    Where no group of soft rows costs more than its slack would, the step without slacks is the step with them.
    """
    n = H.shape[0] - SLACKS
    price = np.empty(C.shape[0])
    hard = (np.ascontiguousarray(H[:n, :n]), g[:n].copy(), np.ascontiguousarray(C[:, :n]))
    if priced_step(*hard, b, equalities, x[:n], price) == SOLVED:
        x[n:] = 0.0
        fair = True
        for k in range(n, n + SLACKS):
            fair = fair and np.dot(np.ascontiguousarray(C[:, k]), price) <= -g[k]
        if fair:
            return SOLVED
    return bounded_step(H, g, C, b, equalities, x)


@njit(cache=True)
def _errors(stance: Stance, goal: LegGoal, t: Tangent, e_pos: Array, e_rot: Array, e_com: Array) -> None:
    """What is left to go: the other sole (3,) m and (3,) rad in the world, the CoM's projection (2,) m."""
    o = 1 - stance.side
    e_pos[:] = 0.0
    add_turned(t.R, t.other_at, e_pos)
    e_pos[:] = stance.pos[o] - t.p - e_pos
    e_rot[:] = rotation_vector(np.ascontiguousarray(stance.rot[o]) @ np.ascontiguousarray(t.other_rot.T))
    for k in range(2):
        e_com[k] = goal.com[k] - t.p[k] - (t.R[k, 0] * t.com[0] + t.R[k, 1] * t.com[1] + t.R[k, 2] * t.com[2])


@njit(cache=True)
def _closure(stance: Stance, e_pos: Array, e_rot: Array) -> float:
    """How far the other sole is from where it must be, in m and rad, summed: a foot that comes down may be higher."""
    if stance.kind not in (POSE, DOWN):
        return 0.0
    height = max(e_pos[2], 0.0) if stance.kind == DOWN else abs(e_pos[2])
    return np.abs(e_pos[:2]).sum() + height + np.abs(e_rot).sum()


@njit(cache=True)
def _tasks(
    legs: Legs,
    weights: LegWeights,
    stance: Stance,
    goal: LegGoal,
    t: Tangent,
    q: Array,
    e_pos: Array,
    e_rot: Array,
    e_com: Array,
    damping: float,
    H: Array,
    g: Array,
) -> None:
    """The weighted least squares of a step, H and g with their slacks: feet, CoM, a torso that stays, rest."""
    s, o, n = stance.side, 1 - stance.side, legs.joints.shape[0]
    H[:], g[:] = 0.0, 0.0
    _add_task(t.at, goal.feet[s] - (t.stance_at - legs.hip[s]), weights.foot * goal.foot_weight[s], H, g)
    _add_task(t.other, goal.feet[o] - (t.other_at - legs.hip[o]), weights.foot * goal.foot_weight[o], H, g)
    _add_task(t.base, np.zeros(3), weights.still_reaching if stance.kind == REACH else weights.still, H, g)
    _add_task(t.com_world[:2], e_com, weights.com, H, g)
    if stance.kind == REACH:
        _add_task(t.other_world, e_pos, weights.reach, H, g)
        _add_task(t.other_world_turn, e_rot, weights.reach_turn, H, g)
    elif stance.kind == FREE:
        part = min(1.0, weights.secondary_step / max(float(np.linalg.norm(e_rot)), 1e-9))
        _add_task(t.other_world_turn, part * e_rot, weights.level, H, g)
    for i in range(n):
        away = legs.rest[legs.joints[i]] - q[legs.joints[i]]
        H[i, i] += damping * damping + weights.rest**2
        g[i] += weights.rest**2 * min(max(away, -weights.secondary_step), weights.secondary_step)
    for k, price in enumerate((weights.overload, weights.jerk, weights.torso, weights.momentum, weights.descent)):
        H[n + k, n + k], g[n + k] = 1.0, -price


@njit(cache=True)
def _add_task(J: Array, e: Array, weight: float, H: Array, g: Array) -> None:
    w = weight * weight
    if w == 0.0:
        return
    m, n = J.shape
    for r in range(m):
        for i in range(n):
            a = w * J[r, i]
            if a != 0.0:
                g[i] += a * e[r]
                for k in range(n):
                    H[i, k] += a * J[r, k]
