"""The tool that computes a robot's landing set: it solves both one-foot poses of every relative sole pose of a grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from naoimitate.balance.clearance import Clearance, ClearanceSettings
from naoimitate.balance.leg_solver import solve_legs
from naoimitate.balance.legs import POSE, LegLimits, LegWeights, Stance, build_legs, free_goal
from naoimitate.balance.pose import Pose, PoseMaker
from naoimitate.balance.retarget import Reach
from naoimitate.core.geometry import yaw_matrix
from naoimitate.robot.model import RobotModel

Array = npt.NDArray[np.float64]

COM_TOLERANCE = 0.001
"""[m] of the CoM from the foot's centre that still counts as over it."""
ARMS = ("stand", "calibration", "zero")
"""Postures whose arms every member of the set must be able to carry."""
CLOSED = 2e-5
"""Sum of m and rad by which a planted sole may differ from where it is asked to be."""
STEPS = 25
"""Solves in which the foot is brought to its place, and then the CoM over one foot."""
STEP = 0.2
"""[rad] of each joint in one solve."""


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


def compute_landing_set(
    robot: RobotModel, grid: LandingGrid | None = None, progress: Callable[[float], None] | None = None
) -> dict[str, Any]:
    """The ``landing`` section of a robot's data: polygons of places where both feet can carry, by yaw.

    A place belongs to a yaw when it is proved there and half-way to both neighbours, because yaws between are
    interpolated. progress: called with the share that is done.
    """
    grid = grid or LandingGrid()
    count = round(grid.behind / grid.step)
    xs = np.arange(-count, count + 1) * grid.step
    ys = np.arange(grid.narrow, grid.wide + 1e-9, grid.step)
    points = np.array([(x, y) for x in xs for y in ys])
    yaws = np.linspace(-grid.turn, grid.turn, 2 * grid.turns - 1)
    proved = _proved(Prover(robot), points, yaws, progress)
    angles = np.arange(grid.directions) * 2.0 * np.pi / grid.directions
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    kept, reach = [], []
    for k in range(0, len(yaws), 2):
        good = proved[max(k - 1, 0) : k + 2].all(axis=0)
        if good.sum() >= 3:
            kept.append(float(yaws[k]))
            reach.append(_polygon(points[good], points[~good], normals) - grid.reserve)
    return {
        "directions_deg": [round(float(a), 3) for a in np.degrees(angles)],
        "yaws": [round(y, 4) for y in kept],
        "reach": [[round(float(r), 4) for r in row] for row in reach],
    }


def _proved(
    prover: Prover, points: Array, yaws: Array, progress: Callable[[float], None] | None
) -> npt.NDArray[np.bool_]:
    """Which points (N, 2) m are proved at which yaws (Y,) rad, (Y, N)."""
    rows = []
    for yaw in yaws:
        rows.append([prover.both_feet(p, yaw) for p in points])
        if progress is not None:
            progress(len(rows) / len(yaws))
    return np.array(rows)


def _polygon(good: Array, bad: Array, normals: Array) -> Array:
    """Reach (K,) of half planes that hold no bad point and lose few good ones."""
    reach = (good @ normals.T).max(axis=0)
    while True:
        inside = (bad @ normals.T < reach - 1e-9).all(axis=1)
        if not inside.any():
            return np.asarray(reach)
        levels = bad[inside] @ normals.T
        kept_good = good[(good @ normals.T <= reach + 1e-9).all(axis=1)]
        along = kept_good @ normals.T
        losses = np.array([(along > row - 1e-9).sum(axis=0) for row in levels])
        point, cut = np.unravel_index(int(losses.argmin()), losses.shape)
        reach[cut] = levels[point, cut] - 1e-6


class Prover:
    """Tries whether the CoM comes over either foot of a stance, with several arm postures."""

    def __init__(self, robot: RobotModel) -> None:
        self._tree, self._legs = robot.tree, build_legs(robot, LegLimits())
        self._maker = PoseMaker(robot, self._legs)
        self._weights = LegWeights(foot=0.05)
        self._clearance = Clearance(robot, ClearanceSettings())
        arms = [*robot.chains["l_arm"], *robot.chains["r_arm"]]
        self._starts = []
        for name in ARMS:
            q = robot.postures["stand"].copy()
            q[arms] = robot.postures[name][arms]
            self._starts.append(q)

    def both_feet(self, position: Array, yaw: float) -> bool:
        """Whether every arm posture can be carried over either foot with the left sole there in the right one's frame.

        position: (2,) m. yaw: rad.
        """
        return all(self._reaches(q, position, yaw, side) for q in self._starts for side in (0, 1))

    def _reaches(self, q: Array, position: Array, yaw: float, side: int) -> bool:
        """Move the left foot to its place, then the CoM over one foot; whether every constraint holds in the end."""
        pose = self._maker.stand(q)
        start = pose.sole_pos * [1.0, 1.0, 0.0]
        goal = start[1] + [position[0], position[1], 0.0]
        for k in range(2 * STEPS + 5):
            part, shift = min(1.0, (k + 1) / STEPS), min(max(0.0, (k + 1 - STEPS) / STEPS), 1.0)
            soles = np.array([start[0] + part * (goal - start[0]), start[1]])
            stepped = self._solved(pose, soles, part * yaw, 0.5 + shift * (side - 0.5))
            if stepped is None:
                return False
            pose = stepped
        over = self._maker.centres(pose.sole_pos, pose.sole_rot)[side]
        self._clearance.look(pose)
        return bool(np.linalg.norm((pose.com - over)[:2]) < COM_TOLERANCE and self._clearance.nearest > 0.0)

    def _solved(self, pose: Pose, soles: Array, yaw: float, offset: float) -> Pose | None:
        """The pose with flat soles at (2, 3) m, the left one turned, and the CoM between them; None without one."""
        rot = np.stack([yaw_matrix(yaw), np.eye(3)])
        left, right = self._maker.centres(soles, rot)[:, :2]
        feet, shares = pose.soles_in_base - self._legs.hip, np.array([1.0 - offset, offset])
        goal = free_goal(feet, left + offset * (right - left), np.ones(2), shares)
        self._clearance.look(pose)
        rows = self._clearance.leg_rows(pose, self._legs, 1)
        q, stance = pose.q.copy(), Stance(1, soles, rot, POSE, 0.0)
        low, high = pose.q - STEP, pose.q + STEP
        reach = Reach(1.0, low, high, low, high)
        closure = solve_legs(self._tree, self._legs, self._weights, stance, goal, q, reach, *rows).closure
        return self._maker.hang(q, 1, soles, rot) if closure < CLOSED else None
