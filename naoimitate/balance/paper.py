"""Retargeting as published (Koenemann 2014, section V-C): one foot is shifted, both are turned to the ground.

In the torso frame the feet go where the mapping asks; in double support one of them is then shifted towards the CoM
until the offset is met, and the soles are turned so that their normal points from the shifted offset point to the CoM.
On a real floor the shifted foot drags; ``planted`` avoids that.

What the paper leaves open: the mapping goes on from its own last answer (from the stabilised pose, the shifts of one
frame would add to those of the next); a swing foot keeps off the floor, and comes down in a landing phase; feet that
the legs cannot reach are asked for nearer to the stand, so that balance is never traded for similarity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from naoimitate.balance.legs import Legs
from naoimitate.balance.offset import OffsetLaw, advance
from naoimitate.balance.planted import SCALES, Planted
from naoimitate.balance.pose import Pose, PoseMaker
from naoimitate.balance.retarget import Answer, Footing, Reach
from naoimitate.balance.soles import SoleGoal, into_tables, shortened, soles_and_com, solve_soles, uncoupled_leg
from naoimitate.core.frames import GivenUp
from naoimitate.core.geometry import heading, wrap, yaw_matrix
from naoimitate.fsm import Mode, SupportFsm, SupportInput, offset_target
from naoimitate.gate import Gate
from naoimitate.limb import solve_limb_fixed
from naoimitate.robot.model import RobotModel

Array = npt.NDArray[np.float64]

TOUCHDOWN = 0.005
"""[m] off the floor at which a landing foot counts as down: what 1 mm and 0.033 rad over 0.1 m between the feet leave."""
SWING_CLEARANCE = 0.008
"""[m] of a swing sole's lowest point above the floor: 5 mm, and what the tolerances of the solve take from it."""
SHARE_SPEED = 1.0
"""[1/s] at which the share of the mapped feet in the request grows, or shrinks while the legs cannot reach it."""


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


def shifted(soles: Array, com: Array, offset: float) -> Array:
    """Section V-C 1: soles (2, 3) m with the left one shifted towards the CoM where o' < o, else the right one."""
    left, right = soles
    if offset < offset_in_space(left, right, com):
        return np.array([left + shift_factor(left, right, com, offset) * (com - left), right])
    return np.array([left, right + shift_factor(right, left, com, 1.0 - offset) * (com - right)])


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
        self._legs, self._limbs = legs, [uncoupled_leg(robot, side) for side in "lr"]
        self._leg_joints = np.concatenate([limb.joints for limb in self._limbs])
        self._law, self._ik, self._foot_speed = law, ik, foot_speed
        self._stand = maker.stand(robot.postures["stand"]).soles_in_base - legs.hip

    def place(self, q: Array, feet: Array, footing: Footing) -> Pose:
        """The stand of frame 0; see ``Planted.place``."""
        pose = self._planted.place(q, feet, footing)
        self._fsm, self._landed, self._side, self._share = SupportFsm(), False, 0, 1.0
        self._offset, self._speed = self._planted.offset, 0.0
        self._mapped = pose.q[self._leg_joints]
        self._between = wrap(heading(pose.sole_rot[0]) - heading(pose.sole_rot[1]))
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
        offset, speed = self._next_offset(pose, footing, reach.dt)
        mapped = self._mapped_soles(q_arms, self._stand + self._share * (feet - self._stand))
        soles, com = soles_and_com(self._tree, self._legs, q_arms)
        single = self.mode is not Mode.DOUBLE and not self.mode.landing
        places = self._raised(mapped, com, pose) if single else shifted(mapped, com, offset)
        turned = np.array([self.mode.stance != "R" or self.mode.landing, self.mode.stance != "L" or self.mode.landing])
        q, ik = q_arms.copy(), self._ik
        goal = SoleGoal(places, up_vector(*places, com, offset), turned, self._between)
        tolerance = ik.position_tolerance, ik.angle_tolerance
        used, _ = solve_soles(self._tree, self._legs, goal, q, ik.damping, *tolerance, ik.max_iterations)
        way = float(np.linalg.norm(soles_and_com(self._tree, self._legs, q)[0] - soles, axis=1).max())
        near = min(1.0, self._foot_speed * reach.dt / max(way, 1e-9))
        self._hang_on(self._base_side(mapped, com, offset), pose)
        q = shortened(pose.q, q_arms + near * (q - q_arms), reach.low, reach.high)
        answer = self._taken(pose, q, (offset, speed), reach.dt, used + 2 * ik.leg_iterations)
        flat = self._flat(answer.pose)
        self._landed = self.mode.landing and flat
        good = not answer.given_up and (single or flat or near < 1.0)
        self._share = min(max(self._share + (SHARE_SPEED if good else -SHARE_SPEED) * reach.dt, 0.0), 1.0)
        return answer

    def _next_offset(self, pose: Pose, footing: Footing, dt: float) -> tuple[float, float]:
        """The support machine takes its transition; the offset o' of this frame and its speed, 1/s (section V-A)."""
        given = SupportInput(
            human=footing.support, offset=self._offset, landed=self._landed, ahead=footing.ahead, may_lift=footing.may_lift
        )
        target = offset_target(self._fsm.step(given), given, footing.offset)
        centres = self._maker.centres(pose.sole_pos, pose.sole_rot)
        limit = self._law.acceleration(float(np.linalg.norm(centres[1] - centres[0])), float(pose.com[2]))
        return advance(self._offset, self._speed, target, dt, self._law, limit)

    def _mapped_soles(self, q_arms: Array, feet: Array) -> Array:
        """Centres of the soles (2, 3) m in the torso frame where the posture mapping puts them."""
        q = q_arms.copy()
        q[self._leg_joints] = self._mapped
        for limb, foot in zip(self._limbs, feet, strict=True):
            solve_limb_fixed(self._tree, limb, foot, q, self._ik.damping, self._ik.leg_iterations)
        self._mapped = q[self._leg_joints]
        return soles_and_com(self._tree, self._legs, q)[0]

    def _raised(self, soles: Array, com: Array, pose: Pose) -> Array:
        """Single support: soles (2, 3) m with the swing foot off the floor, which is the plane of the stance sole."""
        stance, swing = (0, 1) if self.mode.stance == "L" else (1, 0)
        up = com - soles[stance]
        up = up / np.linalg.norm(up)
        corners = (self._legs.outline[swing] - self._legs.centre[swing]) @ pose.sole_rot[swing, 2, :2]
        height = float((soles[swing] - soles[stance]) @ up)
        raised = soles.copy()
        raised[swing] += max(0.0, SWING_CLEARANCE - float(corners.min()) - height) * up
        return raised

    def _base_side(self, soles: Array, com: Array, offset: float) -> int:
        """The foot that is not shifted: the right one when o' < o, else the left one; in single support the stance."""
        if self.mode is not Mode.DOUBLE:
            return 0 if self.mode.stance == "L" else 1
        return 1 if offset < offset_in_space(soles[0], soles[1], com) else 0

    def _hang_on(self, side: int, pose: Pose) -> None:
        """From now on the robot hangs on sole ``side``, flat where it is."""
        if side != self._side:
            self._side = side
            self._stance_pos[side] = pose.sole_pos[side] * [1.0, 1.0, 0.0]
            self._stance_rot[side] = yaw_matrix(heading(pose.sole_rot[side]))

    def _taken(self, pose: Pose, q: Array, offset: tuple[float, float], dt: float, iterations: int) -> Answer:
        """The whole step to q (J,) rad, a part of it, or none, whatever passes the gate first."""
        stances = (self.mode.stance != "R", self.mode.stance != "L")
        for part in SCALES:
            q_part = pose.q + part * (q - pose.q)
            into_tables(self._legs, q_part)
            candidate = self._maker.hang(q_part, self._side, self._stance_pos, self._stance_rot)
            if self._gate.passes(candidate, pose, stances, candidate.sole_pos, candidate.sole_rot, dt):
                self._offset += part * (offset[0] - self._offset)
                self._speed = offset[1] if part == 1.0 else 0.0
                return Answer(candidate, GivenUp(0), iterations)
        self._speed = 0.0
        return Answer(pose, GivenUp.HOLD, iterations)

    def _flat(self, pose: Pose) -> bool:
        """Whether the sole on which the robot does not hang lies on the floor as well."""
        other = 1 - self._side
        height, tilt = pose.sole_pos[other, 2], np.linalg.norm(pose.sole_rot[other, 2, :2])
        return bool(abs(height) < TOUCHDOWN and tilt < self._ik.angle_tolerance)
