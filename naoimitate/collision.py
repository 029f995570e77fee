"""Clearance of the body: signed distances between pairs of its shapes, and the lowest point of each shape.

Compiled, on flat arrays; link frames ``pos`` (J + 1, 3) m and ``rot`` (J + 1, 3, 3) are those of
``robot.kernel.forward``, so points and normals are in the frame of the base link.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.convex import Frame, Vector, box_box, capsule_box, capsule_capsule
from naoimitate.robot.model import Array, RobotModel

CAPSULE, BOX = 0, 1
"""Kinds of shapes; a sphere is a capsule of length 0."""


class ShapeArrays(NamedTuple):
    """The shapes of a robot as flat arrays; S shapes, everything in the frame of the shape's link, m.

    link: (S,) row of pos and rot. kind: (S,) CAPSULE or BOX. p0, p1: (S, 3) ends of the segment, of a box its centre.
    radius: (S,). half: (S, 3) half sizes. centre (S, 3), bound (S,): sphere around the shape.
    """

    link: npt.NDArray[np.int64]
    kind: npt.NDArray[np.int64]
    p0: Array
    p1: Array
    radius: Array
    half: Array
    centre: Array
    bound: Array


def shape_arrays(model: RobotModel) -> ShapeArrays:
    """Flat arrays of ``model.shapes``, in their order."""
    shapes = model.shapes
    p0 = np.array([shape.p0 for shape in shapes]).reshape(-1, 3)
    p1 = np.array([shape.p1 for shape in shapes]).reshape(-1, 3)
    radius = np.array([shape.radius for shape in shapes])
    half = np.array([shape.half for shape in shapes]).reshape(-1, 3)
    return ShapeArrays(
        link=np.array([shape.joint + 1 for shape in shapes], dtype=np.int64),
        kind=np.array([BOX if shape.kind == "box" else CAPSULE for shape in shapes], dtype=np.int64),
        p0=p0,
        p1=p1,
        radius=radius,
        half=half,
        centre=0.5 * (p0 + p1),
        bound=0.5 * np.linalg.norm(p1 - p0, axis=1) + radius + np.linalg.norm(half, axis=1),
    )


@njit(cache=True)
def distances(
    shapes: ShapeArrays,
    pairs: npt.NDArray[np.int64],
    pos: Array,
    rot: Array,
    reach: float,
    out_d: Array,
    out_point_a: Array,
    out_point_b: Array,
    out_normal: Array,
) -> None:
    """Fill the signed distance of every pair of shapes, its two points, and the unit normal from a to b.

    pairs: (P, 2) as ``RobotModel.pairs``. out_d: (P,) m, negative = depth of the overlap; the others (P, 3), with
    ``point_b - point_a = d normal``. Pairs surely farther apart than ``reach`` (m) get d = inf and keep the rest.
    """
    placed = np.empty((shapes.link.shape[0], 3, 3))
    for i in range(shapes.link.shape[0]):
        _place(shapes, i, pos, rot, placed)
    for p in range(pairs.shape[0]):
        a, b = pairs[p, 0], pairs[p, 1]
        x, y, z = (
            placed[a, 0, 0] - placed[b, 0, 0],
            placed[a, 0, 1] - placed[b, 0, 1],
            placed[a, 0, 2] - placed[b, 0, 2],
        )
        apart = shapes.bound[a] + shapes.bound[b] + reach
        if x * x + y * y + z * z > apart * apart:
            out_d[p] = math.inf
            continue
        d, point_a, point_b, normal = _contact(shapes, a, b, placed, rot)
        out_d[p] = d
        for k in range(3):
            out_point_a[p, k] = point_a[k]
            out_point_b[p, k] = point_b[k]
            out_normal[p, k] = normal[k]


@njit(cache=True)
def lowest_points(shapes: ShapeArrays, pos: Array, rot: Array, base_pos: Array, base_rot: Array, out: Array) -> None:
    """Fill out (S, 3) m: the lowest point of every shape in the WORLD; its z is the height above the floor.

    base_pos: (3,) m, base_rot: (3, 3): base link in the world. Of equally low points it is one of them.
    """
    down = (-base_rot[2, 0], -base_rot[2, 1], -base_rot[2, 2])
    placed = np.empty((shapes.link.shape[0], 3, 3))
    for i in range(shapes.link.shape[0]):
        _place(shapes, i, pos, rot, placed)
        point = _support(shapes, i, placed, rot, down)
        for k in range(3):
            out[i, k] = base_pos[k] + base_rot[k, 0] * point[0] + base_rot[k, 1] * point[1] + base_rot[k, 2] * point[2]


@njit(cache=True)
def _place(shapes: ShapeArrays, i: int, pos: Array, rot: Array, placed: Array) -> None:
    """Fill placed[i]: centre, p0 and p1 of shape i in the base frame."""
    link = shapes.link[i]
    for k in range(3):
        placed[i, 1, k] = pos[link, k]
        placed[i, 2, k] = pos[link, k]
        for c in range(3):
            placed[i, 1, k] += rot[link, k, c] * shapes.p0[i, c]
            placed[i, 2, k] += rot[link, k, c] * shapes.p1[i, c]
        placed[i, 0, k] = 0.5 * (placed[i, 1, k] + placed[i, 2, k])


@njit(cache=True)
def _contact(shapes: ShapeArrays, a: int, b: int, placed: Array, rot: Array) -> tuple[float, Vector, Vector, Vector]:
    """Signed distance, points and normal of shapes a and b."""
    a0, a1, b0, b1 = _row(placed[a, 1]), _row(placed[a, 2]), _row(placed[b, 1]), _row(placed[b, 2])
    if shapes.kind[a] == CAPSULE and shapes.kind[b] == CAPSULE:
        return capsule_capsule(a0, a1, shapes.radius[a], b0, b1, shapes.radius[b])
    if shapes.kind[a] == CAPSULE:
        return capsule_box(a0, a1, shapes.radius[a], b0, _frame(rot[shapes.link[b]]), _row(shapes.half[b]))
    frame_a, half_a = _frame(rot[shapes.link[a]]), _row(shapes.half[a])
    if shapes.kind[b] == CAPSULE:
        d, point_b, point_a, n = capsule_box(b0, b1, shapes.radius[b], a0, frame_a, half_a)
        return d, point_a, point_b, (-n[0], -n[1], -n[2])
    return box_box(a0, frame_a, half_a, b0, _frame(rot[shapes.link[b]]), _row(shapes.half[b]))


@njit(cache=True)
def _support(shapes: ShapeArrays, i: int, placed: Array, rot: Array, direction: Vector) -> Vector:
    """Point of shape i that lies farthest in a direction (unit vector), base frame."""
    x, y, z = direction
    if shapes.kind[i] == CAPSULE:
        first, second = placed[i, 1], placed[i, 2]
        ahead = (second[0] - first[0]) * x + (second[1] - first[1]) * y + (second[2] - first[2]) * z
        end, r = (second if ahead > 0.0 else first), shapes.radius[i]
        return end[0] + r * x, end[1] + r * y, end[2] + r * z
    px, py, pz = _row(placed[i, 0])
    m = rot[shapes.link[i]]
    for k in range(3):
        along = shapes.half[i, k] if m[0, k] * x + m[1, k] * y + m[2, k] * z > 0.0 else -shapes.half[i, k]
        px, py, pz = px + along * m[0, k], py + along * m[1, k], pz + along * m[2, k]
    return px, py, pz


@njit(cache=True)
def _row(v: Array) -> Vector:
    return v[0], v[1], v[2]


@njit(cache=True)
def _frame(m: Array) -> Frame:
    return _row(m[0]), _row(m[1]), _row(m[2])
