"""Arms and head: to their targets in the torso frame, within limits and clear of the body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.balance.clearance import Clearance
from naoimitate.balance.legs import table_bounds
from naoimitate.balance.paper import PaperIk
from naoimitate.balance.pose import Pose
from naoimitate.balance.retarget import Reach
from naoimitate.branch import Branch
from naoimitate.core.geometry import yaw_matrix
from naoimitate.gaze import Gaze
from naoimitate.human.observer import Observation
from naoimitate.ik import SOLVED, bounded_step
from naoimitate.limb import Limb, LimbWeights, build_limb, solve_limb, solve_limb_fixed
from naoimitate.robot.kernel import forward
from naoimitate.robot.model import RobotModel

Array = npt.NDArray[np.float64]

Task = tuple[Array, Array, Array, int]
"""Of an arm: target (3,) m, elbow direction (3,), tip rotation (3, 3), and how many of its rows count."""
_ORIENTATION_ROWS = {"free": 0, "upright": 2, "follow": 3}
_PALM = (yaw_matrix(np.pi / 2), yaw_matrix(-np.pi / 2))
"""Torso from hand link in a T-pose: the links point along x, the human's arms along +-y."""


_FREE = np.eye(3)
AT_END, AT_BOUND = 0.02, 1e-6
"""[rad] from a joint's end, and from what a frame allows, at which it counts as there."""

SETTLE_STEP = 0.1
"""[rad] of each joint in one step of ``settle``."""


ROUGHER = (0.05, 0.2, 1.0)
"""Shares of the way from smooth bounds to those of speed alone, tried in turn where the body is in the way."""


class Arms:
    """Both arms and the head of a robot."""

    def __init__(
        self,
        robot: RobotModel,
        weights: LimbWeights,
        reserve: float,
        orientation: str,
        paper: PaperIk | None,
        gaze: Gaze | None = None,
    ) -> None:
        self._paper, self._gaze = paper, gaze
        self._robot, self._weights, self._orientation = robot, weights, orientation
        self._limbs = [build_limb(robot, f"{s}_arm", reserve) for s in "lr"]
        self._branches = [Branch(robot, limb) for limb in self._limbs]
        self._reserve = reserve
        self._to_goal = weights._replace(bend=0.0)
        self.reset()
        self._head = robot.chains.get("head", ())
        self._table = next((t for t in robot.tables if t.y in self._head), None)

    def reset(self) -> None:
        """Forget the past."""
        for branch in self._branches:
            branch.reset()
        self._errors = [0.0, 0.0]
        self._hurried = [False, False]

    def hands(self, pose: Pose) -> Array:
        """Hands from the shoulders in the torso frame, (2, 3) m."""
        return np.array(
            [
                pose.link_pos[limb.tip_joint + 1] + pose.link_rot[limb.tip_joint + 1] @ limb.tip - limb.root
                for limb in self._limbs
            ]
        )

    def touches(self, side: int, clearance: Clearance) -> bool:
        """Whether an arm is kept from moving on by the body or the floor, in the pose last looked at."""
        return clearance.touching(self._limbs[side].joints)

    def settle(self, pose: Pose, targets: Array, seen: Observation, clearance: Clearance, steps: int) -> Array:
        """Joint angles (J,) with arms and head at their targets, found without speed limits (frame 0)."""
        clearance.look(pose)
        for _ in range(steps):
            low, high = pose.q - SETTLE_STEP, pose.q + SETTLE_STEP
            q, _ = self.solve(pose, targets, seen, Reach(0.0, low, high, low, high), clearance)
            self.head(q, seen.head, SETTLE_STEP, low, high)
            link_pos, link_rot = pose.link_pos.copy(), pose.link_rot.copy()
            forward(self._robot.tree, q, link_pos, link_rot)
            pose = replace(pose, q=q, link_pos=link_pos, link_rot=link_rot)
            clearance.look(pose)
        return pose.q

    def solve(
        self, pose: Pose, targets: Array, seen: Observation, reach: Reach, clearance: Clearance
    ) -> tuple[Array, int]:
        """Joint angles (J,) with both arms moved towards targets (2, 3) m, and the iterations it took."""
        q, iterations = pose.q.copy(), 0
        for side, (limb, branch) in enumerate(zip(self._limbs, self._branches, strict=True)):
            rows = clearance.limb_rows(pose, limb.joints)
            if self._paper is not None:
                iterations += self._as_published(self._paper, limb, targets[side], q, reach.low, reach.high, *rows)
                continue
            task = (targets[side], seen.body.elbows[side], *self._tip(pose, seen, side))
            branch.look(q, targets[side], reach.dt, self._errors[side], self._hurried[side])
            if branch.goal is None:
                done, error = self._follow(limb, self._weights, task, q, branch.bounds(q, reach), rows)
            else:
                done, error = self._change(limb, branch, task, q, reach, rows)
            self._errors[side], self._hurried[side] = error, self._at_speed(side, q, reach)
            iterations += done
        return q, iterations

    def _follow(
        self, limb: Limb, weights: LimbWeights, task: Task, q: Array, reach: Reach, rows: tuple[Array, Array]
    ) -> tuple[int, float]:
        """One frame of a limb, as smooth as the body allows: (iterations, tip error m)."""
        found = solve_limb(self._robot.tree, limb, weights, *task, q, reach.smooth_low, reach.smooth_high, *rows)
        for share in ROUGHER:
            if found[0] > 0:
                break
            low = reach.smooth_low + share * (reach.low - reach.smooth_low)
            high = reach.smooth_high + share * (reach.high - reach.smooth_high)
            found = solve_limb(self._robot.tree, limb, weights, *task, q, low, high, *rows)
        return found

    def _change(
        self, limb: Limb, branch: Branch, task: Task, q: Array, reach: Reach, rows: tuple[Array, Array]
    ) -> tuple[int, float]:
        """One frame of a limb on its way to another posture, the hand as near to its target as the way allows."""
        goal, before = branch.goal, q[limb.joints]
        assert goal is not None
        if reach.dt == 0.0:
            q[limb.joints], branch.goal = goal, None
            return 1, 0.0
        free = (task[0], np.zeros(3), task[2], 0)
        found = self._follow(limb._replace(rest=goal), self._to_goal, free, q, branch.bounds(q, reach), rows)
        branch.moved(before, q[limb.joints])
        return found

    def hurried(self, side: int, q: Array, reach: Reach) -> bool:
        """Whether an arm has moved as fast as it may in this frame, joints at their ends apart."""
        return self._branches[side].goal is not None or self._at_speed(side, q, reach)

    def _at_speed(self, side: int, q: Array, reach: Reach) -> bool:
        limb = self._limbs[side]
        return _at_bound(q, reach.smooth_low, reach.smooth_high, limb.joints, limb.lower, limb.upper)

    def _as_published(
        self, ik: PaperIk, limb: Limb, target: Array, q: Array, low: Array, high: Array, rows: Array, bounds: Array
    ) -> int:
        """The paper's iterations, then the nearest angles within speed, range and clear of the body (section V-D)."""
        before = q[limb.joints]
        solve_limb_fixed(self._robot.tree, limb, target, q, ik.damping, ik.arm_iterations)
        wish, step, unit = q[limb.joints] - before, np.zeros(len(before)), np.eye(len(before))
        down = np.minimum(np.maximum(low[limb.joints], limb.lower) - before, 0.0)
        up = np.maximum(np.minimum(high[limb.joints], limb.upper) - before, 0.0)
        within = np.concatenate([unit, -unit, rows]), np.concatenate([down, -up, bounds])
        solved = bounded_step(unit, wish, *within, 0, step) == SOLVED
        q[limb.joints] = before + (step if solved else 0.0)
        return ik.arm_iterations

    def _tip(self, pose: Pose, seen: Observation, side: int) -> tuple[Array, int]:
        """Orientation asked of a hand in the base frame, and how many of its rows count."""
        if self._orientation == "upright":
            return np.ascontiguousarray(pose.base_rot.T), 2
        if self._orientation == "follow" and seen.hands is not None:
            return seen.hands[side] @ _PALM[side], 3
        return _FREE, 0

    def head(self, q: Array, wanted: tuple[float, float], step: float, low: Array, high: Array) -> None:
        """Turn the head of q (J,) at most ``step`` rad, within its coupling table: towards yaw and pitch (rad) wanted.

        A robot with a gaze looks at its hand instead; the arms of q are where they will be.
        """
        angles = wanted if self._gaze is None else self._gaze.angles(q)
        for joint, angle in zip(self._head, angles, strict=False):
            near, far = max(low[joint], q[joint] - step), min(high[joint], q[joint] + step)
            lower, upper = self._robot.lower[joint] + self._reserve, self._robot.upper[joint] - self._reserve
            if self._table is not None and self._table.y == joint:
                table_low, _, table_high, _ = table_bounds(self._table.rows, q[self._table.x])
                lower, upper = max(lower, table_low + self._reserve), min(upper, table_high - self._reserve)
            q[joint] = min(max(min(max(angle, lower), upper), near), far)


@njit(cache=True)
def _at_bound(q: Array, low: Array, high: Array, joints: npt.NDArray[np.int64], lower: Array, upper: Array) -> bool:
    """Whether a joint that is not at its end is at what the frame allows; q, low, high: (J,) rad."""
    for i in range(joints.shape[0]):
        j = joints[i]
        inside = q[j] - lower[i] > AT_END and upper[i] - q[j] > AT_END
        if inside and (q[j] - low[j] < AT_BOUND or high[j] - q[j] < AT_BOUND):
            return True
    return False
