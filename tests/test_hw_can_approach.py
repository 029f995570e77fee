"""A connection leads the motors from wherever they are to the posture in which a session begins."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from can_rig import QUICK, Rig, rig, wait_for
from hypothesis import given
from hypothesis import strategies as st

from naoimitate.core.errors import DriverError
from naoimitate.core.frames import Array
from naoimitate.hw.approach import Approach
from naoimitate.hw.can.joints import read_joint_map
from naoimitate.robot import RobotModel

STEP = 0.0002
"""rad, one step of a position in the database."""
BRISK = replace(QUICK, approach=2.0)
"""So that the tests do not take the time that a robot does."""


def paths(it: Rig, key: str = "position") -> dict[int, Array]:
    """What each motor was sent, in order."""
    sent: dict[int, list[float]] = {node: [] for node in it.stub.motors}
    for _, name, values in it.frames():
        if name.startswith("Command") and values["mode"] == "follow":
            sent[int(name[-2:])].append(values[key])
    return {node: np.array(values) for node, values in sent.items()}


@contextmanager
def after(seconds: float, do: Callable[[], object]) -> Iterator[None]:
    timer = threading.Timer(seconds, do)
    timer.start()
    yield
    timer.join()


angles = st.lists(st.floats(-3.0, 3.0).map(lambda x: round(x, 4)), min_size=3, max_size=3).map(np.array)


@given(angles, angles, st.floats(0.05, 5.0))
def test_a_way_is_straight_within_its_speed_and_ends_at_rest_where_it_should(
    start: Array, goal: Array, speed: float
) -> None:
    way = Approach(start, goal, np.full(3, speed))
    times = np.linspace(0.0, way.duration + 0.1, 400)
    path = np.array([way.at(float(t)) for t in times])
    np.testing.assert_allclose(path[0], start, atol=1e-12)
    np.testing.assert_allclose(path[-1], goal, atol=1e-12)
    assert np.all((path >= np.minimum(start, goal) - 1e-9) & (path <= np.maximum(start, goal) + 1e-9))
    fastest = (np.abs(np.diff(path, axis=0)) / np.diff(times)[:, None]).max()
    assert fastest <= speed * (1.0 + 1e-6)
    if np.abs(goal - start).max() > 0.5:
        assert fastest >= 0.9 * speed, "and no slower than it has to be"


@pytest.mark.parametrize("posture", ["Crouch", "zero"])
def test_from_a_crouch_and_from_zero_it_comes_to_the_stand(nao: RobotModel, posture: str) -> None:
    said: list[str] = []
    with rig(nao, settings=BRISK, compensation=False, notice=said.append, posture=posture) as it:
        it.driver.connect()
        q, stand = it.driver.read().q, nao.postures["stand"]
        assert np.abs(q - stand).max() < 0.05, "at the end its newest answers may be a period old"
        assert it.driver.read().alarms == ()
        sent = paths(it)
    assert said == ["moving to the stand posture within 2 s: hold the robot"]
    joints = read_joint_map(nao)
    start = joints.gather(nao.postures[posture], np.zeros(2))
    goal = joints.gather(stand, np.zeros(2))
    longest = max(sent.values(), key=np.ptp)
    for motor, node in enumerate(joints.nodes):
        path = sent[node]
        low, high = sorted((start[motor], goal[motor]))
        assert abs(path[0] - start[motor]) <= STEP and abs(path[-1] - goal[motor]) <= STEP
        assert np.all((path >= low - STEP) & (path <= high + STEP)), "straight, so within the joint's range"
        assert np.abs(np.diff(path)).max() <= 2.0 * 2.0 * it.driver.period + STEP
        share = (path - path[0]) / max(np.ptp(path), 0.1)
        common = (longest - longest[0]) / np.ptp(longest)
        if np.ptp(path) > 0.1:  # all on their way together
            np.testing.assert_allclose(np.abs(share), np.abs(common), atol=2.0 * STEP / 0.1)


def test_from_anywhere_nothing_moves_before_it_is_stiff_and_nothing_jumps(nao: RobotModel) -> None:
    """Outside the limits of the joints too."""
    rng = np.random.default_rng(3)
    with rig(nao, settings=BRISK, compensation=False) as it:
        for motor in it.stub.motors.values():
            motor.position = float(rng.uniform(-2.5, 2.5))
        before = {node: motor.position for node, motor in it.stub.motors.items()}
        it.driver.connect()
        seen = it.frames()
    for node, start in before.items():
        mine = [v for _, name, v in seen if name == f"Command_{node:02d}" and v["mode"] == "follow"]
        assert all(abs(v["position"] - start) <= STEP for v in mine if v["stiffness"] < 1.0)
        path = np.array([v["position"] for v in mine])
        assert np.abs(np.diff(path)).max() <= 2.0 * 2.0 * it.driver.period + STEP


def test_a_robot_that_stands_already_is_moved_without_a_word(nao: RobotModel) -> None:
    said: list[str] = []
    with rig(nao, settings=QUICK, notice=said.append) as it:
        it.driver.connect()
    assert said == []


def test_the_way_usually_takes_its_time() -> None:
    """1.8 rad of a crouched knee at 0.3 rad/s."""
    from naoimitate.hw.can import CanSettings

    way = Approach(np.array([2.1]), np.array([0.3]), np.array([CanSettings().approach]))
    assert way.duration == pytest.approx(11.25)


def test_a_motor_that_is_stuck_is_named_and_the_robot_let_go_of(nao: RobotModel) -> None:
    with rig(
        nao, "LKneePitch:stuck@0", "RHipPitch:stuck@0", settings=BRISK, compensation=False, posture="Crouch"
    ) as it:
        with pytest.raises(DriverError, match=r"motor 11 \(LKneePitch\).*motor 15 \(RHipPitch\)") as error:
            it.driver.connect()
        assert "\n" not in str(error.value) and "HeadYaw" not in str(error.value)
        assert wait_for(lambda: {motor.status for motor in it.stub.motors.values()} == {"off"})
        assert not [thread for thread in threading.enumerate() if thread.name == "can"]


@pytest.mark.parametrize("moment", [0.02, 0.5])
def test_stop_from_another_thread_ends_the_way_at_once(nao: RobotModel, moment: float) -> None:
    """While the motors are being found, and on the way."""
    with rig(nao, settings=replace(QUICK, approach=0.3), compensation=False, posture="Crouch") as it:
        begin = time.monotonic()
        with after(moment, it.driver.stop), pytest.raises(DriverError, match="stopped while the robot was being"):
            it.driver.connect()
        assert time.monotonic() - begin < moment + 0.5
        assert wait_for(lambda: {motor.status for motor in it.stub.motors.values()} == {"off"})


def test_the_emergency_stop_on_the_way_stops_every_motor_within_a_period(nao: RobotModel) -> None:
    with rig(nao, settings=replace(QUICK, approach=1.0, ramp=0.3), compensation=False, posture="Crouch") as it:
        pressed: list[float] = []

        def press() -> None:
            pressed.append(time.time())
            it.driver.emergency_stop()

        with after(1.0, press), pytest.raises(DriverError, match="stopped while"):
            it.driver.connect()
        stops = [when for when, name, _ in it.frames() if name == "EmergencyStop"]
        assert stops[0] - pressed[0] < it.driver.period
        knee = it.stub.motors[11]
        assert nao.postures["stand"][nao.joint("LKneePitch")] + 0.1 < knee.position < 2.1


def test_a_signal_handler_may_stop_the_way(nao: RobotModel) -> None:
    """It runs in the thread that waits for the robot to arrive."""
    with rig(nao, settings=replace(QUICK, approach=0.3), compensation=False, posture="Crouch") as it:
        for stop in (it.driver.stop, it.driver.emergency_stop):
            before = signal.signal(signal.SIGUSR1, lambda *_, stop=stop: stop())
            try:
                begin = time.monotonic()
                with after(0.6, lambda: os.kill(os.getpid(), signal.SIGUSR1)), pytest.raises(DriverError, match="stop"):
                    it.driver.connect()
                assert time.monotonic() - begin < 1.2
            finally:
                signal.signal(signal.SIGUSR1, before)
