"""What a NAO feels, from NAOqi's ALMemory to ``RobotState``. Keys: Aldebaran, "NAO - Actuator & Sensor list" (2.1)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from naoimitate.calib.zeros import JointZeros
from naoimitate.core.falling import TILT_LIMIT
from naoimitate.core.frames import Array
from naoimitate.core.physics import GRAVITY
from naoimitate.hw.driver import RobotState
from naoimitate.hw.lean import lean

PREFIX, VALUE = "Device/SubDeviceList/", "/Sensor/Value"
ANGLES = ("InertialSensor/AngleX", "InertialSensor/AngleY")
GYRO = tuple(f"InertialSensor/Gyroscope{axis}" for axis in "XYZ")
ACCELEROMETER = tuple(f"InertialSensor/Accelerometer{axis}" for axis in "XYZ")
FSR = tuple(
    f"{foot}/FSR/{place}"
    for foot in ("LFoot", "RFoot")
    for place in ("FrontLeft", "FrontRight", "RearLeft", "RearRight")
)
BATTERY = "Battery/Charge"

HOT = {1: "is hot: less stiffness", 2: "is very hot: much less stiffness"}
"""A joint's temperature status beyond 0; the robot lowers the stiffness itself."""
LIMP = 3
"""The status of a joint that the robot has switched off because of its heat."""

LOW_BATTERY = 0.15
"""Charge, 0 to 1, under which there is an alarm: 5 to 10 minutes of standing are left."""
EMPTY_BATTERY = 0.05
"""Charge under which it is a fault: the robot is about to switch itself off as it stands."""


def keys(joint_names: Sequence[str]) -> list[str]:
    """All keys to read, in the order in which ``state`` takes their values."""
    sensors = [PREFIX + name + VALUE for name in (*ANGLES, *GYRO, *ACCELEROMETER, *FSR, BATTERY)]
    return [*sensors, *(f"{PREFIX}{name}/Temperature/Sensor/Status" for name in joint_names)]


def state(
    time: float,
    servos: Sequence[float],
    values: Sequence[object],
    joint_names: Sequence[str],
    zeros: JointZeros,
    upright: float,
    planned: Array,
) -> RobotState:
    """The state at a time (s) from the encoders (J,) rad and the values of ``keys``; what is missing is NaN.

    upright: sign of the accelerometer's z when the robot stands, see ``accelerometer_sign``. planned: (4,) where the
    torso was told to be. Weights on the feet come in kg. NAOqi gives no torques.
    """
    numbers = np.array([_number(value) for value in values[:17]])
    heat = [(name, _status(value)) for name, value in zip(joint_names, values[17:], strict=True)]
    alarms = [f"{name} {HOT[status]}" for name, status in heat if status in HOT]
    faults = [f"{name} is too hot and has no stiffness any more" for name, status in heat if status == LIMP]
    if numbers[16] < LOW_BATTERY:
        low = faults if numbers[16] < EMPTY_BATTERY else alarms
        low.append(f"battery at {100.0 * numbers[16]:.0f} %")
    return RobotState(
        time=time,
        q=zeros.from_servos(np.array(servos, dtype=np.float64)),
        torque=np.full(len(joint_names), np.nan),
        angles=numbers[0:2],
        gyro=numbers[2:5],
        accelerometer=upright * numbers[5:8],
        fsr=GRAVITY * numbers[8:16].reshape(2, 4),
        fell=lean(planned, numbers[0:2]) > TILT_LIMIT,
        alarms=tuple(alarms),
        faults=tuple(faults),
    )


def as_known(newest: RobotState, now: float, oldest: float) -> RobotState:
    """The newest state as one of ``now``, as long as it is not older than ``oldest`` s: between two answers the robot
    is still where it was felt. An older one stays as old as it is, so that loops let go of what they do from it."""
    return replace(newest, time=now) if now - newest.time <= oldest else newest


def blank(joints: int, q: Array) -> RobotState:
    """The state before the first reading: the joints only."""
    nan = np.full(joints, np.nan)
    return RobotState(0.0, q, nan, nan[:2], nan[:3], nan[:3], np.full((2, 4), np.nan), fell=False)


def accelerometer_sign(values: Sequence[object]) -> float:
    """+1 or -1: by what to multiply the accelerometer so that a standing robot reads +9.81 along z.

    The versions of NAO and its software differ in it; the robot stands when this is asked.
    """
    return -1.0 if _number(values[7]) < 0.0 else 1.0


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan


def _status(value: object) -> int:
    return int(value) if isinstance(value, int | float) and math.isfinite(value) else 0
