"""The run once more, from joint angles and torso pose alone: what the scores, plots and pictures look at.

Nothing that the program says about itself (``com``, ``contact_points``) is used where it can be computed again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.core.errors import RunFileError
from naoimitate.core.geometry import convex_hull, matrix_from_quat, polygon_margin
from naoimitate.mapping import Mapping
from naoimitate.robot.kernel import center_of_mass, forward
from naoimitate.robot.model import RobotModel, Tree
from naoimitate.run.file import Run

Array = npt.NDArray[np.float64]
SIDES = ("l", "r")
EFFECTORS = (("l_shoulder", "l_hand"), ("l_hip", "l_sole"), ("r_shoulder", "r_hand"), ("r_hip", "r_sole"))
"""The origin and the end of each vector of equation (1), in the order of the run file."""
LOADED = {"D": (True, True), "L": (True, False), "R": (False, True)}
"""Which soles (left, right) carry the robot in each support mode."""


@dataclass(frozen=True)
class Replay:
    """Geometry of N poses in the world (N = T frames, or T - 1 midpoints).

    links_pos (N, J + 1, 3) m and links_rot (N, J + 1, 3, 3): link frames in the BASE frame. base_pos (N, 3) m,
    base_rot (N, 3, 3): torso in the world. com: (N, 3) m, world. soles: per side (N, K, 3) m, outline in the world.
    sole_up: per side (N, 3), the sole's normal in the world. posture: (N, 4, 3) m, equation (1) as the robot has it.
    """

    links_pos: Array
    links_rot: Array
    base_pos: Array
    base_rot: Array
    com: Array
    soles: tuple[Array, Array]
    sole_up: tuple[Array, Array]
    posture: Array

    def low(self, side: int) -> Array:
        """Height of the lowest outline point of a sole over the floor, (N,) m."""
        return np.asarray(self.soles[side][:, :, 2].min(axis=1))

    def margins(self, support: npt.NDArray[np.str_], points: Array | None = None) -> Array:
        """Signed distance of points (N, 2) m, the centre of mass where none are given, to the edge of the support
        polygon, (N,) m, positive inside; NaN where a point is."""
        points = self.com[:, :2] if points is None else points
        left, right = self.soles[0][:, :, :2], self.soles[1][:, :, :2]
        carries = np.array([LOADED[mode] for mode in support], dtype=np.bool_).reshape(-1, 2)
        margins = _margins(left, right, carries, np.ascontiguousarray(points))
        return np.where(np.isfinite(points).all(axis=1), margins, np.nan)

    def on_sole(self, robot: RobotModel, side: int, points: Array) -> Array:
        """Points (K, 2) m of a sole, given in its frame, in the world: (N, K, 3) m."""
        return _on_sole(robot, SIDES[side], points, self.links_pos, self.links_rot, self.base_pos, self.base_rot)


def replay(robot: RobotModel, q: Array, base_pos: Array, base_quat: Array) -> Replay:
    """Poses from joint angles (N, J) rad and the torso's pose (N, 3) m, (N, 4) (w, x, y, z)."""
    links_pos, links_rot, com = _forward_all(robot.tree, q)
    base_rot = np.array([matrix_from_quat(quat) for quat in base_quat]).reshape(-1, 3, 3)
    soles, up = [], []
    for side in SIDES:
        soles.append(_on_sole(robot, side, robot.soles[side], links_pos, links_rot, base_pos, base_rot))
        up.append(np.einsum("nij,nj->ni", base_rot, links_rot[:, robot.points[f"{side}_sole"].joint + 1, :, 2]))
    return Replay(
        links_pos=links_pos,
        links_rot=links_rot,
        base_pos=base_pos,
        base_rot=base_rot,
        com=base_pos + np.einsum("nij,nj->ni", base_rot, com),
        soles=(soles[0], soles[1]),
        sole_up=(up[0], up[1]),
        posture=np.stack([_vector(robot, links_pos, links_rot, *pair) for pair in EFFECTORS], axis=1),
    )


def _on_sole(
    robot: RobotModel, side: str, points: Array, links_pos: Array, links_rot: Array, base_pos: Array, base_rot: Array
) -> Array:
    sole = robot.points[f"{side}_sole"]
    row, in_link = sole.joint + 1, np.column_stack([points, np.zeros(len(points))]) + sole.offset
    local = links_pos[:, None, row] + np.einsum("nij,kj->nki", links_rot[:, row], in_link)
    return np.asarray(base_pos[:, None] + np.einsum("nij,nkj->nki", base_rot, local))


def frames(run: Run, robot: RobotModel) -> Replay:
    """The commanded poses at the frames of a run. Raises RunFileError when the run is of another robot."""
    if tuple(run.joint_names) != robot.joint_names:
        raise RunFileError(f"the run's joints are not those of {robot.name} {robot.version}; load the robot it names")
    return replay(robot, run.q, run.base_pos, run.base_quat)


def moved(run: Run, robot: RobotModel) -> Replay | None:
    """The poses of the simulated robot at the frames of a run; None without simulation."""
    if run.sim_q is None or run.sim_base_pos is None or run.sim_base_quat is None:
        return None
    return replay(robot, run.sim_q, run.sim_base_pos, run.sim_base_quat)


def midpoints(run: Run, robot: RobotModel) -> Replay:
    """The poses half-way between the frames of a run: what a robot that interpolates passes through."""
    a, b = run.base_quat[:-1], run.base_quat[1:]
    quat = a + np.where(np.sum(a * b, axis=1, keepdims=True) < 0.0, -b, b)
    return replay(robot, _middle(run.q), _middle(run.base_pos), quat)


def targets(run: Run) -> Array:
    """Equations (2), (3), (5) of Koenemann et al. 2014: f_R = f_ref,R + m (f_H - f_ref,H), (T, 4, 3) m, torso frame."""
    return Mapping(run.ref_human, run.ref_robot, run.scale).targets(run.human_posture)


def place(robot: RobotModel, poses: Replay, name: str) -> Array:
    """A named point of the robot in the base frame at every pose, (N, 3) m."""
    point = robot.points[name]
    row = point.joint + 1
    return np.asarray(poses.links_pos[:, row] + poses.links_rot[:, row] @ point.offset)


def _vector(robot: RobotModel, pos: Array, rot: Array, origin: str, end: str) -> Array:
    at = [pos[:, p.joint + 1] + rot[:, p.joint + 1] @ p.offset for p in (robot.points[origin], robot.points[end])]
    return np.asarray(at[1] - at[0])


def _middle(values: Array) -> Array:
    return np.asarray(0.5 * (values[:-1] + values[1:]))


@njit(cache=True)
def _forward_all(tree: Tree, q: Array) -> tuple[Array, Array, Array]:
    n, joints = q.shape
    pos, rot, com = np.empty((n, joints + 1, 3)), np.empty((n, joints + 1, 3, 3)), np.empty((n, 3))
    for i in range(n):
        forward(tree, q[i], pos[i], rot[i])
        center_of_mass(tree, pos[i], rot[i], com[i])
    return pos, rot, com


@njit(cache=True)
def _margins(left: Array, right: Array, carries: npt.NDArray[np.bool_], points: Array) -> Array:
    margin = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        if carries[i, 0] and carries[i, 1]:
            hull = convex_hull(np.concatenate((left[i], right[i])))
        else:
            hull = convex_hull(left[i] if carries[i, 0] else right[i])
        margin[i] = polygon_margin(hull, points[i, 0], points[i, 1])
    return margin
