"""Signed distance between two convex primitives, with the two nearest (or deepest) points and the normal; compiled.

For convex bodies A and B the signed distance is that of the origin to the boundary of the Minkowski difference B - A:
positive outside, where it is the Euclidean distance, negative inside, where its size is the shortest translation that
separates them (Ericson, Real-Time Collision Detection, 2005, sections 5.1 and 9.3). A capsule is a segment plus a ball,
so its distance is the segment's less the radius, inside too; a sphere is a capsule of length 0.

All functions return ``(d, point_a, point_b, normal)``: m, points on the two surfaces in the common frame, unit normal
from a to b, and ``point_b - point_a = d normal``. Vectors are tuples of three floats, so nothing is allocated.
"""

from __future__ import annotations

import math

from numba import njit

Vector = tuple[float, float, float]
Contact = tuple[float, Vector, Vector, Vector]
Frame = tuple[Vector, Vector, Vector]
"""Rows of a rotation matrix."""

TOUCH = 1e-9
"""m; cores nearer than this count as overlapping, and overlapping ones are pulled apart by this beyond contact to find
where they touch."""
PARALLEL = 1e-12
"""Squared sine of an angle below which two directions count as parallel."""


@njit(cache=True)
def capsule_capsule(p0: Vector, p1: Vector, ra: float, q0: Vector, q1: Vector, rb: float) -> Contact:
    """Capsules with segments p0-p1, q0-q1 (m) and radii ra, rb (m)."""
    u, v = _sub(p1, p0), _sub(q1, q0)
    s, t = _nearest_on_segments(u, v, _sub(p0, q0))
    x, y = _add(p0, u, s), _add(q0, v, t)
    apart = _sub(y, x)
    distance = math.sqrt(_dot(apart, apart))
    if distance > TOUCH:
        normal = _scale(apart, 1.0 / distance)
    else:
        normal = _perpendicular(u, v, _sub(_add(q0, v, 0.5), _add(p0, u, 0.5)))
    return distance - ra - rb, _add(x, normal, ra), _add(y, normal, -rb), normal


@njit(cache=True)
def capsule_box(p0: Vector, p1: Vector, radius: float, centre: Vector, rot: Frame, half: Vector) -> Contact:
    """Capsule (a) with segment p0-p1 and a box (b): centre (m), axes = columns of rot, half sizes (m)."""
    e = _turn_back(rot, _scale(_sub(p1, p0), 0.5))
    c = _turn_back(rot, _sub(_add(p0, _sub(p1, p0), 0.5), centre))
    x = _add(c, e, _nearest_to_box(c, e, half))
    y = _clamp(x, half)
    apart = _sub(y, x)
    d = math.sqrt(_dot(apart, apart))
    if d > TOUCH:
        normal = _scale(apart, 1.0 / d)
    else:
        d, normal = _segment_box_separation(c, e, half)
        pulled = _add(c, normal, -(TOUCH - d))
        x = _add(pulled, e, _nearest_to_box(pulled, e, half))
        y = _clamp(x, half)
        x = _add(y, normal, -d)
    point_a, point_b = _add(x, normal, radius), y
    return (
        d - radius,
        _add(_turn(rot, point_a), centre, 1.0),
        _add(_turn(rot, point_b), centre, 1.0),
        _turn(rot, normal),
    )


@njit(cache=True)
def box_box(ca: Vector, ra: Frame, ha: Vector, cb: Vector, rb: Frame, hb: Vector) -> Contact:
    """Boxes with centres (m), axes = columns of the rotations, half sizes (m)."""
    c = _turn_back(ra, _sub(cb, ca))
    m = _relative(ra, rb)
    d, normal = _box_box_separation(c, m, ha, hb)
    overlap = d <= TOUCH
    pull = TOUCH - d if overlap else 0.0
    x, y = _nearest_of_boxes(_add(c, normal, pull), m, ha, hb)
    if overlap:
        y = _add(x, normal, d)
    else:
        apart = _sub(y, x)
        d = math.sqrt(_dot(apart, apart))
        normal = _scale(apart, 1.0 / d)
    return d, _add(_turn(ra, x), ca, 1.0), _add(_turn(ra, y), ca, 1.0), _turn(ra, normal)


@njit(cache=True)
def _nearest_on_segments(u: Vector, v: Vector, r: Vector) -> tuple[float, float]:
    """(s, t) in [0, 1]^2 that minimise |r + s u - t v|^2: the line's optimum, clamped one variable after the other."""
    a, e, b, c, f = _dot(u, u), _dot(v, v), _dot(u, v), _dot(u, r), _dot(v, r)
    if a <= TOUCH * TOUCH:
        return 0.0, 0.0 if e <= TOUCH * TOUCH else _unit(f / e)
    if e <= TOUCH * TOUCH:
        return _unit(-c / a), 0.0
    denominator = a * e - b * b
    s = _unit((b * f - c * e) / denominator) if denominator > PARALLEL * a * e else 0.5
    t = (b * s + f) / e
    if t < 0.0:
        return _unit(-c / a), 0.0
    if t > 1.0:
        return _unit((b - c) / a), 1.0
    return _unit((b * t - c) / a), t


@njit(cache=True)
def _nearest_to_box(c: Vector, e: Vector, half: Vector) -> float:
    """t in [-1, 1] whose point c + t e is nearest to a box at the origin.

    Half the derivative of the squared distance is piecewise linear and grows with t, its kinks lie where the segment
    crosses a face's plane: bracket the root between kinks, then it is one line.
    """
    low, high = -1.0, 1.0
    slope_low, slope_high = _slope(low, c, e, half), _slope(high, c, e, half)
    if slope_low >= 0.0:
        return low
    if slope_high <= 0.0:
        return high
    for i in range(6):
        axis = i // 2
        if e[axis] != 0.0:
            face = half[axis] if i % 2 else -half[axis]
            t = (face - c[axis]) / e[axis]
            if low < t < high:
                slope = _slope(t, c, e, half)
                if slope > 0.0:
                    high, slope_high = t, slope
                else:
                    low, slope_low = t, slope
    return low - slope_low * (high - low) / (slope_high - slope_low)


@njit(cache=True)
def _slope(t: float, c: Vector, e: Vector, half: Vector) -> float:
    """Half the derivative by t of the squared distance of c + t e from a box at the origin."""
    slope = 0.0
    for i in range(3):
        x = c[i] + t * e[i]
        if x > half[i]:
            slope += (x - half[i]) * e[i]
        elif x < -half[i]:
            slope += (x + half[i]) * e[i]
    return slope


@njit(cache=True)
def _segment_box_separation(c: Vector, e: Vector, half: Vector) -> tuple[float, Vector]:
    """Largest separation (negative: overlap) of segment c +- e and a box at the origin, and its axis to the box.

    Candidates: the box's face normals and their cross products with the segment.
    """
    best, normal = -math.inf, (1.0, 0.0, 0.0)
    for i in range(6):
        axis = _cross(e, _unit_vector(i - 3)) if i >= 3 else _unit_vector(i)
        length = math.sqrt(_dot(axis, axis))
        if i < 3 or length * length > PARALLEL * _dot(e, e):
            axis = _scale(axis, (-1.0 if _dot(axis, c) > 0.0 else 1.0) / length)
            separation = -_dot(axis, c) - abs(_dot(axis, e)) - _extent(axis, half)
            if separation > best:
                best, normal = separation, axis
    return best, normal


@njit(cache=True)
def _box_box_separation(c: Vector, m: Frame, ha: Vector, hb: Vector) -> tuple[float, Vector]:
    """Largest separation (negative: overlap) of a box at the origin and one at c turned by m, and its axis to c.

    Candidates: the face normals of both and the nine cross products of their edges (Gottschalk et al. 1996).
    """
    best, normal = -math.inf, (1.0, 0.0, 0.0)
    for i in range(15):
        if i < 3:
            axis = _unit_vector(i)
        elif i < 6:
            axis = _column(m, i - 3)
        else:
            axis = _cross(_unit_vector((i - 6) // 3), _column(m, (i - 6) % 3))
        squared = _dot(axis, axis)
        if squared > PARALLEL:
            axis = _scale(axis, (1.0 if _dot(axis, c) >= 0.0 else -1.0) / math.sqrt(squared))
            separation = _dot(axis, c) - _extent(axis, ha) - _extent(_turn_back(m, axis), hb)
            if separation > best:
                best, normal = separation, axis
    return best, normal


@njit(cache=True)
def _nearest_of_boxes(c: Vector, m: Frame, ha: Vector, hb: Vector) -> tuple[Vector, Vector]:
    """Nearest points of a box at the origin and a disjoint one at c turned by m.

    One of them lies on an edge of the second box (all 12 against the first box), or the first is a corner.
    """
    best = math.inf
    x, y = c, c
    for i in range(12):
        axis, s, t = i // 4, 1.0 - 2.0 * (i % 2), 1.0 - 2.0 * (i // 2 % 2)
        along = _scale(_column(m, axis), hb[axis])
        second, third = (axis + 1) % 3, (axis + 2) % 3
        middle = _add(_add(c, _column(m, second), s * hb[second]), _column(m, third), t * hb[third])
        point = _add(middle, along, _nearest_to_box(middle, along, ha))
        nearest = _clamp(point, ha)
        apart = _sub(point, nearest)
        if _dot(apart, apart) < best:
            best, x, y = _dot(apart, apart), nearest, point
    for i in range(8):
        corner = (ha[0] * (1 - 2 * (i % 2)), ha[1] * (1 - 2 * (i // 2 % 2)), ha[2] * (1 - 2 * (i // 4)))
        nearest = _add(_turn(m, _clamp(_turn_back(m, _sub(corner, c)), hb)), c, 1.0)
        apart = _sub(nearest, corner)
        if _dot(apart, apart) < best:
            best, x, y = _dot(apart, apart), corner, nearest
    return x, y


@njit(cache=True)
def _perpendicular(u: Vector, v: Vector, towards: Vector) -> Vector:
    """Unit vector at right angles to u and v (to u alone where they are parallel), on the side of ``towards``."""
    axis = _cross(u, v)
    if _dot(axis, axis) <= PARALLEL * _dot(u, u) * _dot(v, v):
        long = u if _dot(u, u) >= _dot(v, v) else v
        axis = _cross(long, (1.0, 0.0, 0.0) if abs(long[0]) <= abs(long[1]) else (0.0, 1.0, 0.0))
    squared = _dot(axis, axis)
    if squared == 0.0:
        return 0.0, 0.0, 1.0
    return _scale(axis, (1.0 if _dot(axis, towards) >= 0.0 else -1.0) / math.sqrt(squared))


@njit(cache=True)
def _extent(axis: Vector, half: Vector) -> float:
    """Half the width of a box along an axis in its own frame."""
    return abs(axis[0]) * half[0] + abs(axis[1]) * half[1] + abs(axis[2]) * half[2]


@njit(cache=True)
def _clamp(x: Vector, half: Vector) -> Vector:
    return (
        min(max(x[0], -half[0]), half[0]),
        min(max(x[1], -half[1]), half[1]),
        min(max(x[2], -half[2]), half[2]),
    )


@njit(cache=True)
def _unit(x: float) -> float:
    return min(max(x, 0.0), 1.0)


@njit(cache=True)
def _unit_vector(i: int) -> Vector:
    return (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)


@njit(cache=True)
def _column(m: Frame, i: int) -> Vector:
    return m[0][i], m[1][i], m[2][i]


@njit(cache=True)
def _relative(a: Frame, b: Frame) -> Frame:
    """Transposed a times b."""
    x, y, z = _turn_back(a, _column(b, 0)), _turn_back(a, _column(b, 1)), _turn_back(a, _column(b, 2))
    return (x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])


@njit(cache=True)
def _turn(m: Frame, v: Vector) -> Vector:
    return _dot(m[0], v), _dot(m[1], v), _dot(m[2], v)


@njit(cache=True)
def _turn_back(m: Frame, v: Vector) -> Vector:
    return (
        m[0][0] * v[0] + m[1][0] * v[1] + m[2][0] * v[2],
        m[0][1] * v[0] + m[1][1] * v[1] + m[2][1] * v[2],
        m[0][2] * v[0] + m[1][2] * v[1] + m[2][2] * v[2],
    )


@njit(cache=True)
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _add(a: Vector, b: Vector, factor: float) -> Vector:
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@njit(cache=True)
def _sub(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(cache=True)
def _scale(a: Vector, factor: float) -> Vector:
    return factor * a[0], factor * a[1], factor * a[2]
