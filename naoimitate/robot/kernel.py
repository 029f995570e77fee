"""Compiled kinematics on the flat arrays of ``Tree``: link frames, centre of mass, Jacobians.

Everything is in the frame of the base link; J joints; ``pos`` (J + 1, 3) m and ``rot`` (J + 1, 3, 3) are what
``forward`` fills: row 0 the base, row j + 1 the link behind joint j. Outputs are written into the caller's arrays.
"""

from __future__ import annotations

import math

from numba import njit

from naoimitate.robot.model import Array, Tree


@njit(cache=True)
def forward(tree: Tree, q: Array, pos: Array, rot: Array) -> None:
    """Fill the link frames at joint angles q (J,) rad: p_j = p_i + R_i t_j, R_j = R_i F_j exp(q_j [a_j]x)."""
    for a in range(3):
        pos[0, a] = 0.0
        for b in range(3):
            rot[0, a, b] = 1.0 if a == b else 0.0
    for j in range(q.shape[0]):
        _place(tree, j, q[j], pos, rot)


@njit(cache=True)
def _place(tree: Tree, j: int, angle: float, pos: Array, rot: Array) -> None:
    """Frame of link j from its parent's, with Rodrigues' formula for the joint's own rotation."""
    i = tree.parent[j] + 1
    x, y, z = tree.axis[j, 0], tree.axis[j, 1], tree.axis[j, 2]
    s, c = math.sin(angle), math.cos(angle)
    v = 1.0 - c
    for a in range(3):
        r0, r1, r2 = rot[i, a, 0], rot[i, a, 1], rot[i, a, 2]
        pos[j + 1, a] = pos[i, a] + r0 * tree.pos[j, 0] + r1 * tree.pos[j, 1] + r2 * tree.pos[j, 2]
        f0 = r0 * tree.rot[j, 0, 0] + r1 * tree.rot[j, 1, 0] + r2 * tree.rot[j, 2, 0]
        f1 = r0 * tree.rot[j, 0, 1] + r1 * tree.rot[j, 1, 1] + r2 * tree.rot[j, 2, 1]
        f2 = r0 * tree.rot[j, 0, 2] + r1 * tree.rot[j, 1, 2] + r2 * tree.rot[j, 2, 2]
        rot[j + 1, a, 0] = f0 * (c + x * x * v) + f1 * (y * x * v + z * s) + f2 * (z * x * v - y * s)
        rot[j + 1, a, 1] = f0 * (x * y * v - z * s) + f1 * (c + y * y * v) + f2 * (z * y * v + x * s)
        rot[j + 1, a, 2] = f0 * (x * z * v + y * s) + f1 * (y * z * v - x * s) + f2 * (c + z * z * v)


@njit(cache=True)
def center_of_mass(tree: Tree, pos: Array, rot: Array, out: Array) -> None:
    """Fill out (3,) m: sum of m_l (p_l + R_l c_l) over all links l, divided by the total mass."""
    total = 0.0
    out[:] = 0.0
    for link in range(tree.mass.shape[0]):
        m = tree.mass[link]
        total += m
        for a in range(3):
            out[a] += m * _along(tree, pos, rot, link, a)
    for a in range(3):
        out[a] /= total


@njit(cache=True)
def com_jacobian(tree: Tree, pos: Array, rot: Array, out: Array) -> None:
    """Fill out (3, J) m/rad: column k = a_k x (sum over the links l that joint k moves of m_l (c_l - p_k)) / M."""
    total = tree.mass.sum()
    for k in range(tree.parent.shape[0]):
        mx, my, mz = 0.0, 0.0, 0.0
        for j in range(k, tree.parent.shape[0]):
            if tree.ancestor[j, k]:
                m = tree.mass[j + 1] / total
                mx += m * (_along(tree, pos, rot, j + 1, 0) - pos[k + 1, 0])
                my += m * (_along(tree, pos, rot, j + 1, 1) - pos[k + 1, 1])
                mz += m * (_along(tree, pos, rot, j + 1, 2) - pos[k + 1, 2])
        x, y, z = _axis(tree, rot, k)
        out[0, k] = y * mz - z * my
        out[1, k] = z * mx - x * mz
        out[2, k] = x * my - y * mx


@njit(cache=True)
def point_jacobian(tree: Tree, pos: Array, rot: Array, joint: int, point: Array, out: Array) -> None:
    """Fill out (3, J) m/rad: linear velocity of a point fixed to the link of ``joint`` (-1 = base: zeros).

    point: (3,) m in the base frame. Column k = a_k x (point - p_k) for the joints k that move the link.
    """
    for k in range(tree.parent.shape[0]):
        if joint < 0 or not tree.ancestor[joint, k]:
            out[0, k] = 0.0
            out[1, k] = 0.0
            out[2, k] = 0.0
        else:
            x, y, z = _axis(tree, rot, k)
            dx, dy, dz = point[0] - pos[k + 1, 0], point[1] - pos[k + 1, 1], point[2] - pos[k + 1, 2]
            out[0, k] = y * dz - z * dy
            out[1, k] = z * dx - x * dz
            out[2, k] = x * dy - y * dx


@njit(cache=True)
def angular_jacobian(tree: Tree, pos: Array, rot: Array, joint: int, out: Array) -> None:
    """Fill out (3, J): angular velocity of the link of ``joint`` (-1 = base: zeros); column k = a_k."""
    for k in range(tree.parent.shape[0]):
        x, y, z = 0.0, 0.0, 0.0
        if joint >= 0 and tree.ancestor[joint, k]:
            x, y, z = _axis(tree, rot, k)
        out[0, k] = x
        out[1, k] = y
        out[2, k] = z


@njit(cache=True)
def _axis(tree: Tree, rot: Array, k: int) -> tuple[float, float, float]:
    """Axis of joint k in the base frame; it is the same vector in the frames before and behind the joint."""
    x, y, z = tree.axis[k, 0], tree.axis[k, 1], tree.axis[k, 2]
    return (
        rot[k + 1, 0, 0] * x + rot[k + 1, 0, 1] * y + rot[k + 1, 0, 2] * z,
        rot[k + 1, 1, 0] * x + rot[k + 1, 1, 1] * y + rot[k + 1, 1, 2] * z,
        rot[k + 1, 2, 0] * x + rot[k + 1, 2, 1] * y + rot[k + 1, 2, 2] * z,
    )


@njit(cache=True)
def _along(tree: Tree, pos: Array, rot: Array, link: int, a: int) -> float:
    """Coordinate a of the centre of mass of a link (row of pos) in the base frame, m."""
    c = tree.com[link]
    value: float = pos[link, a] + rot[link, a, 0] * c[0] + rot[link, a, 1] * c[1] + rot[link, a, 2] * c[2]
    return value
