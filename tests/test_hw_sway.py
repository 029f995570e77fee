"""The velocity of the centre of mass, from gyro and encoders: of the whole body, not of a torso that nods."""

from __future__ import annotations

import math

import numpy as np
import pytest

from naoimitate import load_robot
from naoimitate.hw.driver import RobotState
from naoimitate.hw.lean import quat_from_angles
from naoimitate.hw.planted_shift import PlantedShift, level
from naoimitate.hw.sway import SwayMeter
from naoimitate.hw.target import Target
from naoimitate.robot.model import Array

NAO = load_robot("nao")
PERIOD, LAG, OMEGA = 0.01, 0.03, 8.0
STAND = Target(NAO.postures["stand"], np.zeros(3), quat_from_angles(np.zeros(2)), "L")
PLANTED = PlantedShift(NAO)


def seen(q: Array, angles: Array, turning: Array, time: float) -> RobotState:
    nan = np.full(3, np.nan)
    return RobotState(time, q, np.full(len(q), np.nan), angles, turning, nan, np.zeros((2, 4)), fell=False)


def swaying(joint: str, size: float, time: float) -> tuple[Array, Array, Array]:
    """Joints, roll and pitch, and gyro of a robot on its flat left sole, one joint of which swings."""
    q = STAND.q.copy()
    q[NAO.joint(joint)] += size * math.sin(OMEGA * time)
    pose = PLANTED.pose(q, "L")
    up = pose.base_rot[2]
    angles = np.array([math.atan2(up[1], up[2]), -math.asin(up[0])])
    return q, angles, pose.base_rot


def centre(q: Array) -> Array:
    pose = PLANTED.pose(q, "L")
    return np.asarray(level(pose.base_rot[2]) @ pose.base_rot.T @ (pose.com - pose.sole_pos[0]))[:2]


@pytest.mark.parametrize("joint", ["LAnkleRoll", "LHipRoll", "LAnklePitch", "LHipPitch"])
def test_it_sees_how_fast_the_body_sways(joint: str) -> None:
    meter, step = SwayMeter(PLANTED, PERIOD, LAG), 1e-4
    found, true = [], []
    for frame in range(200):
        time = frame * PERIOD
        q, angles, rot = swaying(joint, 0.02, time)
        after, before = swaying(joint, 0.02, time + step), swaying(joint, 0.02, time - step)
        change = rot.T @ (after[2] - before[2]) / (2.0 * step)
        gyro = np.array([change[2, 1], change[0, 2], change[1, 0]])
        meter.follow(STAND)
        found.append(-meter.measure(STAND, seen(q, angles, gyro, time)).velocity)
        true.append((centre(after[0]) - centre(before[0])) / (2.0 * step))
    late = round(0.035 / PERIOD)  # smoothing, and half a period of the difference
    moved = np.abs(true).max(axis=0)
    off = np.abs(np.array(found)[50:] - np.array(true)[50 - late : -late]).max(axis=0)
    assert off[moved.argmax()] < 0.15 * moved.max()


def test_a_robot_that_moves_as_planned_does_not_sway() -> None:
    meter = SwayMeter(PLANTED, PERIOD, LAG)
    speed, largest = 0.05, 0.0
    for frame in range(150):
        q = STAND.q.copy()
        q[[NAO.joint("LHipPitch"), NAO.joint("LKneePitch")]] += speed * frame * PERIOD * np.array([-1.0, 2.0])
        q[NAO.joint("LAnklePitch")] -= speed * frame * PERIOD
        target = STAND._replace(q=q)
        meter.follow(target)
        up = PLANTED.pose(q, "L").base_rot[2]
        angles = np.array([math.atan2(up[1], up[2]), -math.asin(up[0])])
        sway = meter.measure(target, seen(q, angles, np.zeros(3), frame * PERIOD))
        largest = max(largest, float(np.abs(sway.velocity).max())) if frame > 30 else 0.0
    assert largest < 2e-3
    assert np.abs(sway.place).max() < 2e-3


def test_without_a_gyro_the_velocity_is_unknown_and_known_again_with_it() -> None:
    meter = SwayMeter(PLANTED, PERIOD, LAG)
    q, angles, _ = swaying("LAnkleRoll", 0.0, 0.0)
    for frame in range(5):
        meter.follow(STAND)
        sway = meter.measure(STAND, seen(q, angles, np.full(3, np.nan), frame * PERIOD))
    assert np.isnan(sway.velocity).all() and np.isfinite(sway.place).all()
    for frame in range(5, 7):
        meter.follow(STAND)
        sway = meter.measure(STAND, seen(q, angles, np.zeros(3), frame * PERIOD))
    assert np.isfinite(sway.velocity).all()
