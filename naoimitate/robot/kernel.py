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
def joint_axes(tree: Tree, rot: Array, out: Array) -> None:
    """Fill out (3, J): the unit axes of all joints."""
    for k in range(tree.parent.shape[0]):
        out[0, k], out[1, k], out[2, k] = _axis(tree, rot, k)


@njit(cache=True)
def composite_bodies(tree: Tree, pos: Array, rot: Array, about: Array, out: Array) -> None:
    """Fill out (J + 1, 10): mass and moments about a point (3,) m of all that joint j moves, row j + 1; row 0: all.

    Links count as point masses, with shares of the total mass: m, first moments s (3,) m, then xx, yy, zz, xy, xz, yz
    of the inertia sum m (|r|^2 E - r r^T), m^2.
    """
    total = tree.mass.sum()
    out[:] = 0.0
    for link in range(tree.parent.shape[0], -1, -1):
        x, y, z = (
            _along(tree, pos, rot, link, 0) - about[0],
            _along(tree, pos, rot, link, 1) - about[1],
            _along(tree, pos, rot, link, 2) - about[2],
        )
        m, row = tree.mass[link] / total, out[link]
        row[0] += m
        row[1] += m * x
        row[2] += m * y
        row[3] += m * z
        row[4] += m * (y * y + z * z)
        row[5] += m * (x * x + z * z)
        row[6] += m * (x * x + y * y)
        row[7] -= m * x * y
        row[8] -= m * x * z
        row[9] -= m * y * z
        if link > 0:
            above = out[tree.parent[link - 1] + 1]
            for i in range(10):
                above[i] += row[i]


@njit(cache=True)
def momentum_of(
    body: Array, wx: float, wy: float, wz: float, vx: float, vy: float, vz: float
) -> tuple[float, float, float]:
    """Angular momentum I w + s x v of a composite body that turns at w about the point, which moves along at v."""
    return (
        body[4] * wx + body[7] * wy + body[8] * wz + body[2] * vz - body[3] * vy,
        body[7] * wx + body[5] * wy + body[9] * wz + body[3] * vx - body[1] * vz,
        body[8] * wx + body[9] * wy + body[6] * wz + body[1] * vy - body[2] * vx,
    )


@njit(cache=True)
def moment_jacobian(axes: Array, pos: Array, bodies: Array, about: Array, out: Array) -> None:
    """Fill out (3, J) m^2: angular momentum about the point of ``composite_bodies``, per joint speed and total mass."""
    for k in range(axes.shape[1]):
        x, y, z = axes[0, k], axes[1, k], axes[2, k]
        dx, dy, dz = about[0] - pos[k + 1, 0], about[1] - pos[k + 1, 1], about[2] - pos[k + 1, 2]
        out[0, k], out[1, k], out[2, k] = momentum_of(
            bodies[k + 1], x, y, z, y * dz - z * dy, z * dx - x * dz, x * dy - y * dx
        )


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
