"""Constraints of the legs as linear rows ``C x >= b`` on a step x of the free variables.

Each function writes its rows from ``row`` on and returns the next free one. The last columns of C belong to the slacks
that soften the bounds of load, smoothness, sway and descent: what cannot brake in time passes them as little as it
must.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.balance.legs import DOWN, POSE, LegGoal, Legs, Stance, reduce_columns, table_bounds
from naoimitate.balance.retarget import Reach
from naoimitate.balance.sway import turned
from naoimitate.balance.tangent import Tangent, beyond, cross, over_floor, turn_columns
from naoimitate.robot.kernel import moment_jacobian, momentum_of
from naoimitate.robot.model import Tree

Array = npt.NDArray[np.float64]

LEVER_STEP = 0.0005
"""[m] of lever by which an overloaded joint must be relieved in a frame."""
LEVER_RATE = 8.0
"""[1/s] of what is left to its bound by which a lever may grow, so that the body arrives there slowly."""
TABLE_RATE = 8.0
"""[1/s] of what is left to a coupling table by which a joint may go on towards it: one that comes to its end at speed
stops the whole body."""
TABLE_RESERVE = 5e-4
"""[rad] kept from the coupling tables."""
SLACKS = 5
"""How many slacks there are..."""
LOAD, SMOOTH, TORSO, MOMENTUM, DESCENT = -5, -4, -3, -2, -1
"""...and their columns. The torso has its own: a jolt of a milliradian must not excuse centimetres of the ZMP."""
TURN_SCALE = 5.0
"""[rad/m] How the torso's turn and its way share their slack: a radian counts as a fifth of a metre."""


@njit(cache=True)
def sole_rows(
    legs: Legs, stance: Stance, t: Tangent, e_pos: Array, e_rot: Array, C: Array, b: Array
) -> tuple[int, int]:
    """Where the other sole is to be, errors (3,) m and (3,) rad in the world; (the next row, how many are equalities).

    The equalities come first.
    """
    if stance.kind == POSE:
        return pose_rows(t, e_pos, e_rot, C, b), 6
    if stance.kind == DOWN:
        return down_rows(t, e_pos, e_rot, C, b), 5
    return height_rows(legs, stance, t, C, b), 0


@njit(cache=True)
def pose_rows(t: Tangent, e_pos: Array, e_rot: Array, C: Array, b: Array) -> int:
    """The other sole turns and goes exactly where it is asked to, its height last."""
    n = t.at.shape[1]
    for a in range(3):
        C[a, :n], C[a + 3, :n] = t.other_world_turn[a], t.other_world[a]
        b[a], b[a + 3] = e_rot[a], e_pos[a]
    return 6


@njit(cache=True)
def down_rows(t: Tangent, e_pos: Array, e_rot: Array, C: Array, b: Array) -> int:
    """The same, but the sole may stay higher, for a price."""
    row = pose_rows(t, e_pos, e_rot, C, b)
    C[row], b[row] = -C[row - 1], -b[row - 1]
    C[row, DESCENT], C[row + 1, DESCENT], b[row + 1] = 1.0, 1.0, 0.0
    return row + 2


@njit(cache=True)
def height_rows(legs: Legs, stance: Stance, t: Tangent, C: Array, b: Array) -> int:
    """No outline point of the other sole below ``min_height``."""
    o, row = 1 - stance.side, 0
    height = t.p[2] + t.R[2, 0] * t.other_at[0] + t.R[2, 1] * t.other_at[1] + t.R[2, 2] * t.other_at[2]
    for k in range(legs.outline.shape[1]):
        x, y = legs.outline[o, k, 0], legs.outline[o, k, 1]
        arm_x, arm_y, arm_z = (
            t.other_rot[0, 0] * x + t.other_rot[0, 1] * y,
            t.other_rot[1, 0] * x + t.other_rot[1, 1] * y,
            t.other_rot[2, 0] * x + t.other_rot[2, 1] * y,
        )
        for i in range(t.at.shape[1]):
            C[row, i] = t.other_world[2, i] + arm_y * t.other_world_turn[0, i] - arm_x * t.other_world_turn[1, i]
        b[row] = stance.min_height - height - arm_z
        row += 1
    return row


@njit(cache=True)
def com_rows(t: Tangent, along: Array, e_com: Array, slack: Array, C: Array, b: Array, row: int) -> int:
    """The CoM's horizontal error (2,) m stays within slack (2,) m along a line (2,) and across it."""
    for k in range(2):
        x, y = (along[0], along[1]) if k == 0 else (-along[1], along[0])
        for i in range(t.com_world.shape[1]):
            C[row, i] = x * t.com_world[0, i] + y * t.com_world[1, i]
        error = x * e_com[0] + y * e_com[1]
        row = _both_ways(C, b, row, error - slack[k], error + slack[k])
    return row


@njit(cache=True)
def load_rows(
    tree: Tree, legs: Legs, goal: LegGoal, t: Tangent, dt: float, most: Array, C: Array, b: Array, row: int
) -> tuple[int, float]:
    """What a hip or knee gives to hold the body up stays within what it can give.

    The torque over g M of a joint with axis a at p is ``a . (L x up)`` with ``L = w (c - p) - s``: the robot's weight,
    of which this leg carries the share w, minus the first moment s about p of the leg's own mass beyond the joint.
    most: (2, M) m, the bounds of this frame of dt s; filled in where still zero. Returns the next free row, and the
    largest torque as a share of its bound.
    """
    ux, uy, uz = t.R[2]
    load = 0.0
    for leg in range(2):
        com = t.com + t.R.T @ goal.carried[leg]
        for k in range(legs.loaded.shape[1]):
            j = legs.loaded[leg, k]
            ax, ay, az = t.axes[0, j], t.axes[1, j], t.axes[2, j]
            lx, ly, lz = _carried(t, j, goal.share[leg], com)
            cx, cy, cz = cross(lx, ly, lz, ux, uy, uz)
            lever = ax * cx + ay * cy + az * cz
            load = max(load, abs(lever) / legs.holds[leg, k])
            if most[leg, k] == 0.0:
                left = legs.holds[leg, k] * goal.overload - abs(lever)
                most[leg, k] = abs(lever) + max(left * min(1.0, LEVER_RATE * dt) if left > 0.0 else left, -LEVER_STEP)
            _load_row(tree, legs, goal.share[leg], t, j, com, C[row])
            cx, cy, cz = cross(ax, ay, az, lx, ly, lz)
            cx, cy, cz = cross(ux, uy, uz, cx, cy, cz)
            for i in range(t.turn.shape[1]):
                C[row, i] += cx * t.turn[0, i] + cy * t.turn[1, i] + cz * t.turn[2, i]
            row = _both_ways(C, b, row, -most[leg, k] - lever, most[leg, k] - lever)
            C[row - 2, LOAD], C[row - 1, LOAD] = 1.0, 1.0
    C[row, LOAD], b[row] = 1.0, 0.0
    return row + 1, load


@njit(cache=True)
def _carried(t: Tangent, j: int, share: float, com: Array) -> tuple[float, float, float]:
    """L (3,) m of ``load_rows`` for joint j, with the CoM at (3,) m."""
    own, p = beyond(t, j), t.pos[j + 1]
    return share * (com[0] - p[0]) - own[0], share * (com[1] - p[1]) - own[1], share * (com[2] - p[2]) - own[2]


@njit(cache=True)
def _load_row(tree: Tree, legs: Legs, share: float, t: Tangent, j: int, com: Array, out: Array) -> None:
    """Derivative of ``a . (L x up)`` for joint j by the free variables while the base stays, into out."""
    ux, uy, uz = t.R[2]
    ax, ay, az = t.axes[0, j], t.axes[1, j], t.axes[2, j]
    sx, sy, sz = cross(ux, uy, uz, ax, ay, az)
    own, L = beyond(t, j), _carried(t, j, share, com)
    fx, fy, fz = cross(L[0], L[1], L[2], ux, uy, uz)
    hx, hy, hz = cross(ax, ay, az, fx, fy, fz)
    for i in range(legs.variable.shape[0]):
        v = legs.variable[i]
        if v < 0:
            continue
        u = beyond(t, i)
        dx, dy, dz = share * u[0], share * u[1], share * u[2]
        turn_x, turn_y, turn_z = 0.0, 0.0, 0.0
        if tree.ancestor[i, j]:
            dx, dy, dz = dx - u[0], dy - u[1], dz - u[2]
        elif tree.ancestor[j, i]:
            dx -= share * (t.pos[j + 1, 0] - t.pos[i + 1, 0]) + own[0]
            dy -= share * (t.pos[j + 1, 1] - t.pos[i + 1, 1]) + own[1]
            dz -= share * (t.pos[j + 1, 2] - t.pos[i + 1, 2]) + own[2]
            turn_x, turn_y, turn_z = hx, hy, hz
        cx, cy, cz = cross(dx, dy, dz, sx, sy, sz)
        out[v] += t.axes[0, i] * (cx + turn_x) + t.axes[1, i] * (cy + turn_y) + t.axes[2, i] * (cz + turn_z)


@njit(cache=True)
def sway_rows(legs: Legs, goal: LegGoal, t: Tangent, moved: Array, C: Array, b: Array, row: int) -> int:
    """Bounds on the body's momentum and on the torso's way and turn, (8,) as in ``LegGoal``.

    moved: (n,) rad, what the step has done so far.
    """
    n = t.turn.shape[1]
    way = np.empty((8, n))
    _momentum_columns(legs, t, way[:3])
    for i in range(n):
        way[0, i], way[1, i] = turned(goal.along, way[0, i], way[1, i])
    way[2:5] = t.base
    way[5:] = -t.turn
    for a in range(8):
        done = 0.0
        for i in range(n):
            done += way[a, i] * moved[i]
            C[row, i] = way[a, i]
        row = _both_ways(C, b, row, goal.sway_low[a] - done, goal.sway_high[a] - done)
        column = MOMENTUM if a < 2 else TORSO
        scale = TURN_SCALE if a >= 5 else 1.0
        C[row - 2, column], C[row - 1, column] = scale, scale
    C[row, TORSO], b[row] = 1.0, 0.0
    C[row + 1, MOMENTUM], b[row + 1] = 1.0, 0.0
    return row + 2


@njit(cache=True)
def _momentum_columns(legs: Legs, t: Tangent, out: Array) -> None:
    """Angular momentum per mass about the floor point of t, in the world, (3, n) m^2."""
    n = t.turn.shape[1]
    moment_jacobian(t.axes, t.pos, t.bodies, t.about, t.all_joints)
    K, way = np.zeros((3, n)), np.zeros((3, n))
    reduce_columns(t.all_joints, legs, K)
    over_floor(t, way, t.about)
    for i in range(n):
        kx, ky, kz = momentum_of(
            t.bodies[0], -t.turn[0, i], -t.turn[1, i], -t.turn[2, i], way[0, i], way[1, i], way[2, i]
        )
        K[0, i], K[1, i], K[2, i] = K[0, i] + kx, K[1, i] + ky, K[2, i] + kz
    turn_columns(t.R, K, out)


@njit(cache=True)
def joint_rows(legs: Legs, q: Array, start: Array, reach: Reach, C: Array, b: Array, row: int) -> int:
    """Joint limits, and the angles that this frame allows.

    start: (n,) rad, where the step began: a joint outside its limits comes back as fast as it may.
    """
    for i in range(legs.joints.shape[0]):
        j = legs.joints[i]
        C[row, i], b[row] = 1.0, max(reach.low[j], min(legs.lower[j], start[i])) - q[j]
        C[row + 1, i], b[row + 1] = -1.0, q[j] - min(reach.high[j], max(legs.upper[j], start[i]))
        row += 2
        if reach.smooth_low[j] > reach.low[j] or reach.smooth_high[j] < reach.high[j]:
            C[row, i], C[row, SMOOTH], b[row] = 1.0, 1.0, reach.smooth_low[j] - q[j]
            C[row + 1, i], C[row + 1, SMOOTH], b[row + 1] = -1.0, 1.0, q[j] - reach.smooth_high[j]
            row += 2
    C[row, SMOOTH], b[row] = 1.0, 0.0
    return row + 1


@njit(cache=True)
def table_rows(legs: Legs, q: Array, dt: float, C: Array, b: Array, row: int) -> int:
    """Coupling tables at the present angle: y_min(x) <= y <= y_max(x), approached slowly wherever the feet allow it."""
    slow = min(1.0, TABLE_RATE * dt)
    for t in range(legs.table_x.shape[0]):
        jx, jy = legs.table_x[t], legs.table_y[t]
        low, low_slope, high, high_slope = table_bounds(legs.table_rows[t], q[jx])
        vx, vy = legs.variable[jx], legs.variable[jy]
        C[row, vy], C[row, vx], b[row] = 1.0, -low_slope, low + TABLE_RESERVE - q[jy]
        C[row + 1, vy], C[row + 1, vx], b[row + 1] = -1.0, high_slope, q[jy] - high + TABLE_RESERVE
        for k in range(2):
            C[row + 2 + k, vy], C[row + 2 + k, vx] = C[row + k, vy], C[row + k, vx]
            C[row + 2 + k, SMOOTH], b[row + 2 + k] = 1.0, slow * min(b[row + k], 0.0)
        row += 4
    return row


@njit(cache=True)
def extra_rows(rows: Array, bounds: Array, moved: Array, C: Array, b: Array, row: int) -> int:
    """Given rows (K, n) with bounds (K,) on the whole step, of which ``moved`` (n,) is done."""
    n = rows.shape[1]
    for k in range(rows.shape[0]):
        b[row] = bounds[k]
        for i in range(n):
            C[row, i] = rows[k, i]
            b[row] -= rows[k, i] * moved[i]
        row += 1
    return row


@njit(cache=True)
def _both_ways(C: Array, b: Array, row: int, low: float, high: float) -> int:
    """low <= C[row] x <= high as two rows."""
    C[row + 1], b[row], b[row + 1] = -C[row], low, -high
    return row + 2


@njit(cache=True)
def count_rows(legs: Legs, extra: int) -> int:
    """Rows that all these functions write at most."""
    other = max(8, legs.outline.shape[1])
    return other + 4 + 2 * legs.loaded.size + 1 + 18 + 4 * legs.joints.shape[0] + 1 + 4 * legs.table_x.shape[0] + extra
