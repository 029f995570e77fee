"""Retargeting as published (Koenemann 2014, section V-C): one foot is shifted, both are turned to the ground.

In the torso frame the feet go where the mapping asks; in double support one of them is then shifted towards the CoM
until the offset is met, and the soles are turned so that their normal points from the shifted offset point to the CoM.
On a real floor the shifted foot drags; ``planted`` avoids that.

What the paper leaves open: the mapping goes on from its own last answer (from the stabilised pose, the shifts of one
frame would add to those of the next); a swing foot keeps off the floor, and comes down in a landing phase; feet that
the legs cannot reach are asked for nearer to the stand, so that balance is never traded for similarity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from naoimitate.balance.legs import Legs
from naoimitate.balance.offset import OffsetLaw, Span, advance
from naoimitate.balance.planted import SCALES, Planted
from naoimitate.balance.pose import Pose, PoseMaker
from naoimitate.balance.retarget import Answer, Footing, Reach
from naoimitate.balance.shift import levelled, offset_in_space, parted, shifted, swung, up_vector
from naoimitate.balance.soles import (
    SoleGoal,
    Soles,
    into_tables,
    leg_joints,
    shortened,
    soles_at,
    solve_soles,
    uncoupled_leg,
)
from naoimitate.core.frames import GivenUp
from naoimitate.core.geometry import heading, wrap, yaw_matrix
from naoimitate.fsm import Mode, SupportFsm, SupportInput, offset_target
from naoimitate.gate import Gate
from naoimitate.limb import solve_limb_fixed
from naoimitate.robot.model import RobotModel

Array = npt.NDArray[np.float64]

TOUCHDOWN = 0.005
"""[m] off the floor at which a landing foot counts as down: what 1 mm and 0.033 rad leave over 0.1 m."""
SWING_CLEARANCE = 0.015
"""[m] of a swing sole's lowest point above the floor (design: section 4.6)."""
FEET_APART = 0.010
"""[m] kept between the soles' inner edges: what shifting one of them sideways may take, and 5 mm."""
SPREAD = 0.05
"""[m] more that is kept between them where nothing of the mapped feet is asked for: so they come off each other."""
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


class PaperFeet:
    """The published stabilisation. It shares frame 0 with ``planted``."""

    def __init__(
        self,
        robot: RobotModel,
        legs: Legs,
        maker: PoseMaker,
        planted: Planted,
        gate: Gate,
        law: OffsetLaw,
        ik: PaperIk,
        foot_speed: float,
    ) -> None:
        self._tree, self._maker, self._planted, self._gate = robot.tree, maker, planted, gate
        self._legs, self._limbs = legs, [uncoupled_leg(robot, legs, side) for side in "lr"]
        self._joints, self._mapped_joints = leg_joints(legs), np.concatenate([limb.joints for limb in self._limbs])
        self._law, self._ik, self._foot_speed = law, ik, foot_speed
        self._stand = maker.stand(robot.postures["stand"]).soles_in_base - legs.hip

    def place(self, q: Array, feet: Array, footing: Footing) -> Pose:
        """The stand of frame 0; see ``Planted.place``."""
        return self._begin(self._planted.place(q, feet, footing))

    def stand(self, q: Array) -> Pose:
        """See ``Planted.stand``."""
        return self._begin(self._planted.stand(q))

    def _begin(self, pose: Pose) -> Pose:
        self._fsm, self._landed, self._side, self._share = SupportFsm(), False, 0, 1.0
        self._offset, self._speed = self._planted.offset, 0.0
        self._mapped = pose.q[self._mapped_joints]
        self._between = max(0.0, wrap(heading(pose.sole_rot[0]) - heading(pose.sole_rot[1])))
        half = 0.5 * self._between
        self._apart = FEET_APART - self._inner_edge(0, half) + self._inner_edge(1, -half)
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

    @property
    def settled(self) -> bool:
        """The published machine waits for the offset alone."""
        return True

    def step(self, pose: Pose, q_arms: Array, feet: Array, footing: Footing, reach: Reach) -> Answer:
        """The next pose: mapped feet, the offset of this frame, one foot shifted, both turned to the ground."""
        offset, speed = self._next_offset(pose, footing, reach.dt)
        now = soles_at(self._tree, self._legs, q_arms)
        mapped = self._mapped_soles(q_arms, self._stand + self._share * (feet - self._stand))._replace(com=now.com)
        self._hang_on(self._base_side(mapped, offset), pose)
        q = q_arms.copy()
        iterations = self._solve(q, mapped, offset)
        way = np.linalg.norm(soles_at(self._tree, self._legs, q).centres - now.centres, axis=1).max()
        near = min(1.0, self._foot_speed * reach.dt / max(float(way), 1e-9))
        q = shortened(pose.q, q_arms + near * (q - q_arms), self._joints, reach.low, reach.high)
        taken, part = self._taken(pose, q, (offset, speed), reach.dt)
        flat = self._flat(taken)
        self._landed = self.mode.landing and flat
        good = part == 1.0 and (flat or near < 1.0 or self._single)
        self._share = min(max(self._share + (SHARE_SPEED if good else -SHARE_SPEED) * reach.dt, 0.0), 1.0)
        return Answer(taken, GivenUp.HOLD if part < 0.0 else GivenUp(0), iterations + 2 * self._ik.leg_iterations)

    def _solve(self, q: Array, soles: Soles, offset: float) -> int:
        """Put the soles of q (J,) rad where section V-C wants them; the iterations it took.

        Where a joint's limit keeps them from there, a second solve turns them to the ground where they have come to.
        """
        ik, used = self._ik, 0
        for again in (False, True):
            goal = self._goal(soles, offset, again)
            tolerance = ik.position_tolerance, ik.angle_tolerance
            more, arrived = solve_soles(self._tree, self._legs, goal, q, ik.damping, *tolerance, ik.max_iterations)
            used += more
            if arrived:
                break
            soles = soles_at(self._tree, self._legs, q)
        return used

    def _goal(self, soles: Soles, offset: float, again: bool) -> SoleGoal:
        """Section V-C for soles as they were mapped, or ``again`` for soles that have come as near as they can."""
        if self._single:
            outline = self._legs.outline[1 - self._side] - self._legs.centre[1 - self._side]
            places, normals = swung(*soles, self._side, outline, SWING_CLEARANCE)
            return SoleGoal(places, normals, normals[self._side], self._between)
        centres, com = soles.centres, soles.com
        places = levelled(centres, com, offset, self._side) if again else shifted(centres, com, offset)
        up = up_vector(places[0], places[1], com, offset)
        return SoleGoal(places, np.array([up, up]), up, self._between)

    @property
    def _single(self) -> bool:
        return self.mode is not Mode.DOUBLE and not self.mode.landing

    def _next_offset(self, pose: Pose, footing: Footing, dt: float) -> tuple[float, float]:
        """The support machine takes its transition; the offset o' of this frame and its speed, 1/s (section V-A)."""
        given = SupportInput(
            human=footing.support,
            offset=self._offset,
            landed=self._landed,
            ahead=footing.ahead,
            may_lift=footing.may_lift,
        )
        target = offset_target(self._fsm.step(given), given, footing.offset)
        centres = self._maker.centres(pose.sole_pos, pose.sole_rot)
        span = Span(float(np.linalg.norm(centres[1] - centres[0])), float(pose.com[2]), -np.inf, np.inf)
        return advance(self._offset, self._speed, target, dt, self._law.push(self._offset, target, span))

    def _mapped_soles(self, q_arms: Array, feet: Array) -> Soles:
        """The soles where the posture mapping puts them, feet (2, 3) m from the hips; beside each other, not inside."""
        q = q_arms.copy()
        q[self._mapped_joints] = self._mapped
        for limb, foot in zip(self._limbs, feet, strict=True):
            solve_limb_fixed(self._tree, limb, foot, q, self._ik.damping, self._ik.leg_iterations)
        self._mapped = q[self._mapped_joints]
        soles = soles_at(self._tree, self._legs, q)
        return soles._replace(centres=parted(soles.centres, self._apart + (1.0 - self._share) * SPREAD))

    def _inner_edge(self, foot: int, yaw: float) -> float:
        """y of the inner edge of a sole's bounding box from its centre, m, when the sole is turned by ``yaw`` rad."""
        outline = self._legs.outline[foot] - self._legs.centre[foot]
        low, high = outline.min(axis=0), outline.max(axis=0)
        y = np.sin(yaw) * np.array([low[0], high[0]]) + np.cos(yaw) * (low, high)[foot][1]
        return float(y.min() if foot == 0 else y.max())

    def _base_side(self, soles: Soles, offset: float) -> int:
        """The foot that is not shifted: the right one when o' < o, else the left one; in single support the stance."""
        if self.mode is not Mode.DOUBLE:
            return 0 if self.mode.stance == "L" else 1
        return 1 if offset < offset_in_space(soles.centres[0], soles.centres[1], soles.com) else 0

    def _hang_on(self, side: int, pose: Pose) -> None:
        """From now on the robot hangs on sole ``side``, flat where it is."""
        if side != self._side:
            self._side = side
            self._stance_pos[side] = pose.sole_pos[side] * [1.0, 1.0, 0.0]
            self._stance_rot[side] = yaw_matrix(heading(pose.sole_rot[side]))

    def _taken(self, pose: Pose, q: Array, offset: tuple[float, float], dt: float) -> tuple[Pose, float]:
        """The step to q (J,) rad with all of the legs' step, a part, or none; and the part, -1 where all is refused."""
        stances = (self.mode.stance != "R", self.mode.stance != "L")
        for part in (*SCALES, 0.0):
            q_part = q.copy()
            q_part[self._joints] = (pose.q + part * (q - pose.q))[self._joints]
            into_tables(self._legs, q_part)
            candidate = self._maker.hang(q_part, self._side, self._stance_pos, self._stance_rot)
            if self._gate.passes(candidate, pose, stances, candidate.sole_pos, candidate.sole_rot, dt):
                self._offset += part * (offset[0] - self._offset)
                self._speed = offset[1] if part == 1.0 else 0.0
                return candidate, part
        self._speed = 0.0
        return pose, -1.0

    def _flat(self, pose: Pose) -> bool:
        """Whether the sole on which the robot does not hang lies on the floor as well."""
        other = 1 - self._side
        height, tilt = pose.sole_pos[other, 2], np.linalg.norm(pose.sole_rot[other, 2, :2])
        return bool(abs(height) < TOUCHDOWN and tilt < self._ik.angle_tolerance)
