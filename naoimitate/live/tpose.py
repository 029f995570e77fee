"""The T-pose that starts a session: found by itself, held still."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from naoimitate.core.frames import LANDMARK, HumanFrame
from naoimitate.motion.tpose import is_tpose

Array = npt.NDArray[np.float64]

HOLD = 1.5
"""[s] for which a T-pose must be held."""
STILL = 0.05
"""[m] that no landmark may leave its place by meanwhile."""
GAP = 0.3
"""[s] without a frame after which the count begins again."""
_UNWATCHED = ("l_hand", "r_hand", "l_toe", "r_toe", "head", "chest")
_WATCHED = [row for name, row in LANDMARK.items() if name not in _UNWATCHED]


class TPoseWatch:
    """Watches a person for a T-pose that is held still; the frames of the hold are averaged."""

    def __init__(self, hold: float = HOLD) -> None:
        self._hold = hold
        self.reset()

    def reset(self) -> None:
        """Begin to count again."""
        self._begin, self._last = math.nan, math.nan
        self._first: Array | None = None
        self._sum, self._count = np.zeros(0), 0

    @property
    def left(self) -> float:
        """Seconds that the pose still has to be held; all of them while there is none."""
        return self._hold if math.isnan(self._begin) else max(self._hold - (self._last - self._begin), 0.0)

    def see(self, frame: HumanFrame) -> HumanFrame | None:
        """Take a frame; returns the T-pose, the mean over the hold, once it has been held for long enough."""
        p = frame.landmarks
        known = bool(np.isfinite(p[_WATCHED]).all())
        if not known or not bool(is_tpose(p[None])[0]) or frame.time - self._last > GAP:
            self.reset()
        if not known or not bool(is_tpose(p[None])[0]):
            return None
        if self._first is None or float(np.abs(p[_WATCHED] - self._first[_WATCHED]).max()) > STILL:
            self._first, self._begin, self._sum, self._count = p.copy(), frame.time, np.zeros_like(p), 0
        self._sum, self._count, self._last = self._sum + p, self._count + 1, frame.time
        if self._last - self._begin < self._hold:
            return None
        return HumanFrame(frame.time, self._sum / self._count, frame.orientations, frame.com, frame.contacts)
