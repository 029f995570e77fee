"""Where the torso is when a posture stands on the floor."""

from __future__ import annotations

import numpy as np

from naoimitate.core.frames import SIDES, Array
from naoimitate.core.geometry import heading, quat_from_matrix, yaw_matrix
from naoimitate.robot.kernel import forward
from naoimitate.robot.model import RobotModel


def stand_on_floor(robot: RobotModel, q: Array, foot: str | None = None) -> tuple[Array, Array]:
    """Torso (3,) m, (4,) in the world with a sole flat on the floor, heading along +x, sole origin(s) over (0, 0).

    q: (J,) rad. foot: ``l`` or ``r``, the foot that stands; None = both, level on average, the lower one touching.
    """
    joints = len(robot.joint_names)
    pos, rot = np.zeros((joints + 1, 3)), np.zeros((joints + 1, 3, 3))
    forward(robot.tree, q, pos, rot)
    points = [robot.points[f"{side}_sole"] for side in (SIDES if foot is None else foot)]
    up = np.sum([rot[point.joint + 1][:, 2] for point in points], axis=0)
    soles = np.array([pos[point.joint + 1] + rot[point.joint + 1] @ point.offset for point in points])
    level = _rotation_onto_z(up / np.linalg.norm(up))
    level = yaw_matrix(-heading(level)) @ level
    soles = soles @ level.T
    base = -np.array([*soles[:, :2].mean(axis=0), soles[:, 2].min()])
    return base, quat_from_matrix(level)


def _rotation_onto_z(axis: Array) -> Array:
    """Shortest rotation (3, 3) that turns a unit vector (not -z) onto +z: E + [v]x + [v]x^2 / (1 + c)."""
    v = np.array([axis[1], -axis[0], 0.0])
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + cross + cross @ cross / (1.0 + axis[2])
