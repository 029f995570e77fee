"""Closed-loop balance: it helps where floors tilt and servos sag, and asks for nothing unsafe whatever it is told."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate import imitate, load_motion, load_robot
from naoimitate.balance.legs import LegLimits, build_legs
from naoimitate.core.physics import GRAVITY
from naoimitate.gate import build_gate, outline_travel, range_excess, support_margin
from naoimitate.hw.driver import RobotState
from naoimitate.hw.planted_shift import PlantedShift
from naoimitate.hw.stabiliser import DEFAULT, Stabiliser
from naoimitate.hw.target import Target
from naoimitate.sim.disturbance import Disturbance
from naoimitate.sim.stress_play import Outcome, Plan, play

NAO = load_robot("nao")
PERIOD = 0.01
WEIGHT = GRAVITY * NAO.mass
LEGS = build_legs(NAO, LegLimits())
LEANT = np.array([0.0, 0.05])
SMALL = 1e-6


@pytest.fixture(scope="module")
def march() -> Plan:
    run = imitate(load_motion("builtin:march"), NAO, end=12.0)
    return Plan("march", run.time, run.q, run.base_pos, run.base_quat, run.support, run.hand_opening)


def target_at(plan: Plan, frame: int) -> Target:
    return Target(plan.q[frame], plan.base_pos[frame], plan.base_quat[frame], str(plan.support[frame]))


def as_planned(target: Target, time: float) -> RobotState:
    """What a robot measures that is where it should be, on a level floor."""
    w, x, y, z = target.base_quat
    angles = np.array([math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), math.asin(2 * (w * y - z * x))])
    carries = np.array([target.support != "R", target.support != "L"]) * WEIGHT
    fsr = np.tile(carries[:, None] / (4.0 * max(1, carries.astype(bool).sum())), (1, 4))
    nothing = np.zeros(3)
    return RobotState(time, target.q, np.zeros(len(target.q)), angles, nothing, nothing, fsr, fell=False)


def stabiliser() -> Stabiliser:
    return Stabiliser(NAO, lambda target, state: target.q, PERIOD)


def test_a_robot_as_planned_is_left_alone(march: Plan) -> None:
    loop = stabiliser()
    for frame in range(0, len(march.time), 7):
        target = target_at(march, frame)
        for _ in range(30):
            q = loop(target, as_planned(target, loop._time + PERIOD))
        assert np.abs(loop.shift).max() < 1e-3
        assert np.abs(q - target.q).max() < 0.01


def test_the_body_is_brought_back_up_the_floor(march: Plan) -> None:
    """The board says that the robot leans forwards: the floor tilts, the CoM is in front of its place."""
    loop, target = stabiliser(), target_at(march, 50)
    for step in range(300):
        state = as_planned(target, step * PERIOD)
        loop(target, replace(state, angles=state.angles + LEANT))
    assert loop.shift[0] == pytest.approx(-loop._planted.pose(target.q, "D").com[2] * math.sin(0.05), abs=0.006)
    assert abs(loop.shift[1]) < 2e-3


@pytest.mark.parametrize("wrong", ["nan angles", "nan encoder", "old", "infinite", "fell", "far", "lying"])
def test_nothing_is_done_from_a_state_that_is_not_known(march: Plan, wrong: str) -> None:
    loop, target = stabiliser(), target_at(march, 50)
    for step in range(100):
        state = as_planned(target, step * PERIOD)
        loop(target, replace(state, angles=state.angles + LEANT))
    assert np.abs(loop.shift).max() > 0.004
    for step in range(100, 300):
        state = as_planned(target, step * PERIOD)
        changed = {
            "nan angles": {"angles": np.full(2, np.nan)},
            "nan encoder": {"q": np.where(np.arange(len(target.q)) == 3, np.nan, target.q)},
            "old": {"time": 0.5},
            "infinite": {"angles": np.array([np.inf, 0.0])},
            "fell": {"fell": True},
            "far": {"q": target.q + 0.6},
            "lying": {"angles": np.array([1.4, 0.0])},
        }[wrong]
        q = loop(target, replace(state, **changed))
    assert np.abs(loop.shift).max() == 0.0
    assert q == pytest.approx(target.q, abs=1e-9), "what was known has faded"


def test_a_sole_that_carries_in_the_air_is_raised_and_comes_back(march: Plan) -> None:
    frame = int(np.flatnonzero(march.support == "L")[60])
    loop, target = stabiliser(), target_at(march, frame)
    for step in range(20):
        state = as_planned(target, step * PERIOD)
        loaded = state.fsr.copy()
        loaded[1] = 0.05 * WEIGHT
        loop(target, replace(state, fsr=loaded))
    assert loop.raised[1] == pytest.approx(DEFAULT.heights.most)
    assert loop.target is not None
    planted = PlantedShift(NAO)
    before, after = planted.pose(target.q, "L"), planted.pose(loop.target.q, "L")
    assert after.sole_pos[1, 2] - before.sole_pos[1, 2] == pytest.approx(DEFAULT.heights.most, abs=5e-4)
    for step in range(20, 120):
        loop(target, as_planned(target, step * PERIOD))
    assert loop.raised[1] == pytest.approx(0.0, abs=1e-6)


def test_a_sole_that_should_carry_is_lowered_until_it_does(march: Plan) -> None:
    loop, target = stabiliser(), target_at(march, 50)
    for step in range(40):
        state = as_planned(target, step * PERIOD)
        hanging = state.fsr.copy()
        hanging[0] = 0.0
        loop(target, replace(state, fsr=hanging))
    lowered = float(loop.raised[0])
    assert lowered == pytest.approx(-40 * PERIOD * DEFAULT.heights.lowering, abs=2e-4)


def about_to_lift(march: Plan) -> int:
    """A frame in which both feet are planned down and the plan has long had the whole weight on the left one."""
    return int(np.flatnonzero(march.support == "L")[0]) - 10


def test_a_sole_is_eased_before_it_leaves_the_floor(march: Plan) -> None:
    loop, target = stabiliser(), target_at(march, about_to_lift(march))
    assert target.support == "D"
    for step in range(100):
        state = as_planned(target, step * PERIOD)
        left = 0.08 if loop.raised[1] < 0.002 else 0.0
        loop(target, replace(state, fsr=WEIGHT / 4.0 * np.array([[1.0 - left] * 4, [left] * 4])))
    assert 0.002 <= loop.raised[1] < 0.004, "until it carries nothing, and no farther"


@pytest.mark.parametrize("wrong", ["CoM", "load", "just landed"])
def test_a_sole_that_may_be_needed_is_not_eased(march: Plan, wrong: str) -> None:
    loop, target = stabiliser(), target_at(march, about_to_lift(march))
    load = WEIGHT / 4.0 * np.array([[0.92] * 4, [0.08] * 4])
    if wrong == "just landed":
        in_air = target._replace(support="L")
        loop(in_air, as_planned(in_air, -PERIOD))
    for step in range(40):
        state = replace(as_planned(target, step * PERIOD), fsr=load)
        if wrong == "CoM":
            state = replace(state, angles=state.angles + np.array([0.08, 0.0]))
        loop(target, state if wrong != "load" else replace(state, fsr=np.full((2, 4), np.nan)))
    assert loop.raised[1] <= 0.0


def moved_by_gyro(march: Plan, frame: int, turning: float, softness: float = 1.0) -> float:
    """How far to the left the body is moved when the gyro says that the robot rolls to its right."""
    loop = Stabiliser(NAO, lambda target, state: target.q, PERIOD, softness=lambda: softness)
    target = target_at(march, frame)
    for step in range(20):
        loop(target, replace(as_planned(target, step * PERIOD), gyro=np.array([turning, 0.0, 0.0])))
    return float(loop.damped[1])


def test_the_body_is_moved_against_its_sway_in_proportion_to_how_soft_the_servos_are(march: Plan) -> None:
    one_foot = int(np.flatnonzero(march.support == "L")[60])
    firm, soft = (moved_by_gyro(march, one_foot, 0.1, softness) for softness in (1.0, 3.0))
    assert firm == pytest.approx(0.1 * 0.27 * DEFAULT.damping[1], rel=0.25)
    assert soft == pytest.approx(3.0 * firm, rel=0.05)
    assert moved_by_gyro(march, one_foot, -0.1) == pytest.approx(-firm, rel=0.05)
    assert abs(moved_by_gyro(march, one_foot, 100.0, 5.0)) <= DEFAULT.most_damping + SMALL
    assert moved_by_gyro(march, 50, 0.1) == pytest.approx(DEFAULT.on_both * firm, rel=0.25), "on both feet"


def test_without_a_gyro_nothing_is_damped(march: Plan) -> None:
    assert moved_by_gyro(march, 50, math.nan) == 0.0


ANGLES = st.floats(-0.6, 0.6) | st.sampled_from([np.nan, np.inf, -np.inf, 1e9])
TURNING = st.floats(-5.0, 5.0) | st.sampled_from([np.nan, 1e9])
LOADS = st.floats(-5.0, 60.0) | st.sampled_from([np.nan, np.inf, 1e9])


@given(st.data())
@settings(max_examples=25, deadline=None)
def test_whatever_it_is_told_it_asks_for_a_safe_posture(march: Plan, data: st.DataObject) -> None:
    """In range, in steps, on planted soles, with the CoM inside them: for any senses, true, wrong, or absurd."""
    softness = data.draw(st.sampled_from([1.0, 5.0]))
    loop = Stabiliser(NAO, lambda target, state: target.q, PERIOD, softness=lambda: softness)
    gate = build_gate(NAO)
    rng = np.random.default_rng(data.draw(st.integers(0, 2**31)))
    frame, last, time = data.draw(st.integers(0, len(march.time) - 80)), None, 0.0
    for _ in range(6):
        angles = np.array([data.draw(ANGLES), data.draw(ANGLES)])
        gyro = np.array([data.draw(TURNING), data.draw(TURNING), 0.0])
        fsr = np.array([[data.draw(LOADS)] * 4 for _ in range(2)])
        for _ in range(12):
            target = target_at(march, frame)
            state = replace(as_planned(target, time), angles=angles, gyro=gyro, fsr=fsr)
            state = replace(state, q=target.q + rng.normal(0.0, 0.02, 24))
            q = loop(target, state)
            assert range_excess(gate, q) <= SMALL
            _check_stance(target, q)
            if last is not None:
                beside = (q - target.q) - last
                assert np.abs(beside).max() <= DEFAULT.joint_speed * PERIOD + SMALL
            last, time, frame = q - target.q, time + PERIOD, frame + 1


def _check_stance(target: Target, q: np.ndarray) -> None:
    planted = PlantedShift(NAO)
    before, after = planted.pose(target.q, target.support), planted.pose(q, target.support)
    left, right = target.support != "R", target.support != "L"
    if left and right:
        level = np.array([1.0, 1.0, 0.0])
        places = after.sole_pos[1] * level, after.sole_rot[1], before.sole_pos[1] * level, before.sole_rot[1]
        assert outline_travel(LEGS, 1, *places) < 1e-4, "soles keep their places"
        assert abs(after.sole_pos[1, 2]) <= 2.0 * DEFAULT.heights.most + 1e-3
    planned = support_margin(LEGS, before.sole_pos, before.sole_rot, left, right, before.com)
    margin = support_margin(LEGS, after.sole_pos, after.sole_rot, left, right, after.com)
    assert margin >= min(DEFAULT.margin, planned) - 3e-3


def outcome(plan: Plan, disturbance: Disturbance, closed: bool) -> Outcome:
    return play(NAO, plan, disturbance, closed=closed)


def test_it_does_no_harm_where_all_is_as_planned(march: Plan) -> None:
    free, closed = (outcome(march, Disturbance(), c) for c in (False, True))
    assert free.survived and closed.survived
    assert closed.cop_margin > free.cop_margin - 0.005
    assert closed.tilt < free.tilt + math.radians(1.0)


@pytest.mark.parametrize(
    "disturbance",
    [
        Disturbance(tilt=math.radians(7.0), tilt_heading=math.radians(90.0)),
        Disturbance(tilt=math.radians(11.0)),
        Disturbance(stiffness=150.0),
    ],
    ids=["floor tilted 7 deg to a side", "floor tilted 11 deg forwards", "servos half as stiff as believed"],
)
def test_it_survives_what_fells_the_open_loop(march: Plan, disturbance: Disturbance) -> None:
    assert not outcome(march, disturbance, False).survived
    assert outcome(march, disturbance, True).survived


def test_soft_servos_survive_a_walk_at_speed() -> None:
    """60 N m/rad taken for 300: the body stays near its plan, although it sways on one foot."""
    run = imitate(load_motion("builtin:walk"), NAO)
    walk = Plan("walk", run.time, run.q, run.base_pos, run.base_quat, run.support, run.hand_opening)
    closed = play(NAO, walk, Disturbance(stiffness=60.0), closed=True)
    assert closed.survived
    assert closed.tilt < math.radians(3.0)


@pytest.mark.parametrize("at", [0.27, 0.67])
def test_commands_lost_in_a_shift_of_weight_are_survived(march: Plan, at: float) -> None:
    lost = Disturbance(drop_time=0.2, drop_at=at, delay=0.02, noise=1.0)
    assert play(NAO, march, lost, closed=True).survived
