"""Where the soles go so that the offset is met: Koenemann 2014, section V-C, as pure functions in the torso frame."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

LEVEL_BELOW = 0.030
"""[m] off the floor below which a swing sole is levelled more and more."""


def offset_in_space(left: Array, right: Array, com: Array) -> float:
    """Equation (6) with positions (3,) m: where the CoM's projection lies from the left (0) to the right foot (1)."""
    d = right - left
    return float((com - left) @ d / max(float(d @ d), 1e-9))


def up_vector(left: Array, right: Array, com: Array, offset: float) -> Array:
    """Equation (7): the soles' common normal n = p_CoM - (p_L + o' (p_R - p_L)), as a unit vector (3,)."""
    n = com - (left + offset * (right - left))
    return np.asarray(n / max(float(np.linalg.norm(n)), 1e-9))


def shift_factor(foot: Array, other: Array, com: Array, offset: float) -> float:
    """The s of smallest magnitude that solves o(p_L + s (p_CoM - p_L)) = o' for the foot at offset 0.

    foot, other, com: (3,) m; offset: o', counted from ``foot`` to ``other``. With v = p_CoM - p_L and d = p_R - p_L:
    (1 - o') v.v s^2 + (2 o' v.d - v.d - v.v) s + (v.d - o' d.d) = 0. Where it has no real root, the s that comes
    nearest.
    """
    v, d = com - foot, other - foot
    vv, vd, dd = float(v @ v), float(v @ d), float(d @ d)
    a, b, c = (1.0 - offset) * vv, (2.0 * offset - 1.0) * vd - vv, vd - offset * dd
    if abs(a) < 1e-12:
        return -c / b if abs(b) > 1e-12 else 0.0
    root = math.sqrt(max(b * b - 4.0 * a * c, 0.0))
    return min((-b - root) / (2.0 * a), (-b + root) / (2.0 * a), key=abs)


def shifted(soles: Array, com: Array, offset: float) -> Array:
    """Double support: soles (2, 3) m, the left one shifted towards the CoM where o' < o, else the right one."""
    left, right = soles
    if offset < offset_in_space(left, right, com):
        return np.array([left + shift_factor(left, right, com, offset) * (com - left), right])
    return np.array([left, right + shift_factor(right, left, com, 1.0 - offset) * (com - right)])


def levelled(soles: Array, com: Array, offset: float, stance: int) -> Array:
    """Soles (2, 3) m with the other one moved along the up-vector into the plane of the stance sole."""
    up = up_vector(soles[0], soles[1], com, offset)
    level = soles.copy()
    level[1 - stance] -= ((soles[1 - stance] - soles[stance]) @ up) * up
    return level


def swung(
    soles: Array, frames: Array, com: Array, stance: int, outline: Array, clearance: float
) -> tuple[Array, Array]:
    """Single support: places (2, 3) m and normals (2, 3) of the soles at centres (2, 3) m with frames (2, 3, 3).

    The stance sole, whose plane is the floor, is turned to the ground. The swing sole stays as it is, but near the
    floor it is levelled, and its lowest corner is raised to ``clearance`` m. outline: (K, 2) m, from its centre.
    """
    swing, up = 1 - stance, up_vector(soles[0], soles[1], com, float(stance))
    height = float((soles[swing] - soles[stance]) @ up)
    free = min(max(height / LEVEL_BELOW, 0.0), 1.0)
    lowest = height + free * float((outline @ (up @ frames[swing])[:2]).min())
    places, normals = soles.copy(), np.array([up, up])
    places[swing] += max(0.0, clearance - lowest) * up
    normals[swing] += free * (frames[swing][:, 2] - up)
    return places, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def parted(soles: Array, apart: float) -> Array:
    """Soles (2, 3) m moved sideways until the left one is ``apart`` m to the left of the right one."""
    missing = max(0.0, apart - float(soles[0, 1] - soles[1, 1]))
    return np.asarray(soles + 0.5 * missing * np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]))
