"""The joint map turns joint angles into motor angles and back, and refuses what cannot be meant."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate.calib.zeros import JointZeros
from naoimitate.core.errors import DriverError
from naoimitate.hw.can import CanDriver
from naoimitate.hw.can.joints import HAND, read_joint_map
from naoimitate.hw.can.setpoint import Setpoint
from naoimitate.robot import RobotModel, load_robot

NAO = load_robot("nao")


def changed(robot: RobotModel, part: str, name: str, **values: Any) -> RobotModel:
    """The robot with other values in one entry of its joint map."""
    data = deepcopy(robot.data)
    data["can"][part].setdefault(name, {}).update(values)
    return replace(robot, data=data)


def without(robot: RobotModel, name: str) -> RobotModel:
    data = deepcopy(robot.data)
    del data["can"]["joints"][name]
    return replace(robot, data=data)


def test_every_joint_and_hand_of_the_robot_has_a_motor_and_a_shared_motor_has_one_number() -> None:
    joints = read_joint_map(NAO)
    followers = {NAO.joint_names[follower] for _, follower in NAO.coupled}
    assert {*joints.names} == ({*NAO.joint_names} - followers) | {"LHand", "RHand"}
    assert len({*joints.nodes}) == len(joints) == 25
    assert [joints.names[hand] for hand in joints.hands if hand is not None] == ["LHand", "RHand"]


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1, -1]), st.floats(0.1, 200.0), st.floats(-1.0, 1.0))
def test_joint_angles_survive_the_way_to_the_motors_and_back(seed: int, sign: int, gear: float, zero: float) -> None:
    joints = read_joint_map(changed(NAO, "joints", "LKneePitch", sign=sign, gear=gear, zero=zero))
    rng = np.random.default_rng(seed)
    q, opening = rng.uniform(NAO.lower, NAO.upper), rng.uniform(size=2)
    for leader, follower in NAO.coupled:
        q[follower] = q[leader]
    angles = joints.gather(q, opening)
    motor = joints.to_motor(angles)
    assert motor[joints.names.index("LKneePitch")] == pytest.approx(sign * gear * (q[NAO.joint("LKneePitch")] - zero))
    np.testing.assert_allclose(joints.scatter(joints.from_motor(motor)), q, atol=1e-12)
    np.testing.assert_allclose(angles[joints.joint == HAND], opening)


def test_calibrated_zeros_come_on_top_of_those_of_the_map() -> None:
    rng = np.random.default_rng(0)
    zeros = JointZeros("ours", rng.uniform(-0.1, 0.1, len(NAO.joint_names)))
    robot = changed(NAO, "joints", "RElbowYaw", zero=0.3)
    plain, calibrated = read_joint_map(robot), read_joint_map(robot, zeros)
    q = rng.uniform(NAO.lower, NAO.upper)
    moved = calibrated.to_motor(calibrated.gather(q, np.zeros(2)))
    np.testing.assert_allclose(moved, plain.to_motor(plain.gather(zeros.to_servos(q), np.zeros(2))))


def test_limits_and_speeds_are_the_models_unless_the_map_has_its_own() -> None:
    joints = read_joint_map(changed(NAO, "joints", "HeadYaw", lower=-0.5, speed=1.0))
    assert (joints.lower[0], joints.upper[0], joints.speed[0]) == (-0.5, NAO.upper[0], 1.0)


@pytest.mark.parametrize(
    ("robot", "message"),
    [
        (without(NAO, "LKneePitch"), "joint LKneePitch has no motor"),
        (changed(NAO, "joints", "LTailWag", id=30), "no joint or hand 'LTailWag'"),
        (changed(NAO, "joints", "LHand", id=30), "no joint or hand 'LHand'"),
        (changed(NAO, "joints", "RHipYawPitch", id=30), "RHipYawPitch shares another joint's motor"),
        (changed(NAO, "joints", "HeadYaw", id=2), "two joints have the id 2"),
        (changed(NAO, "joints", "HeadYaw", sign=2), "a sign of 1 or -1"),
        (changed(NAO, "joints", "HeadYaw", gear=0.0), "a positive gear"),
        (changed(NAO, "joints", "HeadYaw", geer=2.0), "unknown 'geer'"),
        (replace(NAO, data={}), "has no joint map"),
        (changed(NAO, "joints", "HeadYaw", gear=100.0), r"motor 1 \(HeadYaw\) turns from -208.57 to 208.57 rad"),
    ],
)
def test_a_map_that_cannot_be_meant_is_refused(robot: RobotModel, message: str) -> None:
    with pytest.raises(DriverError, match=message) as error:
        CanDriver(robot, interface="virtual", channel="unused")
    assert "\n" not in str(error.value)


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_setpoint_never_runs_and_never_leaves_its_range_and_gets_there(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lower, upper, speed = -rng.uniform(0.1, 2.0, 6), rng.uniform(0.1, 2.0, 6), rng.uniform(0.5, 8.0, 6)
    start = rng.uniform(-3.0, 3.0, 6)  # perhaps outside
    point = Setpoint(start, lower, upper, speed)
    np.testing.assert_array_equal(point.angles, start)
    last = start
    for _ in range(30):
        target, dt = rng.uniform(-4.0, 4.0, 6), rng.uniform(-0.01, 0.05)
        angles = point.step(target, dt)
        assert np.all(np.abs(angles - last) <= speed * max(dt, 0.0) + 1e-12)
        inside = (last >= lower) & (last <= upper)
        assert np.all((angles >= lower - 1e-12) & (angles <= upper + 1e-12) | ~inside)
        last = angles
    for _ in range(200):
        point.step(np.full(6, 9.0), 0.1)
    np.testing.assert_allclose(point.angles, upper)
