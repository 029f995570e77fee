"""How far a torso leans away from its plan, whatever its heading: told from the direction of gravity alone."""

from __future__ import annotations

import math

import numpy as np

from naoimitate.core.frames import Array

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
"""Where a torso is meant to be before the first command."""


def up_from_quat(quat: Array) -> tuple[float, float, float]:
    """World z in the frame of a torso with orientation (4,) (w, x, y, z): the last row of its rotation matrix."""
    w, x, y, z = (float(v) for v in quat)
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


def up_from_angles(angles: Array) -> tuple[float, float, float]:
    """The same from roll and pitch (2,) rad: (-sin p, cos p sin r, cos p cos r)."""
    roll, pitch = float(angles[0]), float(angles[1])
    return -math.sin(pitch), math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll)


def quat_from_angles(angles: Array) -> Array:
    """A torso's orientation (4,) with roll and pitch (2,) rad and heading +x: Ry(pitch) Rx(roll)."""
    (sr, sp), (cr, cp) = np.sin(0.5 * angles), np.cos(0.5 * angles)
    return np.array([cp * cr, cp * sr, sp * cr, -sp * sr])


def lean(planned_quat: Array, angles: Array) -> float:
    """Angle in rad between where up is planned to be and where it is measured; NaN where angles are."""
    planned, measured = up_from_quat(planned_quat), up_from_angles(angles)
    cosine = sum(a * b for a, b in zip(planned, measured, strict=True))
    return math.acos(min(max(cosine, -1.0), 1.0)) if cosine == cosine else math.nan


def turning(gyro: Array) -> float:
    """Speed (rad/s) of a torso about horizontal axes; gyro: (3,) rad/s."""
    return math.hypot(float(gyro[0]), float(gyro[1]))
