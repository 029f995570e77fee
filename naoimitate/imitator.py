"""The pipeline at a glance: a person's frame in, a statically stable command for the robot out."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from naoimitate.arms import Arms
from naoimitate.balance.clearance import Clearance, ClearanceSettings
from naoimitate.balance.landing import landing_set
from naoimitate.balance.legs import LegLimits, LegWeights, build_legs, hip_positions
from naoimitate.balance.offset import OffsetLaw, normalised_offset
from naoimitate.balance.pose import Pose
from naoimitate.balance.stabiliser import Footing, Plan, Stabiliser
from naoimitate.balance.swing import SwingSettings
from naoimitate.calib.subject import Subject, calibrate
from naoimitate.core.errors import CalibrationError
from naoimitate.core.frames import GivenUp, HumanFrame, RobotCommand
from naoimitate.core.geometry import heading, quat_from_matrix, wrap, yaw_matrix
from naoimitate.fsm import Mode
from naoimitate.gate import GateLimits, build_gate, outline_travel, range_excess, speed_ratio, support_margin
from naoimitate.human.observer import Observation, Observer
from naoimitate.limb import LimbWeights
from naoimitate.limits import Follower, TaskLimits
from naoimitate.mapping import Mapping, reachable_mapping, virtual_mapping
from naoimitate.robot.model import RobotModel

Array = npt.NDArray[np.float64]

_SCALES = (1.0, 0.5, 0.2)
"""Parts of a step that are tried, in this order, before the pose is held."""
_SETTLE_STEPS = 150
_FEET_ROWS = np.array([1, 3])
_HAND_ROWS = np.array([0, 2])


@dataclass(frozen=True)
class Settings:
    """Everything that can be chosen about an imitation."""

    retarget: str = "planted"
    """``planted``: soles fixed in the world. ``paper``: one foot is shifted. ``direct``: no stabilisation (falls)."""
    hand_orientation: str = "free"
    """``free``, ``upright`` or ``follow`` the person's hands."""
    limits: TaskLimits = field(default_factory=TaskLimits)
    offset: OffsetLaw = field(default_factory=OffsetLaw)
    swing: SwingSettings = field(default_factory=SwingSettings)
    legs: LegLimits = field(default_factory=LegLimits)
    leg_weights: LegWeights = field(default_factory=LegWeights)
    arm_weights: LimbWeights = field(default_factory=LimbWeights)
    clearance: ClearanceSettings = field(default_factory=ClearanceSettings)
    gate: GateLimits = field(default_factory=GateLimits)


class Imitator:
    """One robot that imitates one person, frame by frame."""

    def __init__(self, robot: RobotModel, settings: Settings | None = None) -> None:
        self.robot = robot
        self.settings = settings or Settings()
        s = self.settings
        self._legs = build_legs(robot, s.legs)
        self._gate = build_gate(robot)
        self._arms = Arms(robot, s.arm_weights, s.legs.range_reserve, s.hand_orientation)
        self._hips = hip_positions(robot)
        self._stabiliser = Stabiliser(robot, self._legs, landing_set(robot), s.leg_weights, s.offset, s.swing)
        self._clearance = Clearance(robot, s.clearance)
        self._subject: Subject | None = None
        self._pose: Pose | None = None

    def calibrate(self, frame: HumanFrame) -> Subject:
        """Measure a person who stands in a T-pose; raises CalibrationError where the frame cannot serve."""
        subject = calibrate(frame)
        self.use(subject)
        return subject

    def use(self, subject: Subject) -> None:
        """Imitate a person who was measured before."""
        self._subject = subject
        make = reachable_mapping if self.settings.retarget == "paper" else virtual_mapping
        self.mapping: Mapping = make(self.robot, subject.body, subject.reference)
        self._observer = Observer(subject.body, subject.tpose)
        self._pose = None
        self._time, self._last_time = 0.0, math.nan
        self._human_offset = 0.5
        still = np.zeros((2, 3))
        limits = self.settings.limits
        self._hands = Follower(still, limits.hand_speed, limits.hand_acceleration)
        self._feet = Follower(still, limits.foot_speed, limits.foot_acceleration)

    def step(self, frame: HumanFrame, dt: float | None = None, *, support: str | None = None, ahead: str = "", may_lift: bool = True) -> RobotCommand:
        """Imitate one frame, dt s (default: the difference of frame times) after the last one.

        The first call places the robot in the double support nearest to the frame. support: the person's mode where
        something better than ``frame.support`` is known. ahead, may_lift: see ``SupportInput``.
        """
        if self._subject is None:
            raise CalibrationError("calibrate(frame) with a T-pose, or use(subject), before the first step")
        seen = self._observer.see(frame, support or frame.support or "D")
        targets = self.mapping.targets(seen.body.posture)
        footing = self._footing(seen, targets, ahead, may_lift)
        if self._pose is None:
            given_up, iterations = self._start(seen, targets, footing), _SETTLE_STEPS
        else:
            elapsed = frame.time - self._last_time if dt is None else dt
            elapsed = min(max(elapsed, 1e-4), self.settings.limits.max_dt)
            self._time += elapsed
            given_up, iterations = self._advance(seen, targets, footing, elapsed)
        self._last_time = frame.time
        return self._command(seen, footing, given_up, iterations)

    @property
    def mode(self) -> Mode:
        """The robot's support mode."""
        return self._stabiliser.mode

    @property
    def offset(self) -> float:
        """The robot's normalised CoM offset, 0 left foot to 1 right foot."""
        return self._stabiliser.offset

    @property
    def lag(self) -> float:
        """How far (m) the hands and a swing foot are behind their targets at their speed limits."""
        behind = [self._hands.behind]
        if self.mode is not Mode.DOUBLE:
            behind.append(self._feet.behind[1 - self._stabiliser.base_side :][:1])
        return float(np.max(np.concatenate(behind)))

    # -- one frame ------------------------------------------------------------------------------------------------

    def _advance(self, seen: Observation, targets: Array, footing: Footing, dt: float) -> tuple[GivenUp, int]:
        """Move from the present pose towards the targets as far as limits and balance allow; else hold it."""
        pose, stabiliser = self._pose, self._stabiliser
        assert pose is not None
        reach = self.robot.speed * (self.settings.limits.joint_share * dt)
        low, high = pose.q - reach, pose.q + reach
        plan = stabiliser.plan(pose, footing, dt)
        hands = self._hands.step(targets[_HAND_ROWS], dt)
        feet = self._feet.step(targets[_FEET_ROWS], dt)
        self._clearance.look(pose)
        nearest = self._clearance.nearest
        q_arms, iterations = self._arms.solve(pose, hands, seen, low, high, self._clearance)
        self._arms.head(q_arms, seen.head, self.settings.limits.head_speed * dt, low, high)
        for scale in _SCALES:
            q = pose.q + scale * (q_arms - pose.q)
            moved = stabiliser.pose(q)
            self._clearance.look(moved)
            rows = self._clearance.leg_rows(moved, self._legs, stabiliser.base_side)
            done, closed = stabiliser.solve(q, plan, pose, feet, scale, (low, high), *rows)
            iterations += done
            candidate = stabiliser.pose(q)
            if closed and self._safe(candidate, pose, nearest, dt):
                stabiliser.accept(plan, scale)
                self._pose = candidate
                if scale < 1.0:
                    self._restart_tasks()
                return self._reasons(seen, targets, footing, plan), iterations
        stabiliser.hold(pose)
        self._restart_tasks()
        return self._reasons(seen, targets, footing, plan) | GivenUp.HOLD, iterations

    def _safe(self, pose: Pose, before: Pose, nearest: float, dt: float) -> bool:
        """The gate: ranges, speeds, planted soles, clearance (``nearest`` before the step), margin."""
        limits, s = self.settings.gate, self._stabiliser
        if range_excess(self._gate, pose.q) > 0.0 or speed_ratio(self._gate, pose.q, before.q, dt) > limits.speed_share:
            return False
        left, right = s.mode.stance != "R", s.mode.stance != "L"
        for side, carries in ((0, left), (1, right)):
            if carries and outline_travel(
                self._legs, side, pose.sole_pos[side], pose.sole_rot[side], s.planted_pos[side], s.planted_rot[side]
            ) > limits.slip:
                return False
        self._clearance.look(pose)
        if self._clearance.nearest < min(nearest, -limits.overlap):
            return False
        margin = support_margin(self._legs, pose.sole_pos, pose.sole_rot, left, right, pose.com)
        if margin < limits.margin:
            return bool(margin >= support_margin(self._legs, before.sole_pos, before.sole_rot, left, right, before.com))
        return True

    def _restart_tasks(self) -> None:
        assert self._pose is not None
        posture = self._arms.hands(self._pose)
        self._hands.restart(posture)
        rotation = self._pose.base_rot
        soles = (self._pose.sole_pos - self._pose.base_pos) @ rotation
        self._feet.restart(soles - self._hips)

    # -- start ----------------------------------------------------------------------------------------------------

    def _start(self, seen: Observation, targets: Array, footing: Footing) -> GivenUp:
        """Frame 0: the double-support stand nearest to the person's posture, found without speed limits."""
        s = self._stabiliser
        self._arms.reset()
        q = self.robot.postures["stand"].copy()
        s.fsm.mode, s.base_side = Mode.DOUBLE, 1
        s.plant(np.zeros((2, 3)), np.stack([np.eye(3), np.eye(3)]))
        pose = s.pose(q)
        s.plant(pose.sole_pos * [1.0, 1.0, 0.0], np.stack([np.eye(3), np.eye(3)]))
        pose = s.pose(q)
        start_pos, place = pose.sole_pos.copy(), s.landing.clip(0, *footing.landing[0])
        s.offset = {"L": 0.0, "R": 1.0}.get(footing.support, min(max(footing.offset, 0.0), 1.0))
        goal = np.array([pose.sole_pos[1, 0] + place[0][0], pose.sole_pos[1, 1] + place[0][1], 0.0])
        steady = replace(footing, support="D", offset=s.offset, ahead="")
        for k in range(_SETTLE_STEPS):
            part = min(1.0, 2.0 * (k + 1) / _SETTLE_STEPS)
            s.planted_pos[0] = start_pos[0] + part * (goal - start_pos[0])
            s.planted_rot[0] = yaw_matrix(part * place[1])
            low, high = pose.q - 0.1, pose.q + 0.1
            self._clearance.look(pose)
            q, _ = self._arms.solve(pose, targets[_HAND_ROWS], seen, low, high, self._clearance)
            self._arms.head(q, seen.head, 0.1, low, high)
            plan = Plan(s.offset, 0.0, s.planted_pos[0], s.planted_rot[0], 0, 0.0, False, False)
            _, closed = s.solve(q, plan, pose, targets[_FEET_ROWS], 1.0, (low, high), *self._clearance.leg_rows(pose, self._legs, s.base_side))
            if closed:
                pose = s.pose(q)
        self._centre(pose)
        self._pose = s.pose(pose.q)
        self._time = 0.0
        self._restart_tasks()
        return self._reasons(seen, targets, steady, plan)

    def _centre(self, pose: Pose) -> None:
        """Move the world so that the robot starts between its feet at the origin, facing +x."""
        s = self._stabiliser
        yaw = heading(pose.sole_rot[1]) + 0.5 * wrap(heading(pose.sole_rot[0]) - heading(pose.sole_rot[1]))
        R = yaw_matrix(-yaw)
        middle = pose.sole_pos.mean(axis=0)
        s.plant((s.planted_pos - middle) @ R.T * [1.0, 1.0, 0.0], np.stack([R @ s.planted_rot[0], R @ s.planted_rot[1]]))

    # -- what the person's feet ask for -----------------------------------------------------------------------------

    def _footing(self, seen: Observation, targets: Array, ahead: str, may_lift: bool) -> Footing:
        centres = seen.body.foot_centres
        self._human_offset = normalised_offset(
            seen.com, centres[0], centres[1], self._human_offset, self.settings.offset.min_feet_distance
        )
        places = (self._landing_wish(seen, targets, 0), self._landing_wish(seen, targets, 1))
        return Footing(seen.support, self._human_offset, places, ahead, may_lift)

    def _landing_wish(self, seen: Observation, targets: Array, swing: int) -> tuple[Array, float]:
        """Where the person's swing foot is, in the stance sole's frame, at the robot's scale: (2,) m and yaw, rad."""
        stance = 1 - swing
        between = targets[_FEET_ROWS[swing]] - targets[_FEET_ROWS[stance]] + self._hips[swing] - self._hips[stance]
        yaw = heading(seen.body.feet[stance])
        world = seen.body.torso @ between
        return (yaw_matrix(-yaw) @ world)[:2], wrap(heading(seen.body.feet[swing]) - yaw)

    # -- what comes out ---------------------------------------------------------------------------------------------

    def _reasons(self, seen: Observation, targets: Array, footing: Footing, plan: Plan) -> GivenUp:
        reasons = GivenUp(0) if seen.complete else GivenUp.INPUT
        if footing.support not in (self._stabiliser.mode.stance,) or self._stabiliser.mode.landing:
            reasons |= GivenUp.SUPPORT
        if plan.clipped:
            reasons |= GivenUp.LANDING
        return reasons

    def _command(self, seen: Observation, footing: Footing, given_up: GivenUp, iterations: int) -> RobotCommand:
        pose = self._pose
        assert pose is not None
        return RobotCommand(
            time=self._time,
            q=pose.q.copy(),
            base_pos=pose.base_pos.copy(),
            base_quat=quat_from_matrix(pose.base_rot),
            support=self._stabiliser.mode.stance,
            offset=min(max(self._stabiliser.measured_offset(pose), 0.0), 1.0),
            com=pose.com.copy(),
            soles=pose.sole_pos.copy(),
            posture=seen.body.posture,
            human_support=seen.support,
            human_offset=footing.offset,
            hand_opening=seen.opening,
            given_up=given_up,
            ik_iterations=iterations,
        )
