"""The simulated robot keeps the driver protocol, in real time and as fast as it can."""

from __future__ import annotations

import time
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from naoimitate.core.frames import RobotCommand
from naoimitate.hw.driver import Driver
from naoimitate.robot import RobotModel
from naoimitate.robot.model import Array
from naoimitate.sim.driver import MujocoDriver
from naoimitate.sim.placement import stand_on_floor
from naoimitate.sim.settings import SimSettings


def command(robot: RobotModel, q: Array, support: str = "D", *, moved: Array | None = None) -> RobotCommand:
    """A command to stand as q; moved: joints (J,) rad in place of q, which the torso's plan does not know of.

    A driver looks at joints, torso, support and time only: the rest is left empty.
    """
    base_pos, base_quat = stand_on_floor(robot, q, None if support == "D" else support.lower())
    empty: dict[str, Any] = {field.name: None for field in fields(RobotCommand)}
    body = {"q": q if moved is None else moved, "base_pos": base_pos, "base_quat": base_quat, "support": support}
    return RobotCommand(**{**empty, **body, "time": 0.0})


def raised_arms(robot: RobotModel) -> Array:
    q = robot.postures["stand"].copy()
    for chain in ("l_arm", "r_arm"):
        q[robot.chains[chain][0]] -= 0.3 * robot.tree.axis[robot.chains[chain][0]][1]
    return q


def test_it_is_a_driver(robot: RobotModel) -> None:
    assert isinstance(MujocoDriver(robot), Driver)


def test_before_the_first_command_it_stands_still(robot: RobotModel) -> None:
    driver = MujocoDriver(robot, real_time=False)
    driver.connect()
    state = driver.advance(1.0)
    assert state.time == pytest.approx(1.0)
    assert not state.fell
    np.testing.assert_allclose(state.q, robot.postures["stand"], atol=1e-3)
    np.testing.assert_allclose(state.accelerometer, (0.0, 0.0, 9.81), atol=0.3)
    assert state.fsr.sum() == pytest.approx(robot.mass * 9.81, rel=0.01)


def test_the_servos_follow_the_newest_command(robot: RobotModel) -> None:
    driver = MujocoDriver(robot, real_time=False)
    driver.connect()
    driver.write(command(robot, robot.postures["stand"]))
    driver.write(command(robot, raised_arms(robot)))
    state = driver.advance(1.0)
    np.testing.assert_allclose(state.q, raised_arms(robot), atol=2e-3)


def test_in_real_time_the_clock_runs_by_itself_and_reading_never_waits(nao: RobotModel) -> None:
    driver = MujocoDriver(nao)
    driver.connect()
    start = time.monotonic()
    driver.write(command(nao, raised_arms(nao)))
    reading = time.monotonic()
    driver.read()
    assert time.monotonic() - reading < 0.005
    time.sleep(0.6)
    state = driver.read()
    elapsed = time.monotonic() - start
    driver.stop()
    assert 0.3 < state.time <= elapsed + driver.period
    np.testing.assert_allclose(state.q, raised_arms(nao), atol=0.01)


def test_stopping_stops_time_and_may_be_repeated(nao: RobotModel) -> None:
    driver = MujocoDriver(nao)
    driver.connect()
    time.sleep(0.05)
    driver.stop()
    driver.stop()
    stopped = driver.read().time
    time.sleep(0.05)
    assert driver.read().time == stopped


def test_connecting_again_starts_from_the_stand(nao: RobotModel) -> None:
    driver = MujocoDriver(nao, real_time=False)
    driver.connect()
    driver.write(command(nao, raised_arms(nao)))
    driver.advance(0.5)
    driver.connect()
    np.testing.assert_allclose(driver.read().q, nao.postures["stand"])
    assert driver.read().time == 0.0


def leant_on(nao: RobotModel, **loops: bool) -> tuple[float, float]:
    """How far (m) the torso gives way to a steady push of 8 N, in a first and in a second connection."""
    driver = MujocoDriver(nao, SimSettings(stiffness=60.0), real_time=False, **loops)
    places = []
    for _ in range(2):
        driver.model.opt.gravity[0] = 0.0
        driver.connect()
        stood = driver.advance(6.0).base_pos
        driver.model.opt.gravity[0] = 8.0 / nao.mass
        places.append(float((driver.advance(6.0).base_pos - stood)[0]))
    return places[0], places[1]


def test_with_balance_it_gives_way_less_in_every_connection(nao: RobotModel) -> None:
    free, closed = leant_on(nao), leant_on(nao, balance=True)
    assert free[0] > 0.004 and abs(closed[0]) < 0.5 * free[0]
    assert closed[1] == pytest.approx(closed[0], abs=1e-6)


def test_a_fall_shows_in_the_state(nao: RobotModel) -> None:
    driver = MujocoDriver(nao, real_time=False)
    driver.connect()
    q = nao.postures["stand"].copy()
    for side in "LR":
        q[nao.joint(f"{side}AnklePitch")] += 0.6
    driver.write(command(nao, nao.postures["stand"], moved=q))
    assert driver.advance(2.0).fell
    assert abs(driver.read().angles[1]) > 0.7


def test_a_softened_robot_gives_way_and_a_new_connection_stands_again(robot: RobotModel) -> None:
    driver = MujocoDriver(robot, real_time=False)
    driver.connect()
    height = driver.advance(0.5).base_pos[2]
    driver.soften(0.0)
    assert driver.advance(2.0).base_pos[2] < 0.8 * height
    driver.connect()
    assert driver.advance(0.5).base_pos[2] == pytest.approx(height, abs=1e-3)
