"""Speed and acceleration limits of tasks, per wall-clock frame (Koenemann 2014, section V-D)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.core.geometry import lengths

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class TaskLimits:
    """How fast hands, feet and joints may be asked to move."""

    hand_speed: float = 0.6
    """[m/s] of a hand in the torso frame."""
    hand_acceleration: float = 4.0
    """[m/s^2]: two arms of a tenth of the mass each then move the ZMP by about 1 cm."""
    foot_speed: float = 0.3
    """[m/s] of a foot in the torso frame."""
    foot_acceleration: float = 2.0
    """[m/s^2]."""
    head_speed: float = 2.0
    """[rad/s]."""
    joint_share: float = 0.84
    """Share of the motors' no-load speed that a joint may use."""
    leg_acceleration: float = 60.0
    """[rad/s^2] of a leg joint, wherever the feet allow it."""
    arm_acceleration: float = 40.0
    """[rad/s^2] of an arm joint, wherever the body does not stand in its way."""
    min_dt: float = 1e-4
    """[s], for frames that come at once."""
    max_dt: float = 0.05
    """[s] of elapsed time that a single step may use up, however late it comes."""


class Follower:
    """Points that follow their targets with bounded speed and acceleration, and without lag where they can."""

    def __init__(self, start: Array, speed: float, acceleration: float) -> None:
        self.position = np.array(start, dtype=np.float64)
        self.velocity = np.zeros_like(self.position)
        self._target = self.position.copy()
        self._speed = speed
        self._acceleration = acceleration

    def step(self, target: Array, dt: float) -> Array:
        """Advance (K, 3) points towards targets (K, 3) m by dt s and return where they are now."""
        follow(
            self.position,
            self.velocity,
            self._target,
            np.ascontiguousarray(target),
            dt,
            self._speed,
            self._acceleration,
        )
        return self.position

    @property
    def behind(self) -> Array:
        """Distance (K,) m of the points to the targets they were last given."""
        return lengths(self._target - self.position)

    def restart(self, position: Array) -> None:
        """Stand still at a position, after a held frame."""
        self.position[:] = position
        self._target[:] = position
        self.velocity[:] = 0.0


@njit(cache=True)
def reachable_angles(
    q: Array, velocity: Array, lower: Array, upper: Array, speed: Array, acceleration: Array, dt: float
) -> tuple[Array, Array, Array, Array]:
    """Joint angles (J,) rad that dt s allow from q at a velocity (J,) rad/s: low, high, smooth low, smooth high.

    low and high are due to speed (J,) rad/s: a joint may stop within dt, but from full speed it may not turn round. The
    smooth ones are due to acceleration (J,) rad/s^2 too, with room to stop before the limits lower and upper (J,) rad.
    """
    low, high = q - speed * dt, q + speed * dt
    low, high = np.maximum(low, low + velocity * dt), np.minimum(high, high + velocity * dt)
    smooth_low, smooth_high = np.empty_like(q), np.empty_like(q)
    for j in range(q.shape[0]):
        coasting, change = q[j] + velocity[j] * dt, acceleration[j] * dt * dt
        brake_low = q[j] - dt * math.sqrt(2.0 * acceleration[j] * max(q[j] - lower[j], 0.0))
        brake_high = q[j] + dt * math.sqrt(2.0 * acceleration[j] * max(upper[j] - q[j], 0.0))
        smooth_low[j] = min(max(coasting - change, brake_low, low[j]), high[j], brake_high)
        smooth_high[j] = max(min(coasting + change, brake_high, high[j]), low[j], brake_low)
    return low, high, smooth_low, smooth_high


@njit(cache=True)
def limited_step(p: Array, v: Array, target: Array, dt: float, max_speed: float, max_acceleration: float) -> Array:
    """Where points p (K, 3) m, moving at v (K, 3) m/s, may be asked to be dt s later on the way to targets (K, 3) m.

    Asked from where the points really are, so that nothing jumps when what held them back lets go.
    """
    here, speed = p.copy(), v.copy()
    follow(here, speed, target.copy(), target, dt, max_speed, max_acceleration)
    return here


@njit(cache=True)
def follow(
    p: Array, v: Array, last: Array, target: Array, dt: float, max_speed: float, max_acceleration: float
) -> None:
    """One step of points p, v (K, 3) towards ``target``, whose previous value is ``last``; all three are updated.

    The velocity is turned, within the acceleration, towards the target's own velocity plus the speed from which what
    was left of the way can be braked: a target that keeps both bounds is followed exactly, a resting one is not passed.
    """
    wanted = np.empty(3)
    for k in range(p.shape[0]):
        gap = math.sqrt(((last[k] - p[k]) ** 2).sum())
        approach = braking_speed(gap, max_acceleration, dt)
        for a in range(3):
            wanted[a] = (target[k, a] - last[k, a]) / dt + (
                approach * (last[k, a] - p[k, a]) / gap if gap > 0.0 else 0.0
            )
        _shorten(wanted, max_speed)
        turn = wanted - v[k]
        _shorten(turn, max_acceleration * dt)
        for a in range(3):
            v[k, a] += turn[a]
            p[k, a] += v[k, a] * dt
            last[k, a] = target[k, a]
            if abs(target[k, a] - p[k, a]) < 1e-12:
                p[k, a] = target[k, a]


@njit(cache=True)
def braking_speed(distance: float, acceleration: float, dt: float) -> float:
    """The speed from which steps of dt, each slower by acceleration * dt, end exactly at the distance.

    With lengths in units of acceleration * dt^2, n + 1 such steps from speed v cover (n + 1) (v - n / 2).
    """
    unit = acceleration * dt
    length = distance / (unit * dt)
    n = math.floor((math.sqrt(8.0 * length + 1.0) - 1.0) / 2.0)
    return unit * (length / (n + 1) + 0.5 * n)


@njit(cache=True)
def _shorten(v: Array, length: float) -> None:
    norm = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if norm > length:
        for a in range(3):
            v[a] *= length / norm
