"""Blending in: from where the robot is to the person's posture, along a minimum-jerk profile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from naoimitate.human.tracks import minimum_jerk

Array = npt.NDArray[np.float64]


@dataclass
class Blend:
    """Targets that go over from where they were to where they are wanted.

    targets: (4, 3) m, the posture to start from. offset: the normalised offset there. duration: s.
    """

    targets: Array
    offset: float
    duration: float
    elapsed: float = 0.0

    def advance(self, dt: float) -> None:
        """Let dt s pass."""
        self.elapsed += dt

    @property
    def done(self) -> bool:
        """Whether nothing is left of the start."""
        return self.elapsed >= self.duration

    @property
    def share(self) -> float:
        """How much of the wish counts, 0 to 1."""
        return float(minimum_jerk(np.asarray(self.elapsed / self.duration))) if self.duration > 0.0 else 1.0

    def mix(self, targets: Array, offset: float) -> tuple[Array, float]:
        """Targets (4, 3) m and offset of this moment."""
        return self.targets + self.share * (targets - self.targets), self.offset + self.share * (offset - self.offset)
