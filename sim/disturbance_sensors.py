"""What the simulated robot reports of itself, with the noise of a disturbance: all that a closed loop may know."""

from __future__ import annotations

import math

import numpy as np

from naoimitate.core.falling import has_tipped, tilt
from naoimitate.core.frames import Array
from naoimitate.hw.driver import RobotState
from naoimitate.sim.disturbance import NOISE, Disturbance
from naoimitate.sim.physics import Physics
from naoimitate.sim.sensors import roll_pitch

ENCODER_NOISE = math.radians(0.1)
"""Standard deviation of a joint angle, rad: about one count of a 12-bit encoder on the joint's axis (0.088 deg)."""

ANGLE_NOISE = math.radians(0.3)
"""Standard deviation of the inertial board's roll and pitch, rad."""

ANGLE_BIAS = math.radians(0.5)
"""Standard deviation of an error of roll and pitch that stays the same for the whole motion, rad."""

GYRO_NOISE = 0.02
"""Standard deviation of a rate, rad/s: small consumer gyros in a robot whose motors run."""

ACCELEROMETER_NOISE = 0.3
"""Standard deviation of an acceleration, m/s^2, likewise."""


class NoisySensors:
    """Reads a simulated robot as a driver does; the noise is ``Disturbance.noise`` times the deviations above.

    The torso's place in the world is left out: no real robot knows it. Force sensors and torques are exact.
    """

    def __init__(self, physics: Physics, disturbance: Disturbance) -> None:
        self._physics, self._scale, self._up = physics, disturbance.noise, disturbance.up
        self._random = disturbance.random(NOISE)
        self._bias = self._noise(2, ANGLE_BIAS)

    def read(self, planned_pos: Array, planned_quat: Array) -> RobotState:
        """The state now; the planned torso (3,) m, (4,) says whether the robot has fallen."""
        physics = self._physics
        quat, q = physics.base_quat, physics.q
        return RobotState(
            time=physics.time,
            q=q + self._noise(len(q), ENCODER_NOISE),
            torque=physics.torque,
            angles=roll_pitch(quat, self._up) + self._bias + self._noise(2, ANGLE_NOISE),
            gyro=physics.gyro + self._noise(3, GYRO_NOISE),
            accelerometer=physics.accelerometer + self._noise(3, ACCELEROMETER_NOISE),
            fsr=physics.fsr,
            fell=bool(has_tipped(tilt(planned_quat, quat), physics.base_pos[2] / planned_pos[2])),
        )

    def _noise(self, count: int, deviation: float) -> Array:
        return np.asarray(self._scale * deviation * self._random.normal(size=count))
