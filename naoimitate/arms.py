"""Arms and head: to their targets in the torso frame, within limits and clear of the body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from naoimitate.balance.clearance import Clearance
from naoimitate.balance.legs import table_bounds
from naoimitate.balance.paper import PaperIk
from naoimitate.balance.pose import Pose
from naoimitate.balance.retarget import Reach
from naoimitate.core.geometry import yaw_matrix
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


BRANCH_GAIN = 0.006
"""[m] by which another arm posture must fit better to be worth a change."""
BRANCH_PERIOD = 12
"""Frames between two looks for a better arm posture."""
BRANCH_SPEED = 0.6
"""Share of the joints' speed limit at which an arm changes its posture."""
BRANCH_BRAKING = 20.0
"""[rad/s^2] with which it comes to rest there."""
AT_END, AT_BOUND = 0.02, 1e-6
"""[rad] from a joint's end, and from what a frame allows, at which it counts as there."""
BRANCH_NEAR = 0.1
"""[rad] from the other posture at which the hand is followed again."""

SETTLE_STEP = 0.1
"""[rad] of each joint in one step of ``settle``."""


class Arms:
    """Both arms and the head of a robot."""

    def __init__(
        self, robot: RobotModel, weights: LimbWeights, reserve: float, orientation: str, paper: PaperIk | None
    ) -> None:
        self._paper = paper
        self._robot, self._weights, self._orientation = robot, weights, orientation
        self._limbs = [build_limb(robot, f"{s}_arm", reserve) for s in "lr"]
        self._no_rows = [(np.zeros((0, len(limb.joints))), np.zeros(0)) for limb in self._limbs]
        self._reserve = reserve
        self._thorough = weights._replace(iterations=30.0)
        self._transit = weights._replace(tip=0.0, rest=0.1, iterations=1.0)
        self._anywhere = (robot.lower, robot.upper)
        self._seeds = [
            np.unique([posture[limb.joints] for posture in robot.postures.values()], axis=0) for limb in self._limbs
        ]
        self.reset()
        self._head = robot.chains["head"]
        self._table = next((t for t in robot.tables if t.y in self._head), None)

    def reset(self) -> None:
        """Forget the past."""
        self._branch: list[Array | None] = [None, None]
        self._frames = 0

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
        self._frames += 1
        for side, limb in enumerate(self._limbs):
            task = (targets[side], seen.body.elbows[side], *self._tip(pose, seen, side))
            rows = clearance.limb_rows(pose, limb.joints)
            if self._paper is not None:
                iterations += self._as_published(self._paper, limb, targets[side], q, reach.low, reach.high, *rows)
                continue
            if self._branch[side] is not None:
                iterations += self._change_branch(side, q, task, reach, rows)
                continue
            done, error, misfit = self._follow(limb, task, q, reach, rows)
            iterations += done
            if error > BRANCH_GAIN and self._frames % BRANCH_PERIOD == side:
                iterations += self._look_for_branch(side, q, task, misfit)
        return q, iterations

    def _follow(
        self, limb: Limb, task: Task, q: Array, reach: Reach, rows: tuple[Array, Array]
    ) -> tuple[int, float, float]:
        """One frame of a limb, smooth where the body does not forbid it: (iterations, tip error m, misfit m)."""
        found = solve_limb(self._robot.tree, limb, self._weights, *task, q, reach.smooth_low, reach.smooth_high, *rows)
        if found[0] == 0:
            found = solve_limb(self._robot.tree, limb, self._weights, *task, q, reach.low, reach.high, *rows)
        return found

    def hurried(self, side: int, q: Array, reach: Reach) -> bool:
        """Whether an arm has moved as fast as it may in this frame, joints at their ends apart."""
        if self._branch[side] is not None:
            return True
        limb = self._limbs[side]
        angles, low, high = q[limb.joints], reach.smooth_low[limb.joints], reach.smooth_high[limb.joints]
        inside = (angles - limb.lower > AT_END) & (limb.upper - angles > AT_END)
        return bool((inside & ((angles - low < AT_BOUND) | (high - angles < AT_BOUND))).any())

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

    def _look_for_branch(self, side: int, q: Array, task: Task, misfit: float) -> int:
        """Start afresh from other postures; keep the best arm posture that fits clearly better."""
        limb, iterations = self._limbs[side], 0
        for seed in self._seeds[side]:
            trial = q.copy()
            trial[limb.joints] = seed
            done, _, found = solve_limb(
                self._robot.tree, limb, self._thorough, *task, trial, *self._anywhere, *self._no_rows[side]
            )
            iterations += done
            if found < misfit - BRANCH_GAIN:
                misfit, self._branch[side] = found, trial[limb.joints]
        return iterations

    def _change_branch(self, side: int, q: Array, task: Task, reach: Reach, rows: tuple[Array, Array]) -> int:
        """Move an arm of q through joint space towards its other posture, until that is near."""
        limb, goal = self._limbs[side], q.copy()
        goal[limb.joints] = self._branch[side]
        done, _, _ = solve_limb(
            self._robot.tree, limb, self._weights, *task, goal, *self._anywhere, *self._no_rows[side]
        )
        if reach.dt == 0.0:
            q[limb.joints], self._branch[side] = goal[limb.joints], None
            return done
        way = limb._replace(rest=goal[limb.joints])
        before = q[limb.joints]
        most = np.minimum(BRANCH_SPEED * (reach.high - q), np.sqrt(2.0 * BRANCH_BRAKING * np.abs(goal - q)) * reach.dt)
        slow_low = np.clip(q - most, reach.smooth_low, reach.smooth_high)
        slow_high = np.clip(q + most, reach.smooth_low, reach.smooth_high)
        free = (task[0], np.zeros(3), task[2], 0)
        more, _, _ = solve_limb(self._robot.tree, way, self._transit, *free, q, slow_low, slow_high, *rows)
        near = np.abs(q[limb.joints] - way.rest).max() < BRANCH_NEAR
        stuck = np.abs(q[limb.joints] - before).max() < 1e-4
        self._branch[side] = None if near or stuck else way.rest
        return done + more

    def _tip(self, pose: Pose, seen: Observation, side: int) -> tuple[Array, int]:
        """Orientation asked of a hand in the base frame, and how many of its rows count."""
        if self._orientation == "upright":
            return np.ascontiguousarray(pose.base_rot.T), 2
        if self._orientation == "follow" and seen.hands is not None:
            return seen.hands[side] @ _PALM[side], 3
        return np.eye(3), 0

    def head(self, q: Array, wanted: tuple[float, float], step: float, low: Array, high: Array) -> None:
        """Turn the head of q (J,) towards yaw and pitch (rad), at most ``step`` rad, within its coupling table."""
        for joint, angle in zip(self._head, wanted, strict=False):
            near, far = max(low[joint], q[joint] - step), min(high[joint], q[joint] + step)
            lower, upper = self._robot.lower[joint] + self._reserve, self._robot.upper[joint] - self._reserve
            if self._table is not None and self._table.y == joint:
                table_low, _, table_high, _ = table_bounds(self._table.rows, q[self._table.x])
                lower, upper = max(lower, table_low + self._reserve), min(upper, table_high - self._reserve)
            q[joint] = min(max(min(max(angle, lower), upper), near), far)
