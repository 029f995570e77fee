"""How soon the legs come to an end of their range, at the speed they have: a leg that stops there stops the body."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.balance.legs import Legs, table_bounds

Array = npt.NDArray[np.float64]

SLOW = 0.3
"""[rad/s] towards an end at which nothing has to wait for a joint."""


def time_to_end(legs: Legs, before: Array, q: Array, dt: float) -> float:
    """The time in s until the first leg joint is at the end of its range, inf where all are slow or go away from it.

    before, q: (J,) rad, dt s apart.
    """
    left = _left(legs, q)
    closing = (_left(legs, before) - left) / dt
    soon = closing > SLOW
    return float((np.maximum(left[soon], 0.0) / closing[soon]).min(initial=np.inf))


@njit(cache=True)
def _left(legs: Legs, q: Array) -> Array:
    """What the joints and coupling tables leave in both directions, (2 n + 2 B,) rad."""
    n, count = legs.joints.shape[0], legs.table_x.shape[0]
    left = np.empty(2 * (n + count))
    for i in range(n):
        j = legs.joints[i]
        left[2 * i], left[2 * i + 1] = q[j] - legs.lower[j], legs.upper[j] - q[j]
    for t in range(count):
        low, _, high, _ = table_bounds(legs.table_rows[t], q[legs.table_x[t]])
        y = q[legs.table_y[t]]
        left[2 * (n + t)], left[2 * (n + t) + 1] = y - low, high - y
    return left
