"""After a refusal or a pause nothing is refused for ever: the robot catches up by calm steps, each of them safe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate import Imitator, load_motion, load_robot
from naoimitate.between import Between
from naoimitate.command_gate import CommandGate, CommandLimits, Refusal
from naoimitate.core.frames import RobotCommand
from naoimitate.human.support import annotate
from naoimitate.hw.guarded import GuardedDriver
from naoimitate.hw.none import NoDriver
from naoimitate.sim.driver import MujocoDriver
from naoimitate.sim.settings import SimSettings

NAO = load_robot("nao", "v4")
GATE, LIMITS, DT = CommandGate(NAO), CommandLimits(), 0.01
BETWEEN = Between(NAO)
UP = np.array([0.0, 0.0, 1.0])
PATIENCE = 30
"""Steps: a third of the second after which a session gives up."""


@cache
def run_of(name: str, begin: float, end: float) -> tuple[RobotCommand, ...]:
    motion, imitator = annotate(load_motion(f"builtin:{name}")), Imitator(NAO)
    imitator.calibrate(motion.tpose)
    seen = [motion.at(float(t)) for t in np.arange(begin, end, DT)]
    return tuple(imitator.step(frame, DT, support=frame.support) for frame in seen)


def lifted(command: RobotCommand) -> RobotCommand:
    """What no gate lets pass."""
    return replace(command, base_pos=command.base_pos + 0.1 * UP)


def sent(commands: Sequence[RobotCommand]) -> tuple[list[RobotCommand | None], list[bool]]:
    """What a robot is given for each command, and whether it is the command itself."""
    state, given_, own = GATE.begin(commands[0].q), [], []
    for command in commands:
        state, accepted, why = GATE.catch_up(state, command, DT)
        given_.append(accepted)
        own.append(not why)
        assert (accepted is command) == (not why)
    return given_, own


def assert_safe(commands: list[RobotCommand], given_: list[RobotCommand | None], own: list[bool]) -> None:
    """Every pose within the gate's bounds, measured anew; a step of catching up no faster than the method and calm."""
    moved = [c for c in given_ if c is not None]
    for c in moved:
        feet = GATE.feet(c.q, c.base_pos, c.base_quat, c.support)
        assert feet.margin >= LIMITS.margin and max(feet.off, feet.under) <= LIMITS.height
        assert np.all((c.q >= NAO.lower - 1e-9) & (c.q <= NAO.upper + 1e-9))
    for a, b in pairwise(moved):
        assert (np.abs(b.q - a.q) <= LIMITS.speed_share * NAO.speed * min(b.time - a.time, LIMITS.max_dt) + 1e-9).all()
    held = commands[0]
    for i, (c, itself) in enumerate(zip(given_, own, strict=True)):
        if c is not None and not itself:
            share = np.full(len(c.q), LIMITS.catch_up_share)
            for chain, feet in (("l_leg", "DL"), ("r_leg", "DR")):
                share[list(NAO.chains[chain])] = LIMITS.stance_share if held.support in feet else LIMITS.catch_up_share
            share[[NAO.joint("LHipYawPitch"), NAO.joint("RHipYawPitch")]] = LIMITS.stance_share
            most = np.abs(commands[i].q - commands[i - 1].q) + share * NAO.speed * DT
            assert (np.abs(c.q - held.q) <= 1.05 * most + 1e-6).all()
            assert c.support == held.support
            assert BETWEEN.nearest(c.q) >= -LIMITS.overlap - 1e-9
        held = held if c is None else c


@pytest.mark.parametrize("gap", [1, 5, 10])
@pytest.mark.parametrize(("name", "begin"), [("wave", 1.0), ("march", 3.0), ("paper", 5.0)])
def test_after_a_tenth_of_a_second_of_refusals_the_robot_moves_on_at_once_wherever_it_was(
    name: str, begin: float, gap: int
) -> None:
    """Arms that wave, a leg that swings. Without catching up some of these runs are refused to their end."""
    commands = list(run_of(name, begin, begin + 7.0))
    for k in range(30, 550, 26):
        tried = [*commands[:k], *(lifted(c) for c in commands[k : k + gap]), *commands[k + gap :]]
        given_, own = sent(tried)
        assert not any(given_[k : k + gap])
        for i in range(k + gap, len(commands) - PATIENCE):
            assert any(given_[i : i + PATIENCE]), "nothing is held for long"
        if commands[k - 1].support == commands[k + gap].support:
            assert all(own[k + gap + 120 :]), "and soon the robot is where the method is"
        assert_safe(commands, given_, own)


@settings(max_examples=20, deadline=None)
@given(st.sampled_from([("wave", 1.0), ("march", 3.0), ("paper", 5.0)]), st.integers(20, 400), st.integers(1, 150))
def test_however_long_it_was_held_whatever_the_robot_is_given_is_safe(
    which: tuple[str, float], k: int, gap: int
) -> None:
    commands = list(run_of(which[0], which[1], which[1] + 7.0))
    assert_safe(commands, *sent([*commands[:k], *(lifted(c) for c in commands[k : k + gap]), *commands[k + gap :]]))


def test_a_body_that_was_left_behind_follows_without_tipping() -> None:
    """Half a second of the weight's way to the other foot is missed; made up for in one leap, the robot falls."""
    motion, imitator = annotate(load_motion("builtin:march")), Imitator(NAO)
    imitator.calibrate(motion.tpose)
    robot = MujocoDriver(NAO, SimSettings(period=0.02), real_time=False)
    state = None
    for i in range(250):
        frame = motion.at(0.02 * i)
        command = imitator.step(frame, 0.02, support=frame.support)
        if state is None:
            state = GATE.begin(command.q)
            robot._physics.place(command.q, command.base_pos, command.base_quat)
        tried = lifted(command) if 140 <= i < 165 else command
        state, accepted, _ = GATE.catch_up(state, tried, 0.02)
        if accepted is not None:
            robot.write(accepted)
        assert not robot.advance(0.02).fell


def test_a_jump_is_held_and_not_followed() -> None:
    commands = run_of("wave", 1.0, 8.0)
    wild = commands[60].q.copy()
    wild[NAO.joint("HeadYaw")] += 1.5
    given_, own = sent([*commands[:60], replace(commands[60], q=wild), *commands[61:]])
    assert given_[60] is None
    assert all(own[61:])


def test_a_method_that_jumps_and_goes_on_from_there_is_followed_slowly() -> None:
    """Better than to hold for ever, and no faster than calm."""
    commands = []
    for i, command in enumerate(run_of("wave", 1.0, 8.0)):
        q = command.q.copy()
        q[NAO.joint("HeadYaw")] += 1.0 if i >= 60 else 0.0
        commands.append(replace(command, q=q))
    given_, own = sent(commands)
    assert given_[60] is None
    assert all(given_[62:]), "one more look, to see that it was no single jump"
    assert own.index(True, 61) > 61 + 0.5 * 1.0 / (LIMITS.catch_up_share * NAO.speed[0] * DT)
    assert own[-1]


def test_a_foot_that_the_method_lifted_meanwhile_stays_down_until_it_is_down_again() -> None:
    commands = list(run_of("march", 3.0, 9.0))
    lift = next(i for i, c in enumerate(commands) if c.support == "L")
    down = next(i for i in range(lift, len(commands)) if commands[i].support == "D")
    given_, own = sent([*commands[:lift], *(lifted(c) for c in commands[lift : lift + 100]), *commands[lift + 100 :]])
    assert all(c.support == "D" for c in given_ if c is not None)
    assert_safe(commands, given_, own)
    assert all(own[down + 100 :])


def test_a_joint_that_turns_round_too_fast_is_not_caught_up_with_in_the_same_step() -> None:
    """It stops first: that is what the refusal is for."""
    commands = run_of("wave", 1.0, 8.0)
    step = 0.6 * NAO.speed[0] * DT
    state = GATE.begin(commands[0].q)
    for i, yaw in enumerate((0.0, step, 2.0 * step, step)):
        q = commands[0].q.copy()
        q[NAO.joint("HeadYaw")] += yaw
        state, accepted, why = GATE.catch_up(state, replace(commands[0], q=q, time=i * DT), DT)
    assert accepted is None
    assert why == (Refusal.ACCELERATION,)


def test_a_pose_in_between_keeps_the_stance_sole_where_it_is() -> None:
    commands = run_of("paper", 5.0, 12.0)
    single = [c for c in commands if c.support == "L"]
    a, b = single[0], single[60]
    for share in (0.0, 0.3, 1.0):
        c = BETWEEN.pose(a, b, share)
        np.testing.assert_allclose(c.q, a.q + share * (b.q - a.q))
        feet, at = GATE.feet(c.q, c.base_pos, c.base_quat, "L"), GATE.feet(a.q, a.base_pos, a.base_quat, "L")
        np.testing.assert_allclose(feet.pos[0], at.pos[0], atol=1e-9)
        np.testing.assert_allclose(feet.rot[0], at.rot[0], atol=1e-9)


@pytest.mark.parametrize("pause", [0.1, 0.3, 2.0])
@pytest.mark.parametrize(("name", "begin"), [("wave", 1.0), ("march", 3.0), ("paper", 5.0)])
def test_after_a_pause_of_the_computer_every_command_of_a_live_method_passes(
    name: str, begin: float, pause: float
) -> None:
    """The method steps with the time that has passed, of which it uses 50 ms at most."""
    motion, imitator = annotate(load_motion(f"builtin:{name}")), Imitator(NAO)
    imitator.calibrate(motion.tpose)
    now = [begin]
    guard = GuardedDriver(NoDriver(NAO, clock=lambda: now[0]), GATE, clock=lambda: now[0])
    guard.connect()
    first = motion.at(begin)
    guard._gate_state = GATE.begin(imitator.step(first, DT, support=first.support).q)
    for i in range(500):
        dt = DT + (pause if i % 100 == 99 else 0.0)
        now[0] += dt
        frame = motion.at(now[0])
        guard.write(imitator.step(frame, dt, support=frame.support))
        assert guard.status.refusing == (), (i, guard.status)
    assert guard.status.accepted == 500


def test_the_guard_says_that_it_catches_up_and_keeps_its_patience() -> None:
    commands = run_of("wave", 1.0, 8.0)
    now = [0.0]
    guard = GuardedDriver(NoDriver(NAO, clock=lambda: now[0]), GATE, clock=lambda: now[0])
    guard.connect()
    guard._gate_state = GATE.begin(commands[0].q)
    for k in range(30, 400):  # a moment at which the arms are fast
        if np.abs(commands[k].q - commands[k + 30].q).max() > 0.4:
            break
    caught: list[bool] = []
    for i, command in enumerate(commands[: k + 150]):
        now[0] += DT
        guard.write(lifted(command) if k <= i < k + 30 else command)
        status = guard.status
        caught.append(status.catching_up)
        if status.catching_up:
            assert status.refusing and status.held == 0.0
            assert guard.command is not command
    assert any(caught) and not any(caught[: k + 30]) and not caught[-1]
    assert guard.status.accepted == k + 150 - 30 - sum(caught)
