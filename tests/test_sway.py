"""Sway: what a step may do to the zero moment point."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from naoimitate.balance.legs import LegLimits, build_legs
from naoimitate.balance.pose import Pose, PoseMaker
from naoimitate.balance.sway import BRAKING, ONE_FOOT, QUIET, STEADY, TWO_FEET, Ground, Sway, SwayLimits
from naoimitate.core.physics import GRAVITY
from naoimitate.robot.model import RobotModel

DT = 0.01

STILL = (np.zeros(2), np.zeros(2))
"""No planned weight shift, before and after."""


WIDE = Ground(np.array([0.0, 1.0]), np.ones(4))
"""Feet beside each other, seen from the right one, and room wherever the zero moment point may go."""


def lifted(pose: Pose, way: np.ndarray) -> Pose:
    """The whole robot elsewhere."""
    return replace(
        pose,
        base_pos=pose.base_pos + way,
        com=pose.com + way,
        sole_pos=pose.sole_pos + way,
        centres=pose.centres + way,
    )


@pytest.fixture
def pose(robot: RobotModel) -> Pose:
    return PoseMaker(robot, build_legs(robot, LegLimits())).stand(robot.postures["stand"].copy())


def test_a_body_at_rest_may_start_as_fast_as_the_zero_moment_point_allows(robot: RobotModel, pose: Pose) -> None:
    about, low, high = Sway(robot).bounds(pose, pose, TWO_FEET, STILL, WIDE, DT)
    assert about == pytest.approx([pose.com[0], pose.com[1], 0.0])
    assert high[0] == pytest.approx(GRAVITY * TWO_FEET.zmp * DT**2)
    assert high[1] == pytest.approx(GRAVITY * TWO_FEET.zmp_across * DT**2)
    assert low == pytest.approx(-high)


def test_the_bound_is_the_inverted_pendulum_for_a_body_that_moves_as_one(robot: RobotModel, pose: Pose) -> None:
    """A step with the largest change of momentum about y, all links alike, moves the ZMP by just the bound: a z / g."""
    _, _, high = Sway(robot).bounds(pose, pose, TWO_FEET, STILL, WIDE, DT)
    acceleration = high[1] / pose.com[2] / DT**2
    assert acceleration * pose.com[2] / GRAVITY == pytest.approx(TWO_FEET.zmp_across)


def test_what_moves_may_go_on_and_need_not_stop_at_once(robot: RobotModel, pose: Pose) -> None:
    sway, speed = Sway(robot), 0.5
    sway.accept(lifted(pose, np.array([-speed * DT, 0.0, 0.0])), pose, DT)
    _, low, high = sway.bounds(pose, pose, ONE_FOOT, STILL, WIDE, DT)
    coasting = speed * DT * pose.com[2]
    assert low[1] <= high[1] < coasting, "faster than allowed: it has to brake"
    assert coasting - high[1] == pytest.approx(BRAKING * GRAVITY * ONE_FOOT.zmp_across * DT**2)
    assert not sway.calm
    sway.rest()
    assert sway.calm
    assert sway.bounds(pose, pose, ONE_FOOT, STILL, WIDE, DT)[2] == pytest.approx(
        -sway.bounds(pose, pose, ONE_FOOT, STILL, WIDE, DT)[1]
    )


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_braking_ends_at_rest(robot: RobotModel, pose: Pose, way: float) -> None:
    """Harder than it speeds up, but not so hard that it turns back faster than it could start."""
    sway, change = Sway(robot), GRAVITY * TWO_FEET.zmp_across * DT**2
    slow = 1.5 * change / pose.com[2]
    sway.accept(lifted(pose, np.array([-way * slow, 0.0, 0.0])), pose, DT)
    _, low, high = sway.bounds(pose, pose, TWO_FEET, STILL, WIDE, DT)
    assert sorted(way * np.array([low[1], high[1]])) == pytest.approx([0.0, 2.5 * change])


def test_what_the_arms_do_is_left_to_the_legs_to_make_up_for(robot: RobotModel, pose: Pose) -> None:
    maker, q = PoseMaker(robot, build_legs(robot, LegLimits())), pose.q.copy()
    q[robot.chains["l_arm"][0]] += 0.05
    arms = maker.stand(q)
    still, moved = (
        Sway(robot).bounds(pose, pose, TWO_FEET, STILL, WIDE, DT),
        Sway(robot).bounds(pose, arms, TWO_FEET, STILL, WIDE, DT),
    )
    assert np.abs(moved[1][:2] - still[1][:2]).max() > 1e-6
    assert moved[2] - moved[1] == pytest.approx(still[2] - still[1])
    assert moved[1][2:] == pytest.approx(still[1][2:])


@pytest.mark.parametrize("tight, wide", [(QUIET, ONE_FOOT), (ONE_FOOT, TWO_FEET)])
def test_fewer_feet_and_a_coming_step_allow_less(tight: SwayLimits, wide: SwayLimits) -> None:
    assert all(a <= b for a, b in zip(tight, wide, strict=True))


def test_a_planned_weight_shift_is_no_sway(robot: RobotModel, pose: Pose) -> None:
    """The body moves as the plan says, and may go on as it says: the bounds hold for what it does beside that."""
    sway, speed = Sway(robot), np.array([0.05, 0.25])
    sway.accept(lifted(pose, -DT * np.append(speed, 0.0)), pose, DT)
    about, low, high = sway.bounds(pose, pose, ONE_FOOT, (speed, 1.1 * speed), WIDE, DT)
    _, still_low, still_high = Sway(robot).bounds(pose, pose, ONE_FOOT, STILL, WIDE, DT)
    assert about == pytest.approx([pose.com[0], pose.com[1], 0.0])
    assert high - low == pytest.approx(still_high - still_low, abs=1e-9)
    middle = 0.5 * (low + high)
    assert middle[:2] == pytest.approx(1.1 * DT * pose.com[2] * np.array([-speed[1], speed[0]]))
    assert pose.base_rot @ middle[2:5] == pytest.approx(1.1 * DT * np.append(speed, 0.0))


def test_plan_and_sway_together_stay_within_the_room(robot: RobotModel, pose: Pose) -> None:
    """A shift that begins throws the zero moment point back: what is left behind it bounds what the body may add."""
    speed = np.array([0.0, 0.004])
    _, low, high = Sway(robot).bounds(pose, pose, TWO_FEET, (np.zeros(2), speed), WIDE, DT)
    planned = -speed[1] * DT * pose.com[2]
    assert low[0] == pytest.approx(planned - GRAVITY * TWO_FEET.zmp * DT**2)
    tight = WIDE._replace(room=np.array([1.0, 0.012, 1.0, 1.0]))
    _, low, high = Sway(robot).bounds(pose, pose, TWO_FEET, (np.zeros(2), speed), tight, DT)
    assert low[0] == pytest.approx(-GRAVITY * 0.012 * DT**2)
    assert high[0] == pytest.approx(planned + GRAVITY * TWO_FEET.zmp * DT**2)


def test_rows_turn_with_the_line_between_the_feet(robot: RobotModel, pose: Pose) -> None:
    """Feet one behind the other: what was across is along, and the other way round with its sign."""
    sway, speed = Sway(robot), np.array([0.03, 0.02])
    sway.accept(lifted(pose, -DT * np.append(speed, 0.0)), pose, DT)
    beside = sway.bounds(pose, pose, ONE_FOOT, STILL, WIDE, DT)
    behind = sway.bounds(pose, pose, ONE_FOOT, STILL, WIDE._replace(along=np.array([1.0, 0.0])), DT)
    assert behind[1][0] == pytest.approx(-beside[2][1])
    assert behind[2][1] == pytest.approx(beside[2][0])


def test_a_body_that_pushes_is_not_steady(robot: RobotModel, pose: Pose) -> None:
    sway = Sway(robot)
    assert sway.steady
    push = 1.1 * STEADY * GRAVITY / pose.com[2]
    sway.accept(lifted(pose, np.array([-push * DT**2, 0.0, 0.0])), pose, DT)
    assert not sway.steady
    sway.accept(pose, lifted(pose, np.array([push * DT**2, 0.0, 0.0])), DT)
    assert sway.steady, "it goes on as fast as before"
