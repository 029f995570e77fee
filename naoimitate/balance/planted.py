"""Retargeting on planted soles: the default (section V-C on feet that do not slide)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from naoimitate.balance.clearance import Clearance
from naoimitate.balance.leg_solver import solve_legs
from naoimitate.balance.legs import FREE, POSE, REACH, Legs, LegWeights, Stance, free_goal
from naoimitate.balance.pose import Pose, PoseMaker
from naoimitate.balance.range_end import time_to_end
from naoimitate.balance.retarget import Answer, Footing, Reach
from naoimitate.balance.stride import Plan, Stride
from naoimitate.balance.sway import Sway
from naoimitate.balance.weight import Body
from naoimitate.core.frames import GivenUp
from naoimitate.core.geometry import (
    heading,
    matrix_from_rotation_vector,
    rotation_vector,
    wrap,
    yaw_matrix,
)
from naoimitate.fsm import Mode
from naoimitate.gate import Gate
from naoimitate.robot.model import RobotModel

Array = npt.NDArray[np.float64]

SCALES = (1.0, 0.5, 0.2)
"""Parts of a step that are tried, in this order, before the pose is held."""
CLOSED = 2e-5
"""Sum of m and rad by which a sole may differ from where it must be after a solve."""
PLACE_STEPS = 150
PLACE_STEP = 0.1
"""[rad] of each joint in one step of ``place``."""
PLACE_TIME = 1.0
"""[s] of one step of ``place``."""
LEVEL_BELOW = 0.05
"""[m] of height below which a swinging sole is levelled more and more."""
LEVEL_GAIN = 4.0
LANDING_WEIGHT = 0.3
"""Of the stance foot's target while the other one lands: the torso gives way, as in the proof of the landing set."""


def _unhurried(q: Array) -> Reach:
    """A step from joint angles (J,) rad with which nothing that a frame's time bounds is in the way."""
    low, high = q - PLACE_STEP, q + PLACE_STEP
    return Reach(PLACE_TIME, low, high, low, high)


class Planted:
    """Soles fixed in the world; the torso moves over them."""

    def __init__(
        self,
        robot: RobotModel,
        legs: Legs,
        maker: PoseMaker,
        stride: Stride,
        weights: LegWeights,
        clearance: Clearance,
        gate: Gate,
    ) -> None:
        self._tree, self._legs, self._maker, self._stride = robot.tree, legs, maker, stride
        self._weights, self._clearance, self._gate = weights, clearance, gate
        self._sway = Sway(robot)
        self._speed, self._body = robot.speed, Body()

    @property
    def mode(self) -> Mode:
        """The robot's support mode."""
        return self._stride.mode

    @property
    def offset(self) -> float:
        """The robot's normalised offset, 0 left to 1 right."""
        return self._stride.offset

    @property
    def settled(self) -> bool:
        """Whether the body has been where it belongs for so long that nothing sways when a foot is lifted."""
        return self._stride.settled and self._body.steady

    def step(self, pose: Pose, q_arms: Array, feet: Array, footing: Footing, reach: Reach) -> Answer:
        """The next pose: the whole step, a part of it, or none, whatever passes the gate first."""
        stride = self._stride
        plan = stride.plan(pose, footing, self._body, reach.dt)
        stances = (stride.mode.stance != "R", stride.mode.stance != "L")
        given_up = GivenUp.LANDING if plan.clipped else GivenUp(0)
        iterations = 0
        for scale in SCALES:
            q = pose.q + scale * (q_arms - pose.q)
            done, closed, load = self._solve(q, plan, pose, feet, scale, reach)
            iterations += done
            candidate = self._maker.hang(q, stride.side, stride.planted_pos, stride.planted_rot)
            if closed and self._gate.passes(candidate, pose, stances, stride.planted_pos, stride.planted_rot, reach.dt):
                stride.accept(plan, scale, candidate, reach.dt)
                self._sway.accept(pose, candidate, reach.dt)
                self._body = self._moved(pose.q, candidate.q, load, reach.dt)
                return Answer(candidate, given_up, iterations)
        stride.hold()
        self._sway.rest()
        self._body = Body()
        return Answer(pose, given_up | GivenUp.HOLD, iterations)

    def _moved(self, before: Array, q: Array, load: float, dt: float) -> Body:
        """What a step of dt s from joint angles (J,) rad to others, with a ``load``, has made of the body."""
        joints = self._legs.joints
        used = float((np.abs(q - before)[joints] / (dt * self._speed[joints])).max())
        return Body(self._sway.calm, self._sway.steady, used, load, time_to_end(self._legs, before, q, dt))

    def _solve(
        self, q: Array, plan: Plan, pose: Pose, feet: Array, scale: float, reach: Reach
    ) -> tuple[int, bool, float]:
        """Move the legs of q (J,) to ``scale`` of the plan; (iterations, whether the other sole is in place, load)."""
        stride, other = self._stride, 1 - self._stride.side
        pos, rot = stride.planted_pos.copy(), stride.planted_rot.copy()
        pos[other], rot[other] = plan.sole_pos, plan.sole_rot
        if plan.kind != FREE and scale < 1.0:
            start, turn = pose.sole_pos[other], rotation_vector(plan.sole_rot @ pose.sole_rot[other].T)
            pos[other] = start + scale * (plan.sole_pos - start)
            rot[other] = matrix_from_rotation_vector(scale * turn) @ pose.sole_rot[other]
        weights, foot_weight = self._weights, np.ones(2)
        if plan.kind == FREE:
            near = max(0.0, 1.0 - max(pose.sole_pos[other][2], 0.0) / LEVEL_BELOW)
            weights = weights._replace(level=weights.level * (1.0 + LEVEL_GAIN * near))
        elif stride.swinging:
            foot_weight[:] = (LANDING_WEIGHT, LANDING_WEIGHT) if stride.mode.landing else (1.0, 1.0)
            foot_weight[other] = 0.0
        offset = stride.offset + scale * (plan.offset - stride.offset)
        share, carried = self._shares(offset, plan.target)
        goal = free_goal(feet, stride.com_goal(offset), foot_weight, share)._replace(carried=carried)
        lowest = plan.min_height if scale == 1.0 else 0.0
        stance = Stance(stride.side, pos, rot, plan.kind, lowest)
        moved = self._maker.hang(q, stride.side, stride.planted_pos, stride.planted_rot)
        self._clearance.look(moved)
        rows = self._clearance.leg_rows(moved, self._legs, stride.side, plan.kind in (FREE, REACH))
        ground = stride.ground(pose)
        about, low, high = self._sway.bounds(pose, moved, plan.sway, stride.shift(plan), ground, reach.dt)
        goal = goal._replace(about=about, along=ground.along, sway_low=low, sway_high=high)
        ways = ((goal, rows[1]), (goal._replace(overload=np.inf), np.minimum(rows[1], 0.0)))
        start, iterations = q.copy(), 0
        for wish, bounds in ways:
            q[:] = start
            found = solve_legs(self._tree, self._legs, weights, stance, wish, q, reach, rows[0], bounds)
            iterations += found.iterations
            if found.iterations > 0 and found.closure < CLOSED:
                return iterations, True, found.load
        return iterations, False, 0.0

    def _shares(self, offset: float, target: float) -> tuple[Array, Array]:
        """How much of the weight the left and the right leg carry, (2,), and how far it has gone by then, (2, 3) m.

        A leg to which the weight is being shifted gets ready for all of it.
        """
        stride, carried = self._stride, np.zeros((2, 3))
        if stride.swinging:
            return np.array([stride.side == 0, stride.side == 1], dtype=np.float64), carried
        share = np.array([1.0 - offset, offset])
        side = 1 if target > offset else 0
        carried[side, :2] = stride.com_goal(target) - stride.com_goal(offset)
        share[side] = target if side == 1 else 1.0 - target
        return share, carried

    def stand(self, q: Array) -> Pose:
        """Stand in double support as q (J,) rad does, its soles flat, its feet around the origin, facing +x."""
        pose = self._maker.stand(q)
        self._stride.restart(*self._centred(pose.sole_pos * [1.0, 1.0, 0.0], pose.sole_rot), self._maker.offset(pose))
        self._sway.rest()
        return self._maker.hang(q, 1, self._stride.planted_pos, self._stride.planted_rot)

    @staticmethod
    def _centred(sole_pos: Array, sole_rot: Array) -> tuple[Array, Array]:
        """Soles (2, 3) m, (2, 3, 3) moved and turned over the floor until they stand around the origin, facing +x."""
        R = yaw_matrix(-wrap(0.5 * (heading(sole_rot[0]) + heading(sole_rot[1]))))
        return (sole_pos - sole_pos.mean(axis=0)) @ R.T, R @ sole_rot

    def place(self, q: Array, feet: Array, footing: Footing) -> Pose:
        """Stand in double support nearest to the footing, between the feet at the origin, facing +x.

        q: (J,) rad, a standing posture with the arms where they belong. feet: (2, 3) m, targets (5). The left sole is
        walked to its place in the landing set without speed limits; where that fails the robot keeps what it reached.
        """
        stride, pose = self._stride, self._maker.stand(q)
        flat = np.stack([np.eye(3), np.eye(3)])
        offset = {"L": 0.0, "R": 1.0}.get(footing.support, min(max(footing.offset, 0.0), 1.0))
        start = pose.sole_pos * [1.0, 1.0, 0.0]
        stride.restart(start, flat, offset)
        place, turn, _ = stride.landing.clip(0, *footing.landing(0))
        goal = start[1] + [place[0], place[1], 0.0]
        for k in range(PLACE_STEPS):
            part = min(1.0, 2.0 * (k + 1) / PLACE_STEPS)
            position, rotation = start[0] + part * (goal - start[0]), yaw_matrix(part * turn)
            q, plan = pose.q.copy(), Plan(offset, 0.0, offset, position, rotation, POSE)
            _, closed, _ = self._solve(q, plan, pose, feet, 1.0, _unhurried(q))
            if closed:
                stride.planted_pos[0], stride.planted_rot[0] = position, rotation
                pose = self._maker.hang(q, 1, stride.planted_pos, stride.planted_rot)
        self._sway.rest()
        stride.restart(*self._centred(stride.planted_pos, stride.planted_rot), offset)
        return self._maker.hang(pose.q, 1, stride.planted_pos, stride.planted_rot)
