"""The reachable bound: how near a hand could have come, had the arm alone been free.

Torso, legs, head and the other arm stay as in the run; the arm may take any posture within its joint ranges in which
the body does not overlap itself. Solved from several starts by bounded Gauss-Newton steps, with overlaps as penalties.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.collision import ShapeArrays, distances, shape_arrays
from naoimitate.robot.kernel import forward, point_jacobian
from naoimitate.robot.model import RobotModel, Tree
from naoimitate.run.overlap import ALLOWED_OVERLAP
from naoimitate.run.replay import Array

STARTS = 6
"""Postures, spread over the arm's ranges, from which each solve starts beside the run's own and the last solution."""
STEPS = 40
"""Gauss-Newton steps from each start."""
REACHED = 1e-4
"""A hand this near its target has reached it, m."""
DAMPING = 1e-5
"""Of a step, m^2/rad^2: arms of a few tenths of a metre have singular values well above its root."""
PENALTY = 30.0
"""Weight of an overlap against a hand's distance, both squared."""
AIM_OVERLAP = 0.5 * ALLOWED_OVERLAP
"""Overlap from which the penalty starts, m: what a penalty leaves over stays within the allowed."""
LONGEST_STEP = 0.3
"""Of any joint in one step, rad."""

Indices = npt.NDArray[np.int64]
Floats = npt.NDArray[np.floating[Any]]


class Arm(NamedTuple):
    """An arm for compiled functions: its joints, the ends of its vector in (1) as link rows and offsets (m), ranges
    (rad), and the pairs of shapes that it can bring together."""

    joints: Indices
    root: int
    root_offset: Array
    hand: int
    hand_offset: Array
    lower: Array
    upper: Array
    pairs: Indices


def reachable_errors(robot: RobotModel, q: Array, hand_targets: Array) -> Array:
    """Least distance of each hand to its target, (N, 2) m, left and right.

    q: (N, J) rad, the run's poses. hand_targets: (N, 2, 3) m, vectors shoulder to hand in the torso frame.
    """
    shapes = shape_arrays(robot)
    spread = np.random.default_rng(0).random((STARTS, max(len(robot.chains[f"{s}_arm"]) for s in "lr")))
    columns = [
        _solve_all(robot.tree, shapes, _arm(robot, side), q, np.ascontiguousarray(hand_targets[:, i]), spread)
        for i, side in enumerate("lr")
    ]
    return np.stack(columns, axis=1)


def _arm(robot: RobotModel, side: str) -> Arm:
    joints = np.array(robot.chains[f"{side}_arm"])
    root, hand = robot.points[f"{side}_shoulder"], robot.points[f"{side}_hand"]
    moved = np.array([shape.joint in joints for shape in robot.shapes])
    return Arm(
        joints,
        root.joint,
        root.offset,
        hand.joint,
        hand.offset,
        robot.lower[joints],
        robot.upper[joints],
        np.ascontiguousarray(robot.pairs[moved[robot.pairs].any(axis=1)]),
    )


@njit(cache=True)
def _solve_all(tree: Tree, shapes: ShapeArrays, arm: Arm, q: Array, targets: Array, spread: Array) -> Array:
    n = arm.joints.shape[0]
    result = np.empty(q.shape[0])
    last = 0.5 * (arm.lower + arm.upper)
    for i in range(q.shape[0]):
        pose = q[i].copy()
        best = np.inf
        for start in range(spread.shape[0] + 2):
            for k in range(n):
                if start == 0:
                    pose[arm.joints[k]] = q[i, arm.joints[k]]
                elif start == 1:
                    pose[arm.joints[k]] = last[k]
                else:
                    share = spread[start - 2, k]
                    pose[arm.joints[k]] = (1.0 - share) * arm.lower[k] + share * arm.upper[k]
            distance, overlap = _descend(tree, shapes, arm, pose, targets[i])
            if overlap <= ALLOWED_OVERLAP and distance < best:
                best = distance
                last[:] = pose[arm.joints]
            if best < REACHED:
                break
        result[i] = best
    return result


@njit(cache=True)
def _descend(tree: Tree, shapes: ShapeArrays, arm: Arm, pose: Array, target: Array) -> tuple[float, float]:
    """Move the arm's joints in ``pose`` (J,) to a local optimum; distance of the hand and deepest overlap there, m."""
    joints, n = pose.shape[0], arm.joints.shape[0]
    pos, rot = np.empty((joints + 1, 3)), np.empty((joints + 1, 3, 3))
    H, g = np.empty((n, n)), np.empty(n)
    distance, overlap = _linearise(tree, shapes, arm, pose, target, pos, rot, H, g)
    cost = distance**2 + PENALTY * max(overlap - AIM_OVERLAP, 0.0) ** 2
    damping = DAMPING
    for _ in range(STEPS):
        before = pose[arm.joints]
        step = _bounded_step(H, g, damping, before, arm.lower, arm.upper)
        for k in range(n):
            pose[arm.joints[k]] = min(max(before[k] + step[k], arm.lower[k]), arm.upper[k])
        H_new, g_new = np.empty((n, n)), np.empty(n)
        new_distance, new_overlap = _linearise(tree, shapes, arm, pose, target, pos, rot, H_new, g_new)
        new_cost = new_distance**2 + PENALTY * max(new_overlap - AIM_OVERLAP, 0.0) ** 2
        if new_cost < cost:
            settled = cost - new_cost < 1e-12
            distance, overlap, cost, H, g = new_distance, new_overlap, new_cost, H_new, g_new
            damping = max(0.3 * damping, DAMPING)
            if settled or (distance < REACHED and overlap <= ALLOWED_OVERLAP):
                break
        else:
            for k in range(n):
                pose[arm.joints[k]] = before[k]
            damping *= 10.0
            if damping > 1.0:
                break
    return distance, overlap


@njit(cache=True)
def _linearise(
    tree: Tree,
    shapes: ShapeArrays,
    arm: Arm,
    pose: Array,
    target: Array,
    pos: Array,
    rot: Array,
    H: Array,
    g: Array,
) -> tuple[float, float]:
    """Fill H (n, n) and g (n,): half the cost's Gauss-Newton Hessian and gradient; return distance and overlap, m."""
    joints, n = pose.shape[0], arm.joints.shape[0]
    forward(tree, pose, pos, rot)
    hand = pos[arm.hand + 1] + rot[arm.hand + 1] @ arm.hand_offset
    root = pos[arm.root + 1] + rot[arm.root + 1] @ arm.root_offset
    Jh, Jr = np.empty((3, joints)), np.empty((3, joints))
    point_jacobian(tree, pos, rot, arm.hand, hand, Jh)
    point_jacobian(tree, pos, rot, arm.root, root, Jr)
    J = np.empty((3, n))
    for k in range(n):
        J[:, k] = Jh[:, arm.joints[k]] - Jr[:, arm.joints[k]]
    error = hand - root - target
    H[:] = J.T @ J
    g[:] = J.T @ error
    return np.sqrt(error @ error), _penalise(tree, shapes, arm, pos, rot, Jh, Jr, H, g)


@njit(cache=True)
def _penalise(
    tree: Tree, shapes: ShapeArrays, arm: Arm, pos: Array, rot: Array, Ja: Array, Jb: Array, H: Array, g: Array
) -> float:
    """Add the penalty of the deepest overlap to H and g and return its depth, m (0 without one).

    With ``normal`` from a to b, the distance changes by normal . (J_b - J_a): the velocities of the two points.
    """
    count, n = arm.pairs.shape[0], arm.joints.shape[0]
    if count == 0:
        return 0.0
    d, a, b, normal = np.empty(count), np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3))
    distances(shapes, arm.pairs, pos, rot, 0.0, d, a, b, normal)
    worst = np.argmin(d)
    depth = max(-d[worst], 0.0)
    if depth > AIM_OVERLAP:
        point_jacobian(tree, pos, rot, shapes.link[arm.pairs[worst, 0]] - 1, a[worst], Ja)
        point_jacobian(tree, pos, rot, shapes.link[arm.pairs[worst, 1]] - 1, b[worst], Jb)
        slope = np.empty(n)
        for k in range(n):
            j = arm.joints[k]
            slope[k] = 0.0
            for axis in range(3):
                slope[k] -= normal[worst, axis] * (Jb[axis, j] - Ja[axis, j])
        g += PENALTY * (depth - AIM_OVERLAP) * slope
        H += PENALTY * np.outer(slope, slope)
    return depth


@njit(cache=True)
def _bounded_step(H: Array, g: Array, damping: float, at: Array, lower: Array, upper: Array) -> Floats:
    """Damped Gauss-Newton step in which joints that would leave their range stay where they are."""
    n = g.shape[0]
    A, b = H.copy(), -g
    for k in range(n):
        if (at[k] <= lower[k] and g[k] > 0.0) or (at[k] >= upper[k] and g[k] < 0.0):
            A[k, :] = 0.0
            A[:, k] = 0.0
            b[k] = 0.0
        A[k, k] += damping
    step = np.linalg.solve(A, b)
    longest = np.abs(step).max()
    if longest > LONGEST_STEP:
        step *= LONGEST_STEP / longest
    return step
