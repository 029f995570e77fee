"""The pipeline at a glance: a person's frame in, a statically stable command for the robot out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from naoimitate.arms import Arms
from naoimitate.balance.clearance import Clearance
from naoimitate.balance.direct import Direct
from naoimitate.balance.landing import landing_set
from naoimitate.balance.legs import Legs, build_legs, hip_positions
from naoimitate.balance.offset import normalised_offset
from naoimitate.balance.paper import PaperFeet, PaperIk
from naoimitate.balance.planted import Planted
from naoimitate.balance.pose import Pose, PoseMaker
from naoimitate.balance.retarget import Footing, Reach, Retargeting
from naoimitate.balance.stride import Stride
from naoimitate.blend import Blend
from naoimitate.calib.subject import Subject, calibrate
from naoimitate.core.errors import CalibrationError
from naoimitate.core.frames import GivenUp, HumanFrame, RobotCommand
from naoimitate.core.geometry import heading, lengths, quat_from_matrix
from naoimitate.fsm import Mode
from naoimitate.gate import Gate
from naoimitate.gaze import build_gaze
from naoimitate.human.observer import Observation, Observer
from naoimitate.limits import Follower, limited_step, reachable_angles
from naoimitate.mapping import Mapping, reachable_mapping, virtual_mapping
from naoimitate.robot.model import RobotModel
from naoimitate.settings import Settings

Array = npt.NDArray[np.float64]

HANDS, FEET = np.array([0, 2]), np.array([1, 3])
"""Rows of a posture (1)."""
FARTHEST = 1.5
"""Limb lengths from its root beyond which the target of a hand or foot is an error of the source."""
SETTLE_STEPS = 60
NOTICEABLE = 0.005
"""[m] by which a hand or foot must miss its target to count as given up."""


class Imitator:
    """One robot that imitates one person, frame by frame."""

    def __init__(self, robot: RobotModel, settings: Settings | None = None) -> None:
        self.robot, self.settings = robot, settings or Settings()
        s = self.settings
        self.upper_body = s.upper_body
        """Whether the robot stands and imitates arms and head only; may be changed between steps."""
        legs = self._legs = build_legs(robot, s.legs)
        self._clearance = Clearance(robot, s.clearance)
        self._maker = PoseMaker(robot, legs)
        self._hips = hip_positions(robot)
        self._farthest = FARTHEST * np.array([robot.limb_length[limb] for limb in ("l_arm", "l_leg", "r_arm", "r_leg")])
        gaze = build_gaze(robot, s.head, s.legs.range_reserve)
        self._arms = Arms(robot, s.arm_weights, s.legs.range_reserve, s.hand_orientation, s.paper_ik, gaze)
        self._retargeting = self._build_retargeting(legs)
        self._subject: Subject | None = None
        self._standing = self._maker.stand(robot.postures["stand"].copy()).soles_in_base - self._hips
        self._pose: Pose | None = None
        self._blend: Blend | None = None
        self._acceleration = np.where(legs.variable >= 0, s.limits.leg_acceleration, s.limits.arm_acceleration)
        self._hurried: Array = np.zeros(2)
        self._unreached: Array = np.full(2, np.inf)

    def _build_retargeting(self, legs: Legs) -> Retargeting:
        robot, s, maker = self.robot, self.settings, self._maker
        gate = self._gate = Gate(robot, legs, self._clearance, s.gate)
        stride = Stride(maker, landing_set(robot), s.offset, s.swing)
        planted = Planted(robot, legs, maker, stride, s.leg_weights, self._clearance, gate)
        ik = s.paper_ik or PaperIk()
        if s.retarget == "paper":
            return PaperFeet(robot, legs, maker, planted, gate, s.offset, ik, s.limits.foot_speed)
        return Direct(robot, legs, maker, planted, ik) if s.retarget == "direct" else planted

    def calibrate(self, frame: HumanFrame) -> Subject:
        """Measure a person who stands in a T-pose; raises CalibrationError where the frame cannot serve."""
        subject = calibrate(frame)
        self.use(subject)
        return subject

    def use(self, subject: Subject) -> None:
        """Imitate a person who was measured before; the next step starts from a stand."""
        self.turn_to(subject)
        self._pose, self._blend = None, None
        limits, still = self.settings.limits, np.zeros((2, 3))
        self._hands = Follower(still, limits.hand_speed, limits.hand_acceleration)
        self._feet = Follower(still, limits.foot_speed, limits.foot_acceleration)
        self._time, self._last_time, self._human_offset = 0.0, math.nan, 0.5

    def turn_to(self, subject: Subject) -> None:
        """Imitate another person from the next step on, from where the robot is."""
        make = reachable_mapping if self.settings.reference == "reachable" else virtual_mapping
        self.mapping: Mapping = make(self.robot, subject.body, subject.reference)
        self._subject = subject
        self._observer = Observer(subject.body, subject.tpose, self.settings.hand_orientation == "follow")

    def stand(self) -> None:
        """Start from the robot's posture ``stand``, for a robot that stands there; call after ``use``."""
        self._arms.reset()
        self._pose = self._retargeting.stand(self.robot.postures["stand"].copy())
        self._stand_still()

    def blend(self, duration: float) -> None:
        """Go over to the person's posture within ``duration`` s from where the robot is; feet stay down meanwhile."""
        if self._pose is not None:
            feet, hands = self._pose.soles_in_base - self._hips, self._arms.hands(self._pose)
            here = np.array([hands[0], feet[0], hands[1], feet[1]])
            self._blend = Blend(here, self._maker.offset(self._pose, self.offset), duration)

    @property
    def blending(self) -> bool:
        """Whether a blend is under way."""
        return self._blend is not None

    def step(
        self,
        frame: HumanFrame,
        dt: float | None = None,
        *,
        support: str | None = None,
        ahead: str = "",
        may_lift: bool = True,
    ) -> RobotCommand:
        """Imitate one frame, dt s (default: the difference of frame times) after the last one.

        The first call places the robot in the double support nearest to the frame. support: the person's mode where
        something better than ``frame.support`` is known. ahead, may_lift: see ``fsm.SupportInput``.
        Raises CalibrationError before ``calibrate`` or ``use``.
        """
        if self._subject is None:
            raise CalibrationError("calibrate(frame) with a T-pose, or use(subject), before the first step")
        seen = self._observer.see(frame, support)
        targets = self._within_reach(self.mapping.targets(seen.body.posture))
        footing = self._footing(seen, targets, ahead, may_lift)
        if self.upper_body:
            targets[FEET] = self._standing
            footing = replace(footing, support="D", offset=0.5, ahead="")
        if self._blend is not None:
            targets, footing = self._blended(self._blend, targets, footing)
        if self._pose is None:
            given_up, iterations = self._start(seen, targets, footing), 0
        else:
            elapsed = frame.time - self._last_time if dt is None else dt
            elapsed = min(self.settings.limits.max_dt, max(self.settings.limits.min_dt, elapsed))
            self._time += elapsed
            if self._blend is not None:
                self._blend.advance(elapsed)
            given_up, iterations = self._advance(self._pose, seen, targets, footing, elapsed)
        self._last_time = frame.time
        return self._command(seen, footing, given_up, iterations)

    def hold(self, frame: HumanFrame, dt: float) -> RobotCommand:
        """Stay where it is for dt s, whatever the person does: for a robot that is at rest, after ``stand`` or steps.

        Raises CalibrationError where there is no pose yet.
        """
        if self._subject is None or self._pose is None:
            raise CalibrationError("use(subject), then stand() or a step, before there is a pose to hold")
        seen = self._observer.see(frame, None)
        footing = self._footing(seen, self._within_reach(self.mapping.targets(seen.body.posture)), "", may_lift=False)
        self._time += min(self.settings.limits.max_dt, max(self.settings.limits.min_dt, dt))
        self._last_time = frame.time
        self._stand_still()
        return self._command(seen, footing, GivenUp.HOLD, 0)

    def _blended(self, blend: Blend, targets: Array, footing: Footing) -> tuple[Array, Footing]:
        """What is asked for while the robot blends in: no foot is lifted before it is over."""
        if blend.done:
            self._blend = None
            return targets, footing
        targets, offset = blend.mix(targets, footing.offset)
        support = footing.support if footing.support == self.mode.stance else "D"
        return targets, replace(footing, support=support, offset=offset)

    def _within_reach(self, targets: Array) -> Array:
        """Targets (4, 3) m, those brought back that are too far off to be meant: the solvers work with short ways."""
        far = lengths(targets) / self._farthest
        return targets if far.max() <= 1.0 else np.asarray(targets / np.maximum(far, 1.0)[:, None])

    def _advance(
        self, pose: Pose, seen: Observation, targets: Array, footing: Footing, dt: float
    ) -> tuple[GivenUp, int]:
        """One frame: limited targets, arms and head, then the legs under them."""
        reach = self._reach(pose, dt)
        hands = self._hands.step(targets[HANDS], dt)
        feet = self._feet_step(pose, targets, dt)
        self._clearance.look(pose)
        q, arm_iterations = self._arms.solve(pose, hands, seen, reach, self._clearance)
        self._arms.head(q, seen.head, self.settings.limits.head_speed * dt, reach.low, reach.high)
        hurried = [self._arms.hurried(side, q, reach) for side in (0, 1)]
        answer = self._retargeting.step(pose, q, feet, footing, reach)
        missed = lengths(hands - self._arms.hands(answer.pose))
        self._unreached = np.where(hurried, np.minimum(self._unreached, missed), missed)
        self._hurried = missed - self._unreached
        self._pose = answer.pose
        self._feet_velocity = (answer.pose.soles_in_base - pose.soles_in_base) / dt
        self._velocity = (answer.pose.q - pose.q) / dt
        if GivenUp.HOLD in answer.given_up:
            self._stand_still()
        return answer.given_up | self._missed(answer.pose, seen, targets, footing), arm_iterations + answer.iterations

    def _reach(self, pose: Pose, dt: float) -> Reach:
        """The joint angles that a frame of dt s allows after a pose: by speed, by acceleration with room to stop."""
        legs, share = self._legs, self.settings.limits.joint_share
        return Reach(
            dt,
            *reachable_angles(
                pose.q, self._velocity, legs.lower, legs.upper, self.robot.speed * share, self._acceleration, dt
            ),
        )

    def _feet_step(self, pose: Pose, targets: Array, dt: float) -> Array:
        """Where to ask the feet to be next, hip to sole in the torso frame (2, 3) m: limited from where they are.

        The published mapping goes on from its own last answer: from shifted feet, shifts would add up.
        """
        if self.settings.retarget != "planted":
            return self._feet.step(targets[FEET], dt)
        limits, here = self.settings.limits, pose.soles_in_base - self._hips
        if self.mode is Mode.DOUBLE:
            self._feet.restart(here)
        wanted = targets[FEET] if self.mode is Mode.DOUBLE else self._feet.step(targets[FEET], dt)
        return np.asarray(
            limited_step(here, self._feet_velocity, wanted, dt, limits.foot_speed, limits.foot_acceleration)
        )

    def _start(self, seen: Observation, targets: Array, footing: Footing) -> GivenUp:
        """Frame 0: the double-support stand nearest to the person's posture, found without speed limits.

        Where that is no safe stand, because the person is none, the robot's own.
        """
        self._arms.reset()
        standing, held = self._maker.stand(self.robot.postures["stand"].copy()), GivenUp(0)
        q = self._arms.settle(standing, targets[HANDS], seen, self._clearance, SETTLE_STEPS)
        pose = self._retargeting.place(q, targets[FEET], footing)
        if not self._gate.safe(pose):
            soles, held = standing.soles_in_base, GivenUp.HOLD
            calm = replace(
                footing, support="D", offset=0.5, between=soles[1] - soles[0], torso=np.eye(3), headings=(0.0, 0.0)
            )
            pose = self._retargeting.place(standing.q, soles - self._hips, calm)
        self._pose = pose
        self._time = 0.0
        self._stand_still()
        return held | self._missed(pose, seen, targets, footing)

    def _stand_still(self) -> None:
        """Hands and feet start again from where they are."""
        assert self._pose is not None
        self._hands.restart(self._arms.hands(self._pose))
        self._feet.restart(self._pose.soles_in_base - self._hips)
        self._hurried, self._unreached = np.zeros(2), np.full(2, np.inf)
        self._feet_velocity, self._velocity = np.zeros((2, 3)), np.zeros(len(self.robot.joint_names))

    def _footing(self, seen: Observation, targets: Array, ahead: str, may_lift: bool) -> Footing:
        """What the person's feet ask for: support, offset (6), and where a swing foot would land."""
        left, right = seen.body.foot_centres
        closest = self.settings.offset.min_feet_distance
        self._human_offset = normalised_offset(seen.com, left, right, self._human_offset, closest)
        between = targets[FEET[1]] - targets[FEET[0]] + self._hips[1] - self._hips[0]
        yaws = (heading(seen.body.feet[0]), heading(seen.body.feet[1]))
        return Footing(seen.support, self._human_offset, between, seen.body.torso, yaws, ahead, may_lift)

    def _missed(self, pose: Pose, seen: Observation, targets: Array, footing: Footing) -> GivenUp:
        """What the pose gave up against the person's posture, and for what."""
        missed = GivenUp(0) if seen.complete else GivenUp.INPUT
        if footing.support != self.mode.stance:
            missed |= GivenUp.SUPPORT
        hands = lengths(targets[HANDS] - self._arms.hands(pose))
        feet = lengths(targets[FEET] - pose.soles_in_base + self._hips)
        for side in (0, 1):
            if hands[side] > NOTICEABLE:
                near = self._arms.touches(side, self._clearance)
                missed |= (
                    GivenUp.SPEED
                    if self._hands.behind[side] > NOTICEABLE
                    else GivenUp.COLLISION
                    if near
                    else GivenUp.REACH
                )
            if feet[side] > NOTICEABLE:
                swings = self.mode.stance not in ("D", "LR"[side])
                missed |= GivenUp.SPEED if swings and self._feet.behind[side] > NOTICEABLE else GivenUp.BALANCE
        return missed

    @property
    def mode(self) -> Mode:
        """The robot's support mode."""
        return self._retargeting.mode

    @property
    def offset(self) -> float:
        """The robot's normalised CoM offset, 0 left foot to 1 right foot."""
        return self._retargeting.offset

    @property
    def settled(self) -> bool:
        """Whether a foot could be lifted now and nothing would sway: the CoM has come to rest over the other one."""
        return self._retargeting.settled

    @property
    def lag(self) -> float:
        """How far (m) the hands and a swing foot are behind their targets at their speed limits."""
        feet = self._feet.behind[[self.mode.stance == "R", self.mode.stance == "L"]]
        return float(max(self._hands.behind.max(), self._hurried.max(), feet.max(initial=0.0)))

    def _command(self, seen: Observation, footing: Footing, given_up: GivenUp, iterations: int) -> RobotCommand:
        pose = self._pose
        assert pose is not None
        return RobotCommand(
            time=self._time,
            q=pose.q.copy(),
            base_pos=pose.base_pos.copy(),
            base_quat=quat_from_matrix(pose.base_rot),
            support=self.mode.stance,
            offset=min(max(self._maker.offset(pose, self.offset), 0.0), 1.0),
            com=pose.com.copy(),
            soles=pose.sole_pos.copy(),
            posture=seen.body.posture,
            human_support=seen.support,
            human_offset=footing.offset,
            hand_opening=seen.opening,
            given_up=given_up,
            ik_iterations=iterations,
        )
