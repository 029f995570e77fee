"""Where a robot that walks is in the world, from what it measures itself: odometry of its stance feet.

The robot hangs on the foot that carries most of the weight. That foot is taken to lie still and flat on a level floor,
z = 0, and its footprint (place and heading) is remembered; joint encoders lead from it to the torso and to the other
sole, whose footprint takes over with the weight. What accumulates is place and heading only, by what feet slip and
encoders err in each step: height comes from the floor, and the inertial board, which knows where down is, corrects
roll and pitch. A foot that slides or pivots unseen, a slope and a stair are not told.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from naoimitate.core.frames import SIDES, Array
from naoimitate.core.geometry import heading, matrix_from_quat, quat_from_matrix, wrap, yaw_matrix
from naoimitate.core.physics import GRAVITY
from naoimitate.hw.compensation import share_of_weight
from naoimitate.hw.driver import RobotState
from naoimitate.hw.lean import quat_from_angles, up_from_angles
from naoimitate.robot.kernel import center_of_mass, forward
from naoimitate.robot.model import RobotModel


@dataclass(frozen=True)
class OdometrySettings:
    """When a foot counts as standing, and how long things are looked at."""

    takeover: float = 0.6
    """Share of what both feet carry from which on the robot hangs on the other foot: more than half, so that a robot
    that sways in the middle does not change feet all the time."""
    standing: float = 0.1
    """Share of the weight from which on a foot stands on the floor; where both carry less, the robot does not."""
    memory: int = 50
    """Updates over which the footprint of the other foot is averaged while both stand: noise of encoders goes."""
    settling: float = 0.3
    """[s] in which the inertial board corrects roll and pitch as the stance leg tells them: its noise goes."""


DEFAULT = OdometrySettings()


@dataclass(frozen=True)
class Place:
    """Where the torso is: pos (3,) m and quat (4,) in the world, floor at z = 0; NaN before anything was known.

    stance: ``L`` or ``R``, the foot that it hangs on. known: False where the robot could not be felt (an encoder that
    is NaN, no weight on either foot, a fall): the last place is kept then, and what it did meanwhile is lost.
    """

    pos: Array
    quat: Array
    stance: str
    known: bool


class _Soles(NamedTuple):
    """Origins (2, 3) m and axes (2, 3, 3) of both soles, and the centre of mass (3,) m, from the torso."""

    origins: Array
    axes: Array
    com: Array


class Odometry:
    """Follows one robot through the states that it measures, one after the other:

        odometry = Odometry(robot)
        while True:
            place = odometry.update(driver.read(), command.support)

    The forces on the feet tell which foot stands. Where they are NaN, the commanded support does, and in double support
    where the centre of mass is. Without an inertial board (angles are NaN) the sole that stands lies flat.
    """

    def __init__(self, robot: RobotModel, settings: OdometrySettings = DEFAULT) -> None:
        self._tree, self._s, self._weight = robot.tree, settings, GRAVITY * robot.mass
        self._points = [robot.points[f"{side}_sole"] for side in SIDES]
        joints = len(robot.joint_names)
        self._pos, self._rot, self._com = np.zeros((joints + 1, 3)), np.zeros((joints + 1, 3, 3)), np.zeros(3)
        self._soles(robot.postures["stand"])  # compiles: no state waits for it
        self.restart()

    def restart(self, at: tuple[float, float] = (0.0, 0.0), facing: float = 0.0) -> None:
        """Forget everything: in the next state the middle between the soles is at (2,) m and faces ``facing`` rad.

        Without arguments that is where the ``Imitator`` begins.
        """
        self._start = np.array([*at, facing])
        self._prints: Array | None = None
        self._side, self._looks = 0, 1
        self._time, self._readings, self._correction = -math.inf, 0, np.zeros(3)
        self.place = Place(np.full(3, np.nan), np.full(4, np.nan), "L", known=False)
        """The newest place."""

    def update(self, state: RobotState, support: str) -> Place:
        """Where the robot is in a state; support: ``D``, ``L`` or ``R``, the feet that it is commanded to stand on."""
        forces = state.fsr.sum(axis=1) / self._weight
        if state.fell or (forces < self._s.standing).all() or not np.isfinite(state.q).all():
            self.place = replace(self.place, known=False)
            return self.place
        soles = self._soles(state.q)
        up = self._up(soles.axes[self._side][:, 2], state)
        angles = np.arctan2([up[1], -up[0]], [up[2], np.hypot(up[1], up[2])])
        level = matrix_from_quat(quat_from_angles(angles))
        felt = np.isfinite(forces).all()
        loads = forces if felt else share_of_weight(soles.com, soles.origins, up, support)
        soles = _Soles(soles.origins @ level.T, level @ soles.axes, level @ soles.com)
        if self._prints is None:
            self._prints = _first_prints(soles, self._start)
        self._look(self._prints, soles, loads)
        pos, turn = _hang(self._prints[self._side], soles, self._side)
        self.place = Place(pos, quat_from_matrix(turn @ level), "LR"[self._side], known=True)
        return self.place

    def _soles(self, q: Array) -> _Soles:
        forward(self._tree, q, self._pos, self._rot)
        center_of_mass(self._tree, self._pos, self._rot, self._com)
        rows = [point.joint + 1 for point in self._points]
        origins = [self._pos[row] + self._rot[row] @ p.offset for row, p in zip(rows, self._points, strict=True)]
        return _Soles(np.array(origins), self._rot[rows], self._com)

    def _up(self, normal: Array, state: RobotState) -> Array:
        """World z (3,) in the torso frame: the normal (3,) of the sole that stands, slowly corrected by gravity."""
        since, self._time = state.time - self._time, state.time
        if np.isfinite(state.angles).all() and since > 0.0:
            self._readings += 1
            share = max(1.0 / self._readings, 1.0 / (1.0 + self._s.settling / since))
            self._correction = self._correction + share * (up_from_angles(state.angles) - normal - self._correction)
        up = normal + self._correction
        return np.asarray(up / np.linalg.norm(up))

    def _look(self, prints: Array, soles: _Soles, loads: Array) -> None:
        """Renew the other foot's footprint, averaged while it stands; with most of the weight on it, hang on it."""
        other = 1 - self._side
        pos, turn = _hang(prints[self._side], soles, self._side)
        here = np.array([*(pos + turn @ soles.origins[other])[:2], heading(turn @ soles.axes[other])])
        self._looks = min(self._looks + 1, self._s.memory) if loads[other] >= self._s.standing else 1
        change = here - prints[other]
        change[2] = wrap(change[2])
        prints[other] += change / self._looks
        if loads[other] > self._s.takeover * loads.sum():
            self._side, self._looks = other, self._s.memory


def _hang(footprint: Array, soles: _Soles, side: int) -> tuple[Array, Array]:
    """Torso (3,) m and its turn about z (3, 3) that bring a sole onto its footprint (3,): x, y m and heading rad."""
    turn = yaw_matrix(footprint[2] - heading(soles.axes[side]))
    return np.array([footprint[0], footprint[1], 0.0]) - turn @ soles.origins[side], turn


def _first_prints(soles: _Soles, start: Array) -> Array:
    """Footprints (2, 3) of soles whose middle stands at, and faces, start (3,): x, y m and rad."""
    yaws = np.array([heading(soles.axes[0]), heading(soles.axes[1])])
    turned = start[2] - yaws[0] - 0.5 * wrap(yaws[1] - yaws[0])
    places = (soles.origins - soles.origins.mean(axis=0)) @ yaw_matrix(turned).T
    return np.column_stack([start[:2] + places[:, :2], yaws + turned])
