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


RETURN = 0.6
"""Share of a frame's room that is taken from a joint outside its range: it comes back, and bounds never contradict."""
CAUTION = 100.0
"""By which the second priority is damped, per error and upper length: a target out of reach is nearest in one posture,
though the Jacobian does not see the way out of it; what leaves it comes back in the next step."""
SEEN = 1e-6
"""Share of a row of the Jacobian that must be new for it to count as independent of the others."""


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
    """Settings of ``solve_limb``: of its second priority the weights, which multiply errors in m (or m/rad)."""

    bend: float = 0.3
    """Of the elbow's place on the human's upper-arm direction."""
    orientation: float = 0.1
    """[m/rad] of the tip's orientation, where one is asked for."""
    rest: float = 0.01
    """[m/rad] towards the rest posture, where the elbow does not matter."""
    damping: float = 0.02
    """[m/rad]. Its square grows by error times upper arm: as much as a stretched limb's way curves, or it would swing
    about in front of a target that it cannot reach (the error's square alone, Sugihara 2011, is too little)."""
    rest_damping: float = 0.004
    """[m/rad] of the second priority, where the target is reached."""
    tolerance: float = 1e-5
    """[m] of the tip's error below which the iteration stops."""
    still: float = 1e-5
    """[rad] below which a step ends the iteration."""
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
) -> tuple[int, float]:
    """Move one limb of q (J,) rad towards its target, never past a bound.

    Two priorities, both with every bound inside: the tip's damped least squares step; then, among the steps that move
    the tip by the same amount, the one that serves elbow, orientation and rest best (Kanoun, Lamiraux and Wieber 2011,
    inequality-constrained tasks in a hierarchy). So a joint at its end costs the elbow, never the hand.

    target: (3,) m, tip minus root in the base frame. bend: (3,) unit vector root to elbow, zero for none.
    tip_rotation: (3, 3) base from tip; orientation_rows: 0 free, 2 only its z axis (upright), 3 all.
    q_low, q_high: (J,) rad of this frame. rows (C, n), bounds (C,): ``rows (x - x0) >= bounds`` (collisions).
    Returns (iterations, tip error in m before the last step). Where no step is feasible q is unchanged.
    """
    n, count = limb.joints.shape[0], q.shape[0]
    pos, rot = np.empty((count + 1, 3)), np.empty((count + 1, 3, 3))
    J, Jn = np.empty((3, count)), np.empty((3, n))
    angles, weights, x, moved = np.empty(n), np.ones(n), np.zeros(n), np.zeros(n)
    C, b = np.zeros((2 * n + rows.shape[0], n)), np.empty(2 * n + rows.shape[0])
    length, done = 0.0, 0
    for _ in range(int(settings.iterations)):
        forward(tree, q, pos, rot)
        row = limb.tip_joint + 1
        tip = pos[row] + rot[row] @ limb.tip
        error = limb.root + target - tip
        length = float(np.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2))
        if done > 0 and (length < settings.tolerance or np.abs(x).max() < settings.still):
            break
        point_jacobian(tree, pos, rot, limb.tip_joint, tip, J)
        for i in range(n):
            Jn[:, i] = J[:, limb.joints[i]]
            angles[i] = q[limb.joints[i]]
        limit_avoiding_weights(angles, x, limb.lower, limb.upper, weights)
        _fill_bounds(limb, angles, moved, q_low, q_high, rows, bounds, C, b)
        H, g = Jn.T @ Jn, Jn.T @ error
        damping = settings.damping**2 + 0.5 * limb.upper_length * length
        for i in range(n):
            H[i, i] += damping * min(weights[i], 10.0)
        if bounded_step(H, g, C, b, 0, x) != SOLVED:
            break
        if done == 0:
            H, g = np.eye(n) * (settings.rest_damping**2 + CAUTION * limb.upper_length * length), np.zeros(n)
            _second_tasks(tree, limb, settings, bend, tip_rotation, orientation_rows, q, pos, rot, H, g)
            _improve(Jn, H, g, C, b, x)
        done += 1
        moved += x
        for i in range(n):
            q[limb.joints[i]] = angles[i] + x[i]
    return done, length


@njit(cache=True)
def _fill_bounds(
    limb: Limb, angles: Array, moved: Array, q_low: Array, q_high: Array, rows: Array, bounds: Array, C: Array, b: Array
) -> None:
    """C x >= b: this frame's bounds and the limb's, where they meet, and the distances left after ``moved`` (n,)."""
    n = angles.shape[0]
    for i in range(n):
        j = limb.joints[i]
        back = RETURN * (q_high[j] - q_low[j])
        C[2 * i, i], b[2 * i] = 1.0, max(q_low[j], min(limb.lower[i], q_low[j] + back)) - angles[i]
        C[2 * i + 1, i], b[2 * i + 1] = -1.0, angles[i] - min(q_high[j], max(limb.upper[i], q_high[j] - back))
    for k in range(rows.shape[0]):
        C[2 * n + k] = rows[k]
        b[2 * n + k] = bounds[k] - np.dot(rows[k], moved)


@njit(cache=True)
def _second_tasks(
    tree: Tree,
    limb: Limb,
    settings: LimbWeights,
    bend: Array,
    tip_rotation: Array,
    orientation_rows: int,
    q: Array,
    pos: Array,
    rot: Array,
    H: Array,
    g: Array,
) -> None:
    """Add elbow, orientation and rest to H (n, n), g (n,)."""
    J = np.empty((3, q.shape[0]))
    for i in range(limb.joints.shape[0]):
        H[i, i] += settings.rest**2
        g[i] = settings.rest**2 * (limb.rest[i] - q[limb.joints[i]])
    if np.any(bend != 0.0):
        elbow = pos[limb.bend_joint + 1] + rot[limb.bend_joint + 1] @ limb.bend
        point_jacobian(tree, pos, rot, limb.bend_joint, elbow, J)
        _add_rows(J, limb.root + limb.upper_length * bend - elbow, settings.bend, limb.joints, H, g)
    if orientation_rows > 0:
        tip = rot[limb.tip_joint + 1]
        angular_jacobian(tree, pos, rot, limb.tip_joint, J)
        turn = rotation_vector(tip_rotation @ np.ascontiguousarray(tip.T))
        if orientation_rows == 2:
            turn = np.cross(tip[:, 2], tip_rotation[:, 2])
        _add_rows(J, turn, settings.orientation, limb.joints, H, g)


@njit(cache=True)
def _improve(Jn: Array, H: Array, g: Array, C: Array, b: Array, x: Array) -> None:
    """Replace x (n,) by the step that minimises 1/2 x^T H x - g^T x with the same J x, within C x >= b.

    With x + Z y, Z an orthonormal basis of the steps that J does not see, it is a small problem without equalities.
    """
    n, k = x.shape[0], C.shape[0]
    Z = _unseen(Jn)
    m = Z.shape[1]
    if m == 0:
        return
    CZ, left, y = np.zeros((k, m)), b.copy(), np.empty(m)
    for r in range(k):
        for i in range(n):
            if C[r, i] != 0.0:
                left[r] -= C[r, i] * x[i]
                for a in range(m):
                    CZ[r, a] += C[r, i] * Z[i, a]
        left[r] = min(left[r], 0.0)
    Zt = np.ascontiguousarray(Z.T)
    if bounded_step(Zt @ H @ Z, Zt @ (g - H @ x), CZ, left, 0, y) == SOLVED:
        x += Z @ y


@njit(cache=True)
def _unseen(J: Array) -> Array:
    """Orthonormal basis (n, m) of the null space of J (3, n), by Gram and Schmidt, twice for rounding."""
    n = J.shape[1]
    basis, v, size, seen = np.empty((n, n)), np.empty(n), 0, 0
    for k in range(3 + n):
        if size == n:
            break
        for i in range(n):
            v[i] = J[k, i] if k < 3 else (1.0 if i == k - 3 else 0.0)
        length = _remove(basis, 0, v)
        for _ in range(2):
            rest = _remove(basis, size, v)
        if rest > (SEEN * length if k < 3 else 0.5 / np.sqrt(n)):
            basis[size] = v / rest
            size += 1
            seen += 1 if k < 3 else 0
    return np.ascontiguousarray(basis[seen:size].T)


@njit(cache=True)
def _remove(basis: Array, size: int, v: Array) -> float:
    """Take from v (n,) what lies along the first ``size`` rows of basis; the length of what is left."""
    n = v.shape[0]
    for i in range(size):
        along = 0.0
        for j in range(n):
            along += basis[i, j] * v[j]
        for j in range(n):
            v[j] -= along * basis[i, j]
    length = 0.0
    for j in range(n):
        length += v[j] * v[j]
    return float(np.sqrt(length))


@njit(cache=True)
def _add_rows(J: Array, error: Array, weight: float, joints: Array, H: Array, g: Array) -> None:
    """Add a task of three rows to H and g."""
    w = weight * weight
    for i in range(joints.shape[0]):
        for r in range(3):
            a = w * J[r, joints[i]]
            g[i] += a * error[r]
            for k in range(joints.shape[0]):
                H[i, k] += a * J[r, joints[k]]
