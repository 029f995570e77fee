"""The driver switches motors on where they are, leads them within their speeds, and lets them go softly."""

from __future__ import annotations

import threading
import time
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from can_rig import QUICK, UPRIGHT, Rig, all_follow, command, rig, wait_for

from naoimitate.command_gate import CommandGate
from naoimitate.core.errors import DriverError
from naoimitate.hw.can import CanDriver, CanSettings
from naoimitate.hw.can.joints import read_joint_map
from naoimitate.hw.compensation import LoadCompensation
from naoimitate.hw.driver import Driver
from naoimitate.hw.guarded import GuardedDriver
from naoimitate.robot import RobotModel

STEP = 0.0002
"""rad, one step of a position in the database."""


def commands_to(frames: list[tuple[float, str, dict]], node: int) -> list[tuple[float, dict]]:
    return [(when, values) for when, name, values in frames if name == f"Command_{node:02d}"]


def positions(it: Rig) -> dict[int, float]:
    return {node: motor.position for node, motor in it.stub.motors.items()}


def test_it_is_a_driver(nao: RobotModel) -> None:
    assert isinstance(CanDriver(nao, interface="virtual", channel="unused", compensation=False), Driver)


def test_it_only_asks_before_every_motor_has_answered(nao: RobotModel) -> None:
    with rig(nao, "7:silent@0", compensation=False) as it:
        with pytest.raises(DriverError, match=r"motor 7 \(LWristYaw\): no answer on virtual"):
            it.driver.connect()
        assert {str(values["mode"]) for _, name, values in it.frames() if name.startswith("Command")} == {"ask"}
        assert {motor.status for motor in it.stub.motors.values()} == {"off"}


def test_the_stiffness_rises_from_zero_and_goes_back_to_zero_before_off(nao: RobotModel) -> None:
    with rig(nao, settings=replace(QUICK, ramp=0.3), compensation=False) as it:
        it.driver.connect()
        time.sleep(0.03)
        up = [v["stiffness"] for _, v in commands_to(it.frames(), 11) if v["mode"] == "follow"]
        it.driver.stop()
        time.sleep(0.03)
        down = [(str(v["mode"]), v["stiffness"], when) for when, v in commands_to(it.frames(), 11)]
    assert up[0] == 0.0 and up[-1] == 1.0 and max(np.diff(up)) <= 0.1
    following = [stiffness for mode, stiffness, _ in down if mode == "follow"]
    assert following[0] == 1.0 and following[-1] < 0.5 and max(np.diff(following)) <= 0.0
    assert down[-1][2] - down[0][2] >= 0.29
    assert [mode for mode, _, _ in down[-3:]] == ["off"] * 3
    assert {motor.status for motor in it.stub.motors.values()} == {"off"}


def test_commands_arrive_within_the_speed_limits_whatever_is_written(nao: RobotModel) -> None:
    settings = replace(QUICK, speed=0.5)
    with rig(nao, settings=settings, compensation=False) as it:
        joints = read_joint_map(nao)
        it.driver.connect()
        it.frames()
        rng = np.random.default_rng(0)
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            it.driver.write(
                command(nao, rng.uniform(nao.lower - 1.0, nao.upper + 1.0), tuple(rng.uniform(0.0, 1.0, 2)))
            )
            time.sleep(0.004)
        frames = it.frames()
    moved = 0.0
    for motor, node in enumerate(joints.nodes):
        sent = commands_to(frames, node)
        path = np.array([values["position"] for _, values in sent])
        limit = 0.5 * joints.speed[motor]
        assert np.all(np.abs(np.diff(path)) <= limit * 2 * it.driver.period + 2 * STEP)  # two periods when it was late
        assert np.abs(path - path[0]).max() <= limit * (sent[-1][0] - sent[0][0] + 0.02) + STEP
        assert np.all((path >= joints.lower[motor] - STEP) & (path <= joints.upper[motor] + STEP))
        assert np.all([abs(values["speed_limit"] - limit) <= 0.001 for _, values in sent])
        moved = max(moved, float(np.ptp(path)))
    assert moved > 0.3


def test_the_motors_reach_the_command_and_the_state_says_so(nao: RobotModel) -> None:
    with rig(nao, compensation=False) as it:
        it.driver.connect()
        goal = nao.postures["Crouch"]
        it.driver.write(command(nao, goal, (1.0, 0.25)))
        assert wait_for(lambda: bool(np.abs(it.driver.read().q - goal).max() < 2 * STEP))
        state = it.driver.read()
        assert state.alarms == () and not state.fell
        assert all(np.isnan(part).all() for part in (state.angles, state.gyro, state.accelerometer, state.fsr))
        assert wait_for(lambda: abs(it.stub.motors[24].position - 1.0) < STEP)
        assert abs(it.stub.motors[25].position - 0.25) < 2 * STEP


def test_sign_gear_zero_and_torque_constant_stand_between_joint_and_motor(nao: RobotModel) -> None:
    data = deepcopy(nao.data)
    data["can"]["joints"]["LKneePitch"] |= {"sign": -1, "gear": 2.5, "zero": 0.1, "torque_constant": 1.5}
    robot = replace(nao, data=data)
    with rig(robot, compensation=False) as it:
        it.driver.connect()
        knee = robot.joint("LKneePitch")
        assert abs(it.driver.read().q[knee] - robot.postures["stand"][knee]) < STEP
        q = robot.postures["stand"].copy()
        q[knee] = 0.5
        it.driver.write(command(robot, q))
        assert wait_for(lambda: abs(it.driver.read().q[knee] - 0.5) < STEP)
        assert abs(it.stub.motors[11].position + 2.5 * 0.4) < 2 * STEP
        state = it.driver.read()
        assert state.torque[knee] == pytest.approx(-1.5 * 0.4)  # the simulated motors take 0.4 A
        assert np.isnan(state.torque[robot.joint("HeadYaw")])


def test_servos_are_sent_what_gravity_takes_from_them(nao: RobotModel) -> None:
    """tau / k on top of the posture, with the stance taken into account."""
    with rig(nao) as it:
        it.driver.connect()
        joints, own = read_joint_map(nao), read_joint_map(nao).joint >= 0
        for support in ("D", "L"):
            q = nao.postures["stand"]
            it.driver.write(replace(command(nao, q), support=support))
            torque = LoadCompensation(nao).torque(q, UPRIGHT, support)
            expected = np.clip(q + torque / 150.0, nao.lower, nao.upper)[joints.joint[own]]
            nodes = np.array(joints.nodes)[own]
            assert wait_for(
                lambda nodes=nodes, expected=expected: all(
                    abs(it.stub.motors[node].position - angle) < 2 * STEP
                    for node, angle in zip(nodes, expected, strict=True)
                )
            )


def test_without_commands_it_keeps_the_last_target_and_the_motors_alive(nao: RobotModel) -> None:
    with rig(nao, compensation=False) as it:
        it.driver.connect()
        q = nao.postures["StandInit"]
        it.driver.write(command(nao, q))
        assert wait_for(lambda: bool(np.abs(it.driver.read().q - q).max() < 2 * STEP))
        time.sleep(1.0)
        assert np.abs(it.driver.read().q - q).max() < 2 * STEP
        assert all_follow(it)
        assert it.driver.read().alarms == ()


def test_motors_hold_within_a_tenth_of_a_second_when_the_driver_dies(nao: RobotModel) -> None:
    with rig(nao, compensation=False) as it:
        it.driver.connect()
        q = nao.postures["stand"].copy()
        q[nao.joint("HeadYaw")] = 2.0
        it.driver.write(command(nao, q))
        time.sleep(0.05)
        assert it.driver._sender is not None
        it.driver._sender.link.send = lambda frames: None  # type: ignore[method-assign]  # as if it were killed
        time.sleep(0.2)
        held = positions(it)
        assert {motor.status for motor in it.stub.motors.values()} == {"holding"}
        assert 0.0 < held[1] < 1.9
        time.sleep(0.2)
        assert positions(it) == held


def test_a_robot_that_still_holds_itself_is_taken_over_without_letting_go(nao: RobotModel) -> None:
    with rig(nao, compensation=False) as it:
        it.driver.connect()
        assert it.driver._sender is not None
        it.driver._sender.link.send = lambda frames: None  # type: ignore[method-assign]
        assert wait_for(lambda: it.stub.motors[1].status == "holding")
        it.frames()
        second = CanDriver(nao, interface="virtual", channel=it.channel, settings=QUICK, compensation=False)
        second.connect()
        assert all(v["stiffness"] == 1.0 for _, v in commands_to(it.frames(), 11) if v["mode"] == "follow")
        second.stop()


def test_the_emergency_stop_ends_every_motion_and_is_over_after_a_new_start(nao: RobotModel) -> None:
    with rig(nao, compensation=False) as it:
        it.driver.connect()
        it.driver.write(command(nao, nao.postures["Crouch"]))
        time.sleep(0.05)
        it.driver.emergency_stop()
        assert wait_for(lambda: {motor.status for motor in it.stub.motors.values()} == {"stopped"}, 0.1)
        held = positions(it)
        it.driver.write(command(nao, nao.postures["zero"]))
        time.sleep(0.2)
        assert positions(it) == held
        assert "every motor has stopped following: stopped" in it.driver.read().faults
        it.driver.connect()
        assert all_follow(it)
        assert it.driver.read().alarms == ()


def test_behind_the_guard_the_emergency_stop_is_on_the_bus_within_a_period(nao: RobotModel) -> None:
    """The motors then hold where they are while they are let down, and are off at the end."""
    with rig(nao, settings=replace(QUICK, ramp=0.4), compensation=False) as it:
        guard = GuardedDriver(it.driver, CommandGate(nao))
        guard.connect()
        it.driver.write(command(nao, nao.postures["Crouch"]))
        time.sleep(0.05)
        began = time.time()
        guard.emergency_stop()
        assert time.time() - began < 0.2
        assert {motor.status for motor in it.stub.motors.values()} == {"stopped"}
        held = positions(it)
        guard.stop()
        assert positions(it) == held
        assert wait_for(lambda: {motor.status for motor in it.stub.motors.values()} == {"off"})
        stops = [when for when, name, _ in it.frames() if name == "EmergencyStop"]
        assert 0.0 <= stops[0] - began < it.driver.period


def test_softening_is_immediate_and_stiffening_slow(nao: RobotModel) -> None:
    with rig(nao, settings=CanSettings(ramp=0.3, patience=0.5), compensation=False) as it:
        it.driver.connect()
        it.frames()
        it.driver.soften(0.2)
        assert wait_for(lambda: it.stub.motors[11].stiffness < 0.21, 0.1)
        it.driver.soften(1.0)
        assert wait_for(lambda: it.stub.motors[11].stiffness == 1.0)
        shares = [v["stiffness"] for _, v in commands_to(it.frames(), 11)]
        assert max(np.diff(shares)) <= 0.1


def test_a_robot_that_was_softened_is_let_go_from_there_and_never_stiffer(nao: RobotModel) -> None:
    with rig(nao, compensation=False) as it:
        it.driver.connect()
        it.frames()
        it.driver.soften(0.4)
        it.driver.stop()
        time.sleep(0.03)
        shares = [v["stiffness"] for _, v in commands_to(it.frames(), 11)]
        assert all(share <= 0.4 for share in shares[shares.index(0.4) :]) and 0.4 in shares[:4]


def test_after_an_emergency_stop_the_robot_is_let_down_where_it_is(nao: RobotModel) -> None:
    with rig(nao, compensation=False) as it:
        it.driver.connect()
        it.driver.write(command(nao, nao.postures["Crouch"]))
        time.sleep(0.05)
        it.driver.emergency_stop()
        time.sleep(0.05)
        held = positions(it)
        it.driver.stop()
        assert positions(it) == held
        assert wait_for(lambda: {(m.status, m.stiffness) for m in it.stub.motors.values()} == {("off", 0.0)})


def test_write_never_waits_and_refuses_nan(nao: RobotModel) -> None:
    with rig(nao) as it:
        it.driver.connect()
        q = nao.postures["stand"]
        start = time.perf_counter()
        for _ in range(1000):
            it.driver.write(command(nao, q))
        assert (time.perf_counter() - start) / 1000 < 0.001
        broken = q.copy()
        broken[3] = np.nan
        with pytest.raises(DriverError, match="NaN"):
            it.driver.write(command(nao, broken))


def test_stop_may_come_twice_and_before_connect_and_leaves_no_thread(nao: RobotModel) -> None:
    with rig(nao, compensation=False) as it:
        it.driver.stop()
        before = threading.active_count()
        it.driver.connect()
        it.driver.stop()
        it.driver.stop()
        assert wait_for(lambda: threading.active_count() == before)
        assert np.isnan(it.driver.read().q).all()


def test_it_can_be_connected_again(nao: RobotModel) -> None:
    with rig(nao, compensation=False) as it:
        for _ in range(2):
            it.driver.connect()
            assert np.isfinite(it.driver.read().q).all()
            it.driver.stop()


def test_a_robot_of_another_make_needs_nothing_but_its_own_map(second_robot: RobotModel) -> None:
    """No coupled joints, no hands, geared motors that turn the other way."""
    numbers = range(1, len(second_robot.joint_names) + 1)
    entries = {
        name: {"id": n, "sign": -1, "gear": 2.0} for name, n in zip(second_robot.joint_names, numbers, strict=True)
    }
    from naoimitate.robot.load import BUILT_IN

    section = {"database": str(BUILT_IN / "nao" / "can.dbc"), "joints": entries}
    robot = replace(second_robot, data={**second_robot.data, "can": section})
    with rig(robot) as it:
        it.driver.connect()
        stand = robot.postures["stand"]
        assert np.abs(it.driver.read().q - stand).max() < STEP
        it.driver.write(command(robot, 0.5 * (stand + robot.lower)))
        assert wait_for(lambda: bool(np.abs(it.driver.read().q - stand).max() > 0.2))
