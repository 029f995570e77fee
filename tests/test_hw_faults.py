"""A guarded robot that complains, fails or falls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from guard_rig import DT, GATE, NAO, STAND, FakeRobot, command, guarded

from naoimitate.core.errors import DriverError
from naoimitate.core.frames import RobotCommand
from naoimitate.fsm.fall_latch import FallLimits
from naoimitate.hw.guarded import NOT_LIVE, Condition, GuardedDriver, GuardSettings
from naoimitate.hw.lean import lean, up_from_angles, up_from_quat
from naoimitate.sim.driver import MujocoDriver
from naoimitate.sim.sensors import roll_pitch


@pytest.mark.parametrize("what", ["read", "write", "soften"])
def test_a_driver_that_fails_in_an_unforeseen_way_is_let_go_of_with_one_line(what: str) -> None:
    guard, robot = guarded()

    def fail(*_: object) -> None:
        raise ValueError("setting an array element\nwith a sequence")

    setattr(robot, what, fail)
    guard.write(command(0.0))
    if what == "soften":
        with pytest.raises(DriverError, match="the driver failed"):
            guard.soften(0.5)
    assert guard.status.condition is Condition.STOPPED
    assert guard.status.problem == "the driver failed (ValueError: setting an array element with a sequence)"
    assert robot.done[-1] == "stop"


def test_a_state_that_makes_no_sense_ends_the_motion() -> None:
    guard, robot = guarded()
    robot.angles = np.zeros(0)
    guard.write(command(0.0))
    assert guard.status.condition is Condition.STOPPED
    assert "IndexError" in guard.status.problem


def test_a_driver_that_cannot_connect_is_stopped_and_its_error_is_one_line() -> None:
    robot = FakeRobot()
    robot.breaks = {"connect"}
    guard = GuardedDriver(robot, GATE)
    with pytest.raises(DriverError, match=r"the driver failed \(RuntimeError: broken\)"):
        guard.connect()
    assert guard.status.condition is Condition.STOPPED
    assert robot.done == ["connect", "stop"]


def test_a_robot_that_leans_is_softened_then_let_go_of_and_latched() -> None:
    guard, robot = guarded()
    guard.write(command(0.0))
    robot.angles = np.array([0.0, 0.6])
    for i in range(1, 120):
        guard.write(command(i * DT))
    assert robot.done[-2:] == [("soften", GuardSettings().fall_stiffness), "stop"]
    assert guard.status.condition is Condition.FALLEN
    assert guard.status.lean == pytest.approx(0.6)
    passed = [d for d in robot.done if isinstance(d, RobotCommand)]
    assert len(passed) <= 1 + FallLimits().patience / DT + 1
    robot.angles = np.zeros(2)
    guard.read()
    assert guard.status.condition is Condition.FALLEN, "latched"
    with pytest.raises(DriverError, match="fallen"):
        guard.connect()
    guard.reset()
    guard.connect()
    assert guard.status.condition is Condition.LIVE


def test_a_robot_that_bows_as_it_is_told_does_not_fall() -> None:
    guard, robot = guarded()
    bowed = command(0.0)
    half = 0.25
    guard._command = replace(bowed, base_quat=np.array([np.cos(half), 0.0, np.sin(half), 0.0]))
    robot.angles = np.array([0.0, 2.0 * half])
    for _ in range(50):
        guard.read()
    assert guard.status.condition is Condition.LIVE
    assert guard.status.lean == pytest.approx(0.0, abs=1e-6)


def test_lean_does_not_depend_on_the_heading() -> None:
    rng = np.random.default_rng(0)
    for _ in range(100):
        quat = rng.normal(size=4)
        quat /= np.linalg.norm(quat)
        np.testing.assert_allclose(up_from_quat(quat), up_from_angles(roll_pitch(quat)), atol=1e-9)
        assert lean(quat, roll_pitch(quat)) == pytest.approx(0.0, abs=1e-6)
    assert np.isnan(lean(quat, np.full(2, np.nan)))


def test_alarms_are_shown_and_end_nothing() -> None:
    guard, robot = guarded()
    robot.alarms = ("RKneePitch is hot",)
    for i in range(100):
        guard.write(command(i * DT))
    assert guard.status.alarms == robot.alarms
    assert guard.status.condition is Condition.LIVE
    assert guard.status.accepted == 100


def test_a_fault_that_lasts_ends_the_motion_and_the_robot_holds_its_pose_stiff() -> None:
    guard, robot = guarded()
    robot.alarms, robot.faults = ("battery at 12 %",), ("RKneePitch is silent",)
    moment = 0.0
    while guard.status.condition is Condition.LIVE:
        moment += DT
        guard.write(command(moment))
        assert moment <= GuardSettings().fault_patience + 2 * DT
    assert moment >= GuardSettings().fault_patience, "not at once"
    held = guard.command
    for i in range(1, 100):
        guard.write(command(moment + i * DT))
    status = guard.status
    assert status.condition is Condition.FAULT
    assert status.problem == "RKneePitch is silent"
    assert status.alarms == ("RKneePitch is silent", "battery at 12 %")
    assert status.refusing == (NOT_LIVE,)
    assert guard.command is held
    assert all(isinstance(d, RobotCommand) for d in robot.done[1:]), "neither softened nor let go of"
    robot.faults = ()
    guard.write(command(moment + 100 * DT))
    assert guard.status.condition is Condition.FAULT, "a person has to look after it first"
    guard.soften(0.3)
    guard.stop()
    assert robot.done[-2:] == [("soften", 0.3), "stop"]
    assert guard.status.condition is Condition.STOPPED
    assert guard.status.problem == "RKneePitch is silent"
    guard.connect()
    assert guard.status.condition is Condition.LIVE


def test_a_robot_that_falls_while_it_holds_its_pose_is_softened_and_let_go_of() -> None:
    guard, robot = guarded()
    robot.faults = ("RKneePitch is silent",)
    for i in range(30):
        guard.write(command(i * DT))
    assert guard.status.condition is Condition.FAULT
    robot.angles = np.array([0.6, 0.0])
    for _ in range(120):
        guard.read()
    assert robot.done[-2:] == [("soften", GuardSettings().fall_stiffness), "stop"]
    assert guard.status.condition is Condition.FALLEN


def test_faults_that_come_and_go_or_are_a_pause_of_the_computer_end_nothing() -> None:
    guard, robot = guarded()
    for i in range(200):
        robot.faults = ("every motor is silent",) if i % 10 else ()
        robot.time += 1.0 if i % 10 == 1 else 0.0
        guard.write(command(i * DT))
    assert guard.status.condition is Condition.LIVE


def test_a_robot_whose_state_grows_old_is_in_fault_too() -> None:
    """Its clock stands still, ours does not."""
    robot = FakeRobot()
    now = [0.0]
    guard = GuardedDriver(robot, GATE, clock=lambda: now[0])
    guard.connect()
    state = replace(robot.read(), faults=("the robot has not answered for 2 s",))
    robot.read = lambda: state  # type: ignore[method-assign]
    for _ in range(30):
        now[0] += DT
        guard.read()
    assert guard.status.condition is Condition.FAULT
    assert guard.status.problem == "the robot has not answered for 2 s"


def test_a_robot_that_cannot_be_watched_is_let_go_of() -> None:
    guard, robot = guarded()
    robot.breaks = {"read"}
    with pytest.raises(DriverError, match="answer"):
        guard.read()
    assert robot.done == ["connect", "stop"]
    assert guard.status.condition is Condition.STOPPED
    assert guard.status.problem == "the robot does not answer"


def test_writing_to_a_robot_that_fails_ends_in_a_state_and_not_in_an_error() -> None:
    guard, robot = guarded()
    robot.breaks = {"read"}
    guard.write(command(0.0))
    assert robot.done == ["connect", "stop"]
    guard, robot = guarded()

    def refuse(_: RobotCommand) -> None:
        raise DriverError("the robot takes nothing")

    robot.write = refuse  # type: ignore[method-assign]
    guard.write(command(0.0))
    assert robot.done == ["connect", "stop"]
    assert guard.status.condition is Condition.STOPPED
    assert guard.status.problem == "the robot takes nothing"


def test_a_fall_in_the_simulation_is_seen_before_the_robot_lies() -> None:
    """The robot tips over its toes by its ankles, behind the guard's back."""
    robot = MujocoDriver(NAO, real_time=False)
    guard = GuardedDriver(robot, GATE)
    guard.connect()
    guard.write(command(0.0))
    robot.advance(0.5)
    q = STAND.copy()
    q[[NAO.joint("LAnklePitch"), NAO.joint("RAnklePitch")]] -= 0.5
    robot.write(replace(command(0.0), q=q))
    for _ in range(200):
        robot.advance(DT)
        guard.read()
        if guard.status.condition is not Condition.LIVE:
            break
    assert guard.status.condition is Condition.FALLING
    assert guard.status.lean < np.radians(35.0)
    for _ in range(200):
        robot.advance(DT)
        guard.read()
    assert guard.status.condition is Condition.FALLEN
