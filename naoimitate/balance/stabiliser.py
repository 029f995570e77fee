"""Posture stabilisation (Koenemann 2014, section V): support mode, offset and planted feet, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from naoimitate.balance.landing import LandingSet
from naoimitate.balance.legs import (
    FREE,
    POSE,
    LegGoal,
    Legs,
    LegWeights,
    Stance,
    base_pose,
    solve_legs,
)
from naoimitate.balance.pose import Pose
from naoimitate.balance.offset import OffsetLaw, advance, normalised_offset
from naoimitate.balance.swing import Swing, SwingSettings
from naoimitate.core.geometry import heading, matrix_from_rotation_vector, rotation_vector, wrap, yaw_matrix
from naoimitate.fsm import Mode, SupportFsm, SupportInput, offset_target
from naoimitate.robot.kernel import center_of_mass, forward
from naoimitate.robot.model import RobotModel

Array = npt.NDArray[np.float64]

CLOSED = 2e-5
"""Sum of m and rad by which a planted sole may differ from where it stands after a solve."""


@dataclass(frozen=True)
class Plan:
    """What one frame asks of the legs.

    offset, offset_speed: the normalised offset to reach and its speed, 1/s. sole_pos, sole_rot: the other sole's pose.
    kind, min_height: as in ``Stance``. touchdown: the step ends with the foot on the floor. clipped: the landing place
    is not the human's.
    """

    offset: float
    offset_speed: float
    sole_pos: Array
    sole_rot: Array
    kind: int
    min_height: float
    touchdown: bool
    clipped: bool


@dataclass(frozen=True)
class Footing:
    """What the human's feet ask for.

    support: ``D``, ``L``, ``R`` or ``F``. offset: the human's, (6). ahead, may_lift: as in ``SupportInput``.
    landing: for a left and a right swing foot, its wished position (2,) m and yaw (rad) in the stance sole's frame.
    """

    support: str
    offset: float
    landing: tuple[tuple[Array, float], tuple[Array, float]]
    ahead: str = ""
    may_lift: bool = True


class Stabiliser:
    """The support machine, the offset and the swing foot around the leg solver."""

    def __init__(
        self, robot: RobotModel, legs: Legs, landing: LandingSet, weights: LegWeights, law: OffsetLaw, swing: SwingSettings
    ) -> None:
        self.robot, self.legs, self.landing, self.weights, self.law = robot, legs, landing, weights, law
        self.fsm = SupportFsm()
        self.offset, self.offset_speed = 0.5, 0.0
        self.planted_pos, self.planted_rot = np.zeros((2, 3)), np.stack([np.eye(3), np.eye(3)])
        self.base_side = 0
        self._swing_settings = swing
        self._swing: Swing | None = None
        self._landed = False

    @property
    def mode(self) -> Mode:
        """The robot's support mode."""
        return self.fsm.mode

    def pose(self, q: Array) -> Pose:
        """Forward kinematics of joint angles, hung on the present stance sole."""
        n = len(q)
        link_pos, link_rot = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
        forward(self.robot.tree, q, link_pos, link_rot)
        R, p, com = np.empty((3, 3)), np.empty(3), np.empty(3)
        stance = Stance(self.base_side, self.planted_pos, self.planted_rot, POSE, 0.0)
        base_pose(self.robot.tree, self.legs, stance, link_pos, link_rot, R, p)
        center_of_mass(self.robot.tree, link_pos, link_rot, com)
        rows = self.legs.sole_joint + 1
        sole_rot = R @ link_rot[rows]
        soles = link_pos[rows] + np.einsum("kij,kj->ki", link_rot[rows], self.legs.sole_point)
        return Pose(q, R, p, p + R @ com, p + soles @ R.T, sole_rot, link_pos, link_rot)

    def centres(self, sole_pos: Array, sole_rot: Array) -> Array:
        """Centroids of the sole outlines in the world, (2, 3) m: the foot centres of (6)."""
        c = self.legs.centre
        return np.asarray(sole_pos + sole_rot[:, :, 0] * c[:, :1] + sole_rot[:, :, 1] * c[:, 1:])

    def measured_offset(self, pose: Pose) -> float:
        """Equation (6) for the robot as it stands."""
        left, right = self.centres(pose.sole_pos, pose.sole_rot)
        return normalised_offset(pose.com, left, right, self.offset, self.law.min_feet_distance)

    def plant(self, position: Array, rotation: Array) -> None:
        """Declare both soles planted at poses (2, 3) m, (2, 3, 3) in the world."""
        self.planted_pos, self.planted_rot = position.copy(), rotation.copy()

    def plan(self, pose: Pose, footing: Footing, dt: float) -> Plan:
        """Advance the support machine, the offset and the swing foot by dt s from the present pose."""
        before = self.fsm.mode
        given = SupportInput(
            human=footing.support,
            offset=self.offset,
            landed=self._landed,
            stance_ok=self._stance_ok() if before is Mode.DOUBLE else (True, True),
            ahead=footing.ahead,
            may_lift=footing.may_lift,
        )
        mode = self.fsm.step(given)
        if mode is not before:
            self._changed(before, mode, pose)
        target = offset_target(mode, given, footing.offset)
        left, right = self.centres(self.planted_pos, self.planted_rot)
        distance = float(np.hypot(*(right - left)[:2])) if mode is Mode.DOUBLE else 0.1
        acceleration = self.law.acceleration(distance, float(pose.com[2]))
        offset, speed = advance(self.offset, self.offset_speed, target, dt, self.law, acceleration)
        if mode is Mode.DOUBLE or self._swing is None:
            other = 1 - self.base_side
            return Plan(offset, speed, self.planted_pos[other], self.planted_rot[other], POSE, 0.0, False, False)
        return self._swing_plan(pose, footing, offset, speed, dt)

    def _swing_plan(self, pose: Pose, footing: Footing, offset: float, speed: float, dt: float) -> Plan:
        assert self._swing is not None
        swing = 1 - self.base_side
        stance_yaw = heading(self.planted_rot[self.base_side])
        wish, yaw = footing.landing[swing]
        place, turn, clipped = self.landing.clip(swing, wish, yaw)
        goal = self.planted_pos[self.base_side][:2] + yaw_matrix(stance_yaw)[:2, :2] @ place
        position, rotation, down = self._swing.step(
            pose.sole_pos[swing], pose.sole_rot[swing], goal, stance_yaw + turn, self.mode.landing, dt
        )
        kind = POSE if self._swing.fixed_pose else FREE
        lowest = self._swing.min_height
        return Plan(offset, speed, position, rotation, kind, lowest, down, clipped and self.mode.landing)

    def solve(self, q: Array, plan: Plan, pose: Pose, feet: Array, scale: float, limits: tuple[Array, Array], rows: Array, bounds: Array) -> tuple[int, bool]:
        """Move the legs of q (J,) rad to a plan, or ``scale`` of the way there from the present pose.

        feet: (2, 3) m, targets (5) of the soles from the hips. Returns (iterations, whether the other sole is where
        it was asked to be).
        """
        side, other = self.base_side, 1 - self.base_side
        pos, rot = self.planted_pos.copy(), self.planted_rot.copy()
        pos[other], rot[other] = plan.sole_pos, plan.sole_rot
        if plan.kind == POSE and scale < 1.0:
            start, turn = pose.sole_pos[other], rotation_vector(plan.sole_rot @ pose.sole_rot[other].T)
            pos[other] = start + scale * (plan.sole_pos - start)
            rot[other] = matrix_from_rotation_vector(scale * turn) @ pose.sole_rot[other]
        lowest = plan.min_height if scale == 1.0 else min(plan.min_height, 0.0)
        offset = self.offset + scale * (plan.offset - self.offset)
        foot_weight = np.ones(2)
        weights = self.weights
        if plan.kind == POSE and self.mode is not Mode.DOUBLE:
            foot_weight[other] = 0.0
        if plan.kind == FREE:
            height = max(pose.sole_pos[other][2], 0.0)
            weights = weights._replace(level=weights.level * (1.0 + 4.0 * max(0.0, 1.0 - height / 0.05)))
        goal = LegGoal(feet, self._com_goal(pose, offset), foot_weight)
        stance = Stance(side, pos, rot, plan.kind, lowest)
        done, closure, _ = solve_legs(self.robot.tree, self.legs, weights, stance, goal, q, *limits, rows, bounds)
        return done, plan.kind == FREE or closure < CLOSED

    def _com_goal(self, pose: Pose, offset: float) -> Array:
        left, right = self.centres(self.planted_pos, self.planted_rot)
        if self.mode is not Mode.DOUBLE:
            centre = left if self.base_side == 0 else right
            return centre[:2].copy()
        return np.asarray((left + offset * (right - left))[:2])

    def accept(self, plan: Plan, scale: float) -> None:
        """The pose that ``solve`` found was taken."""
        self.offset += scale * (plan.offset - self.offset)
        self.offset_speed = plan.offset_speed if scale == 1.0 else 0.0
        if plan.touchdown and scale == 1.0:
            other = 1 - self.base_side
            self.planted_pos[other], self.planted_rot[other] = plan.sole_pos, plan.sole_rot
            self._landed = True

    def hold(self, pose: Pose) -> None:
        """The pose stays as it was: offset and swing start again from rest."""
        self.offset_speed = 0.0
        if self._swing is not None:
            self._swing.stop()

    def _changed(self, before: Mode, mode: Mode, pose: Pose) -> None:
        if mode is Mode.DOUBLE:
            self._swing, self._landed = None, False
        elif before is Mode.DOUBLE:
            self.base_side = 0 if mode.stance == "L" else 1
            other = 1 - self.base_side
            self._swing = Swing(self.planted_pos[other], self.planted_rot[other], self._swing_settings)
            self._landed = False

    def _stance_ok(self) -> tuple[bool, bool]:
        """Whether the CoM can come over the left and the right foot with the soles where they are."""
        yaw = heading(self.planted_rot[1])
        relative = yaw_matrix(-yaw)[:2, :2] @ (self.planted_pos[0] - self.planted_pos[1])[:2]
        good = self.landing.contains(0, relative, wrap(heading(self.planted_rot[0]) - yaw))
        return (True, True) if good else (self.offset < 0.5, self.offset >= 0.5)
