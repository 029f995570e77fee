"""The input filter: each landmark as a point of nearly constant velocity (Kalman 1960), outliers left out."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from filterpy.common import Q_discrete_white_noise
from filterpy.kalman import predict, update

from naoimitate.core.frames import HumanFrame

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class FilterSettings:
    """What the filter believes."""

    noise: float = 0.004
    """[m] of a landmark, standard deviation."""
    acceleration: float = 30.0
    """[m/s^2] of a landmark, standard deviation from frame to frame: quick hands are followed with little delay."""
    gate: float = 6.0
    """Standard deviations of the prediction beyond which a measurement is an outlier."""
    least_gate: float = 0.08
    """[m] within which nothing is an outlier."""
    believed: int = 3
    """Outliers in a row after which they are the truth: somebody has jumped, or the source has lost its origin."""
    longest_gap: float = 0.25
    """[s] without a landmark after which its velocity is forgotten."""


class LandmarkFilter:
    """Position and velocity of all landmarks; dt may vary from frame to frame."""

    def __init__(self, settings: FilterSettings | None = None) -> None:
        self._s = settings or FilterSettings()
        self.reset()

    def reset(self) -> None:
        """Forget the person."""
        self._time = math.nan
        self._state: Array | None = None
        self._age, self._strikes = np.zeros(0), np.zeros(0, dtype=np.int64)
        self._covariance = np.diag([self._s.noise**2, 1.0])
        self.outliers = 0
        """Measurements that were left out so far."""

    def step(self, frame: HumanFrame) -> HumanFrame:
        """The frame, filtered; missing and outlying landmarks are predicted for a short while, then missing."""
        measured = np.asarray(frame.landmarks, dtype=np.float64)
        known = np.asarray(np.isfinite(measured).all(axis=1))
        dt = frame.time - self._time
        if self._state is None or not 0.0 < dt < self._s.longest_gap:
            self._start(measured, frame.time)
            return frame
        self._time = frame.time
        position, velocity = self._state
        predicted = position + dt * velocity
        gain, reach = self._gains(dt)
        off = np.linalg.norm(np.where(known[:, None], measured - predicted, 0.0), axis=1)
        outlying = known & (off > max(self._s.gate * reach, self._s.least_gate))
        self._strikes = np.where(outlying, self._strikes + 1, 0)
        self.outliers += int(outlying.sum())
        moved = outlying & (self._strikes >= self._s.believed)
        new = known & (moved | ~np.isfinite(predicted).all(axis=1) | (self._age > self._s.longest_gap))
        good = known & ~outlying & ~new
        innovation = np.where(good[:, None], measured - predicted, 0.0)
        position, velocity = predicted + gain[0] * innovation, velocity + gain[1] * innovation
        position[new], velocity[new] = measured[new], 0.0
        self._age = np.where(good | new, 0.0, self._age + dt)
        position[self._age > self._s.longest_gap] = np.nan
        self._strikes[new] = 0
        self._state = np.stack([position, velocity])
        return replace(frame, landmarks=position.copy())

    def predicted(self, time: float, frame: HumanFrame) -> HumanFrame:
        """The frame with its landmarks continued to a later time."""
        if self._state is None:
            return frame
        position, velocity = self._state
        return replace(frame, time=time, landmarks=position + (time - self._time) * velocity)

    def delay(self, rate: float, frequency: float = 1.0) -> float:
        """By how much (s) a landmark that swings at ``frequency`` Hz is late, at frames of ``rate`` Hz; NaN at none.

        The steady gains are those of the alpha-beta filter with the same noise (Kalata 1984, The tracking index, IEEE
        Trans. AES-20), the delay is the phase of its response. Cheap, and safe from another thread.
        """
        if not rate > 0.0:
            return math.nan
        dt = 1.0 / rate
        if dt >= self._s.longest_gap:
            return 0.0
        index = self._s.acceleration * dt**2 / self._s.noise
        root = (4.0 + index - math.sqrt(8.0 * index + index**2)) / 4.0
        alpha = 1.0 - root**2
        beta = 2.0 * (2.0 - alpha) - 4.0 * root
        z = cmath.exp(2j * math.pi * frequency * dt)
        response = z * (alpha * (z - 1.0) + beta) / (z**2 - (2.0 - alpha - beta) * z + 1.0 - alpha)
        return -cmath.phase(response) / (2.0 * math.pi * frequency)

    def _start(self, measured: Array, time: float) -> None:
        self._time, self._state = time, np.stack([measured, np.zeros_like(measured)])
        self._covariance = np.diag([self._s.noise**2, 1.0])
        self._age, self._strikes = np.zeros(len(measured)), np.zeros(len(measured), dtype=np.int64)
        self._age[~np.isfinite(measured).all(axis=1)] = math.inf
        self._state[1][~np.isfinite(measured)] = 0.0

    def _gains(self, dt: float) -> tuple[Array, float]:
        """Gains of position and velocity, and the standard deviation (m) of what is measured against its prediction."""
        gain, self._covariance = _kalman(dt, self._covariance, self._s)
        return gain, self._s.noise / math.sqrt(max(1.0 - gain[0], 1e-6))


def _kalman(dt: float, covariance: Array, settings: FilterSettings) -> tuple[Array, Array]:
    """One step of the covariance (2, 2) that all landmarks share; returns the gain (2,) and the next covariance."""
    step, measure = np.array([[1.0, dt], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    noise = Q_discrete_white_noise(dim=2, dt=dt, var=settings.acceleration**2)
    x, covariance = predict(np.zeros((2, 1)), covariance, step, Q=noise)
    _, after, _, gain, *_ = update(
        x, covariance, np.zeros((1, 1)), np.array([[settings.noise**2]]), measure, return_all=True
    )
    return gain[:, 0], after
