"""The simulated robot's inertial board and cameras, from the ``imu`` and ``cameras`` of its data."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from naoimitate.core.frames import Array
from naoimitate.robot.model import BASE, RobotModel
from naoimitate.sim.force_sensors import SENSOR_GROUP

Z_AXIS = np.array([0.0, 0.0, 1.0])


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
