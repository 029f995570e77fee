"""The gate in front of drivers: no command that breaks a bound gets through, and a good run passes untouched."""

from __future__ import annotations

import math
import time
from dataclasses import fields, replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from naoimitate import Imitator, load_motion, load_robot
from naoimitate.command_gate import CommandGate, CommandLimits, GateState, Refusal
from naoimitate.core.frames import Array, RobotCommand
from naoimitate.core.geometry import convex_hull, matrix_from_rotation_vector, polygon_margin, quat_from_matrix
from naoimitate.human.support import annotate
from naoimitate.robot.model import RobotModel
from naoimitate.run.replay import LOADED, replay
from naoimitate.sim.placement import stand_on_floor

DT, UP = 0.02, np.array([0.0, 0.0, 1.0])
LIMITS = CommandLimits()
NAO = load_robot("nao", "v4")
GATE = CommandGate(NAO)


def standing(robot: RobotModel, q: Array | None = None, time: float = 0.0, support: str = "D") -> RobotCommand:
    """A command to stand; what a gate must not believe is left empty."""
    q = robot.postures["stand"].copy() if q is None else q
    pos, quat = stand_on_floor(robot, q, None if support == "D" else support.lower())
    empty: dict[str, Any] = {field.name: None for field in fields(RobotCommand)}
    return RobotCommand(
        **{**empty, "time": time, "q": q, "base_pos": pos, "base_quat": quat, "support": support},
    )


def stood(robot: RobotModel, gate: CommandGate) -> GateState:
    """The gate's state after a first command to stand."""
    verdict = gate.check(gate.begin(robot.postures["stand"]), standing(robot), DT)
    assert verdict.accepted is not None
    return verdict.state


def refusals(command: RobotCommand, dt: float = DT, state: GateState | None = None) -> set[Refusal]:
    return set(GATE.check(state or stood(NAO, GATE), command, dt).refusals)


def with_joint(name: str, change: float, time: float = DT) -> RobotCommand:
    """The stand with one joint elsewhere."""
    q = NAO.postures["stand"].copy()
    q[NAO.joint(name)] += change
    return replace(standing(NAO, time=time), q=q)


@cache
def run_of_the_paper(rate: float) -> tuple[RobotCommand, ...]:
    """``builtin:paper`` from before the lift-off until after it, as the method commands it."""
    motion, imitator = annotate(load_motion("builtin:paper")), Imitator(NAO)
    imitator.calibrate(motion.tpose)
    times = np.arange(4.0, 9.0 if rate > 100.0 else 13.0, 1.0 / rate)
    seen = [motion.at(float(t)) for t in times]
    return tuple(imitator.step(frame, 1.0 / rate, support=frame.support) for frame in seen)


@pytest.mark.parametrize("rate", [50.0, 100.0, 240.0])
def test_a_good_run_passes_without_a_refusal(rate: float) -> None:
    commands = run_of_the_paper(rate)
    assert {"D", "L"} <= {c.support for c in commands}
    state = GATE.begin(commands[0].q)
    for command in commands:
        state, accepted, why = GATE.check(state, command, 1.0 / rate)
        assert accepted is command, (command.time, why)


def test_a_good_run_passes_when_it_comes_in_bursts() -> None:
    """A computer that pauses for 80 ms and then works off what came: commands of 10 ms each at once."""
    commands = run_of_the_paper(100.0)
    state = GATE.begin(commands[0].q)
    for i, command in enumerate(commands):
        state, accepted, why = GATE.check(state, command, 0.08 if i % 8 == 0 else 1e-4)
        assert accepted is command, (command.time, why)


def test_commands_may_not_run_faster_than_the_clock() -> None:
    """Every step looks slow by its own time, but they are given out at twice the pace."""
    state, refused, moved = stood(NAO, GATE), 0, 0.0
    for i in range(1, 200):
        verdict = GATE.check(state, standing(NAO, time=i * DT), DT / 2.0)
        if verdict.accepted is None:
            refused += 1
        else:
            moved += min(verdict.state.time - state.time, LIMITS.max_dt)
        state = verdict.state
        assert moved <= i * DT / 2.0 + LIMITS.clock_lead + 1e-9, "time to move in"
    assert refused > 0


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_refused(value: float) -> None:
    good = standing(NAO, time=DT)
    for name in ("q", "base_pos", "base_quat"):
        for i in range(len(getattr(good, name))):
            broken = getattr(good, name).copy()
            broken[i] = value
            assert refusals(replace(good, **{name: broken})) == {Refusal.MALFORMED}
    assert refusals(replace(good, time=value)) == {Refusal.MALFORMED}


def test_what_is_no_pose_is_refused() -> None:
    good = standing(NAO, time=DT)
    for broken in (
        {"support": "F"},
        {"q": good.q[:-1]},
        {"q": None},
        {"base_pos": np.zeros(2)},
        {"base_quat": 1.01 * good.base_quat},
        {"base_quat": np.zeros(4)},
    ):
        assert refusals(replace(good, **broken)) == {Refusal.MALFORMED}, broken


def test_a_time_that_does_not_advance_is_refused() -> None:
    for moment in (0.0, -DT):
        assert refusals(standing(NAO, time=moment)) == {Refusal.ORDER}


def test_ranges_of_joints_coupled_joints_and_hands_are_kept() -> None:
    roll = NAO.joint("LShoulderRoll")
    beyond = NAO.upper[roll] - NAO.postures["stand"][roll] + 1e-4
    assert Refusal.RANGE in refusals(with_joint("LShoulderRoll", beyond))
    assert Refusal.RANGE in refusals(with_joint("LHipYawPitch", 2e-6))
    for opening in ((1.01, 0.0), (0.0, -0.01)):
        assert refusals(replace(standing(NAO, time=DT), hand_opening=np.array(opening))) == {Refusal.RANGE}
    for opening in ((1.0, 0.0), (np.nan, 0.5)):
        assert refusals(replace(standing(NAO, time=DT), hand_opening=np.array(opening))) == set()


def test_joint_speed_is_taken_over_the_commands_own_time() -> None:
    most = LIMITS.speed_share * NAO.speed[NAO.joint("LElbowYaw")]
    for dt in (0.004, 0.02, 0.05):
        assert refusals(with_joint("LElbowYaw", 0.999 * most * dt, dt), dt) == set()
        assert Refusal.SPEED in refusals(with_joint("LElbowYaw", 1.001 * most * dt, dt), dt)
    assert Refusal.SPEED in refusals(with_joint("LElbowYaw", 1.001 * most * LIMITS.max_dt, 5.0), 5.0), "after a pause"


def test_a_joint_may_stop_at_once_but_not_turn_round_at_speed() -> None:
    step = 0.6 * NAO.speed[NAO.joint("LElbowYaw")] * DT
    first = GATE.check(stood(NAO, GATE), with_joint("LElbowYaw", step), DT)
    assert first.accepted is not None
    assert refusals(with_joint("LElbowYaw", step, 2 * DT), state=first.state) == set(), "stops"
    assert refusals(with_joint("LElbowYaw", 2.0 * step, 2 * DT), state=first.state) == set(), "goes on"
    assert refusals(with_joint("LElbowYaw", 0.0, 2 * DT), state=first.state) == {Refusal.ACCELERATION}


def test_after_a_refusal_the_method_catches_up_from_what_is_held() -> None:
    """One bad command costs one command: the next good one is measured from the last good one."""
    commands = list(run_of_the_paper(100.0))
    for k in range(100, len(commands), 50):
        commands[k] = replace(commands[k], base_pos=commands[k].base_pos + 0.1 * UP)
    state, refused = GATE.begin(commands[0].q), 0
    for command in commands:
        state, accepted, _ = GATE.check(state, command, 0.01)
        refused += accepted is None
    assert refused == len(range(100, len(commands), 50))


def test_a_pose_that_would_tip_is_refused_whatever_the_command_says_of_itself() -> None:
    for support in ("L", "R"):
        claims = {"com": np.zeros(3), "soles": np.zeros((2, 3)), "offset": 0.0}
        between = replace(standing(NAO, time=DT, support=support), **claims)
        assert Refusal.MARGIN in refusals(between)


def test_a_stance_sole_off_the_floor_or_tilted_is_refused() -> None:
    good = standing(NAO, time=DT)
    for height in (1e-3, -1e-3):
        assert refusals(replace(good, base_pos=good.base_pos + height * UP)) == {Refusal.FLOOR}
    tilted = quat_from_matrix(matrix_from_rotation_vector(np.array([0.02, 0.0, 0.0])))
    assert Refusal.FLOOR in refusals(replace(good, base_quat=tilted))
    assert refusals(replace(good, base_pos=good.base_pos + 2e-4 * UP)) == set()


def test_feet_that_both_carry_may_not_slide_against_each_other() -> None:
    """However slowly: the sum since they were set down counts. A straddle of both hips keeps the soles level."""
    state, why = stood(NAO, GATE), ()
    for i in range(1, 60):
        q = NAO.postures["stand"].copy()
        for name, sign in (("LHipRoll", 1.0), ("LAnkleRoll", -1.0), ("RHipRoll", -1.0), ("RAnkleRoll", 1.0)):
            q[NAO.joint(name)] += sign * i * 1e-4
        state, _, why = GATE.check(state, standing(NAO, q, i * DT), DT)
        if why:
            break
    assert set(why) == {Refusal.SLIP}
    assert 2 < i < 30, "0.2 m of leg, twice 0.1 mrad a step, half a millimetre"


def test_the_gate_is_a_pure_function() -> None:
    state = stood(NAO, GATE)
    kept = {f.name: np.copy(getattr(state, f.name)) for f in fields(state) if f.name in ("q", "velocity", "time")}
    command = with_joint("HeadYaw", 0.01)
    first, second = GATE.check(state, command, DT), GATE.check(state, command, DT)
    assert first.accepted is second.accepted is command
    np.testing.assert_array_equal(first.state.velocity, second.state.velocity)
    for name, value in kept.items():
        np.testing.assert_array_equal(getattr(state, name), value)
    command.q[:] = 0.0
    assert first.state.q[NAO.joint("HeadYaw")] == 0.01, "whoever reuses the command's array does not change the past"


def test_margins_agree_with_those_of_the_scores(robot: RobotModel) -> None:
    gate, rng = CommandGate(robot), np.random.default_rng(0)
    for support in ("D", "L", "R"):
        for _ in range(20):
            q = robot.postures["stand"] + rng.uniform(-0.1, 0.1, len(robot.joint_names))
            pos, quat = stand_on_floor(robot, q, None if support == "D" else support.lower())
            feet, again = gate.feet(q, pos, quat, support), replay(robot, q[None], pos[None], quat[None])
            outlines = [again.soles[side][0] for side in (0, 1) if LOADED[support][side]]
            hull = convex_hull(np.ascontiguousarray(np.concatenate(outlines)[:, :2]))
            assert feet.margin == pytest.approx(polygon_margin(hull, *again.com[0, :2]), abs=1e-9)
            assert feet.off == pytest.approx(max(np.abs(o[:, 2]).max() for o in outlines), abs=1e-9)
            assert feet.under == pytest.approx(max(0.0, -min(again.low(0)[0], again.low(1)[0])), abs=1e-9)


@st.composite
def disturbed(draw: st.DrawFn) -> tuple[int, dict[str, Any], float]:
    """Where in a run a command is disturbed, how, and how much later it comes."""
    k = draw(st.integers(1, 800))
    joint = draw(st.integers(0, len(NAO.joint_names) - 1))
    size = draw(st.sampled_from([1e-4, 1e-3, 1e-2, 0.1, 1.0, math.nan])) * draw(st.sampled_from([-1.0, 1.0]))
    what = draw(st.sampled_from(["q", "all", "base_pos", "base_quat", "support", "time"]))
    later = draw(st.sampled_from([-0.01, 0.0, 1e-4, 0.01, 0.04, 1.0]))
    return k, {"what": what, "joint": joint, "size": size}, later


def disturb(command: RobotCommand, what: str, joint: int, size: float) -> RobotCommand:
    """The command with something wrong in it."""
    if what == "support":
        return replace(command, support="DLR"[joint % 3])
    if what == "time":
        return replace(command, time=command.time + size)
    if what == "all":
        return replace(command, q=command.q + size * np.sin(np.arange(len(command.q)) + joint))
    values = getattr(command, what).copy()
    values[joint % len(values)] += size
    return replace(command, **{what: values})


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(disturbed())
def test_no_accepted_command_ever_breaks_a_bound(case: tuple[int, dict[str, Any], float]) -> None:
    k, how, later = case
    commands = run_of_the_paper(100.0)
    state = GATE.begin(commands[k - 1].q)
    accepted: list[RobotCommand] = []
    for i, command in enumerate(commands[k - 1 : k + 3]):
        given_ = disturb(command, **how) if i in (1, 2) else command
        verdict = GATE.check(state, given_, 0.01 + (later if i == 1 else 0.0))
        assert (verdict.accepted is None) == bool(verdict.refusals)
        state = verdict.state
        if verdict.accepted is not None:
            accepted.append(verdict.accepted)
    assert_safe(accepted)


def assert_safe(commands: list[RobotCommand]) -> None:
    """Every bound, measured by the scores' own means."""
    for c in commands:
        assert np.isfinite(c.q).all()
        assert (c.q >= NAO.lower - 1e-9).all()
        assert (c.q <= NAO.upper + 1e-9).all()
        assert all(abs(c.q[a] - c.q[b]) <= 1e-6 for a, b in NAO.coupled)
        for table in NAO.tables:
            low, high = table.bounds(float(c.q[table.x]))
            assert low - 1e-9 <= c.q[table.y] <= high + 1e-9
        margin, off, under = balance(c)
        assert margin >= LIMITS.margin
        assert max(off, under) <= LIMITS.height
    for a, b in pairwise(commands):
        assert b.time > a.time
        assert (np.abs(b.q - a.q) <= 0.9 * NAO.speed * (b.time - a.time) * (1.0 + 1e-9)).all()
        assert (np.abs(b.q - a.q) <= 0.9 * NAO.speed * LIMITS.max_dt * (1.0 + 1e-9)).all()


def balance(c: RobotCommand) -> tuple[float, float, float]:
    again = replay(NAO, c.q[None], c.base_pos[None], c.base_quat[None])
    outlines = [again.soles[side][0] for side in (0, 1) if LOADED[c.support][side]]
    margin = float(again.margins(np.array([c.support]))[0])
    off = max(float(np.abs(o[:, 2]).max()) for o in outlines)
    return margin, off, -min(float(again.low(0)[0]), float(again.low(1)[0]))


def test_a_check_takes_microseconds() -> None:
    """About 40 us on a small cloud machine; the bound leaves room for a busy one."""
    commands, took = run_of_the_paper(100.0), []
    state = GATE.begin(commands[0].q)
    for command in commands:
        begin = time.perf_counter()
        state = GATE.check(state, command, 0.01).state
        took.append(time.perf_counter() - begin)
    assert np.median(took) < 2e-4
