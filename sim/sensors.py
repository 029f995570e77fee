"""The simulated robot's senses, from the ``imu``, ``fsr`` and ``cameras`` of its data: IMU, foot forces, cameras."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from naoimitate.core.frames import SIDES, Array
from naoimitate.hw.driver import FSR_NAMES
from naoimitate.robot.model import BASE, RobotModel
from naoimitate.sim.contacts import plate_name

SENSOR_GROUP = 4
"""MuJoCo's site group of sensors: not drawn."""

FSR_KEYS = ("FrontLeft", "FrontRight", "RearLeft", "RearRight")
"""Names in the robot's data, in the order of ``FSR_NAMES``."""

Z_AXIS = np.array([0.0, 0.0, 1.0])

FSR_REACH = 0.3
"""How far a force sensor's quarter of the sole reaches out from the split, m: beyond any foot."""


def add_imu(spec: mujoco.MjSpec, bodies: dict[int, Any], robot: RobotModel) -> None:
    """Add accelerometer and gyro in torso axes; standing still the accelerometer reads +9.81 along z."""
    imu = robot.data.get("imu", {})
    sensors = (
        ("accelerometer", "accelerometer", mujoco.mjtSensor.mjSENS_ACCELEROMETER),
        ("gyro", "gyrometer", mujoco.mjtSensor.mjSENS_GYRO),
    )
    for name, key, kind in sensors:
        bodies[BASE].add_site(name=name, pos=imu.get(key, [0.0, 0.0, 0.0]), group=SENSOR_GROUP)
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=name)


def add_force_sensors(spec: mujoco.MjSpec, robot: RobotModel) -> None:
    """Add four touch sensors a foot. Each sums the normal forces (N) on its quarter of the sole; the quarters meet
    in the middle between the robot's sensors (of the outline, where its data give none) and leave nothing out."""
    for side in SIDES:
        plate = spec.body(plate_name(side))
        middle = _split(robot, side)
        for name, (forward, left) in zip(FSR_NAMES, ((1, 1), (1, -1), (-1, 1), (-1, -1)), strict=True):
            site = f"{side}_fsr_{name}"
            centre = middle + FSR_REACH * np.array([forward, left])
            plate.add_site(
                name=site,
                type=mujoco.mjtGeom.mjGEOM_BOX,
                pos=[*centre, 0.0],
                size=[FSR_REACH, FSR_REACH, 0.01],
                group=SENSOR_GROUP,
            )
            touch = mujoco.mjtSensor.mjSENS_TOUCH
            spec.add_sensor(name=site, type=touch, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site)


def _split(robot: RobotModel, side: str) -> Array:
    """Where the four quarters of a sole meet, (2,) m in the sole frame."""
    sensors = robot.data.get("fsr", {}).get(side)
    if sensors is None:
        return np.asarray(0.5 * (robot.soles[side].min(axis=0) + robot.soles[side].max(axis=0)))
    return np.asarray(np.mean([sensors[key] for key in FSR_KEYS], axis=0))


def add_cameras(spec: mujoco.MjSpec, robot: RobotModel) -> None:
    """Add the robot's own cameras: optical axis = the link's x axis pitched down, image upright."""
    for name, camera in robot.data.get("cameras", {}).items():
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, _looking_along_x(camera["pitch"]).ravel())
        fovy = math.degrees(camera["fov"][1])
        spec.body(camera["link"]).add_camera(name=name, pos=camera["at"], quat=quat, fovy=fovy)


def _looking_along_x(pitch: float) -> Array:
    """Axes (3, 3) of a MuJoCo camera (x right, y up, z backwards) that looks along +x, pitched down by rad."""
    s, c = math.sin(pitch), math.cos(pitch)
    return np.array([[0.0, s, -c], [-1.0, 0.0, 0.0], [0.0, c, s]])


def roll_pitch(quat: Array, up: Array = Z_AXIS) -> Array:
    """Roll and pitch (2,) rad of a torso, as an inertial board gives them: from the direction of gravity alone.

    up: (3,) the vertical, where it is not the world's z. R = Rz(yaw) Ry(pitch) Rx(roll); the vertical in torso axes,
    the last row of R, is (-sin p, cos p sin r, cos p cos r).
    """
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quat)
    vertical = up @ matrix.reshape(3, 3)
    return np.array([math.atan2(vertical[1], vertical[2]), math.asin(min(max(-vertical[0], -1.0), 1.0))])
