"""The rate-limited offset: where the CoM's projection lies between the feet (Koenemann 2014, section V-A)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from naoimitate.core.physics import GRAVITY
from naoimitate.limits import braking_speed

Array = npt.NDArray[np.float64]


class Span(NamedTuple):
    """What a weight shift happens on, along the line from the left to the right sole's centre.

    length: m between the centres. height: m of the CoM. low, high: m from the left centre, how far the soles reach.
    """

    length: float
    height: float
    low: float
    high: float


class Push(NamedTuple):
    """What an offset may do next: its speed, 1/s, and its accelerations, 1/s^2.

    back: towards 0. forth: towards 1. brake: to come to rest at its target, fading in the last ``fade`` s.
    """

    speed: float
    back: float
    forth: float
    brake: float
    fade: float = 0.0


@dataclass(frozen=True)
class OffsetLaw:
    """How fast the CoM may be shifted from foot to foot."""

    shift: str = "pendulum"
    """``pendulum``: as fast as the zero moment point allows. ``parabola``: the paper's speed law."""
    reach: float = 0.030
    """[m] by which a pendulum's zero moment point may be away from the CoM's projection."""
    least_reach: float = 0.005
    """[m] that it has at least, so that the CoM always moves."""
    zmp_margin: float = 0.020
    """[m] by which it stays inside the soles otherwise."""
    fade: float = 0.3
    """[s] in which its last acceleration fades: a body that is let go of at once swings on over soft ankles."""
    top_speed: float = 0.22
    """[m/s] of a pendulum's CoM..."""
    wide: float = 0.12
    """[m] ...between feet that are no farther apart: legs that are more slanted have to stretch faster for it."""
    min_speed: float = 0.05
    """[1/s] at the borders 0 and 1: the paper's pure parabola never leaves them."""
    max_speed: float = 1.0
    """[1/s] in the middle, 0.5."""
    max_zmp_shift: float = 0.010
    """[m] by which the acceleration of the parabola's offset may move the zero moment point."""
    min_feet_distance: float = 0.03
    """[m] below which (6) is ill-conditioned and the last value is kept."""

    @property
    def brisk(self) -> bool:
        """Whether a shift ends so fast that the body sways."""
        return self.shift == "pendulum"

    def parabola(self, offset: float) -> float:
        """v(o) = v_min + (v_max - v_min) 4 o (1 - o), 1/s: the paper's negative quadratic with its maximum at 0.5."""
        o = min(max(offset, 0.0), 1.0)
        return self.min_speed + (self.max_speed - self.min_speed) * 4.0 * o * (1.0 - o)

    def push(self, offset: float, target: float, span: Span) -> Push:
        """How hard the CoM may be pushed from an offset to its target, from the linear inverted pendulum.

        The CoM is pushed away from the zero moment point: a = g (p_CoM - p_ZMP) / (z d).
        """
        length = max(span.length, self.min_feet_distance)
        gain = GRAVITY / (max(span.height, 1e-3) * length)
        if self.shift == "parabola":
            return Push(self.parabola(offset), *[gain * self.max_zmp_shift] * 3)

        def room(distance: float) -> float:
            return min(max(distance - self.zmp_margin, self.least_reach), self.reach)

        def ahead(o: float) -> float:
            return gain * room(span.high - o * length)

        def behind(o: float) -> float:
            return gain * room(o * length - span.low)

        brake = ahead(target) if target > offset else behind(target)
        speed = self.top_speed * min(1.0, self.wide / length) ** 2
        return Push(speed / length, ahead(offset), behind(offset), brake, self.fade)


def normalised_offset(com: Array, left: Array, right: Array, last: float, min_distance: float = 0.03) -> float:
    """Equation (6): o = (p_CoM - p_L) . (p_R - p_L) / |p_R - p_L|^2 with horizontal positions (2,) m.

    The last value is kept while the feet are closer than ``min_distance``. Not clamped.
    """
    dx, dy = right[0] - left[0], right[1] - left[1]
    squared = dx * dx + dy * dy
    if not squared >= min_distance * min_distance:
        return last
    return float(((com[0] - left[0]) * dx + (com[1] - left[1]) * dy) / squared)


def advance(offset: float, velocity: float, target: float, dt: float, push: Push) -> tuple[float, float]:
    """One step of the offset towards its target: a bound on its speed, and one on its acceleration, braking included.

    offset, target: normalised; velocity: 1/s; dt: s. Returns the new offset and velocity.
    The offset stops at its target without passing it. Only a target that jumps nearer than the way to brake is passed
    and come back to: to stop dead would throw the ZMP.
    """
    distance = target - offset
    wanted = math.copysign(min(push.speed, arrival_speed(abs(distance), push, dt)), distance)
    velocity = min(max(wanted, velocity - push.back * dt), velocity + push.forth * dt)
    moved = offset + velocity * dt
    return (target if abs(moved - target) < 1e-9 else moved), velocity


def arrival_speed(distance: float, push: Push, dt: float) -> float:
    """The speed, 1/s, from which an offset comes to rest after a distance, in steps of dt s.

    The brake b fades evenly within f s: with the jerk j = b / f, its last way is j f^3 / 6 and begins at j f^2 / 2.
    """
    if push.fade <= 0.0:
        return braking_speed(distance, push.brake, dt)
    jerk = push.brake / push.fade
    last = jerk * push.fade**3 / 6.0
    if distance > last:
        return math.sqrt((0.5 * jerk * push.fade**2) ** 2 + 2.0 * push.brake * (distance - last))
    return min(0.5 * jerk ** (1.0 / 3.0) * (6.0 * distance) ** (2.0 / 3.0), distance / dt)
