"""Whole-body poses of a robot in the world, hung on one of its soles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.balance.legs import POSE, Legs, Stance, base_pose
from naoimitate.balance.offset import normalised_offset
from naoimitate.balance.polygon import support_polygon
from naoimitate.core.geometry import distance_to_edge
from naoimitate.robot.kernel import forward
from naoimitate.robot.model import RobotModel, Tree

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Pose:
    """A pose and what is derived from it.

    q: (J,) rad. base_rot: (3, 3), base_pos: (3,) m. com: (3,) m. sole_pos: (2, 3) m, sole_rot: (2, 3, 3). In the world.
    soles_in_base: (2, 3) m, the soles' places in the torso frame. link_pos, link_rot: link frames in the base frame, as
    ``kernel.forward`` fills them. centres: (J + 1, 3) m, of mass of the links, in the world.
    """

    q: Array
    base_rot: Array
    base_pos: Array
    com: Array
    sole_pos: Array
    sole_rot: Array
    soles_in_base: Array
    link_pos: Array
    link_rot: Array
    centres: Array


class PoseMaker:
    """Forward kinematics of one robot, from joint angles to poses."""

    def __init__(self, robot: RobotModel, legs: Legs) -> None:
        self._robot, self._legs = robot, legs

    def hang(self, q: Array, side: int, sole_pos: Array, sole_rot: Array) -> Pose:
        """The pose at q (J,) rad whose sole ``side`` is row ``side`` of poses (2, 3) m, (2, 3, 3) in the world."""
        parts = _hang(self._robot.tree, self._legs, q, side, sole_pos, sole_rot)
        return Pose(q, *parts)

    def stand(self, q: Array) -> Pose:
        """The pose at q (J,) rad with the right sole flat at the origin of the floor."""
        return self.hang(q, 1, np.zeros((2, 3)), np.stack([np.eye(3), np.eye(3)]))

    def centres(self, sole_pos: Array, sole_rot: Array) -> Array:
        """Centroids of the sole outlines in the world, (2, 3) m: the foot centres of (6)."""
        return _centres(self._legs.centre, sole_pos, sole_rot)

    def support_polygon(self, sole_pos: Array, sole_rot: Array, left: bool, right: bool) -> Array:
        """Corners (N, 2) m, counter-clockwise, of the polygon under the soles that carry."""
        return np.asarray(support_polygon(self._legs, sole_pos, sole_rot, left, right))

    def reach(self, sole_rot: Array, along: Array) -> tuple[float, float]:
        """How far (m) the left sole reaches from its centre against a direction (2,), and the right one along it."""
        found = []
        for side, sign in ((0, -1.0), (1, 1.0)):
            dx, dy = sign * (sole_rot[side].T[:2, :2] @ along)
            found.append(distance_to_edge(self._legs.outline[side], *self._legs.centre[side][:2], dx, dy))
        return found[0], found[1]

    def lowest(self, pose: Pose) -> float:
        """Height of the lowest point of both sole outlines, m."""
        heights = pose.sole_pos[:, 2, None] + np.einsum("kni,ki->kn", self._legs.outline, pose.sole_rot[:, 2, :2])
        return float(heights.min())

    def offset(self, pose: Pose, last: float = 0.5) -> float:
        """Equation (6) for a pose; ``last`` where the feet are too close."""
        left, right = self.centres(pose.sole_pos, pose.sole_rot)
        return normalised_offset(pose.com, left, right, last)


@njit(cache=True)
def _hang(
    tree: Tree, legs: Legs, q: Array, side: int, stance_pos: Array, stance_rot: Array
) -> tuple[Array, Array, Array, Array, Array, Array, Array, Array, Array]:
    """The fields of ``Pose`` behind q."""
    n = q.shape[0]
    link_pos, link_rot = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    forward(tree, q, link_pos, link_rot)
    R, p, com, mass = np.empty((3, 3)), np.empty(3), np.zeros(3), tree.mass.sum()
    base_pose(tree, legs, Stance(side, stance_pos, stance_rot, POSE, 0.0), link_pos, link_rot, R, p)
    centres = np.empty((n + 1, 3))
    for link in range(n + 1):
        _placed(link_pos[link], link_rot[link], tree.com[link], R, p, centres[link])
        for a in range(3):
            com[a] += tree.mass[link] / mass * centres[link, a]
    sole_pos, sole_rot, soles_in_base = np.empty((2, 3)), np.empty((2, 3, 3)), np.empty((2, 3))
    here, upright = np.zeros(3), np.eye(3)
    for k in range(2):
        row = legs.sole_joint[k] + 1
        _placed(link_pos[row], link_rot[row], legs.sole_point[k], R, p, sole_pos[k])
        _placed(link_pos[row], link_rot[row], legs.sole_point[k], upright, here, soles_in_base[k])
        for a in range(3):
            for b in range(3):
                sole_rot[k, a, b] = 0.0
                for c in range(3):
                    sole_rot[k, a, b] += R[a, c] * link_rot[row, c, b]
    return R, p, com, sole_pos, sole_rot, soles_in_base, link_pos, link_rot, centres


@njit(cache=True)
def _placed(link_pos: Array, link_rot: Array, point: Array, R: Array, p: Array, out: Array) -> None:
    """out (3,) m: a point of a link in the world."""
    for a in range(3):
        out[a] = p[a]
    for b in range(3):
        at = link_pos[b] + link_rot[b, 0] * point[0] + link_rot[b, 1] * point[1] + link_rot[b, 2] * point[2]
        for a in range(3):
            out[a] += R[a, b] * at


@njit(cache=True)
def _centres(centre: Array, sole_pos: Array, sole_rot: Array) -> Array:
    out = np.empty((2, 3))
    for k in range(2):
        for a in range(3):
            out[k, a] = sole_pos[k, a] + sole_rot[k, a, 0] * centre[k, 0] + sole_rot[k, a, 1] * centre[k, 1]
    return out
