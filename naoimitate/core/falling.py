"""When a robot on servos counts as fallen: the measure ``survival`` as pure functions of plan and real motion."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from naoimitate.core.frames import Array

TILT_LIMIT = math.radians(45.0)
"""Largest angle between the torso's up-axis and its planned direction, rad."""

HEIGHT_LIMIT = 0.6
"""Smallest height of the torso over its planned height."""

SWING_LOAD_LIMIT = 0.1
"""A foot planned in the air must carry less than this share of the weight."""


def up_axis(quat: Array) -> Array:
    """Up-axis (..., 3) of a torso in the world: third column of the rotation of quat (..., 4) (w, x, y, z)."""
    w, x, y, z = np.moveaxis(np.asarray(quat, dtype=float), -1, 0)
    return np.stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)], axis=-1)


def tilt(planned_quat: Array, quat: Array) -> Array:
    """Angle (...) rad between the actual and the planned up-axis; quaternions (..., 4) of unit length."""
    cosine = np.sum(up_axis(planned_quat) * up_axis(quat), axis=-1)
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))


def swing_load(support: npt.NDArray[np.str_], load: Array, weight: float) -> Array:
    """Share (T,) of the weight (N) on the foot planned in the air; support (T,), load (T, 2) N on left, right sole."""
    in_air = np.stack([support == "R", support == "L"], axis=-1)
    return np.asarray(np.sum(np.where(in_air, load, 0.0), axis=-1) / weight)


def has_tipped(tilt: Array, height_ratio: Array) -> npt.NDArray[np.bool_]:
    """Where the torso is too far from its plan: leaning over TILT_LIMIT or sunk under HEIGHT_LIMIT."""
    return np.asarray((tilt > TILT_LIMIT) | (height_ratio < HEIGHT_LIMIT))


def has_fallen(tilt: Array, height_ratio: Array, swing_load: Array) -> npt.NDArray[np.bool_]:
    """(T,) True from the first frame on in which the torso has tipped or a foot in the air carries weight."""
    failed = has_tipped(tilt, height_ratio) | (swing_load >= SWING_LOAD_LIMIT)
    return np.asarray(np.logical_or.accumulate(failed))
