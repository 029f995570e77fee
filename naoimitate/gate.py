"""The last check of a pose before it leaves: limits, planted feet, balance, collisions. A pure function."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.balance.clearance import Clearance
from naoimitate.balance.legs import Legs, table_bounds
from naoimitate.balance.polygon import support_polygon
from naoimitate.balance.pose import Pose
from naoimitate.core.geometry import polygon_margin
from naoimitate.robot.model import RobotModel

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class GateLimits:
    """What a pose must keep to be sent."""

    margin: float = 0.020
    """[m] of the CoM's ground projection inside the stance outlines (or no less than the pose before)."""
    slip: float = 1e-4
    """[m] of any outline point of a stance sole from where it was planted."""
    speed_share: float = 0.89
    """Share of the motors' no-load speed."""
    overlap: float = 5e-4
    """[m] by which two shapes of the body, or the body and the floor, may touch (or no more than before)."""


class GateModel(NamedTuple):
    """Flat arrays of a robot's limits. tables as in ``Legs``, over all joints."""

    lower: Array
    upper: Array
    speed: Array
    table_x: npt.NDArray[np.int64]
    table_y: npt.NDArray[np.int64]
    table_rows: Array


def build_gate(robot: RobotModel) -> GateModel:
    """Flatten a robot's limits."""
    rows = max((len(t.rows) for t in robot.tables), default=1)
    padded = [np.concatenate([t.rows, np.repeat(t.rows[-1:], rows - len(t.rows), axis=0)]) for t in robot.tables]
    return GateModel(
        robot.lower,
        robot.upper,
        robot.speed,
        np.array([t.x for t in robot.tables], dtype=np.int64),
        np.array([t.y for t in robot.tables], dtype=np.int64),
        np.array(padded).reshape(len(padded), rows, 3),
    )


@njit(cache=True)
def range_excess(model: GateModel, q: Array) -> float:
    """Largest angle beyond a joint's range or a coupling table, rad (negative inside); inf for NaN."""
    worst = -np.inf
    for j in range(q.shape[0]):
        if not np.isfinite(q[j]):
            return np.inf
        worst = max(worst, model.lower[j] - q[j], q[j] - model.upper[j])
    for t in range(model.table_x.shape[0]):
        low, _, high, _ = table_bounds(model.table_rows[t], q[model.table_x[t]])
        y = q[model.table_y[t]]
        worst = max(worst, low - y, y - high)
    return worst


@njit(cache=True)
def speed_ratio(model: GateModel, q: Array, before: Array, dt: float) -> float:
    """Largest joint speed over the motor's no-load speed between two poses dt s apart."""
    worst = 0.0
    for j in range(q.shape[0]):
        worst = max(worst, abs(q[j] - before[j]) / (dt * model.speed[j]))
    return worst


@njit(cache=True)
def support_margin(legs: Legs, sole_pos: Array, sole_rot: Array, left: bool, right: bool, com: Array) -> float:
    """Signed distance of the CoM's ground projection to the edge of the stance outlines' convex hull, m."""
    return polygon_margin(support_polygon(legs, sole_pos, sole_rot, left, right), com[0], com[1])


@njit(cache=True)
def outline_travel(legs: Legs, side: int, pos_a: Array, rot_a: Array, pos_b: Array, rot_b: Array) -> float:
    """Largest distance between an outline point of a sole in two poses, m."""
    worst = 0.0
    for k in range(legs.outline.shape[1]):
        squared = 0.0
        for a in range(3):
            d = pos_a[a] - pos_b[a]
            for b in range(2):
                d += (rot_a[a, b] - rot_b[a, b]) * legs.outline[side, k, b]
            squared += d * d
        worst = max(worst, np.sqrt(squared))
    return worst


class Gate:
    """Refuses poses: out of range, too fast, off their planted soles, touching, or without margin."""

    def __init__(self, robot: RobotModel, legs: Legs, clearance: Clearance, limits: GateLimits) -> None:
        self._model, self._legs, self._clearance, self._limits = build_gate(robot), legs, clearance, limits

    def passes(
        self, pose: Pose, before: Pose, stances: tuple[bool, bool], planted_pos: Array, planted_rot: Array, dt: float
    ) -> bool:
        """Whether a pose may follow another one after dt s.

        stances: which feet carry, left and right, where ``planted_pos`` (2, 3) m and ``planted_rot`` (2, 3, 3) say.
        A pose that is no worse than the one before passes clearance and margin, so that a way out stays open.
        """
        return (
            self.moves(pose, before, stances, planted_pos, planted_rot, dt)
            and self._clear(pose, before)
            and self.balanced(pose, before, stances)
        )

    def safe(self, pose: Pose) -> bool:
        """Whether a pose on both feet may be the first of all: in range, clear of itself and the floor, with margin."""
        self._clearance.look(pose)
        clear = self._clearance.nearest >= -self._limits.overlap
        in_range = range_excess(self._model, pose.q) <= 0.0
        return clear and in_range and self.margin(pose, (True, True)) >= self._limits.margin

    def moves(
        self, pose: Pose, before: Pose, fixed: tuple[bool, bool], planted_pos: Array, planted_rot: Array, dt: float
    ) -> bool:
        """Whether ranges and speeds hold, and the ``fixed`` soles stay where they are planted."""
        limits = self._limits
        if (
            range_excess(self._model, pose.q) > 0.0
            or speed_ratio(self._model, pose.q, before.q, dt) > limits.speed_share
        ):
            return False
        return not any(
            fixed[side]
            and outline_travel(
                self._legs, side, pose.sole_pos[side], pose.sole_rot[side], planted_pos[side], planted_rot[side]
            )
            > limits.slip
            for side in (0, 1)
        )

    def _clear(self, pose: Pose, before: Pose) -> bool:
        self._clearance.look(pose)
        nearest = self._clearance.nearest
        if nearest >= -self._limits.overlap:
            return True
        self._clearance.look(before)
        return nearest >= self._clearance.nearest

    def balanced(self, pose: Pose, before: Pose, stances: tuple[bool, bool]) -> bool:
        """Whether the static margin is kept, or at least not made worse."""
        margin = self.margin(pose, stances)
        return margin >= self._limits.margin or margin >= self.margin(before, stances)

    def margin(self, pose: Pose, stances: tuple[bool, bool]) -> float:
        """Static margin of a pose on its stance feet, m."""
        return float(support_margin(self._legs, pose.sole_pos, pose.sole_rot, *stances, pose.com))
