"""The robot at one posture, hung on its stance sole, and its derivatives by the legs' free variables."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.balance.legs import Legs, Stance, add_cross, base_pose, reduce_columns
from naoimitate.robot.kernel import (
    angular_jacobian,
    center_of_mass,
    composite_bodies,
    forward,
    joint_axes,
    point_jacobian,
)
from naoimitate.robot.model import Tree

Array = npt.NDArray[np.float64]


class Tangent(NamedTuple):
    """The robot at one q, hung on its stance sole, and its derivatives by the n free variables.

    pos, rot: link frames in the base frame. R, p: world from base. com, stance_at, other_at: (3,) m in the base frame.
    other_rot: (3, 3) world. Columns (3, n) in the base frame, of the stance sole: at, turn (its motion in the base);
    of the other sole: other, other_turn; of the CoM: com_raw; in the world, with the stance sole fixed: com_world,
    other_world, other_world_turn; of the base origin over the floor, in base axes: base.
    axes: (3, J) of all joints. bodies: (J + 1, 10), ``composite_bodies`` about the floor point ``about`` (3,) m in the
    base frame. all_joints: (3, J) scratch.
    """

    pos: Array
    rot: Array
    R: Array
    p: Array
    com: Array
    stance_at: Array
    other_at: Array
    other_rot: Array
    at: Array
    turn: Array
    other: Array
    other_turn: Array
    com_raw: Array
    base: Array
    com_world: Array
    other_world: Array
    other_world_turn: Array
    axes: Array
    bodies: Array
    about: Array
    all_joints: Array


@njit(cache=True)
def make_tangent(joints: int, n: int) -> Tangent:
    """Room for a robot of so many joints and n free variables."""
    room = np.zeros((9, 3, n))
    points = np.zeros((3, 3))
    return Tangent(
        np.empty((joints + 1, 3)),
        np.empty((joints + 1, 3, 3)),
        np.empty((3, 3)),
        np.empty(3),
        points[0],
        points[1],
        points[2],
        np.empty((3, 3)),
        room[0],
        room[1],
        room[2],
        room[3],
        room[4],
        room[5],
        room[6],
        room[7],
        room[8],
        np.empty((3, joints)),
        np.empty((joints + 1, 10)),
        np.empty(3),
        np.empty((3, joints)),
    )


@njit(cache=True)
def place(tree: Tree, legs: Legs, stance: Stance, q: Array, t: Tangent) -> None:
    """Fill the frames and points of t at q (J,) rad."""
    forward(tree, q, t.pos, t.rot)
    base_pose(tree, legs, stance, t.pos, t.rot, t.R, t.p)
    center_of_mass(tree, t.pos, t.rot, t.com)
    for foot, at in ((stance.side, t.stance_at), (1 - stance.side, t.other_at)):
        row = legs.sole_joint[foot] + 1
        at[:] = t.pos[row]
        add_turned(t.rot[row], legs.sole_point[foot], at)
    turn_columns(t.R, t.rot[legs.sole_joint[1 - stance.side] + 1], t.other_rot)


@njit(cache=True)
def differentiate(tree: Tree, legs: Legs, stance: Stance, floor: Array, t: Tangent) -> None:
    """Fill the columns of t at the frames that ``place`` has left; floor: (3,) m in the world, for ``about``."""
    s, o = legs.sole_joint[stance.side], legs.sole_joint[1 - stance.side]
    J = t.all_joints
    point_jacobian(tree, t.pos, t.rot, s, t.stance_at, J)
    reduce_columns(J, legs, t.at)
    angular_jacobian(tree, t.pos, t.rot, s, J)
    reduce_columns(J, legs, t.turn)
    point_jacobian(tree, t.pos, t.rot, o, t.other_at, J)
    reduce_columns(J, legs, t.other)
    angular_jacobian(tree, t.pos, t.rot, o, J)
    reduce_columns(J, legs, t.other_turn)
    t.about[:] = 0.0
    add_turned(t.R.T, floor - t.p, t.about)
    joint_axes(tree, t.rot, t.axes)
    composite_bodies(tree, t.pos, t.rot, t.about, t.bodies)
    for k in range(J.shape[1]):
        u = beyond(t, k)
        J[0, k], J[1, k], J[2, k] = cross(t.axes[0, k], t.axes[1, k], t.axes[2, k], u[0], u[1], u[2])
    reduce_columns(J, legs, t.com_raw)
    t.base[:] = 0.0
    over_floor(t, t.base, np.zeros(3))
    moved = t.com_raw.copy()
    over_floor(t, moved, t.com)
    turn_columns(t.R, moved, t.com_world)
    moved[:] = t.other
    over_floor(t, moved, t.other_at)
    turn_columns(t.R, moved, t.other_world)
    moved[:] = t.other_turn
    moved -= t.turn
    turn_columns(t.R, moved, t.other_world_turn)


@njit(cache=True)
def over_floor(t: Tangent, columns: Array, point: Array) -> None:
    """Columns (3, n) of a point (3,) m in the base, plus what the base itself moves while the stance sole stays."""
    columns -= t.at
    add_cross(point - t.stance_at, t.turn, columns)


@njit(cache=True)
def turn_columns(R: Array, columns: Array, out: Array) -> None:
    """out = R columns, (3, n)."""
    for i in range(columns.shape[1]):
        for a in range(3):
            out[a, i] = R[a, 0] * columns[0, i] + R[a, 1] * columns[1, i] + R[a, 2] * columns[2, i]


@njit(cache=True)
def add_turned(R: Array, v: Array, out: Array) -> None:
    """out += R v, (3,)."""
    for a in range(3):
        out[a] += R[a, 0] * v[0] + R[a, 1] * v[1] + R[a, 2] * v[2]


@njit(cache=True)
def cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    """a x b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@njit(cache=True)
def beyond(t: Tangent, k: int) -> tuple[float, float, float]:
    """First moment (3,) m about joint k of all that it moves, per total mass."""
    m, s = t.bodies[k + 1, 0], t.bodies[k + 1]
    return (
        s[1] - m * (t.pos[k + 1, 0] - t.about[0]),
        s[2] - m * (t.pos[k + 1, 1] - t.about[1]),
        s[3] - m * (t.pos[k + 1, 2] - t.about[2]),
    )
