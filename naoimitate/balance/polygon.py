"""The support polygon: the convex hull of the outlines of the soles that carry."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.balance.legs import Legs
from naoimitate.core.geometry import convex_hull, distance_to_edge

Array = npt.NDArray[np.float64]


@njit(cache=True)
def support_polygon(legs: Legs, sole_pos: Array, sole_rot: Array, left: bool, right: bool) -> Array:
    """Corners (N, 2) m, counter-clockwise, of the polygon under soles at (2, 3) m, (2, 3, 3) in the world."""
    count = legs.outline.shape[1]
    points = np.empty((count * (int(left) + int(right)), 2))
    row = 0
    for side in range(2):
        if (side == 0 and left) or (side == 1 and right):
            for k in range(count):
                for a in range(2):
                    points[row, a] = (
                        sole_pos[side, a]
                        + sole_rot[side, a, 0] * legs.outline[side, k, 0]
                        + sole_rot[side, a, 1] * legs.outline[side, k, 1]
                    )
                row += 1
    return convex_hull(points)


@njit(cache=True)
def room_around(polygon: Array, x: float, y: float, along: Array, margin: float, least: float) -> Array:
    """How far (4,) m a point may move along a line (2,), against it, to its left and right, and stay in a polygon.

    margin: m that it keeps from the edge. least: m that it may move in any case.
    """
    dx, dy = along
    room = np.empty(4)
    for k, (ux, uy) in enumerate(((dx, dy), (-dx, -dy), (-dy, dx), (dy, -dx))):
        room[k] = max(distance_to_edge(polygon, x, y, ux, uy, margin), least)
    return room
