"""Rotations and convex polygons, compiled: the small geometry that every room shares.

Quaternions are (w, x, y, z); rotation matrices map local to parent coordinates; angles in rad.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[np.float64]


@njit(cache=True)
def lengths(v: Array) -> Array:
    """Lengths (K,) of vectors (K, 3)."""
    out = np.empty(v.shape[0])
    for k in range(v.shape[0]):
        out[k] = math.sqrt(v[k, 0] * v[k, 0] + v[k, 1] * v[k, 1] + v[k, 2] * v[k, 2])
    return out


@njit(cache=True)
def quat_from_matrix(R: Array) -> Array:
    """Unit quaternion (4,) with w >= 0 of a rotation matrix (3, 3) (Shepperd's method: divides by the largest)."""
    q = np.empty(4)
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace > 0.0:
        s = 2.0 * math.sqrt(trace + 1.0)
        q[0] = 0.25 * s
        q[1] = (R[2, 1] - R[1, 2]) / s
        q[2] = (R[0, 2] - R[2, 0]) / s
        q[3] = (R[1, 0] - R[0, 1]) / s
        return q
    i = 0
    if R[1, 1] > R[0, 0]:
        i = 1
    if R[2, 2] > R[i, i]:
        i = 2
    j, k = (i + 1) % 3, (i + 2) % 3
    s = 2.0 * math.sqrt(max(1.0 + R[i, i] - R[j, j] - R[k, k], 0.0))
    q[0] = (R[k, j] - R[j, k]) / s
    q[i + 1] = 0.25 * s
    q[j + 1] = (R[j, i] + R[i, j]) / s
    q[k + 1] = (R[k, i] + R[i, k]) / s
    return -q if q[0] < 0.0 else q


@njit(cache=True)
def matrix_from_quat(q: Array) -> Array:
    """Rotation matrix (3, 3) of a quaternion (4,), normalised first."""
    w, x, y, z = q / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


@njit(cache=True)
def rotation_vector(R: Array) -> Array:
    """Axis times angle (3,) of a rotation matrix, angle in [0, pi]."""
    q = quat_from_matrix(R)
    s = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    scale = 2.0 if s < 1e-9 else 2.0 * math.atan2(s, q[0]) / s
    return scale * q[1:]


@njit(cache=True)
def matrix_from_rotation_vector(v: Array) -> Array:
    """Rotation matrix (3, 3) of axis times angle (3,)."""
    angle = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    half = 0.5 * angle
    k = 0.5 if angle < 1e-9 else math.sin(half) / angle
    return matrix_from_quat(np.array([math.cos(half), k * v[0], k * v[1], k * v[2]]))


@njit(cache=True)
def yaw_matrix(yaw: float) -> Array:
    """Rotation about z by yaw, (3, 3)."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@njit(cache=True)
def heading(R: Array) -> float:
    """Yaw of the x axis of a rotation matrix in the horizontal plane, rad."""
    return math.atan2(R[1, 0], R[0, 0])


@njit(cache=True)
def wrap(angle: float) -> float:
    """The same angle in (-pi, pi]."""
    return angle - 2.0 * math.pi * math.ceil((angle - math.pi) / (2.0 * math.pi))


@njit(cache=True)
def convex_hull(points: Array) -> Array:
    """Counter-clockwise convex hull of (N, 2) points, N >= 3 (Andrew's monotone chain)."""
    n = points.shape[0]
    order = np.argsort(points[:, 0] + 1e-9 * points[:, 1])
    hull = np.empty((2 * n, 2))
    size = 0
    for sweep in range(2):
        start = size
        for i in range(n):
            p = points[order[i if sweep == 0 else n - 1 - i]]
            while size - start >= 2 and _turn(hull[size - 2], hull[size - 1], p) <= 0.0:
                size -= 1
            hull[size] = p
            size += 1
        size -= 1
    return hull[:size].copy()


@njit(cache=True)
def _turn(a: Array, b: Array, c: Array) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


@njit(cache=True)
def polygon_margin(polygon: Array, x: float, y: float) -> float:
    """Signed distance of a point to the edge of a convex counter-clockwise polygon (N, 2), m; positive inside.

    Outside, the distance to the nearest edge line is reported, which is never larger than the true distance.
    """
    margin = math.inf
    n = polygon.shape[0]
    for i in range(n):
        ax, ay = polygon[i]
        bx, by = polygon[(i + 1) % n]
        length = math.hypot(bx - ax, by - ay)
        if length > 1e-12:
            margin = min(margin, ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / length)
    return margin


@njit(cache=True)
def distance_to_edge(polygon: Array, x: float, y: float, dx: float, dy: float, margin: float = 0.0) -> float:
    """How far (m) a point in a convex counter-clockwise polygon (N, 2) may go along a unit direction.

    margin: m that it keeps from every edge; negative where it is nearer to one already.
    """
    nearest = np.inf
    n = polygon.shape[0]
    for i in range(n):
        ax, ay = polygon[i]
        bx, by = polygon[(i + 1) % n]
        nx, ny = by - ay, ax - bx
        along = nx * dx + ny * dy
        if along > 0.0:
            inside = nx * (ax - x) + ny * (ay - y) - margin * np.hypot(nx, ny)
            nearest = min(nearest, inside / along)
    return nearest


def polygon_centroid(polygon: Array) -> Array:
    """Centroid (2,) of a simple polygon (N, 2) by its area."""
    x, y = polygon[:, 0], polygon[:, 1]
    nx, ny = np.roll(x, -1), np.roll(y, -1)
    cross = x * ny - nx * y
    area = cross.sum() / 2.0
    return np.array([((x + nx) * cross).sum(), ((y + ny) * cross).sum()]) / (6.0 * area)
