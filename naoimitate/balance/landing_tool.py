"""The tool that computes a robot's landing set, by solving both one-foot poses of every relative sole pose of a grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from naoimitate.balance.clearance import Clearance, ClearanceSettings
from naoimitate.balance.landing import LandingSet
from naoimitate.balance.legs import POSE, LegLimits, LegWeights, build_legs
from naoimitate.balance.offset import OffsetLaw
from naoimitate.balance.stabiliser import Plan, Stabiliser
from naoimitate.balance.swing import SwingSettings
from naoimitate.core.geometry import yaw_matrix
from naoimitate.robot.model import RobotModel

Array = npt.NDArray[np.float64]

COM_TOLERANCE = 0.001
"""[m] of the CoM from the foot's centre that still counts as over it."""
ARMS = ("stand", "calibration", "zero")
"""Postures whose arms every member of the set must be able to carry."""


@dataclass(frozen=True)
class LandingGrid:
    """The relative poses that are tried: left sole in the right sole's frame."""

    step: float = 0.010
    """[m] of the grid."""
    behind: float = 0.16
    """[m] behind the other foot, and as much in front."""
    narrow: float = 0.06
    wide: float = 0.20
    """[m] apart."""
    turn: float = 0.6
    """[rad] of toe-in and toe-out."""
    turns: int = 7
    directions: int = 16
    """Half planes of each polygon."""
    reserve: float = 0.004
    """[m] by which the polygons are drawn in."""


def compute_landing_set(robot: RobotModel, grid: LandingGrid | None = None, progress: Callable[[float], None] | None = None) -> dict[str, Any]:
    """The ``landing`` section of a robot's data: polygons of places where both feet can carry, by yaw."""
    grid = grid or LandingGrid()
    count = round(grid.behind / grid.step)
    xs = np.arange(-count, count + 1) * grid.step
    ys = np.arange(grid.narrow, grid.wide + 1e-9, grid.step)
    yaws = np.linspace(-grid.turn, grid.turn, grid.turns)
    prover = _Prover(robot)
    angles = np.arange(grid.directions) * 2.0 * np.pi / grid.directions
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    kept, reach = [], []
    for k, yaw in enumerate(yaws):
        points = np.array([(x, y) for x in xs for y in ys])
        good = np.array([prover.both_feet(p, yaw) for p in points])
        if progress is not None:
            progress((k + 1) / len(yaws))
        if good.sum() >= 3:
            kept.append(float(yaw))
            reach.append(_polygon(points[good], points[~good], normals) - grid.reserve)
    return {
        "directions_deg": [round(float(a), 3) for a in np.degrees(angles)],
        "yaws": [round(y, 4) for y in kept],
        "reach": [[round(float(r), 4) for r in row] for row in reach],
    }


def _polygon(good: Array, bad: Array, normals: Array) -> Array:
    """Reach (K,) of half planes that hold no bad point and lose few good ones."""
    reach = (good @ normals.T).max(axis=0)
    while True:
        inside = (bad @ normals.T < reach - 1e-9).all(axis=1)
        if not inside.any():
            return np.asarray(reach)
        levels = bad[inside] @ normals.T
        kept_good = good[(good @ normals.T <= reach + 1e-9).all(axis=1)]
        losses = np.array([[(kept_good @ n > level - 1e-9).sum() for n, level in zip(normals, row, strict=True)] for row in levels])
        point, cut = np.unravel_index(int(losses.argmin()), losses.shape)
        reach[cut] = levels[point, cut] - 1e-6


class _Prover:
    """Tries whether the CoM comes over either foot of a stance, with several arm postures."""

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        limits = LegLimits()
        everywhere = LandingSet(np.array([-3.0, 3.0]), np.array([[1.0, 0.0]]), np.full((2, 1), 9.0))
        weights = LegWeights(foot=0.05)
        self._stabiliser = Stabiliser(robot, build_legs(robot, limits), everywhere, weights, OffsetLaw(), SwingSettings())
        self._clearance = Clearance(robot, ClearanceSettings())
        arms = [*robot.chains["l_arm"], *robot.chains["r_arm"]]
        self._starts = []
        for name in ARMS:
            q = robot.postures["stand"].copy()
            q[arms] = robot.postures[name][arms]
            self._starts.append(q)

    def both_feet(self, position: Array, yaw: float) -> bool:
        return all(self._reaches(q, position, yaw, side) for q in self._starts for side in (0.0, 1.0))

    def _reaches(self, q: Array, position: Array, yaw: float, offset: float, steps: int = 25) -> bool:
        """Move the left foot to its place, then the CoM over one foot; whether every constraint holds in the end."""
        s = self._stabiliser
        s.base_side = 1
        s.plant(np.zeros((2, 3)), np.stack([np.eye(3), np.eye(3)]))
        pose = s.pose(q.copy())
        s.plant(pose.sole_pos * [1.0, 1.0, 0.0], np.stack([np.eye(3), np.eye(3)]))
        pose = s.pose(q.copy())
        feet = np.zeros((2, 3))
        rows = self._stabiliser.legs.sole_joint + 1
        start = pose.sole_pos[0].copy()
        goal = pose.sole_pos[1] + [position[0], position[1], 0.0]
        for k in range(2 * steps + 5):
            part, shift = min(1.0, (k + 1) / steps), min(max(0.0, (k + 1 - steps) / steps), 1.0)
            s.planted_pos[0] = start + part * (goal - start)
            s.planted_rot[0] = yaw_matrix(part * yaw)
            s.offset = 0.5 + shift * (offset - 0.5)
            for i in (0, 1):
                feet[i] = pose.link_pos[rows[i]] + pose.link_rot[rows[i]] @ s.legs.sole_point[i] - s.legs.hip[i]
            self._clearance.look(pose)
            plan = Plan(s.offset, 0.0, s.planted_pos[0], s.planted_rot[0], POSE, 0.0, False, False)
            q_new = pose.q.copy()
            _, closed = s.solve(q_new, plan, pose, feet, 1.0, (pose.q - 0.2, pose.q + 0.2), *self._clearance.leg_rows(pose, s.legs, 1))
            if not closed:
                return False
            pose = s.pose(q_new)
        left, right = s.centres(s.planted_pos, s.planted_rot)
        over = (left if offset == 0.0 else right)[:2]
        self._clearance.look(pose)
        return bool(np.linalg.norm(pose.com[:2] - over) < COM_TOLERANCE and self._clearance.nearest > 0.0)
