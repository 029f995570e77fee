"""The legs as one problem: the torso over planted soles (Koenemann 2014, section V-C, on feet that do not slide).

The paper shifts one foot in double support; on the floor that drags it. Here the soles are fixed in the world and the
torso moves: over all leg joints minimise the squared distance of both feet to their targets in the torso frame, with
the CoM over p_L + o' (p_R - p_L) in both horizontal directions (the up-vector rule (7)), the soles where they are,
coupled joints equal, and joint, speed, table, clearance and collision bounds inside the solve.

The base hangs on the stance sole: ``T_world_base = T_world_sole T_base_sole^-1``, so the stance foot is fixed exactly;
the other foot is a constraint (planted, lifting, landing) or a task (swinging).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.balance.offset import GRAVITY
from naoimitate.core.geometry import polygon_centroid, rotation_vector
from naoimitate.ik import SOLVED, bounded_step
from naoimitate.robot.kernel import angular_jacobian, center_of_mass, com_jacobian, forward, point_jacobian
from naoimitate.robot.model import RobotModel, Tree

Array = npt.NDArray[np.float64]

POSE = 0
"""The other sole follows a given pose exactly: planted, lifting, coming down."""
FREE = 1
"""The other sole swings: its place in the torso frame and its level are tasks, its height a bound."""
REACH = 2
"""The other sole makes for a pose in the world, around whatever is in its way; its height is a bound."""

LEVER_STEP = 0.0005
"""[m] by which a knee's lever must shrink in a frame where it is too long."""
TABLE_RESERVE = 5e-4
"""[rad] kept from the coupling tables."""


class Legs(NamedTuple):
    """Flat description of both legs for the compiled solver.

    variable: (J,) int64, index of the free variable that moves the joint, -1 if none (a coupled follower shares its
    leader's). joints: (n,) the leader of each variable. sole_joint: (2,), sole_point: (2, 3) in that link.
    hip: (2, 3) m in the base frame. outline: (2, K, 2) m, the soles' outlines, padded by repetition. centre: (2, 2) m.
    lower, upper: (J,) rad, with the knees kept off the stretched singularity. table_x, table_y: (B,) joints;
    table_rows: (B, R, 3), padded by repetition. rest: (J,) rad, the posture that decides what nothing else does.
    knee: (2,) joints; knee_lever: (2,) m, how far the CoM's plumb line may pass from the knee that carries it all.
    """

    variable: npt.NDArray[np.int64]
    joints: npt.NDArray[np.int64]
    sole_joint: npt.NDArray[np.int64]
    sole_point: Array
    hip: Array
    outline: Array
    centre: Array
    lower: Array
    upper: Array
    table_x: npt.NDArray[np.int64]
    table_y: npt.NDArray[np.int64]
    table_rows: Array
    rest: Array
    knee: npt.NDArray[np.int64]
    knee_lever: Array


class LegWeights(NamedTuple):
    """Settings of the leg solver; weights multiply errors in m (or m/rad where said)."""

    com: float = 30.0
    """Of the CoM's horizontal error: it outweighs the feet, so that balance is never traded for similarity."""
    foot: float = 1.0
    """Of the feet in the torso frame."""
    com_slack: float = 0.010
    """[m] of CoM error along x and y that nothing may exceed (or increase, where it is already larger)."""
    still: float = 0.3
    """Of the torso's own motion over the floor in a frame: it goes no faster than the feet's targets need."""
    still_reaching: float = 2.0
    """The same while a foot reaches for its landing place: the foot then waits for the torso."""
    reach: float = 4.0
    """Of the sole's place in the world on its way to a landing."""
    reach_turn: float = 0.4
    """[m/rad] of its orientation then."""
    level: float = 0.02
    """[m/rad] of the swing sole's orientation in free swing."""
    rest: float = 0.004
    """[m/rad] towards the rest posture: decides only what the rest leaves open."""
    secondary_step: float = 0.02
    """[rad] of level and rest that one frame may ask for: the feet's own errors are as short, a frame's way each."""
    damping: float = 0.002
    """[m/rad] of the damped least squares in the first step."""
    damping_growth: float = 8.0
    """Factor on the damping from step to step: later steps only close the loop, and cannot go to and fro."""
    iterations: float = 5.0
    """Largest number of Newton steps a frame."""


@dataclass(frozen=True)
class LegLimits:
    """Reserves kept inside the robot's own limits."""

    knee_min: float = 0.30
    """[rad]. Below 0.15 the torso loses one of its five free directions with both soles planted; up to 0.3 a lift of
    millimetres still takes radians a second of the knee. It costs 1.7 mm of leg length."""
    torque_share: float = 0.7
    """Share of a knee's effort that the weight of the body may take: on one foot a deep bend is more than it holds."""
    range_reserve: float = 0.002
    """[rad] kept from every joint limit."""


def build_legs(robot: RobotModel, limits: LegLimits) -> Legs:
    """Flatten a robot's legs."""
    variable = np.full(len(robot.joint_names), -1, dtype=np.int64)
    leader = {follower: leader for leader, follower in robot.coupled}
    chain = [*robot.chains["l_leg"], *robot.chains["r_leg"]]
    joints = [j for j in chain if j not in leader]
    for index, j in enumerate(joints):
        variable[j] = index
    for follower, lead in leader.items():
        variable[follower] = variable[lead]
    lower, upper = robot.lower + limits.range_reserve, robot.upper - limits.range_reserve
    knees = np.array([robot.points[f"{s}_knee"].joint for s in "lr"], dtype=np.int64)
    for knee in knees:
        if upper[knee] >= -lower[knee]:
            lower[knee] = max(lower[knee], limits.knee_min)
        else:
            upper[knee] = min(upper[knee], -limits.knee_min)
    tables = [t for t in robot.tables if variable[t.y] >= 0]
    rows = max((len(t.rows) for t in tables), default=1)
    return Legs(
        variable,
        np.array(joints, dtype=np.int64),
        np.array([robot.points[f"{s}_sole"].joint for s in "lr"], dtype=np.int64),
        np.array([robot.points[f"{s}_sole"].offset for s in "lr"]),
        hip_positions(robot),
        np.array([_pad(robot.soles[s], max(len(robot.soles["l"]), len(robot.soles["r"]))) for s in "lr"]),
        np.array([polygon_centroid(robot.soles[s]) for s in "lr"]),
        lower,
        upper,
        np.array([t.x for t in tables], dtype=np.int64),
        np.array([t.y for t in tables], dtype=np.int64),
        np.array([_pad(t.rows, rows) for t in tables]).reshape(len(tables), rows, 3),
        robot.postures["stand"].copy(),
        knees,
        limits.torque_share * robot.effort[knees] / (robot.tree.mass.sum() * GRAVITY),
    )


def hip_positions(robot: RobotModel) -> Array:
    """Hip points (2, 3) m, left and right, in the base frame at the zero posture."""
    n = len(robot.joint_names)
    pos, rot = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    forward(robot.tree, np.zeros(n), pos, rot)
    points = [robot.points[f"{s}_hip"] for s in "lr"]
    return np.array([pos[p.joint + 1] + rot[p.joint + 1] @ p.offset for p in points])


def _pad(rows: Array, count: int) -> Array:
    return np.concatenate([rows, np.repeat(rows[-1:], count - len(rows), axis=0)])


class Stance(NamedTuple):
    """Where the soles are asked to be, in the world.

    side: 0 or 1, the foot on which the base hangs. pos: (2, 3) m, rot: (2, 3, 3): stance sole as it is, other sole as
    asked. kind: ``POSE`` or ``FREE``. min_height: m, below which no outline point of a free sole may come.
    """

    side: int
    pos: Array
    rot: Array
    kind: int
    min_height: float


class LegGoal(NamedTuple):
    """feet: (2, 3) m, hip to sole in the torso frame, (5). com: (2,) m, world. foot_weight: (2,).

    turn_low, turn_high: (3,) rad, bounds of the torso's rotation in this frame, about its own axes; move_low and
    move_high: (3,) m, of its origin's way, along them. The torso is heavy: what jerks it tips the stance foot.
    lever: (2,) m, how far the CoM's plumb line may pass from each knee.
    """

    feet: Array
    com: Array
    foot_weight: Array
    turn_low: Array
    turn_high: Array
    move_low: Array
    move_high: Array
    lever: Array


def free_goal(legs: Legs, feet: Array, com: Array, foot_weight: Array, share: Array) -> LegGoal:
    """A goal whose torso may move as it likes; share: (2,) of the weight on each leg, which bounds its knee's lever."""
    free = np.full(3, np.inf)
    return LegGoal(feet, com, foot_weight, -free, free, -free, free, legs.knee_lever / np.maximum(share, 1e-3))


@njit(cache=True)
def base_pose(tree: Tree, legs: Legs, stance: Stance, pos: Array, rot: Array, R_wb: Array, p_wb: Array) -> None:
    """World pose of the base from the stance sole; pos, rot from ``forward``. Writes R_wb (3, 3) and p_wb (3,)."""
    row = legs.sole_joint[stance.side] + 1
    R_wb[:] = stance.rot[stance.side] @ np.ascontiguousarray(rot[row].T)
    sole = pos[row] + rot[row] @ legs.sole_point[stance.side]
    p_wb[:] = stance.pos[stance.side] - R_wb @ sole


@njit(cache=True)
def reduce_columns(J: Array, legs: Legs, out: Array) -> None:
    """Columns of the joints to columns of the free variables: a follower's motion is its leader's."""
    out[:] = 0.0
    for j in range(J.shape[1]):
        v = legs.variable[j]
        if v >= 0:
            for i in range(J.shape[0]):
                out[i, v] += J[i, j]


@njit(cache=True)
def add_cross(v: Array, W: Array, out: Array) -> None:
    """out += skew(v) W, (3, n)."""
    for k in range(W.shape[1]):
        out[0, k] += v[1] * W[2, k] - v[2] * W[1, k]
        out[1, k] += v[2] * W[0, k] - v[0] * W[2, k]
        out[2, k] += v[0] * W[1, k] - v[1] * W[0, k]


@njit(cache=True)
def _add_task(J: Array, e: Array, weight: float, H: Array, g: Array) -> None:
    w = weight * weight
    m, n = J.shape
    for r in range(m):
        for i in range(n):
            a = w * J[r, i]
            if a != 0.0:
                g[i] += a * e[r]
                for k in range(n):
                    H[i, k] += a * J[r, k]


@njit(cache=True)
def solve_legs(
    tree: Tree,
    legs: Legs,
    weights: LegWeights,
    stance: Stance,
    goal: LegGoal,
    q: Array,
    q_low: Array,
    q_high: Array,
    rows: Array,
    bounds: Array,
) -> tuple[int, float, float]:
    """Move the leg joints of q (J,) rad towards the goal; the rest of q is given.

    q_low, q_high: (J,) rad, what the frame's speed limits allow. rows: (C, n), bounds: (C,): extra rows
    ``rows (x - x0) >= bounds`` on the change of the free variables since the call (collisions).
    Returns (iterations, closure error of the other sole in m and rad summed, CoM error m). q is left at the best
    feasible point; where the first step is infeasible it is unchanged.
    """
    n, count = legs.joints.shape[0], q.shape[0]
    pos, rot = np.empty((count + 1, 3)), np.empty((count + 1, 3, 3))
    R_wb, p_wb = np.empty((3, 3)), np.empty(3)
    J, x = np.empty((3, count)), np.empty(n)
    Js, Ws, Jo, Wo, Jc = np.empty((3, n)), np.empty((3, n)), np.empty((3, n)), np.empty((3, n)), np.empty((3, n))
    com, moved, slack, most = np.empty(3), np.zeros(n), np.zeros(2), np.zeros(2)
    Jraw, Jk = np.empty((3, n)), np.empty((3, n))
    s, o = stance.side, 1 - stance.side
    equalities = 6 if stance.kind == POSE else 0
    corners = legs.outline.shape[1] if stance.kind != POSE else 0
    tables = legs.table_x.shape[0]
    start = np.array([q[j] for j in legs.joints])
    C = np.zeros((equalities + 20 + 2 * n + 2 * tables + corners + rows.shape[0], n))
    b = np.empty(C.shape[0])
    closure, com_error = 0.0, 0.0
    limit, damping, done = int(weights.iterations), weights.damping, 0
    for iteration in range(limit + 1):
        forward(tree, q, pos, rot)
        base_pose(tree, legs, stance, pos, rot, R_wb, p_wb)
        center_of_mass(tree, pos, rot, com)
        ls, lo = legs.sole_joint[s], legs.sole_joint[o]
        ps, po = pos[ls + 1] + rot[ls + 1] @ legs.sole_point[s], pos[lo + 1] + rot[lo + 1] @ legs.sole_point[o]
        e_pos = stance.pos[o] - (p_wb + R_wb @ po)
        R_wo = R_wb @ rot[lo + 1]
        e_rot = rotation_vector(stance.rot[o] @ np.ascontiguousarray(R_wo.T))
        e_com = goal.com - (p_wb + R_wb @ com)[:2]
        com_error = np.sqrt(e_com[0] ** 2 + e_com[1] ** 2)
        closure = np.abs(e_pos).sum() + np.abs(e_rot).sum() if equalities else 0.0
        if iteration == limit or (iteration > 0 and np.abs(x).max() < 1e-6 and closure < 1e-8):
            break
        point_jacobian(tree, pos, rot, ls, ps, J)
        reduce_columns(J, legs, Js)
        angular_jacobian(tree, pos, rot, ls, J)
        reduce_columns(J, legs, Ws)
        point_jacobian(tree, pos, rot, lo, po, J)
        reduce_columns(J, legs, Jo)
        angular_jacobian(tree, pos, rot, lo, J)
        reduce_columns(J, legs, Wo)
        com_jacobian(tree, pos, rot, J)
        reduce_columns(J, legs, Jc)
        H, g = np.zeros((n, n)), np.zeros(n)
        _add_task(Js, goal.feet[s] - (ps - legs.hip[s]), weights.foot * goal.foot_weight[s], H, g)
        _add_task(Jo, goal.feet[o] - (po - legs.hip[o]), weights.foot * goal.foot_weight[o], H, g)
        Jraw[:] = Jc
        Jc -= Js
        add_cross(com - ps, Ws, Jc)
        Jb = -Js
        add_cross(-ps, Ws, Jb)
        still = weights.still_reaching if stance.kind == REACH else weights.still
        _add_task(Jb, np.zeros(3), still, H, g)
        Jcw = R_wb @ Jc
        _add_task(Jcw[:2], e_com, weights.com, H, g)
        Jow = Jo - Js
        add_cross(po - ps, Ws, Jow)
        Jow, Wow = R_wb @ Jow, R_wb @ (Wo - Ws)
        C[:] = 0.0
        row = equalities
        if stance.kind == POSE:
            C[:3], C[3:6] = Jow, Wow
            b[:3], b[3:6] = e_pos, e_rot
        else:
            if stance.kind == REACH:
                _add_task(Jow, e_pos, weights.reach, H, g)
            else:
                e_rot *= min(1.0, weights.secondary_step / max(float(np.linalg.norm(e_rot)), 1e-9))
            _add_task(Wow, e_rot, weights.reach_turn if stance.kind == REACH else weights.level, H, g)
            for k in range(corners):
                arm = R_wo[:, 0] * legs.outline[o, k, 0] + R_wo[:, 1] * legs.outline[o, k, 1]
                for i in range(n):
                    C[row, i] = Jow[2, i] + arm[1] * Wow[0, i] - arm[0] * Wow[1, i]
                b[row] = stance.min_height - ((p_wb + R_wb @ po)[2] + arm[2])
                row += 1
        for k in range(2):
            if iteration == 0:
                slack[k] = max(weights.com_slack, abs(e_com[k]))
            C[row], b[row] = Jcw[k], e_com[k] - slack[k]
            C[row + 1], b[row + 1] = -Jcw[k], -e_com[k] - slack[k]
            row += 2
        for k in range(2):
            at, arm = pos[legs.knee[k] + 1], rot[legs.knee[k] + 1] @ tree.axis[legs.knee[k]]
            up = np.ascontiguousarray(R_wb[2])
            point_jacobian(tree, pos, rot, legs.knee[k], at, J)
            reduce_columns(J, legs, Jk)
            lever = np.dot(arm, np.cross(com - at, up))
            if iteration == 0:
                most[k] = max(goal.lever[k], abs(lever) - LEVER_STEP)
            side_way, turn_way = np.cross(up, arm), np.cross(up, np.cross(arm, com - at))
            for i in range(n):
                for a in range(3):
                    C[row, i] += side_way[a] * (Jraw[a, i] - Jk[a, i]) + turn_way[a] * Ws[a, i]
            C[row + 1] = -C[row]
            b[row], b[row + 1] = -most[k] - lever, lever - most[k]
            row += 2
        turned, went = Ws @ moved, Jb @ moved
        for k in range(3):
            C[row], b[row] = Jb[k], goal.move_low[k] - went[k]
            C[row + 1], b[row + 1] = -Jb[k], went[k] - goal.move_high[k]
            row += 2
            C[row], b[row] = -Ws[k], goal.turn_low[k] + turned[k]
            C[row + 1], b[row + 1] = Ws[k], -goal.turn_high[k] - turned[k]
            row += 2
        for i in range(n):
            j = legs.joints[i]
            H[i, i] += damping * damping + weights.rest**2
            pull = min(max(legs.rest[j] - q[j], -weights.secondary_step), weights.secondary_step)
            g[i] += weights.rest**2 * pull
            C[row, i], b[row] = 1.0, max(q_low[j], min(legs.lower[j], start[i])) - q[j]
            C[row + 1, i], b[row + 1] = -1.0, q[j] - min(q_high[j], max(legs.upper[j], start[i]))
            row += 2
        row = _table_rows(legs, q, C, b, row)
        for k in range(rows.shape[0]):
            C[row] = rows[k]
            b[row] = bounds[k]
            for i in range(n):
                b[row] -= rows[k, i] * moved[i]
            row += 1
        if bounded_step(H, g, C, b, equalities, x) != SOLVED:
            break
        done += 1
        damping *= weights.damping_growth
        moved += x
        for j in range(count):
            if legs.variable[j] >= 0:
                q[j] += x[legs.variable[j]]
    return done, closure, com_error


@njit(cache=True)
def _table_rows(legs: Legs, q: Array, C: Array, b: Array, row: int) -> int:
    """Coupling tables as linear rows at the present angle: y_min(x) <= y <= y_max(x)."""
    for t in range(legs.table_x.shape[0]):
        jx, jy = legs.table_x[t], legs.table_y[t]
        table = legs.table_rows[t]
        low, low_slope, high, high_slope = table_bounds(table, q[jx])
        vx, vy = legs.variable[jx], legs.variable[jy]
        C[row, vy], C[row, vx], b[row] = 1.0, -low_slope, low + TABLE_RESERVE - q[jy]
        C[row + 1, vy], C[row + 1, vx], b[row + 1] = -1.0, high_slope, q[jy] - high + TABLE_RESERVE
        row += 2
    return row


@njit(cache=True)
def table_bounds(table: Array, x: float) -> tuple[float, float, float, float]:
    """Lower bound, its slope, upper bound, its slope at x of a table (R, 3), linear between rows."""
    last = table.shape[0] - 1
    k = 0
    while k < last - 1 and table[k + 1, 0] < x:
        k += 1
    span = table[k + 1, 0] - table[k, 0]
    if span <= 0.0:
        return table[last, 1], 0.0, table[last, 2], 0.0
    low, high = (table[k + 1, 1] - table[k, 1]) / span, (table[k + 1, 2] - table[k, 2]) / span
    d = min(max(x, table[0, 0]), table[last, 0]) - table[k, 0]
    return table[k, 1] + low * d, low, table[k, 2] + high * d, high
