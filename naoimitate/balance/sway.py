"""How far a step may throw the zero moment point: bounds on the whole body's momentum.

With K the angular momentum per mass about a point of the floor under the CoM, links as point masses, the zero moment
point lies (-dK_y/dt, dK_x/dt) / g from the CoM's projection while the CoM's height is steady (Moulard 2013, the full
multi-body formula). A step of dt may therefore change K dt by g d dt^2 for a shift of d. Shifts are counted along the
line between the feet and across it: (K_x, K_y) turned by a quarter.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.balance.pose import Pose
from naoimitate.core.geometry import rotation_vector
from naoimitate.core.physics import GRAVITY
from naoimitate.robot.model import RobotModel

Array = npt.NDArray[np.float64]


STEADY = 0.010
"""[m] by which the zero moment point may be off the CoM's projection when a body at rest lifts a foot."""
BRAKING = 2.0
"""Times as hard as it speeds up may a body brake: one that stops only on as long a way as it took to get going passes
its goal, comes back, and passes it again."""
FLOOR = np.array([1.0, 1.0, 0.0])
"""What is left of a place (3,) m on the floor."""
LOWEST = 0.05
"""[m] of the CoM's height that the pendulum is taken to have at least."""


class Ground(NamedTuple):
    """What the body stands on, seen from its CoM's projection.

    along: (2,) unit vector from the left to the right foot. room: (4,) m, how far the zero moment point may be off in
    this direction, against it, to its left, and to its right.
    """

    along: Array
    room: Array


class SwayLimits(NamedTuple):
    """What a body may do on soft legs; the defaults are for two feet that share the weight."""

    zmp: float = 0.012
    """[m] by which a step may move the zero moment point off its plan, along the line between the feet..."""
    zmp_across: float = 0.030
    """[m] ...and across it, where two soles are long."""
    drift: float = 0.030
    """[m] by which the body's momentum may carry its CoM after the feet stop it, of the capture point: what is bounded
    in its change alone gathers speed until it meets a bound that stops it at once."""
    speed: float = 0.2
    """[m/s] of the torso."""
    acceleration: float = 1.5
    """[m/s^2] of the torso."""
    turn_speed: float = 1.0
    """[rad/s] of the torso."""
    turn_acceleration: float = 8.0
    """[rad/s^2] of the torso: what its inertia asks, soft hips have to give."""


TWO_FEET = SwayLimits()
ONE_FOOT = SwayLimits(0.012, 0.012, 0.006, 0.1, 0.75, 0.5, 4.0)
QUIET = SwayLimits(0.008, 0.008, 0.004, 0.04, 0.75, 0.2, 4.0)
"""Around a lift-off and a touchdown: millimetres of sway are a foot that carries too early or too long."""


class Sway:
    """What the body's momentum was, and what the next step may make of it."""

    def __init__(self, robot: RobotModel) -> None:
        self._mass = robot.tree.mass / robot.tree.mass.sum()
        self._speed, self._torso, self._thrown = np.zeros((len(self._mass), 3)), np.zeros(6), 0.0

    def rest(self) -> None:
        """The body stands still."""
        self._speed[:], self._torso[:], self._thrown = 0.0, 0.0, 0.0

    @property
    def calm(self) -> bool:
        """Whether the torso moves as little as it must around a lift-off."""
        way, turn = math.hypot(*self._torso[:3]), math.hypot(*self._torso[3:])
        return way < 2.0 * QUIET.speed and turn < 2.0 * QUIET.turn_speed

    @property
    def steady(self) -> bool:
        """Whether the zero moment point is where the CoM is."""
        return self._thrown < STEADY

    def accept(self, before: Pose, pose: Pose, dt: float) -> None:
        """The body has gone from one pose to another in dt s."""
        speed = (pose.centres - before.centres) / dt
        change = np.empty(2)
        _moment(self._mass, before.centres, speed - self._speed, before.com * FLOOR, FLOOR[:2], change)
        self._speed, self._thrown = speed, math.hypot(*change) / (GRAVITY * dt)
        self._torso[:3] = (pose.base_pos - before.base_pos) @ before.base_rot / dt
        self._torso[3:] = rotation_vector(before.base_rot.T @ pose.base_rot) / dt

    def bounds(
        self, pose: Pose, arms: Pose, limits: SwayLimits, shift: tuple[Array, Array], ground: Ground, dt: float
    ) -> tuple[Array, Array, Array]:
        """What the legs may add in the next dt s: the point (3,) m on the floor, lowest and highest (8,), ``LegGoal``.

        arms: the pose with the arms where they will be, and the legs as they were. shift: velocities (2,) m/s of the
        planned weight shift before and after the step; the limits hold for what the body does beside it, the room that
        the ground leaves for both.
        """
        before, after = (np.array([x, y, 0.0]) for x, y in shift)
        return _bounds(
            self._mass, self._speed, self._torso, pose.com, pose.centres, arms.centres, limits,
            before * dt, after * dt, ground, pose.base_rot, dt,
        )  # fmt: skip


@njit(cache=True)
def _bounds(
    mass: Array,
    speed: Array,
    torso: Array,
    com: Array,
    here: Array,
    arms: Array,
    limits: SwayLimits,
    shifted: Array,
    shift: Array,
    ground: Ground,
    base: Array,
    dt: float,
) -> tuple[Array, Array, Array]:
    about = np.array([com[0], com[1], 0.0])
    coasting, arms_way, planned, low, high = np.empty(8), np.zeros(8), np.zeros(8), np.empty(8), np.empty(8)
    _moment(mass, here, speed * dt - shifted, about, ground.along, coasting)
    _moment(mass, here, arms - here, about, ground.along, arms_way)
    _moment(mass, here, np.zeros_like(here) + shift, about, ground.along, planned)
    thrown = np.empty(2)
    _moment(mass, here, shift - shifted + np.zeros_like(here), about, ground.along, thrown)
    coasting[2:] = torso * dt
    coasting[2:5] -= base.T @ shifted
    planned[2:5] = base.T @ shift
    momentum = math.sqrt(GRAVITY * max(com[2], LOWEST)) * limits.drift
    for i in range(8):
        most, change = momentum, GRAVITY * (limits.zmp if i == 0 else limits.zmp_across)
        if 2 <= i < 5:
            most, change = limits.speed, limits.acceleration
        elif i >= 5:
            most, change = limits.turn_speed, limits.turn_acceleration
        slowest, fastest = _next(coasting[i], change * dt * dt)
        if i < 2:
            unit = GRAVITY * dt * dt
            back, forth = -unit * ground.room[2 * i + 1] - thrown[i], unit * ground.room[2 * i] - thrown[i]
            slowest = max(slowest, coasting[i] + min(back, forth))
            fastest = min(fastest, coasting[i] + max(back, forth))
            slowest, fastest = min(slowest, fastest), max(slowest, fastest)
        low[i], high[i] = max(slowest, -most * dt), min(fastest, most * dt)
        low[i], high[i] = min(low[i], max(slowest, high[i])), max(high[i], min(fastest, low[i]))
        low[i], high[i] = low[i] + planned[i] - arms_way[i], high[i] + planned[i] - arms_way[i]
    return about, low, high


@njit(cache=True)
def _next(coasting: float, change: float) -> tuple[float, float]:
    """Least and most that may follow on ``coasting``: ``change`` more, or ``BRAKING`` times that less, down to rest."""
    speed = abs(coasting)
    least, most = min(speed - change, max(speed - BRAKING * change, 0.0)), speed + change
    return (least, most) if coasting > 0.0 else (-most, -least)


@njit(cache=True)
def _moment(mass: Array, here: Array, way: Array, about: Array, along: Array, out: Array) -> None:
    """First two of out: moment per mass, m^2, of links at (J + 1, 3) m that go (J + 1, 3) m, ``turned`` to a line."""
    about_x, about_y = 0.0, 0.0
    for link in range(here.shape[0]):
        x, y, z = here[link, 0] - about[0], here[link, 1] - about[1], here[link, 2] - about[2]
        about_x += mass[link] * (y * way[link, 2] - z * way[link, 1])
        about_y += mass[link] * (z * way[link, 0] - x * way[link, 2])
    out[0], out[1] = turned(along, about_x, about_y)


@njit(cache=True)
def turned(along: Array, about_x: float, about_y: float) -> tuple[float, float]:
    """Moments about x and y as what moves the zero moment point along a line (2,), and to the left of it."""
    return along[1] * about_x - along[0] * about_y, along[0] * about_x + along[1] * about_y
