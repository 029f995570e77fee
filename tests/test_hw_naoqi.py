"""The driver of a real NAO, against a fake one that ``qi`` serves over TCP."""

from __future__ import annotations

import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from naoimitate import load_robot
from naoimitate.calib.zeros import JointZeros
from naoimitate.command_gate import CommandGate
from naoimitate.core.errors import DriverError
from naoimitate.core.frames import RobotCommand
from naoimitate.hw.driver import Driver
from naoimitate.hw.guarded import Condition, GuardedDriver
from naoimitate.hw.naoqi import NaoqiDriver
from naoimitate.hw.naoqi_sender import HEADROOM
from naoimitate.hw.naoqi_senses import as_known, blank
from naoimitate.hw.naoqi_settings import NaoqiSettings
from naoimitate.robot.model import Array, RobotModel
from naoimitate.sim.placement import stand_on_floor

NAO = load_robot("nao", "v4")
INIT, STAND = NAO.postures["StandInit"], NAO.postures["stand"]


def test_without_qi_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "qi", None)
    with pytest.raises(DriverError, match=r"naoimitate\[naoqi\]"):
        NaoqiDriver(NAO).connect()


pytest.importorskip("qi", reason="the package qi has wheels for Python 3.8 to 3.12 on Linux x86_64 only")


from naoqi_robot import RemoteNao  # noqa: E402 - needs qi


@pytest.fixture
def fake() -> Iterator[RemoteNao]:
    fake = RemoteNao(NAO)
    yield fake
    fake.quit()


@pytest.fixture
def connect(fake: RemoteNao) -> Iterator[Callable[..., NaoqiDriver]]:
    opened: list[NaoqiDriver] = []

    def make(robot: RobotModel = NAO, **settings: Any) -> NaoqiDriver:
        extra = {key: settings.pop(key) for key in ("zeros", "notice") if key in settings}
        driver = NaoqiDriver(robot, NaoqiSettings(url=fake.order("serve"), patience=2.0, **settings), **extra)
        opened.append(driver)
        driver.connect()
        return driver

    yield make
    for driver in opened:
        driver.stop()


def command(q: Array, moment: float = 0.0, hands: tuple[float, float] | None = None) -> RobotCommand:
    pos, quat = stand_on_floor(NAO, q)
    empty: dict[str, Any] = {field.name: None for field in fields(RobotCommand)}
    pose = {"time": moment, "q": q, "base_pos": pos, "base_quat": quat, "support": "D"}
    return RobotCommand(**{**empty, **pose, "hand_opening": None if hands is None else np.array(hands)})


def turned(angle: float, name: str = "HeadYaw") -> Array:
    q = STAND.copy()
    q[NAO.joint(name)] += angle
    return q


def wait_for(true: Callable[[], bool], patience: float = 15.0) -> None:
    end = time.monotonic() + patience
    while not true():
        assert time.monotonic() < end, "did not happen in time"
        time.sleep(0.002)


def test_it_is_a_driver() -> None:
    assert isinstance(NaoqiDriver(NAO), Driver)


def test_it_wakes_up_softly_comes_to_its_stand_and_rests_at_the_end(
    connect: Callable[..., NaoqiDriver], fake: RemoteNao
) -> None:
    """NAOqi's stand is not the model's: from there it goes on to the posture in which a session begins."""
    said: list[str] = []
    driver = connect(stiffness=0.9, ramp=0.7, notice=said.append)
    assert fake.done[:3] == [("stiffnessInterpolation", 0.9, 0.7), ("wakeUp",), ("goToPosture", "StandInit")]
    name, duration = fake.done[3]
    assert name == "angleInterpolation"
    assert duration == pytest.approx(1.875 * np.abs(STAND - INIT).max() / NaoqiSettings().approach)
    assert said == ["moving to the stand posture within 3 s: hold the robot"]
    np.testing.assert_allclose(driver.read().q, STAND)
    driver.stop()
    driver.stop()
    assert fake.done[4:] == [("killAll",), ("rest",)]


def test_a_joint_that_does_not_arrive_is_named(connect: Callable[..., NaoqiDriver], fake: RemoteNao) -> None:
    fake.blocked = ["RKneePitch"]
    with pytest.raises(DriverError, match=r"^RKneePitch \(0\.40 rad away\): did not arrive"):
        connect()
    assert fake.done[-1] == ("rest",)


def test_a_session_can_begin_where_it_stands(fake: RemoteNao) -> None:
    """The first command of a session passes the gate."""
    guard = GuardedDriver(NaoqiDriver(NAO, NaoqiSettings(url=fake.order("serve"))), CommandGate(NAO))
    guard.connect()
    guard.write(command(STAND))
    assert guard.status.accepted == 1, guard.status
    guard.stop()


def test_before_the_first_command_nothing_is_sent(connect: Callable[..., NaoqiDriver], fake: RemoteNao) -> None:
    connect()
    time.sleep(0.1)
    assert fake.sent == []


def test_the_newest_command_is_sent_every_period_as_fast_as_its_step_needs(
    connect: Callable[..., NaoqiDriver], fake: RemoteNao
) -> None:
    driver = connect()
    step, i = 0.001, 0
    command(STAND)  # compiles
    begin = time.monotonic()
    while time.monotonic() < begin + 1.0:
        i += 1
        driver.write(command(turned(step * i)))
        time.sleep(0.005)
    wait_for(lambda: fake.sent[-1][1]["HeadYaw"] == pytest.approx(step * i))
    times = np.array([moment for moment, _, _ in fake.sent])
    assert 40 <= len(times) <= 53, "one for each 20 ms, not one for each command"
    assert np.median(np.diff(times)) == pytest.approx(driver.period, abs=0.004)
    yaw, speed = np.array([a["HeadYaw"] for _, a, _ in fake.sent]), NAO.speed[NAO.joint("HeadYaw")]
    steps = np.diff(np.concatenate([[STAND[NAO.joint("HeadYaw")]], yaw]))
    expected = np.maximum(HEADROOM * steps / (driver.period * speed), 0.01)
    np.testing.assert_allclose([fraction for _, _, fraction in fake.sent], expected, rtol=1e-6)
    assert set(fake.sent[0][1]) == set(NAO.joint_names), "both names of the shared motor too"


def test_a_step_too_large_for_a_period_goes_at_full_speed_and_none_at_zero(
    connect: Callable[..., NaoqiDriver], fake: RemoteNao
) -> None:
    driver = connect()
    driver.write(command(turned(1.0)))
    wait_for(lambda: len(fake.sent) >= 1)
    driver.write(command(turned(1.0 + 1e-6)))
    wait_for(lambda: len(fake.sent) == 2)
    assert [fraction for _, _, fraction in fake.sent] == [1.0, 0.01]


def test_hands_follow_their_opening_and_stay_where_there_is_none(
    connect: Callable[..., NaoqiDriver], fake: RemoteNao
) -> None:
    driver = connect()
    for hands in ((0.8, math.nan), (0.81, math.nan), (0.2, math.nan)):
        driver.write(command(STAND, hands=hands))
        time.sleep(0.08)
    assert [a for _, a, _ in fake.sent if "LHand" in a or "RHand" in a] == [{"LHand": 0.8}, {"LHand": 0.2}]


def test_zeros_and_gravity_belong_to_the_servos_alone(connect: Callable[..., NaoqiDriver], fake: RemoteNao) -> None:
    offsets = np.full(len(STAND), 0.01)
    driver = connect(zeros=JointZeros("Hugo", offsets), servo_stiffness=200.0)
    q = turned(0.1) + INIT - STAND
    driver.write(command(q))
    wait_for(lambda: len(fake.sent) >= 1)
    knee = NAO.joint("LKneePitch")
    assert fake.sent[0][1]["HeadYaw"] == pytest.approx(q[NAO.joint("HeadYaw")] + 0.01, abs=1e-4)
    assert fake.sent[0][1]["LKneePitch"] < q[knee] + 0.01 - 1e-3, "the bent knee is commanded straighter than it hangs"
    wait_for(lambda: abs(driver.read().q[NAO.joint("HeadYaw")] - q[NAO.joint("HeadYaw")]) < 1e-4)


def test_a_guessed_stiffness_can_be_corrected_by_what_the_robot_feels(
    connect: Callable[..., NaoqiDriver], fake: RemoteNao
) -> None:
    """Its joints are at once where they are told to be, as firm servos are."""
    for place in ("FrontLeft", "FrontRight", "RearLeft", "RearRight"):
        fake.feels(f"LFoot/FSR/{place}", 0.65)
        fake.feels(f"RFoot/FSR/{place}", 0.65)
    driver = connect(servo_stiffness=200.0, learning=True)
    driver.write(command(STAND))
    wait_for(lambda: driver._command.inner.factor < 0.8)  # type: ignore[attr-defined]


def test_closed_loops_balance_what_it_feels_and_let_go_when_it_feels_nothing_new(
    connect: Callable[..., NaoqiDriver], fake: RemoteNao
) -> None:
    """It leans 2 deg too far forwards: the body is brought back over the feet, until the robot does not answer."""
    fake.feels("InertialSensor/AngleY", math.radians(2.0))
    driver = connect(balance=True)
    driver.write(command(STAND))
    legs = [j for side in "lr" for j in NAO.chains[f"{side}_leg"]]

    def moved() -> float:
        """By how much (rad) what is sent is beside the command, at most."""
        sent = fake.sent
        return max(abs(sent[-1][1][NAO.joint_names[j]] - STAND[j]) for j in legs) if sent else 0.0

    wait_for(lambda: moved() > math.radians(1.5))
    fake.order("event", "answering", False)
    wait_for(lambda: moved() < math.radians(0.1))
    fake.order("event", "answering", True)
    wait_for(lambda: moved() > math.radians(1.5))


def test_between_two_answers_a_state_is_still_known_and_later_it_is_not() -> None:
    state = blank(len(STAND), STAND)
    assert [as_known(state, now, 0.06).time for now in (0.0, 0.03, 0.06, 0.07, 5.0)] == [0.0, 0.03, 0.06, 0.0, 0.0]


def test_it_feels_what_the_robot_measures_in_our_units(connect: Callable[..., NaoqiDriver], fake: RemoteNao) -> None:
    fake.feels("InertialSensor/AngleY", 0.2)
    fake.feels("InertialSensor/GyroscopeX", 0.5)
    state = connect().read()
    np.testing.assert_allclose(state.angles, (0.0, 0.2))
    np.testing.assert_allclose(state.gyro, (0.5, 0.0, 0.0))
    np.testing.assert_allclose(state.accelerometer, (-0.3, 0.0, 9.8), err_msg="standing is positive")
    np.testing.assert_allclose(state.fsr, 9.81 * np.arange(0.1, 0.85, 0.1).reshape(2, 4), rtol=1e-3)
    assert np.isnan(state.torque).all()
    assert not state.fell
    assert state.alarms == ()


def test_a_robot_that_lies_has_fallen(connect: Callable[..., NaoqiDriver], fake: RemoteNao) -> None:
    driver = connect()
    fake.feels("InertialSensor/AngleX", -1.4)
    wait_for(lambda: driver.read().fell)
    fake.posture = "LyingRight"
    driver.stop()
    assert fake.done[-2:] == [("killAll",), ("setStiffnesses", 0.0)], "no movement of a robot that lies"


def test_heat_battery_and_silence_are_alarms(connect: Callable[..., NaoqiDriver], fake: RemoteNao) -> None:
    driver = connect()
    fake.heats("RKneePitch", 2)
    fake.feels("Battery/Charge", 0.08)
    wait_for(lambda: len(driver.read().alarms) == 2)
    assert driver.read().alarms == ("RKneePitch is very hot: much less stiffness", "battery at 8 %")
    fake.order("event", "answering", False)
    wait_for(lambda: "not answered" in driver.read().alarms[-1])
    assert driver.read().faults == ()
    fake.order("event", "answering", True)
    wait_for(lambda: len(driver.read().alarms) == 2)


def test_what_makes_a_robot_disobey_is_a_fault(connect: Callable[..., NaoqiDriver], fake: RemoteNao) -> None:
    driver = connect()
    fake.heats("RKneePitch", 3)
    fake.feels("Battery/Charge", 0.04)
    wait_for(lambda: len(driver.read().faults) == 2)
    assert driver.read().faults == ("RKneePitch is too hot and has no stiffness any more", "battery at 4 %")
    assert driver.read().alarms == ()
    fake.order("event", "answering", False)
    wait_for(lambda: driver.read().faults[-1] == "the robot has not answered for 2 s")
    fake.order("event", "answering", True)
    wait_for(lambda: len(driver.read().faults) == 2)


def test_answers_that_make_no_sense_are_told_as_such_and_the_robot_is_still_commanded(
    connect: Callable[..., NaoqiDriver], fake: RemoteNao
) -> None:
    driver = connect()
    angles = fake.angles
    fake.angles = {**angles, "HeadYaw": "warm"}
    says = "no sense in what the robot answers (ValueError: could not convert"
    wait_for(lambda: any(alarm.startswith(says) for alarm in driver.read().alarms))
    fake.sent = []
    driver.write(command(turned(0.01)))
    wait_for(lambda: fake.sent != [])
    wait_for(lambda: driver.read().alarms == (), 5.0)


def test_behind_the_guard_a_robot_that_falls_silent_is_in_fault_and_one_that_is_lost_is_let_go_of(
    fake: RemoteNao,
) -> None:
    guard = GuardedDriver(NaoqiDriver(NAO, NaoqiSettings(url=fake.order("serve"))), CommandGate(NAO))
    guard.connect()
    fake.order("event", "answering", False)
    wait_for(lambda: guard.write(command(STAND)) or guard.status.condition is Condition.FAULT)
    assert guard.status.problem == "the robot has not answered for 2 s"
    assert ("rest",) not in fake.done
    fake.order("event", "answering", True)
    guard.connect()
    fake.order("close")
    wait_for(lambda: guard.write(command(STAND)) or guard.status.condition is Condition.STOPPED)
    assert guard.status.problem.startswith("the connection to the robot broke")


def test_sensors_that_a_robot_does_not_have_are_nan(connect: Callable[..., NaoqiDriver], fake: RemoteNao) -> None:
    fake.order("lack", "Gyroscope", "FSR", "Battery")
    state = connect().read()
    assert np.isnan(state.gyro).all()
    assert np.isnan(state.fsr).all()
    assert state.alarms == ()


def test_softening_does_not_wait_for_the_robot(connect: Callable[..., NaoqiDriver], fake: RemoteNao) -> None:
    driver = connect(stiffness=0.8)
    begin = time.monotonic()
    driver.soften(0.5)
    assert time.monotonic() - begin < 0.01
    wait_for(lambda: ("setStiffnesses", pytest.approx(0.4)) in fake.done)


def test_what_moves_the_robot_by_itself_is_switched_off_with_a_word(
    connect: Callable[..., NaoqiDriver], fake: RemoteNao
) -> None:
    fake.life, fake.moves_alone, fake.reflexes = "solitary", True, False
    said: list[str] = []
    connect(notice=said.append)
    assert fake.done[:6] == [
        ("setState", "disabled"),
        ("setBreathEnabled", False),
        ("setIdlePostureEnabled", False),
        ("setCollisionProtectionEnabled", True),
        ("setFallManagerEnabled", True),
        ("setSmartStiffnessEnabled", True),
    ]
    for what in ("autonomous life was solitary", "breathing", "idle", "collision", "fall manager", "smart stiffness"):
        assert any(what in sentence for sentence in said), what


def test_reflexes_that_are_on_are_left_alone(connect: Callable[..., NaoqiDriver], fake: RemoteNao) -> None:
    said: list[str] = []
    connect(notice=said.append)
    assert not [sentence for sentence in said if "hold the robot" not in sentence]
    assert not [what for what, *_ in fake.done if what.endswith("Enabled")]


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"version": "2.9.5"}, "2.9.5 is not supported"),
        ({"version": "1.14.5"}, "not supported"),
        ({"version": "unknown"}, "not NAOqi"),
        ({"posture": "LyingBelly"}, "LyingBelly: put it on its feet"),
        ({"posture": "Sitting"}, "Sitting"),
        ({"names": ["HeadYaw", "HeadPitch"]}, "has no LShoulderPitch"),
    ],
)
def test_a_robot_that_cannot_be_driven_is_one_clear_line_and_not_touched(
    connect: Callable[..., NaoqiDriver], fake: RemoteNao, wrong: dict[str, Any], says: str
) -> None:
    for name, value in wrong.items():
        setattr(fake, name, value)
    with pytest.raises(DriverError, match=says) as caught:
        connect()
    assert "\n" not in str(caught.value)
    assert fake.done == []


def test_a_robot_that_cannot_stand_up_is_put_to_rest(connect: Callable[..., NaoqiDriver], fake: RemoteNao) -> None:
    fake.can_stand = False
    with pytest.raises(DriverError, match="could not stand up"):
        connect()
    assert fake.done[-1] == ("rest",)


def test_an_unreachable_robot_is_one_clear_line() -> None:
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        port = closed.getsockname()[1]
    for url, says in ((f"tcp://127.0.0.1:{port}", "no robot at"), ("bogus", "no address"), ("tcp://[", "no robot at")):
        begin = time.monotonic()
        with pytest.raises(DriverError, match=says) as caught:
            NaoqiDriver(NAO, NaoqiSettings(url=url, patience=1.0)).connect()
        assert "\n" not in str(caught.value)
        assert time.monotonic() - begin < 2.0


def test_something_that_listens_but_is_no_robot_is_given_up_in_time() -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute:
        url = f"tcp://127.0.0.1:{mute.getsockname()[1]}"
        with pytest.raises(DriverError, match=r"no robot at .*no answer in 0\.5 s"):
            NaoqiDriver(NAO, NaoqiSettings(url=url, patience=0.5)).connect()


def test_a_robot_without_its_services_is_one_clear_line(connect: Callable[..., NaoqiDriver], fake: RemoteNao) -> None:
    fake.offers = ["ALMotion"]
    with pytest.raises(DriverError, match="ALSystem"):
        connect()


def test_a_connection_that_breaks_is_told_and_the_driver_still_stops(
    connect: Callable[..., NaoqiDriver], fake: RemoteNao
) -> None:
    driver = connect()
    driver.write(command(turned(0.1)))
    fake.order("close")
    with pytest.raises(DriverError, match="connection"):
        wait_for(lambda: driver.read() is None)
    begin = time.monotonic()
    driver.stop()
    assert time.monotonic() - begin < 2.5
    assert not [thread for thread in threading.enumerate() if thread.name == "naoqi"]


def test_a_program_that_is_killed_leaves_a_robot_at_rest(fake: RemoteNao, tmp_path: Path) -> None:
    url = fake.order("serve")
    program = (
        "import os; from naoimitate import load_robot; from naoimitate.hw.naoqi import NaoqiDriver, NaoqiSettings\n"
        f"NaoqiDriver(load_robot('nao'), NaoqiSettings(url='{url}')).connect(); os.kill(os.getpid(), 9)"
    )
    assert subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=False).returncode == -9
    wait_for(lambda: fake.done[-2:] == [("killAll",), ("rest",)], 15.0)


def test_a_stop_that_is_interrupted_can_be_repeated(connect: Callable[..., NaoqiDriver], fake: RemoteNao) -> None:
    driver = connect()
    fake.order("event", "resting", False)
    before = signal.signal(signal.SIGUSR1, signal.default_int_handler)
    try:
        threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGUSR1)).start()
        with pytest.raises(KeyboardInterrupt):
            driver.stop()
    finally:
        signal.signal(signal.SIGUSR1, before)
    driver.emergency_stop()
    fake.order("event", "resting", True)
    count = len(fake.done)
    driver.stop()
    assert fake.done[count:] == [("killAll",), ("rest",)]
    assert not [thread for thread in threading.enumerate() if thread.name == "naoqi"]


def test_a_child_that_dies_is_a_connection_that_broke(connect: Callable[..., NaoqiDriver], fake: RemoteNao) -> None:
    driver = connect()
    assert driver._link is not None
    driver._link._child.kill()
    with pytest.raises(DriverError, match="connection"):
        wait_for(lambda: driver.read() is None)
    driver.stop()


def test_an_emergency_stop_while_the_robot_wakes_up_puts_it_to_rest(fake: RemoteNao) -> None:
    guard = GuardedDriver(NaoqiDriver(NAO, NaoqiSettings(url=fake.order("serve"))), CommandGate(NAO))
    fake.order("event", "awake", False)
    threading.Timer(1.0, guard.emergency_stop).start()
    with pytest.raises(DriverError):
        guard.connect()
    assert ("goToPosture", "StandInit") not in fake.done
    guard.stop()
    assert fake.done[-1] == ("rest",)
    assert guard.status.condition is Condition.EMERGENCY


def test_an_emergency_stop_ends_the_motion_at_once_and_then_puts_the_robot_to_rest(fake: RemoteNao) -> None:
    """Neither waits for the robot, which takes its time to rest."""
    driver = NaoqiDriver(NAO, NaoqiSettings(url=fake.order("serve")))
    guard = GuardedDriver(driver, CommandGate(NAO))
    guard.connect()
    guard.write(command(STAND))
    guard.write(command(turned(0.05), 0.05))
    fake.order("event", "resting", False)
    began, before = time.monotonic(), len(fake.done)
    guard.emergency_stop()
    assert time.monotonic() - began < 0.2
    wait_for(lambda: len(fake.done) >= before + 2)
    first = fake.done[before : before + 2]  # asked without waiting: one may overtake the other
    assert ("killAll",) in first and ("setStiffnesses", pytest.approx(0.6)) in first
    sent = len(fake.sent)
    guard.write(command(turned(0.1), 0.1))
    driver.write(command(turned(0.1), 0.1))
    time.sleep(0.1)
    assert len(fake.sent) == sent
    fake.order("event", "resting", True)
    guard.stop()
    assert fake.done[-1] == ("rest",)
    assert guard.status.condition is Condition.EMERGENCY


def test_behind_the_guard_a_robot_that_tips_is_softened_and_let_go_of(
    connect: Callable[..., NaoqiDriver], fake: RemoteNao
) -> None:
    driver = NaoqiDriver(NAO, NaoqiSettings(url=fake.order("serve")))
    guard = GuardedDriver(driver, CommandGate(NAO))
    guard.connect()
    guard.write(command(STAND))
    assert guard.status.accepted == 1, guard.status
    fake.feels("InertialSensor/AngleY", 0.5)
    wait_for(lambda: guard.read() is not None and guard.status.condition is Condition.FALLING)
    wait_for(lambda: ("setStiffnesses", pytest.approx(0.1)) in fake.done)
    fake.feels("InertialSensor/AngleY", 1.5)
    fake.posture = "LyingBelly"
    wait_for(lambda: guard.read() is not None and guard.status.condition is Condition.FALLEN)
    assert fake.done[-1] == ("setStiffnesses", 0.0)
