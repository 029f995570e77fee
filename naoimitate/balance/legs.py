"""Both legs as one problem: what they are, and what is asked of them (``leg_solver`` solves it)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.core.geometry import polygon_centroid
from naoimitate.core.physics import GRAVITY
from naoimitate.robot.kernel import forward
from naoimitate.robot.model import RobotModel, Tree

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


POSE = 0
"""The other sole follows a given pose exactly: planted, lifting, landing."""
FREE = 1
"""The other sole swings: its place in the torso frame and its level are tasks, its height a bound."""
REACH = 2
"""The other sole makes for a pose in the world, around whatever is in its way; its height is a bound."""
DOWN = 3
"""The other sole comes down: it follows a given pose exactly, but stays higher where the body cannot follow."""


class Legs(NamedTuple):
    """Flat description of both legs for the compiled solver.

    variable: (J,) int64, index of the free variable that moves the joint, -1 if none (a coupled follower shares its
    leader's). joints: (n,) the leader of each variable. sole_joint: (2,), sole_point: (2, 3) in that link.
    hip: (2, 3) m in the base frame. outline: (2, K, 2) m, the soles' outlines, padded by repetition. centre: (2, 2) m.
    lower, upper: (J,) rad, with the knees kept off the stretched singularity. table_x, table_y: (B,) joints;
    table_rows: (B, R, 3), padded by repetition. rest: (J,) rad, the posture that decides what nothing else does.
    loaded: (2, M) joints of each leg that hold the body up; holds: (2, M) m, the torque that they may give to it, as
    lever of the robot's weight.
    """

    variable: Ints
    joints: Ints
    sole_joint: Ints
    sole_point: Array
    hip: Array
    outline: Array
    centre: Array
    lower: Array
    upper: Array
    table_x: Ints
    table_y: Ints
    table_rows: Array
    rest: Array
    loaded: Ints
    holds: Array


class LegWeights(NamedTuple):
    """Settings of the leg solver; weights multiply errors in m (or m/rad where said)."""

    com: float = 30.0
    """Of the CoM's horizontal error: it outweighs the feet, so that balance is never traded for similarity."""
    foot: float = 1.0
    """Of the feet in the torso frame."""
    com_slack: float = 0.010
    """[m] of CoM error along the line between the feet that nothing may exceed (or increase, where it is larger)..."""
    com_slack_across: float = 0.025
    """[m] ...and across it, where soles are long: what stops there at speed throws the zero moment point."""
    overload: float = 10.0
    """Price of m of lever by which a joint holds more than it should."""
    jerk: float = 1.0
    """Price of rad by which a joint's step is not smooth."""
    torso: float = 300.0
    """Price of m of the torso's step beyond the bounds of sway, and..."""
    momentum: float = 3000.0
    """...of m^2 of momentum: so high that only a body that cannot brake in time pays."""
    descent: float = 2.0
    """Price of m by which a foot that comes down stays higher than asked."""
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
    torque_share: float = 0.75
    """Share of a joint's effort that holding the body up may take: a deep bend on one foot is more than it gives."""
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
    for side in "lr":
        knee = robot.points[f"{side}_knee"].joint
        if upper[knee] >= -lower[knee]:
            lower[knee] = max(lower[knee], limits.knee_min)
        else:
            upper[knee] = min(upper[knee], -limits.knee_min)
    tables = [t for t in robot.tables if variable[t.y] >= 0]
    rows = max((len(t.rows) for t in tables), default=1)
    loaded = np.array([_loaded(robot, side) for side in "lr"], dtype=np.int64)
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
        loaded,
        limits.torque_share * robot.effort[loaded] / (robot.tree.mass.sum() * GRAVITY),
    )


def hip_positions(robot: RobotModel) -> Array:
    """Hip points (2, 3) m, left and right, in the base frame at the zero posture."""
    n = len(robot.joint_names)
    pos, rot = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    forward(robot.tree, np.zeros(n), pos, rot)
    points = [robot.points[f"{s}_hip"] for s in "lr"]
    return np.array([pos[p.joint + 1] + rot[p.joint + 1] @ p.offset for p in points])


def _loaded(robot: RobotModel, side: str) -> list[int]:
    """Joints from hip to knee with a motor of their own: ankles only feel how far the CoM is from the sole's middle."""
    chain, shared = robot.chains[f"{side}_leg"], {j for pair in robot.coupled for j in pair}
    return [j for j in chain[: chain.index(robot.points[f"{side}_knee"].joint) + 1] if j not in shared]


def _pad(rows: Array, count: int) -> Array:
    return np.concatenate([rows, np.repeat(rows[-1:], count - len(rows), axis=0)])


class Stance(NamedTuple):
    """Where the soles are asked to be, in the world.

    side: 0 or 1, the foot on which the base hangs. pos: (2, 3) m, rot: (2, 3, 3): stance sole as it is, other sole as
    asked. kind: ``POSE``, ``FREE``, ``REACH`` or ``DOWN``. min_height: m, below which no outline point of a free sole
    may come.
    """

    side: int
    pos: Array
    rot: Array
    kind: int
    min_height: float


class LegGoal(NamedTuple):
    """What is asked of the legs in one frame.

    feet: (2, 3) m, hip to sole in the torso frame, (5). com: (2,) m, world. foot_weight: (2,). share: (2,) of the
    weight that each leg carries, or will soon; carried: (2, 3) m, world, how far the CoM will have gone by then.
    overload: factor on what the loaded joints may hold. about: (3,) m, along: (2,), world; sway_low,
    sway_high: (8,), soft bounds of ``Sway`` on what the legs add: the angular momentum about that point, ``turned`` to
    that line, m^2; the torso's way along its own axes, m; its turn about them, rad.
    """

    feet: Array
    com: Array
    foot_weight: Array
    share: Array
    carried: Array
    overload: float
    about: Array
    along: Array
    sway_low: Array
    sway_high: Array


def free_goal(feet: Array, com: Array, foot_weight: Array, share: Array) -> LegGoal:
    """A goal whose body may move as it likes."""
    free = np.full(8, np.inf)
    return LegGoal(feet, com, foot_weight, share, np.zeros((2, 3)), 1.0, np.zeros(3), np.array([0.0, 1.0]), -free, free)


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


@njit(cache=True)
def base_pose(tree: Tree, legs: Legs, stance: Stance, pos: Array, rot: Array, R_wb: Array, p_wb: Array) -> None:
    """World pose of the base from the stance sole; pos, rot from ``forward``. Writes R_wb (3, 3) and p_wb (3,)."""
    s = stance.side
    row, point = legs.sole_joint[s] + 1, legs.sole_point[s]
    for a in range(3):
        for b in range(3):
            R_wb[a, b] = 0.0
            for c in range(3):
                R_wb[a, b] += stance.rot[s, a, c] * rot[row, b, c]
    for a in range(3):
        p_wb[a] = stance.pos[s, a]
        for b in range(3):
            sole = pos[row, b]
            for c in range(3):
                sole += rot[row, b, c] * point[c]
            p_wb[a] -= R_wb[a, b] * sole


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
