"""Unity's world (x right, y up, z forward, left-handed, metres) and ours (x forward, y left, z up, right-handed).

The change of hand turns the vector part of a quaternion the other way than a position.
"""

from __future__ import annotations

import numpy as np

from naoimitate.core.frames import Array


def to_world(positions: Array) -> Array:
    """Positions (..., 3) from Unity's axes to ours."""
    return np.asarray(positions[..., [2, 0, 1]] * [1.0, -1.0, 1.0])


def from_world(positions: Array) -> Array:
    """Positions (..., 3) from our axes to Unity's."""
    return np.asarray(positions[..., [1, 2, 0]] * [-1.0, 1.0, 1.0])


def quaternions_to_world(quaternions: Array) -> Array:
    """Unity's quaternions (..., 4) (x, y, z, w) as ours (w, x, y, z)."""
    return np.asarray(quaternions[..., [3, 2, 0, 1]] * [1.0, -1.0, 1.0, -1.0])


def quaternions_from_world(quaternions: Array) -> Array:
    """Our quaternions (..., 4) (w, x, y, z) as Unity's (x, y, z, w)."""
    return np.asarray(quaternions[..., [2, 3, 1, 0]] * [1.0, -1.0, -1.0, 1.0])
