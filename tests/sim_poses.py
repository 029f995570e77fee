"""Postures for the simulation's tests, solved on the spot for any robot."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from naoimitate.core.geometry import polygon_centroid
from naoimitate.robot.kernel import center_of_mass, forward
from naoimitate.robot.model import RobotModel

WIDTH = 0.11
"""Between the sole origins, m."""


def one_foot_pose(robot: RobotModel, side: str, lift: float = 0.03, arms: float = 0.0) -> np.ndarray:
    """Posture (J,) rad on one foot, torso upright, CoM over the centroid of its sole, the other sole level beside it.

    lift: m of the other sole. arms: rad, how far both shoulders' first joints are turned from the stand.
    """
    stand = robot.postures["stand"].copy()
    other = "r" if side == "l" else "l"
    for arm in ("l_arm", "r_arm"):
        stand[robot.chains[arm][0]] += arms
    followers = {follower: leader for leader, follower in robot.coupled}
    free = [j for leg in ("l_leg", "r_leg") for j in robot.chains[leg] if j not in followers]
    pos, rot = np.zeros((len(stand) + 1, 3)), np.zeros((len(stand) + 1, 3, 3))
    com, goal = np.zeros(3), polygon_centroid(robot.soles[side])
    beside = np.array([0.0, WIDTH if side == "r" else -WIDTH, lift])

    def posture(x: np.ndarray) -> np.ndarray:
        q = stand.copy()
        q[free] = x
        for follower, leader in followers.items():
            q[follower] = q[leader]
        return q

    def residual(x: np.ndarray) -> np.ndarray:
        forward(robot.tree, posture(x), pos, rot)
        center_of_mass(robot.tree, pos, rot, com)
        stance, swing = (robot.points[f"{s}_sole"] for s in (side, other))
        R, S = rot[stance.joint + 1], rot[swing.joint + 1]
        origin = pos[stance.joint + 1] + R @ stance.offset
        foot = R.T @ (pos[swing.joint + 1] + S @ swing.offset - origin)
        level = (R.T @ S)[:2, 2]
        over = (R.T @ (com - origin))[:2] - goal
        return np.concatenate([10 * over, 10 * (foot - beside), level, R[2, :2], 0.01 * (x - stand[free])])

    low, high = robot.lower[free] + 1e-3, robot.upper[free] - 1e-3
    return posture(least_squares(residual, np.clip(stand[free], low, high), bounds=(low, high)).x)
