"""The force sensors under a robot's soles: where they are, and the centre of pressure that they tell.

A sole that rests on four sensors gives them its whole force and moment, so the mean of their places, weighted by their
forces, is the centre of pressure, as long as that lies between them. Nothing can be told of a force beyond their hull:
the mean then stays on its edge.
"""

from __future__ import annotations

import numpy as np

from naoimitate.core.frames import SIDES, Array
from naoimitate.robot.model import RobotModel

FSR_KEYS = ("FrontLeft", "FrontRight", "RearLeft", "RearRight")
"""Names in the robot's data, in the order of ``driver.FSR_NAMES``."""


def sensor_places(robot: RobotModel) -> Array:
    """Places (2, 4, 2) m of the left and the right foot's sensors in the sole frames, columns as ``FSR_NAMES``.

    Where a robot's data give none, the corners of the box around the sole's outline.
    """
    return np.array([_places(robot, side) for side in SIDES])


def _places(robot: RobotModel, side: str) -> Array:
    sensors = robot.data.get("fsr", {}).get(side)
    if sensors is not None:
        return np.array([sensors[key] for key in FSR_KEYS], dtype=np.float64)
    (back, right), (front, left) = robot.soles[side].min(axis=0), robot.soles[side].max(axis=0)
    return np.array([[front, left], [front, right], [back, left], [back, right]])


def center_of_pressure(force: Array, places: Array) -> Array:
    """Mean (..., 2) m of sensors' places (..., N, 2) m, weighted by their forces (..., N) N; NaN without any force."""
    total = force.sum(axis=-1)
    moment = np.sum(force[..., None] * places, axis=-2)
    return np.asarray(np.divide(moment, total[..., None], out=np.full_like(moment, np.nan), where=total[..., None] > 0))
