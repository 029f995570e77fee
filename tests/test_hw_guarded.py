"""The guarded driver: nothing reaches the robot around it, and what does not pass is held and counted."""

from __future__ import annotations

import time
from itertools import count

import numpy as np
from guard_rig import DT, GATE, NAO, STAND, FakeRobot, command, guarded

from naoimitate.command_gate import Refusal
from naoimitate.core.frames import RobotCommand
from naoimitate.hw.driver import Driver
from naoimitate.hw.guarded import NOT_LIVE, Condition, GuardedDriver
from naoimitate.hw.none import NoDriver


def test_it_is_a_driver_itself() -> None:
    guard, robot = guarded()
    assert isinstance(robot, Driver)
    assert isinstance(guard, Driver)
    assert guard.period == robot.period


def test_the_driver_behind_it_cannot_be_reached() -> None:
    guard, robot = guarded()
    for name in dir(guard):
        if not name.startswith("_"):
            assert getattr(guard, name) is not robot


def test_good_commands_pass_and_bad_ones_are_held_counted_and_named() -> None:
    guard, robot = guarded()
    good = command(0.02, head=0.01)
    guard.write(good)
    guard.write(command(0.04, lift=0.01))
    assert guard.status.refusing == (Refusal.FLOOR.value,)
    guard.write(command(0.06, head=2.0))
    guard.write(command(0.02))
    assert [done for done in robot.done if isinstance(done, RobotCommand)] == [good]
    assert guard.command is good, "held"
    status = guard.status
    assert status.accepted == 1
    assert status.refused == {"feet on the floor": 1, "joint speed": 1, "acceleration": 1, "order of time": 1}
    guard.write(command(0.08))
    assert guard.status.refusing == ()
    assert guard.status.accepted == 2


def test_the_first_command_must_be_near_where_the_robot_is_measured() -> None:
    guard, _ = guarded()
    guard.write(command(0.0, head=1.5))
    assert guard.status.refusing[0] == Refusal.SPEED.value
    assert guard.command is None
    guard.write(command(0.02, head=0.05))
    assert guard.command is not None


def test_nothing_passes_before_connect_or_after_the_end() -> None:
    robot = FakeRobot()
    guard = GuardedDriver(robot, GATE)
    guard.write(command(0.0))
    assert robot.done == []
    for end in (GuardedDriver.stop, GuardedDriver.emergency_stop):
        guard, robot = guarded()
        guard.write(command(0.0))
        end(guard)
        done = len(robot.done)
        guard.write(command(0.02))
        guard.soften(1.0)
        assert len(robot.done) == done
        assert guard.status.refused == {NOT_LIVE: 1}


def test_the_delays_of_the_gate_and_of_the_hand_over_are_told_apart() -> None:
    guard, robot = guarded()
    assert guard.delays == (0.0, 0.0)
    write = robot.write

    def slowly(command: RobotCommand) -> None:
        time.sleep(0.02)
        write(command)

    robot.write = slowly  # type: ignore[method-assign]
    guard.write(command(0.02))
    gate, hand_over = guard.delays
    assert 1e-6 < gate < 0.01
    assert 0.02 <= hand_over < 0.05
    guard.write(command(0.04, lift=0.01))
    assert guard.delays.hand_over < 0.01, "nothing was handed over"


def test_no_robot_is_where_it_is_told_to_be() -> None:
    taken: list[RobotCommand] = []
    ticks = count(0.0, DT)
    guard = GuardedDriver(NoDriver(NAO, taken.append), GATE, clock=lambda: next(ticks))
    guard.connect()
    np.testing.assert_array_equal(guard.read().q, STAND)
    for i in range(10):
        guard.write(command(i * DT, head=0.01 * i))
    state = guard.read()
    assert state.base_pos is None and state.base_quat is None, "nobody has simulated where its torso is"
    np.testing.assert_array_equal(state.q, taken[-1].q)
    assert len(taken) == 10
    assert not state.fell
    assert np.isnan(state.angles).all()
    assert guard.status.condition is Condition.LIVE
    guard.stop()
    assert len(taken) == 10
