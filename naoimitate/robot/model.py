"""What the program knows about a robot: one frozen, checked value that every room reads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from naoimitate.core.errors import RobotModelError

Array = npt.NDArray[np.float64]
BASE = -1
"""Index that stands for the base link (torso) where a joint index stands for the link behind the joint."""


class Tree(NamedTuple):
    """Kinematics and masses as flat arrays that compiled functions accept; J joints, parents first.

    parent: (J,) joint before joint j, -1 = base.
    pos (J, 3) m, rot (J, 3, 3): frame of joint j in the frame of its parent LINK, at q = 0.
    axis: (J, 3) unit vector in the frame of the joint.
    mass (J + 1,) kg, com (J + 1, 3) m: row 0 the base link, row j + 1 the link moved by joint j, in that link's frame.
    ancestor: (J, J) bool, ancestor[j, k] = joint k lies on the path from the base to link j, j included.
    """

    parent: npt.NDArray[np.int64]
    pos: Array
    rot: Array
    axis: Array
    mass: Array
    com: Array
    ancestor: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Point:
    """A named place on a link: ``joint`` that moves the link (-1 = base), ``offset`` (3,) m in the link's frame."""

    joint: int
    offset: Array


@dataclass(frozen=True)
class CouplingTable:
    """Range of joint ``y`` as a function of joint ``x``: rows (K, 3) rad of x, y_min, y_max, x increasing."""

    x: int
    y: int
    rows: Array

    def bounds(self, x: float) -> tuple[float, float]:
        """Lowest and highest y (rad) at x: linear between the rows, the first and last row hold beyond them."""
        return (
            float(np.interp(x, self.rows[:, 0], self.rows[:, 1])),
            float(np.interp(x, self.rows[:, 0], self.rows[:, 2])),
        )


@dataclass(frozen=True)
class Shape:
    """A convex piece of the body in the frame of the link that ``joint`` moves (-1 = base); m.

    kind ``capsule``: all points within ``radius`` of the segment p0-p1. ``sphere``: p0 and radius (p1 = p0).
    ``box``: centre p0, half sizes ``half`` along the axes of the link (p1 = p0, radius 0). Unused sizes are 0.
    """

    name: str
    joint: int
    kind: str
    p0: Array
    p1: Array
    radius: float
    half: Array


@dataclass(frozen=True)
class RobotModel:
    """A robot of one version. J actuated joints in the order of ``joint_names``, parents first.

    urdf: URDF text with masses and motors of this version. tree: kinematics and masses.
    lower, upper: (J,) rad. speed: (J,) rad/s, no-load. effort: (J,) N m.
    coupled: (leader, follower) joints that one motor moves: follower = leader.
    tables: ranges of one joint that depend on another. points: by name, ``head`` and l_/r_ + shoulder, elbow, wrist,
    hand, hip, knee, ankle, sole. chains: head, l_arm, r_arm, l_leg, r_leg: joints from the base outwards.
    soles: ``l``, ``r``: (N, 2) m convex counter-clockwise outline in the sole frame (origin: point l_sole, r_sole;
    axes: the foot link's). shapes, pairs: the body; (P, 2) indices of shapes that must not overlap.
    postures: by name, (J,) rad: at least zero, stand (initial and landing stance), calibration (arms of the T-pose).
    limb_length: m, l_arm: shoulder-elbow-hand, l_leg: hip-knee-ankle-sole; also r_.
    data: robot.yaml as merged for this version, for what only one room needs (sensors, landing set, drivers).
    """

    name: str
    version: str
    urdf: str
    joint_names: tuple[str, ...]
    tree: Tree
    lower: Array
    upper: Array
    speed: Array
    effort: Array
    coupled: tuple[tuple[int, int], ...]
    tables: tuple[CouplingTable, ...]
    points: dict[str, Point]
    chains: dict[str, tuple[int, ...]]
    soles: dict[str, Array]
    shapes: tuple[Shape, ...]
    pairs: npt.NDArray[np.int64]
    postures: dict[str, Array]
    limb_length: dict[str, float]
    data: dict[str, Any]

    def joint(self, name: str) -> int:
        """Index of a joint by its name; RobotModelError when the robot has no such joint."""
        if name not in self.joint_names:
            raise RobotModelError(f"{self.name} has no joint {name!r}; it has {', '.join(self.joint_names)}")
        return self.joint_names.index(name)

    @property
    def mass(self) -> float:
        """Total mass, kg."""
        return float(self.tree.mass.sum())
