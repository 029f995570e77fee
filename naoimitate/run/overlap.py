"""Self-collision: in which frames do two shapes of the body overlap."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.collision import ShapeArrays, distances, shape_arrays
from naoimitate.robot.model import RobotModel
from naoimitate.run.measure import Bar, Measure
from naoimitate.run.replay import Array, Replay

ALLOWED_OVERLAP = 0.001
"""Two shapes may overlap by this much, m."""


def nearest_pairs(robot: RobotModel, frames: Replay) -> Array:
    """Signed distance of the nearest pair of shapes that must not overlap, (N,) m; infinity where none is near."""
    return np.asarray(_nearest(shape_arrays(robot), robot.pairs, frames.links_pos, frames.links_rot))


def overlap(robot: RobotModel, frames: Replay) -> list[Measure]:
    """The measures of self-collision."""
    colliding = nearest_pairs(robot, frames) < -ALLOWED_OVERLAP
    return [Measure("self_collision_frames", "frames in self-collision", int(colliding.sum()), "", Bar(0))]


@njit(cache=True)
def _nearest(shapes: ShapeArrays, pairs: npt.NDArray[np.int64], links_pos: Array, links_rot: Array) -> Array:
    count = pairs.shape[0]
    d, a, b, normal = np.empty(count), np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3))
    nearest = np.full(links_pos.shape[0], np.inf)
    for i in range(links_pos.shape[0]):
        distances(shapes, pairs, links_pos[i], links_rot[i], 0.0, d, a, b, normal)
        for k in range(count):
            nearest[i] = min(nearest[i], d[k])
    return nearest
