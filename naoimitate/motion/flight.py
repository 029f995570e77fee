"""The true frame rate from free flight: whoever is in the air falls with g."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from naoimitate.core.frames import LANDMARK, SIDES, Array
from naoimitate.core.physics import GRAVITY
from naoimitate.human.segments import center_of_mass

CLEAR = 0.10
"""m: feet that are this far above their floor do not touch it."""
HANDS_CLEAR = 0.25
"""m: so far above the lowest level of the feet that neither hands nor head carry the body."""
MIN_FRAMES = 7
MIN_DEPTH = 0.03
"""m from the top of a flight's parabola to its ends: less is no flight."""
RESIDUAL = 0.05
"""A flight's parabola fits to this share of its depth, or it was none."""
DRIFT = 0.25
"""Horizontal acceleration of a flight is less than this share of the vertical one."""
RATIOS = (0.25, 0.5, 1.0, 2.0)
"""True rate / labelled rate that conversions get wrong: every second frame kept under the old label, and so on."""
TOLERANCE = 0.5
"""Logarithmic error allowed in g: the ratios are 1.39 apart, the uniform skeleton of 88_01 is off by 0.46."""


@dataclass(frozen=True)
class Flight:
    """One free flight: frames first to last, and g in m/s^2 at the labelled rate."""

    first: int
    last: int
    gravity: float


def flights(landmarks: Array, rate: float) -> list[Flight]:
    """All clean free flights of a clip, (T, 19, 3) m, z up."""
    found = []
    com = center_of_mass(landmarks)
    for first, last in _runs(_airborne(landmarks)):
        if last - first + 1 >= MIN_FRAMES:
            gravity = _gravity(com[first : last + 1], rate)
            if gravity is not None:
                found.append(Flight(first, last, gravity))
    return found


def rate_by_flight(landmarks: Array, rate: float) -> tuple[float, str]:
    """The rate at which the person falls with g, and a sentence when it is not the labelled one, else an empty text."""
    found = flights(landmarks, rate)
    if not found:
        return rate, ""
    frames = np.array([f.last - f.first + 1 for f in found], dtype=np.float64)
    gravity = float(np.average([f.gravity for f in found], weights=frames**2))
    fits = {ratio: abs(np.log(gravity * ratio**2 / GRAVITY)) for ratio in RATIOS}
    ratio = min(fits, key=lambda r: fits[r])
    if ratio == 1.0 or fits[ratio] > TOLERANCE or (ratio > 1.0 and len(found) < 2):
        return rate, ""
    return rate * ratio, (
        f"Free flight falls with {gravity:.1f} m/s^2 at the file's {rate:g} Hz: the true rate is {rate * ratio:g} Hz."
    )


def _airborne(landmarks: Array) -> npt.NDArray[np.bool_]:
    """Frames in which no foot, hand or head is near the floor, (T,)."""
    z = landmarks[..., 2]
    ankles, toes = (np.nan_to_num(z[:, [LANDMARK[f"{s}_{p}"] for s in SIDES]], nan=-np.inf) for p in ("ankle", "toe"))
    if not np.isfinite(toes).any():
        toes = ankles
    clear = (ankles > _floor(ankles) + CLEAR).all(axis=1) & (toes > _floor(toes) + CLEAR).all(axis=1)
    upper = z[:, [LANDMARK[n] for n in ("head", "l_wrist", "r_wrist")]]
    return np.asarray(clear & (upper > _floor(toes) + HANDS_CLEAR).all(axis=1))


def _floor(heights: Array) -> float:
    finite = heights[np.isfinite(heights)]
    return float(np.percentile(finite, 5)) if len(finite) else 0.0


def _runs(mask: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of every stretch of True."""
    edges = np.diff(np.concatenate([[0], mask.astype(int), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist(), strict=True))


def _gravity(com: Array, rate: float) -> float | None:
    """Downward acceleration (m/s^2) of a centre of mass on a parabola, (n, 3) m; None where it is on none."""
    if not np.isfinite(com).all():
        return None
    t = (np.arange(len(com)) - 0.5 * (len(com) - 1)) / rate
    coefficients = np.polyfit(t, com, 2)
    error = com - np.stack([np.polyval(coefficients[:, i], t) for i in range(3)], axis=1)
    acceleration = 2.0 * coefficients[0]
    depth = 0.5 * abs(acceleration[2]) * t[-1] ** 2
    straight = np.hypot(acceleration[0], acceleration[1]) < DRIFT * abs(acceleration[2])
    good = acceleration[2] < 0.0 and straight and depth > MIN_DEPTH
    good = good and np.sqrt(np.mean(error[:, 2] ** 2)) < RESIDUAL * depth
    return float(-acceleration[2]) if good else None
