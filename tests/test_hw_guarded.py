"""A guarded driver: nothing unsafe passes, falls and alarms are seen, and it always ends let go of."""

from __future__ import annotations

import os
import signal
import threading
import time
from dataclasses import fields, replace
from itertools import count
from typing import Any

import numpy as np
import pytest

from naoimitate import load_robot
from naoimitate.command_gate import CommandGate, Refusal
from naoimitate.core.errors import DriverError
from naoimitate.core.frames import RobotCommand
from naoimitate.fsm.fall_latch import FallLimits
from naoimitate.hw.driver import Driver, RobotState
from naoimitate.hw.guarded import NOT_LIVE, Condition, GuardedDriver, GuardSettings
from naoimitate.hw.lean import lean, up_from_angles, up_from_quat
from naoimitate.hw.none import NoDriver
from naoimitate.sim.driver import MujocoDriver
from naoimitate.sim.placement import stand_on_floor
from naoimitate.sim.sensors import roll_pitch

NAO = load_robot("nao", "v4")
GATE = CommandGate(NAO)
STAND = NAO.postures["stand"]
DT, UP = 0.02, np.array([0.0, 0.0, 1.0])
NAN = np.full(24, np.nan)


class FakeRobot:
    """A driver that writes down what is done to it. Every reading takes a period; its time is the clock of a test."""

    period = DT

    def __init__(self) -> None:
        self.done: list[object] = []
        self.angles = np.zeros(2)
        self.fell, self.alarms, self.time = False, (), 0.0
        self.alarms: tuple[str, ...]
        self.faults: tuple[str, ...] = ()
        self.breaks: set[str] = set()
        self.slow = 0.0

    def connect(self) -> None:
        self._do("connect")

    def read(self) -> RobotState:
        if "read" in self.breaks:
            raise DriverError("the robot does not answer")
        self.time += DT
        gyro = np.zeros(3)
        state = (self.time, STAND, NAN, self.angles, gyro, np.zeros(3), np.zeros((2, 4)), self.fell)
        return RobotState(*state, alarms=self.alarms, faults=self.faults)

    def write(self, command: RobotCommand) -> None:
        self._do(command)

    def soften(self, share: float) -> None:
        self._do(("soften", share))

    def emergency_stop(self) -> None:
        self._do("emergency stop")

    def stop(self) -> None:
        time.sleep(self.slow)
        self._do("stop")

    def _do(self, what: object) -> None:
        self.done.append(what)
        if str(what if isinstance(what, str) else what[0] if isinstance(what, tuple) else "write") in self.breaks:
            raise RuntimeError("broken")


def command(moment: float, *, head: float = 0.0, lift: float = 0.0) -> RobotCommand:
    """A stand at a time, with the head turned by rad, lifted off the floor by m."""
    q = STAND.copy()
    q[NAO.joint("HeadYaw")] = head
    pos, quat = stand_on_floor(NAO, q)
    empty: dict[str, Any] = {field.name: None for field in fields(RobotCommand)}
    pose = {"time": moment, "q": q, "base_pos": pos + lift * UP, "base_quat": quat, "support": "D"}
    return RobotCommand(**{**empty, **pose})


def guarded(settings: GuardSettings | None = None) -> tuple[GuardedDriver, FakeRobot]:
    robot = FakeRobot()
    guard = GuardedDriver(robot, GATE, settings, clock=lambda: robot.time)
    guard.connect()
    return guard, robot


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


def test_an_emergency_stop_while_the_robot_is_being_connected_counts() -> None:
    robot = FakeRobot()
    guard = GuardedDriver(robot, GATE)
    robot.connect = guard.emergency_stop  # type: ignore[method-assign]
    with pytest.raises(DriverError, match="emergency stop"):
        guard.connect()
    assert robot.done[-1] == "stop"
    assert guard.status.condition is Condition.EMERGENCY


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


def test_an_emergency_stop_ends_a_fault() -> None:
    guard, robot = guarded()
    robot.faults = ("RKneePitch is silent",)
    for i in range(30):
        guard.write(command(i * DT))
    guard.emergency_stop()
    guard.stop()
    assert robot.done[-3:] == ["emergency stop", ("soften", GuardSettings().emergency_stiffness), "stop"]
    assert guard.status.condition is Condition.EMERGENCY


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
