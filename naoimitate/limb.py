"""One limb to its target in the torso frame (Koenemann 2014, section IV-B): the paper's iterations, and ours.

Both are damped least squares with Chang and Dubey's weights against joint limits. The paper's: fixed damping, a fixed
number of iterations, limits by clipping. Ours: damping that follows the error, speed, range and distance bounds inside
the step, an early stop, and optional rows for the elbow (weak) and the hand's orientation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.core.geometry import rotation_vector
from naoimitate.ik import SOLVED, bounded_step, damped_step, limit_avoiding_weights
from naoimitate.robot.kernel import angular_jacobian, forward, point_jacobian
from naoimitate.robot.model import RobotModel, Tree

Array = npt.NDArray[np.float64]


class Limb(NamedTuple):
    """Flat description of an arm or a leg.

    joints: (n,) int64, base outwards. lower, upper: (n,) rad. tip_joint, tip: link and (3,) m of the end effector.
    bend_joint, bend: the same for the elbow or knee. root: (3,) m, shoulder or hip in the base frame.
    upper_length: m, root to bend. rest: (n,) rad.
    """

    joints: npt.NDArray[np.int64]
    lower: Array
    upper: Array
    tip_joint: int
    tip: Array
    bend_joint: int
    bend: Array
    root: Array
    upper_length: float
    rest: Array


class LimbWeights(NamedTuple):
    """Settings of ``solve_limb``; weights multiply errors in m (or m/rad)."""

    tip: float = 1.0
    """Of the hand; 0 while the arm changes its branch in joint space."""
    bend: float = 0.3
    """Of the elbow's place on the human's upper-arm direction."""
    orientation: float = 0.1
    """[m/rad] of the tip's orientation, where one is asked for."""
    rest: float = 0.01
    """[m/rad] towards the rest posture: without it a joint at a singularity runs to its stop for a millimetre."""
    null_damping: float = 0.001
    """[m/rad] below which a direction counts as one that the tip leaves free: elbow, orientation and rest act there."""
    damping: float = 0.004
    """[m/rad]. Its square grows by error times upper arm: as much as a stretched limb's way curves, or it would swing
    about in front of a target that it cannot reach (the error's square alone, Sugihara 2011, is too little)."""
    tolerance: float = 1e-5
    """[m] of the tip's error below which the iteration stops."""
    iterations: float = 6.0


def build_limb(robot: RobotModel, name: str, reserve: float) -> Limb:
    """Flatten a limb (``l_arm``, ``r_leg``...) with ``reserve`` rad kept from its limits."""
    side, kind = name.split("_")
    root, bend, tip = ("shoulder", "elbow", "hand") if kind == "arm" else ("hip", "knee", "sole")
    joints = np.array(robot.chains[name], dtype=np.int64)
    n = len(robot.joint_names)
    pos, rot = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    forward(robot.tree, np.zeros(n), pos, rot)
    points = [robot.points[f"{side}_{part}"] for part in (root, bend, tip)]
    places = [pos[p.joint + 1] + rot[p.joint + 1] @ p.offset for p in points]
    return Limb(
        joints,
        robot.lower[joints] + reserve,
        robot.upper[joints] - reserve,
        points[2].joint,
        np.ascontiguousarray(points[2].offset),
        points[1].joint,
        np.ascontiguousarray(points[1].offset),
        places[0],
        float(np.linalg.norm(places[1] - places[0])),
        robot.postures["stand"][joints].copy(),
    )


@njit(cache=True)
def solve_limb_fixed(tree: Tree, limb: Limb, target: Array, q: Array, damping: float, iterations: int) -> float:
    """The paper's iteration: ``iterations`` damped steps with constant damping, clipped to the joint limits.

    target: (3,) m, tip minus root in the base frame. q: (J,) rad, written. Returns the remaining error, m.
    """
    n = limb.joints.shape[0]
    pos, rot = np.empty((q.shape[0] + 1, 3)), np.empty((q.shape[0] + 1, 3, 3))
    J, Jn = np.empty((3, q.shape[0])), np.empty((3, n))
    angles, weights, step = np.empty(n), np.empty(n), np.zeros(n)
    for _ in range(iterations):
        forward(tree, q, pos, rot)
        row = limb.tip_joint + 1
        tip = pos[row] + rot[row] @ limb.tip
        point_jacobian(tree, pos, rot, limb.tip_joint, tip, J)
        for i in range(n):
            Jn[:, i] = J[:, limb.joints[i]]
            angles[i] = q[limb.joints[i]]
        limit_avoiding_weights(angles, step, limb.lower, limb.upper, weights)
        step[:] = damped_step(Jn, limb.root + target - tip, weights, damping)
        for i in range(n):
            q[limb.joints[i]] = min(max(angles[i] + step[i], limb.lower[i]), limb.upper[i])
    forward(tree, q, pos, rot)
    row = limb.tip_joint + 1
    return float(np.linalg.norm(limb.root + target - pos[row] - rot[row] @ limb.tip))


@njit(cache=True)
def solve_limb(
    tree: Tree,
    limb: Limb,
    settings: LimbWeights,
    target: Array,
    bend: Array,
    tip_rotation: Array,
    orientation_rows: int,
    q: Array,
    q_low: Array,
    q_high: Array,
    rows: Array,
    bounds: Array,
) -> tuple[int, float, float]:
    """Move one limb of q (J,) rad towards its target, never past a bound.

    target: (3,) m, tip minus root in the base frame. bend: (3,) unit vector root to elbow, zero for none.
    tip_rotation: (3, 3) base from tip; orientation_rows: 0 free, 2 only its z axis (upright), 3 all.
    q_low, q_high: (J,) rad of this frame. rows (C, n), bounds (C,): ``rows (x - x0) >= bounds`` (collisions).
    Returns (iterations, tip error in m, misfit in m: root of the whole weighted cost), the latter two before the last
    step. Where no step is feasible q is unchanged.
    """
    n, count = limb.joints.shape[0], q.shape[0]
    pos, rot = np.empty((count + 1, 3)), np.empty((count + 1, 3, 3))
    J = np.empty((3, count))
    angles, weights, x, moved = np.empty(n), np.ones(n), np.zeros(n), np.zeros(n)
    C, b = np.zeros((2 * n + rows.shape[0], n)), np.empty(2 * n + rows.shape[0])
    wanted_bend = limb.root + limb.upper_length * bend
    bend_weight = settings.bend * np.sqrt(bend[0] ** 2 + bend[1] ** 2 + bend[2] ** 2)
    length, misfit, done = 0.0, 0.0, 0
    limit = int(settings.iterations)
    for iteration in range(limit + 1):
        forward(tree, q, pos, rot)
        row = limb.tip_joint + 1
        tip = pos[row] + rot[row] @ limb.tip
        error = limb.root + target - tip
        length = float(np.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2))
        elbow = pos[limb.bend_joint + 1] + rot[limb.bend_joint + 1] @ limb.bend
        misfit = (settings.tip * length) ** 2 + bend_weight**2 * np.sum((wanted_bend - elbow) ** 2)
        for i in range(n):
            misfit += (settings.rest * (q[limb.joints[i]] - limb.rest[i])) ** 2
        if iteration == limit or (iteration > 0 and np.abs(x).max() < 1e-5):
            break
        H, g = np.zeros((n, n)), np.zeros(n)
        for i in range(n):
            H[i, i] = settings.rest**2
            g[i] = settings.rest**2 * (limb.rest[i] - q[limb.joints[i]])
        if bend_weight > 0.0:
            point_jacobian(tree, pos, rot, limb.bend_joint, elbow, J)
            _add_rows(J, wanted_bend - elbow, bend_weight, limb.joints, H, g)
        if orientation_rows > 0:
            angular_jacobian(tree, pos, rot, limb.tip_joint, J)
            turn = rotation_vector(tip_rotation @ np.ascontiguousarray(rot[row].T))
            if orientation_rows == 2:
                turn = np.cross(rot[row][:, 2], tip_rotation[:, 2])
            _add_rows(J, turn, settings.orientation, limb.joints, H, g)
        point_jacobian(tree, pos, rot, limb.tip_joint, tip, J)
        if settings.tip > 0.0:
            _project(J, limb.joints, settings.null_damping, H, g)
        _add_rows(J, error, settings.tip, limb.joints, H, g)
        for i in range(n):
            angles[i] = q[limb.joints[i]]
        limit_avoiding_weights(angles, x, limb.lower, limb.upper, weights)
        damping = settings.damping**2 + 0.5 * limb.upper_length * length
        for i in range(n):
            j = limb.joints[i]
            H[i, i] += damping * min(weights[i], 10.0)
            middle = 0.5 * (q_low[j] + q_high[j])
            C[2 * i, i], b[2 * i] = 1.0, max(q_low[j], min(limb.lower[i], middle)) - angles[i]
            C[2 * i + 1, i], b[2 * i + 1] = -1.0, angles[i] - min(q_high[j], max(limb.upper[i], middle))
        for k in range(rows.shape[0]):
            C[2 * n + k] = rows[k]
            b[2 * n + k] = bounds[k] - np.dot(rows[k], moved)
        if bounded_step(H, g, C, b, 0, x) != SOLVED:
            break
        done += 1
        moved += x
        for i in range(n):
            q[limb.joints[i]] = angles[i] + x[i]
        if length < settings.tolerance:
            break
    return done, length, np.sqrt(misfit)


@njit(cache=True)
def _project(J: Array, joints: Array, damping: float, H: Array, g: Array) -> None:
    """Confine a secondary task to what the tip leaves free: H, g -> N H N, N g with N = E - J^+ J, J^+ damped."""
    n = joints.shape[0]
    Jn = np.empty((3, n))
    for i in range(n):
        Jn[:, i] = J[:, joints[i]]
    A = Jn @ Jn.T
    for a in range(3):
        A[a, a] += damping**2
    N = np.eye(n) - Jn.T @ np.linalg.solve(A, Jn)
    H[:] = N @ H @ N
    g[:] = N @ g


@njit(cache=True)
def _add_rows(J: Array, error: Array, weight: float, joints: Array, H: Array, g: Array) -> None:
    w = weight * weight
    for i in range(joints.shape[0]):
        for r in range(3):
            a = w * J[r, joints[i]]
            g[i] += a * error[r]
            for k in range(joints.shape[0]):
                H[i, k] += a * J[r, joints[k]]
