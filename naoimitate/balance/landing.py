"""The landing set: where a foot may be set down so that the CoM can come over either foot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from naoimitate.core.errors import RobotModelError
from naoimitate.ik import bounded_step
from naoimitate.robot.model import RobotModel

Array = npt.NDArray[np.float64]
_UNIT = np.eye(2)


@dataclass(frozen=True)
class LandingSet:
    """Relative sole poses, one convex polygon of positions for each yaw of a grid.

    yaws: (Y,) rad, increasing, Y >= 2: heading of the swing sole in the stance sole's frame.
    directions: (K, 2) outward unit normals. reach: (Y, K) m: p is inside at a yaw when directions @ p <= reach.
    Given for the LEFT sole relative to the RIGHT one (frames: origin under the ankle); the other side is its mirror.
    """

    yaws: Array
    directions: Array
    reach: Array

    def clip(self, swing: int, position: Array, yaw: float) -> tuple[Array, float, bool]:
        """The nearest landing pose to a wish, and whether it had to be moved.

        swing: 0 left, 1 right. position (2,) m and yaw rad: the swing sole in the stance sole's frame.
        """
        mirror = np.array([1.0, 1.0 if swing == 0 else -1.0])
        p, turn = position * mirror, yaw * mirror[1]
        allowed = float(min(max(turn, self.yaws[0]), self.yaws[-1]))
        row = min(max(int(np.searchsorted(self.yaws, allowed)), 1), len(self.yaws) - 1)
        part = (allowed - self.yaws[row - 1]) / (self.yaws[row] - self.yaws[row - 1])
        bound = (1.0 - part) * self.reach[row - 1] + part * self.reach[row]
        x = np.empty(2)
        bounded_step(_UNIT, p, -self.directions, -bound, 0, x)
        moved = bool(np.linalg.norm(x - p) > 1e-6 or abs(allowed - turn) > 1e-6)
        return x * mirror, allowed * mirror[1], moved

    def middle(self, swing: int) -> Array:
        """A place (2,) m well inside the set for feet that are parallel."""
        outermost = [self.clip(0, 10.0 * direction, 0.0)[0] for direction in self.directions]
        return np.mean(outermost, axis=0) * [1.0, 1.0 if swing == 0 else -1.0]

    def contains(self, swing: int, position: Array, yaw: float, tolerance: float = 0.002) -> bool:
        """Whether both feet can carry with the swing sole there; tolerance in m (and in rad * 0.1 m)."""
        nearest, allowed, _ = self.clip(swing, position, yaw)
        return bool(np.linalg.norm(nearest - position) <= tolerance and abs(allowed - yaw) <= 10.0 * tolerance)


def landing_set(robot: RobotModel) -> LandingSet:
    """The landing set kept in the robot's data; RobotModelError where there is none."""
    data = robot.data.get("landing")
    if data is None:
        raise RobotModelError(
            f"robot {robot.name} has no landing set: compute it with `naoimitate robots --landing-set`"
        )
    angles = np.array(data["directions_deg"]) * np.pi / 180.0
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return LandingSet(np.array(data["yaws"], dtype=np.float64), directions, np.array(data["reach"], dtype=np.float64))
