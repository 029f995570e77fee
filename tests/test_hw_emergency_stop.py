"""The emergency stop: at once, from anywhere, in any moment, and it always ends in a defined state."""

from __future__ import annotations

import os
import signal
import threading
import time

import numpy as np
import pytest
from guard_rig import DT, GATE, NAO, STAND, FakeRobot, command, guarded

from naoimitate.core.errors import DriverError
from naoimitate.core.frames import RobotCommand
from naoimitate.hw.guarded import Condition, GuardedDriver, GuardSettings
from naoimitate.sim.driver import MujocoDriver


def test_an_emergency_stop_ends_the_motion_then_softens_then_lets_go_once_and_stays_until_reset() -> None:
    """Pressed again, the driver's own stop is repeated: a motor may have missed it."""
    guard, robot = guarded()
    guard.emergency_stop()
    for _ in range(2):
        guard.emergency_stop()
    guard.stop()
    softened = ("soften", GuardSettings().emergency_stiffness)
    assert robot.done == ["connect", "emergency stop", softened, "stop", "emergency stop", "emergency stop"]
    assert guard.status.condition is Condition.EMERGENCY
    with pytest.raises(DriverError, match="reset"):
        guard.connect()
    guard.reset()
    guard.connect()
    guard.write(command(0.0))
    assert guard.status.condition is Condition.LIVE
    assert guard.command is not None


def test_an_emergency_stop_does_not_wait_for_a_robot_that_takes_its_time_to_let_go() -> None:
    guard, robot = guarded()
    robot.slow = 0.4
    begin = time.monotonic()
    guard.emergency_stop()
    assert time.monotonic() - begin < 0.2
    assert robot.done[-1] == ("soften", GuardSettings().emergency_stiffness)
    guard.stop()
    assert robot.done[-1] == "stop", "but a stop does"
    guard, robot = guarded()
    robot.slow = 0.2
    guard.emergency_stop()
    guard.reset()
    guard.connect()
    assert robot.done[-2:] == ["stop", "connect"], "and so does the next connection"


BREAKS: list[set[str]] = [{"soften"}, {"stop"}, {"emergency stop"}, {"soften", "stop", "emergency stop"}]


@pytest.mark.parametrize("breaks", BREAKS)
def test_an_emergency_stop_ends_defined_whatever_the_driver_does(breaks: set[str]) -> None:
    guard, robot = guarded()
    robot.breaks = breaks
    guard.emergency_stop()
    assert guard.status.condition is Condition.EMERGENCY
    assert robot.done[-1] == "stop"
    assert guard.status.problem == "the driver failed (RuntimeError: broken)"


def test_an_emergency_stop_from_many_threads_during_writes_is_one() -> None:
    guard, robot = guarded()
    go, running = threading.Event(), True

    def writes() -> None:
        moment = 0.0
        while running:
            moment += 0.001
            guard.write(command(moment))

    def stops() -> None:
        go.wait()
        guard.emergency_stop()

    threads = [threading.Thread(target=stops) for _ in range(8)]
    writer = threading.Thread(target=writes)
    for thread in (*threads, writer):
        thread.start()
    time.sleep(0.1)
    go.set()
    for thread in threads:
        thread.join(2.0)
        assert not thread.is_alive()
    done = len([d for d in robot.done if isinstance(d, RobotCommand)])
    time.sleep(0.05)
    running = False
    writer.join(2.0)
    assert robot.done.count("stop") == 1
    assert robot.done.index("emergency stop") < robot.done.index("stop")
    assert len([d for d in robot.done if isinstance(d, RobotCommand)]) <= done + 1, "but for one on its way"
    assert guard.status.condition is Condition.EMERGENCY


def test_an_emergency_stop_from_a_signal_never_waits_for_what_it_interrupts() -> None:
    """The signal comes while the same thread is inside the driver, with the guard's lock held."""
    guard, robot = guarded()
    before = signal.signal(signal.SIGUSR1, lambda *_: guard.emergency_stop())
    try:
        robot.write = lambda c: os.kill(os.getpid(), signal.SIGUSR1)  # type: ignore[method-assign]
        guard.write(command(0.0))
        assert guard.status.condition is Condition.EMERGENCY
        assert robot.done[-1] == "stop"
    finally:
        signal.signal(signal.SIGUSR1, before)


class Wayward(FakeRobot):
    """A driver that forgets every stop from before its connection, as all do, and begins late; it goes on for 5 s."""

    def connect(self) -> None:
        self.begun.set()
        self.go.wait(5.0)
        self.done.clear()
        end = time.monotonic() + 5.0
        while "stop" not in self.done and time.monotonic() < end:
            time.sleep(0.01)

    def __init__(self) -> None:
        super().__init__()
        self.begun, self.go = threading.Event(), threading.Event()


def test_an_emergency_stop_just_before_the_driver_begins_to_connect_is_not_lost() -> None:
    robot = Wayward()
    guard = GuardedDriver(robot, GATE)
    errors: list[BaseException] = []

    def connect() -> None:
        try:
            guard.connect()
        except DriverError as error:
            errors.append(error)

    thread = threading.Thread(target=connect)
    thread.start()
    robot.begun.wait(5.0)
    guard.emergency_stop()
    robot.go.set()
    thread.join(10.0)
    assert not thread.is_alive(), "stopped again while it was connecting"
    assert robot.done[-1] == "stop"
    assert "emergency stop" in str(errors[0])
    assert guard.status.condition is Condition.EMERGENCY


@pytest.mark.parametrize("ended", [False, True])
def test_an_emergency_stop_while_the_last_connection_is_let_go_of_reaches_the_next(ended: bool) -> None:
    """It comes after ``connect`` has looked for one, and before there is a connection that it could end."""
    guard, robot = guarded()
    if ended:
        guard.stop()
    latch = guard._latch
    robot.stop = lambda: robot._do("stop") or guard.emergency_stop()  # type: ignore[func-returns-value,method-assign]
    if ended:
        guard._letting_go.wait = guard.emergency_stop  # type: ignore[method-assign]
    done = len(robot.done)
    with pytest.raises(DriverError, match="stopped while"):
        guard.connect()
    assert guard._latch is not latch, "it was on its way to connect"
    assert "connect" not in robot.done[done:]
    assert guard.status.condition is Condition.EMERGENCY


def test_what_is_shown_does_not_wait_for_a_connection() -> None:
    robot = Wayward()
    guard = GuardedDriver(robot, GATE)

    def connect() -> None:
        with pytest.raises(DriverError):
            guard.connect()

    thread = threading.Thread(target=connect)
    thread.start()
    robot.begun.wait(5.0)
    begin = time.monotonic()
    assert guard.status.condition is Condition.CONNECTING
    assert time.monotonic() - begin < 0.2
    robot.go.set()
    guard.stop()
    thread.join(2.0)
    assert not thread.is_alive()
    assert guard.status.condition is Condition.STOPPED


def test_a_stop_that_is_interrupted_lets_go_all_the_same() -> None:
    guard, robot = guarded()
    robot.slow = 0.3
    before = signal.signal(signal.SIGUSR1, signal.default_int_handler)
    try:
        for _ in range(2):
            threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGUSR1)).start()
            with pytest.raises(KeyboardInterrupt):
                guard.stop()
        assert "stop" not in robot.done
    finally:
        signal.signal(signal.SIGUSR1, before)
    guard.stop()
    assert robot.done == ["connect", "stop"]


def test_an_emergency_stop_while_the_robot_is_being_connected_counts() -> None:
    robot = FakeRobot()
    guard = GuardedDriver(robot, GATE)
    robot.connect = guard.emergency_stop  # type: ignore[method-assign]
    with pytest.raises(DriverError, match="emergency stop"):
        guard.connect()
    assert robot.done[-1] == "stop"
    assert guard.status.condition is Condition.EMERGENCY


def test_an_emergency_stop_ends_a_fault() -> None:
    guard, robot = guarded()
    robot.faults = ("RKneePitch is silent",)
    for i in range(30):
        guard.write(command(i * DT))
    guard.emergency_stop()
    guard.stop()
    assert robot.done[-3:] == ["emergency stop", ("soften", GuardSettings().emergency_stiffness), "stop"]
    assert guard.status.condition is Condition.EMERGENCY


def test_after_an_emergency_stop_the_simulated_robot_holds_its_pose() -> None:
    robot = MujocoDriver(NAO, real_time=False)
    guard = GuardedDriver(robot, GATE)
    guard.connect()
    guard.write(command(0.0))
    guard.emergency_stop()
    robot.write(command(0.02, head=1.0))
    held = robot.advance(1.0)
    np.testing.assert_allclose(held.q, STAND, atol=0.02)
    assert not held.fell
    robot.connect()
    robot.write(command(0.02, head=0.5))
    assert robot.advance(1.0).q[NAO.joint("HeadYaw")] == pytest.approx(0.5, abs=0.02)
