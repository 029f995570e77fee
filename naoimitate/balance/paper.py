"""Retargeting as published (Koenemann 2014, section V-C): one foot is shifted, both are turned to the ground.

In the torso frame the feet go where the mapping asks; in double support one of them is then shifted towards the CoM
until the offset is met, and the soles are turned so that their normal points from the shifted offset point to the CoM.
On a real floor the shifted foot drags; ``planted`` avoids that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.balance.legs import LegLimits, Legs, reduce_columns, table_bounds
from naoimitate.balance.offset import OffsetLaw, advance
from naoimitate.balance.planted import Planted
from naoimitate.balance.pose import Pose, PoseMaker
from naoimitate.balance.retarget import Answer, Footing, Reach
from naoimitate.core.frames import GivenUp
from naoimitate.core.geometry import heading, yaw_matrix
from naoimitate.fsm import Mode, SupportFsm, SupportInput, offset_target
from naoimitate.gate import Gate
from naoimitate.ik import damped_step, limit_avoiding_weights
from naoimitate.limb import Limb, build_limb, solve_limb_fixed
from naoimitate.robot.kernel import angular_jacobian, center_of_mass, forward, point_jacobian
from naoimitate.robot.model import RobotModel, Tree

Array = npt.NDArray[np.float64]

STALLED = 1e-4
"""[rad] of the largest joint step below which a solve has come as near as it can."""
TOUCHDOWN = 0.005
"""[m] off the floor at which a landing foot counts as down: what 1 mm and 0.033 rad over 0.1 m between the feet leave."""


@dataclass(frozen=True)
class PaperIk:
    """The published parameters of the inverse kinematics (section VI)."""

    damping: float = 0.3
    arm_iterations: int = 30
    leg_iterations: int = 5
    position_tolerance: float = 0.001
    """[m]."""
    angle_tolerance: float = 0.033
    """[rad]."""
    max_iterations: int = 2000
    """The paper's longest solve took 1784."""


def shift_factor(foot: Array, other: Array, com: Array, offset: float) -> float:
    """The s of smallest magnitude that solves o(p_L + s (p_CoM - p_L)) = o' for the foot at offset 0.

    foot, other, com: (3,) m in one frame; offset: o', counted from ``foot`` to ``other``. With v = p_CoM - p_L and
    d = p_R - p_L: (1 - o') v.v s^2 + (2 o' v.d - v.d - v.v) s + (v.d - o' d.d) = 0. Where it has no real root, the s
    that comes nearest.
    """
    v, d = com - foot, other - foot
    vv, vd, dd = float(v @ v), float(v @ d), float(d @ d)
    a, b, c = (1.0 - offset) * vv, (2.0 * offset - 1.0) * vd - vv, vd - offset * dd
    if abs(a) < 1e-12:
        return -c / b if abs(b) > 1e-12 else 0.0
    root = math.sqrt(max(b * b - 4.0 * a * c, 0.0))
    return min((-b - root) / (2.0 * a), (-b + root) / (2.0 * a), key=abs)


def up_vector(left: Array, right: Array, com: Array, offset: float) -> Array:
    """Equation (7): the soles' common normal n = p_CoM - (p_L + o' (p_R - p_L)), as a unit vector (3,)."""
    n = com - (left + offset * (right - left))
    return np.asarray(n / max(float(np.linalg.norm(n)), 1e-9))


def offset_in_space(left: Array, right: Array, com: Array) -> float:
    """Equation (6) with positions (3,) m in the torso frame."""
    d = right - left
    return float((com - left) @ d / max(float(d @ d), 1e-9))


class PaperFeet:
    """The published stabilisation. It shares frame 0 with ``planted``."""

    def __init__(self, robot: RobotModel, legs: Legs, maker: PoseMaker, planted: Planted, gate: Gate, law: OffsetLaw, ik: PaperIk, foot_speed: float) -> None:
        self._tree, self._maker, self._planted, self._gate = robot.tree, maker, planted, gate
        self._legs = _without_shared_joints(robot, legs)
        self._law, self._ik, self._foot_speed = law, ik, foot_speed
        self._limbs = [uncoupled_leg(robot, side) for side in "lr"]

    def place(self, q: Array, feet: Array, footing: Footing) -> Pose:
        """The stand of frame 0; see ``Planted.place``."""
        pose = self._planted.place(q, feet, footing)
        self._fsm, self._landed, self._side = SupportFsm(), False, 0
        self._offset, self._speed = self._planted.offset, 0.0
        self._mapped = pose.q[self._legs.joints]
        self._stance_pos, self._stance_rot = pose.sole_pos.copy(), pose.sole_rot.copy()
        return pose

    @property
    def mode(self) -> Mode:
        """The robot's support mode."""
        return self._fsm.mode

    @property
    def offset(self) -> float:
        """The robot's normalised offset, 0 left to 1 right."""
        return self._offset

    def step(self, pose: Pose, q_arms: Array, feet: Array, footing: Footing, reach: Reach) -> Answer:
        """The next pose: mapped feet, the offset of this frame, one foot shifted, both turned to the ground."""
        given = SupportInput(footing.support, self._offset, self._landed, (True, True), footing.ahead, footing.may_lift)
        mode = self._fsm.step(given)
        target = offset_target(mode, given, footing.offset)
        centres = self._maker.centres(pose.sole_pos, pose.sole_rot)
        limit = self._law.acceleration(float(np.linalg.norm(centres[1] - centres[0])), float(pose.com[2]))
        offset, speed = advance(self._offset, self._speed, target, reach.dt, self._law, limit)
        soles = self._mapped_soles(q_arms, feet)
        com = self._in_base(q_arms)[1]
        q = q_arms.copy()
        side = self._base_side(soles, com, offset)
        soles, normal = self._retargeted(soles, com, offset, pose, reach.dt)
        turned = np.array([mode.stance != "R" or mode.landing, mode.stance != "L" or mode.landing])
        used = solve_soles(
            self._tree, self._legs, soles, normal, turned, q, self._ik.damping,
            self._ik.position_tolerance, self._ik.angle_tolerance, self._ik.max_iterations,
        )  # fmt: skip
        q = shortened(pose.q, q, reach)
        return self._answer(pose, q, side, (offset, speed), reach.dt, used + 2 * self._ik.leg_iterations)

    def _answer(self, pose: Pose, q: Array, side: int, offset: tuple[float, float], dt: float, iterations: int) -> Answer:
        """Hang the pose flat on its stance sole, which stays where it was; hold where the gate refuses."""
        if side != self._side:
            self._side = side
            self._stance_pos[side] = pose.sole_pos[side] * [1.0, 1.0, 0.0]
            self._stance_rot[side] = yaw_matrix(heading(pose.sole_rot[side]))
        candidate = self._maker.hang(q, side, self._stance_pos, self._stance_rot)
        stances = (self.mode.stance != "R", self.mode.stance != "L")
        fixed = (side == 0, side == 1)
        if not self._gate.moves(candidate, pose, fixed, self._stance_pos, self._stance_rot, dt) or not self._gate.balanced(candidate, pose, stances):
            self._speed = 0.0
            return Answer(pose, GivenUp.HOLD, iterations)
        self._offset, self._speed = offset
        swing_height = candidate.sole_pos[1 - side][2]
        self._landed = self.mode.landing and abs(swing_height) < TOUCHDOWN
        return Answer(candidate, GivenUp(0), iterations)

    def _mapped_soles(self, q_arms: Array, feet: Array) -> Array:
        """Centres of the soles (2, 3) m where the posture mapping puts them: it goes on from its own last answer, so
        that the shifts of one frame do not add to those of the next."""
        legs = self._legs.joints
        q = q_arms.copy()
        q[legs] = self._mapped
        for limb, foot in zip(self._limbs, feet, strict=True):
            solve_limb_fixed(self._tree, limb, foot, q, self._ik.damping, self._ik.leg_iterations)
        self._mapped = q[legs]
        return self._in_base(q)[0]

    def _in_base(self, q: Array) -> tuple[Array, Array]:
        """Centres of the soles (2, 3) m and CoM (3,) m in the torso frame."""
        n = len(q)
        pos, rot, com = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3)), np.empty(3)
        forward(self._tree, q, pos, rot)
        center_of_mass(self._tree, pos, rot, com)
        rows = self._legs.sole_joint + 1
        centre = self._legs.sole_point + np.pad(self._legs.centre, ((0, 0), (0, 1)))
        return pos[rows] + np.einsum("kij,kj->ki", rot[rows], centre), com

    def _base_side(self, soles: Array, com: Array, offset: float) -> int:
        """The foot that is not shifted: the right one when o' < o_R, else the left one; in single support the stance."""
        if self.mode is not Mode.DOUBLE:
            return 0 if self.mode.stance == "L" else 1
        return 1 if offset < offset_in_space(soles[0], soles[1], com) else 0

    def _retargeted(self, soles: Array, com: Array, offset: float, pose: Pose, dt: float) -> tuple[Array, Array]:
        """Section V-C: new places (2, 3) m of the soles' centres in the torso frame, and their normal (3,)."""
        soles = soles.copy()
        if self.mode is not Mode.DOUBLE and not self.mode.landing:
            return soles, up_vector(soles[0], soles[1], com, offset)
        if offset < offset_in_space(soles[0], soles[1], com):
            soles[0] += shift_factor(soles[0], soles[1], com, offset) * (com - soles[0])
        else:
            soles[1] += shift_factor(soles[1], soles[0], com, 1.0 - offset) * (com - soles[1])
        normal = up_vector(soles[0], soles[1], com, offset)
        if self.mode.landing:
            swing = 1 if self.mode.stance == "L" else 0
            now = self._in_base(pose.q)[0][swing]
            way = soles[swing] - now
            soles[swing] = now + way * min(1.0, self._foot_speed * dt / max(float(np.linalg.norm(way)), 1e-9))
        return soles, normal


def uncoupled_leg(robot: RobotModel, side: str) -> Limb:
    """A leg whose shared joints are held, so that one leg's solution does not move the other."""
    limb = build_limb(robot, f"{side}_leg", LegLimits().range_reserve)
    joints = {j for pair in robot.coupled for j in pair}
    keep = np.array([j not in joints for j in limb.joints])
    return limb._replace(joints=limb.joints[keep], lower=limb.lower[keep], upper=limb.upper[keep], rest=limb.rest[keep])


def _without_shared_joints(robot: RobotModel, legs: Legs) -> Legs:
    """The legs with their shared joints held: the paper's problem of 5 degrees of freedom a foot."""
    shared = {j for pair in robot.coupled for j in pair}
    joints = np.array([j for j in legs.joints if j not in shared], dtype=np.int64)
    variable = np.full_like(legs.variable, -1)
    variable[joints] = np.arange(len(joints))
    return legs._replace(variable=variable, joints=joints)


def shortened(before: Array, q: Array, reach: Reach) -> Array:
    """The longest part of a joint step that no joint's speed limit forbids."""
    step = q - before
    room = np.where(step > 0.0, reach.high - before, before - reach.low)
    part = float(np.min(np.where(np.abs(step) > room, room / np.maximum(np.abs(step), 1e-12), 1.0)))
    return np.asarray(before + part * step)


@njit(cache=True)
def solve_soles(
    tree: Tree, legs: Legs, places: Array, normal: Array, turned: Array, q: Array, damping: float, near: float, angle: float, limit: int
) -> int:
    """Damped least squares on both legs until every sole centre is within ``near`` m and ``angle`` rad; q is written.

    places: (2, 3) m in the torso frame; normal: (3,) of the soles that are ``turned`` (2,) bool. Returns the iterations.
    """
    n, count = legs.joints.shape[0], q.shape[0]
    pos, rot = np.empty((count + 1, 3)), np.empty((count + 1, 3, 3))
    J, A, e = np.empty((3, count)), np.zeros((12, n)), np.zeros(12)
    angles, lower, upper = np.empty(n), np.empty(n), np.empty(n)
    weights, step = np.ones(n), np.zeros(n)
    for iteration in range(limit):
        forward(tree, q, pos, rot)
        worst_place, worst_turn = 0.0, 0.0
        for k in range(2):
            row = legs.sole_joint[k] + 1
            local = legs.sole_point[k] + np.array([legs.centre[k, 0], legs.centre[k, 1], 0.0])
            centre = pos[row] + rot[row] @ local
            e[6 * k : 6 * k + 3] = places[k] - centre
            point_jacobian(tree, pos, rot, legs.sole_joint[k], centre, J)
            reduce_columns(J, legs, A[6 * k : 6 * k + 3])
            worst_place = max(worst_place, np.linalg.norm(e[6 * k : 6 * k + 3]))
            if turned[k]:
                e[6 * k + 3 : 6 * k + 6] = np.cross(rot[row][:, 2], normal)
                angular_jacobian(tree, pos, rot, legs.sole_joint[k], J)
                reduce_columns(J, legs, A[6 * k + 3 : 6 * k + 6])
                worst_turn = max(worst_turn, np.linalg.norm(e[6 * k + 3 : 6 * k + 6]))
        if worst_place < near and worst_turn < angle:
            return iteration
        for i in range(n):
            j = legs.joints[i]
            angles[i], lower[i], upper[i] = q[j], legs.lower[j], legs.upper[j]
        limit_avoiding_weights(angles, step, lower, upper, weights)
        step[:] = damped_step(A, e, weights, damping)
        for j in range(count):
            v = legs.variable[j]
            if v >= 0:
                q[j] = min(max(q[j] + step[v], legs.lower[j]), legs.upper[j])
        for t in range(legs.table_x.shape[0]):
            low, _, high, _ = table_bounds(legs.table_rows[t], q[legs.table_x[t]])
            q[legs.table_y[t]] = min(max(q[legs.table_y[t]], low), high)
        if np.abs(step).max() < STALLED:
            return iteration + 1
    return limit
