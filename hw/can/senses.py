"""What motors on a CAN bus tell of a robot, as a ``RobotState``: joints and torques; there is no inertial board."""

from __future__ import annotations

import numpy as np

from naoimitate.core.frames import Array
from naoimitate.hw.can.joints import JointMap
from naoimitate.hw.driver import RobotState


def sensed(joints: JointMap, time: float, position: Array, current: Array) -> RobotState:
    """The state at a time (s) from the motors' angles (N,) rad and currents (N,) A; NaN for what nobody measures."""
    torque = joints.scatter(current * joints.torque_constant * np.sign(joints.factor))
    torque[[follower for _, follower in joints.followers]] = 0.0
    return RobotState(
        time=time,
        q=joints.scatter(joints.from_motor(position)),
        torque=torque,
        angles=np.full(2, np.nan),
        gyro=np.full(3, np.nan),
        accelerometer=np.full(3, np.nan),
        fsr=np.full((2, 4), np.nan),
        fell=False,
    )
