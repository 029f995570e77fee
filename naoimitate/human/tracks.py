"""Values over time for scripted motion: rests joined by minimum-jerk moves, and smooth curves through keys."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline

from naoimitate.core.frames import Array

Move = tuple[float, float, npt.ArrayLike]
"""From s, to s, the value to arrive at."""
Curve = Callable[[Array], Array]
"""Times (T,) s to values (T,) or (T, n), twice continuously differentiable."""


@dataclass(frozen=True)
class Track:
    """A value that rests, moves, and rests again, twice continuously differentiable.

    start: the value at the beginning, a number or a vector. moves: when it changes, in order of time, not overlapping.
    """

    start: npt.ArrayLike
    moves: tuple[Move, ...] = ()

    def __call__(self, time: Array) -> Array:
        """The value at times (T,) s, (T,) or (T, n)."""
        value = np.asarray(self.start, dtype=float)
        result = np.broadcast_to(value, (len(time), *value.shape)).copy()
        for begin, end, goal in self.moves:
            change = np.asarray(goal, dtype=float) - value
            result += np.multiply.outer(minimum_jerk((time - begin) / (end - begin)), change)
            value = value + change
        return result


@dataclass(frozen=True)
class Spline:
    """A value that flows along control values without a stop: uniform cubic B-spline, so it never overshoots them.

    begin: s of the first control; the curve leaves its value one spacing earlier. spacing: s from one control to the
    next. controls: (n,) or (n, m), where it is drawn to; it passes through a control that is the mean of its
    neighbours, and an oscillation of period 4 controls keeps 2/3 of its amplitude, one of period 2 keeps 1/3.
    """

    begin: float
    spacing: float
    controls: npt.ArrayLike

    def __call__(self, time: Array) -> Array:
        """The value at times (T,) s, (T,) or (T, m)."""
        controls = np.asarray(self.controls, dtype=float)
        padded = np.concatenate([np.repeat(controls[:1], 3, axis=0), controls, np.repeat(controls[-1:], 3, axis=0)])
        knots = self.begin + self.spacing * (np.arange(len(padded) + 4) - 5)
        end = self.begin + self.spacing * (len(controls) + 1)
        return np.asarray(BSpline(knots, padded, 3)(np.clip(time, self.begin - 2.0 * self.spacing, end)))


def minimum_jerk(s: Array) -> Array:
    """Blend from 0 to 1 over s = 0..1 with velocity and acceleration zero at both ends (Flash and Hogan 1985)."""
    s = np.clip(s, 0.0, 1.0)
    return np.asarray(s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


def bump(s: Array) -> Array:
    """From 0 up to 1 at s = 0.5 and back to 0 at s = 1, smooth to the second derivative, 0 elsewhere."""
    s = np.clip(s, 0.0, 1.0)
    return np.asarray(64.0 * (s * (1.0 - s)) ** 3)
