"""Joins the suit's centre of mass (MXTP24) to poses, which never wait for it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from naoimitate.core.frames import Array

AGE = 4
"""Samples after its own for which a centre of mass is carried along with the pelvis."""
REACH = 0.6
"""m; no centre of mass of a person is farther from mid-hip."""


class Convention(NamedTuple):
    """How a sender writes space. scale: m per unit. y_up: x forward, y up, z right, instead of z up."""

    scale: float
    y_up: bool

    def points(self, points: Array) -> Array:
        """Points (..., 3) in m, z up."""
        if self.y_up:
            points = points[..., (0, 2, 1)] * (1.0, -1.0, 1.0)
        return points if self.scale == 1.0 else self.scale * points

    def quaternions(self, turns: Array) -> Array:
        """Quaternions (..., 4) (w, x, y, z), z up."""
        return turns[..., (0, 1, 3, 2)] * (1.0, 1.0, -1.0, 1.0) if self.y_up else turns


class CentreOfMass:
    """The centre of mass of one character.

    The order of a sample's datagrams is free. One that comes before its pose belongs to it as it is; of one that comes
    after its pose the way from mid-hip is kept and carried along with the next few poses.
    """

    def __init__(self) -> None:
        self._newest: tuple[int, tuple[float, float, float]] | None = None
        self._pose: tuple[int, Array, Convention] | None = None
        self._carried: tuple[int, Array] | None = None

    def take(self, counter: int, com: tuple[float, float, float]) -> None:
        """A centre of mass (3,) in the sender's unit and axes."""
        self._newest = (counter, com)
        if self._pose is not None and self._pose[0] == counter:
            self._carry(*self._pose)

    def at(self, counter: int, hips: Array, convention: Convention) -> Array | None:
        """The centre of mass (3,) m that fits a pose with mid-hip at ``hips`` (3,) m; None when none is recent."""
        self._pose = (counter, hips.copy(), convention)
        if self._newest is not None and self._newest[0] == counter:
            self._carry(*self._pose)
        if self._carried is None or not 0 <= counter - self._carried[0] <= AGE:
            return None
        com = hips + self._carried[1]
        return com if math.isfinite(com.sum()) else None

    def _carry(self, counter: int, hips: Array, convention: Convention) -> None:
        if self._newest is not None:
            way = convention.points(np.array(self._newest[1])) - hips
            if np.dot(way, way) < REACH**2:
                self._carried = (counter, way)
