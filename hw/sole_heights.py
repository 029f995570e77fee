"""Soles a little higher or lower than planned, from what the force sensors say that they carry.

A sole that carries and should not is raised; one that should and does not is lowered until it does: early and late
contact, on a floor that is not where the plan has it. A sole that is about to leave the floor, because the plan already
has the whole weight on the other, is raised until it carries nothing: servos that sag, and senses that are a little
wrong, leave weight on it, and a foot that carries when it is lifted throws the body over. One that has just come down
is left alone: it waits for its weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from naoimitate.core.frames import SIDES, Array


@dataclass(frozen=True)
class HeightSettings:
    """How far and how fast soles go up and down, and from which loads; loads are shares of the weight."""

    most: float = 0.008
    """[m] by which a sole may be raised or lowered."""
    raising: float = 0.08
    """[m/s] at which a sole is raised that carries and should not."""
    lowering: float = 0.01
    """[m/s] at which a sole is lowered that should carry and does not, and at which a raised one comes back."""
    easing: float = 0.015
    """[m/s] at which a sole is raised that is about to leave the floor."""
    loaded: float = 0.06
    """Load from which a sole in the air carries..."""
    unloaded: float = 0.01
    """...and under which one on the floor does not."""
    due: float = 0.10
    """Load that a sole should carry before it is missed."""
    idle: float = 0.01
    """Load under which the plan needs a sole on the floor for nothing: it is about to leave."""
    eased: float = 0.02
    """Load, averaged over ``averaged``, that such a sole may carry."""
    averaged: float = 0.05
    """[s]"""
    spare: float = 0.001
    """[m] that a sole in the air keeps above its plan for each nominal sag by which the servos hang deeper: a body that
    sways on soft servos sets it down before its time."""
    landed: float = 0.5
    """[s] that a sole has been down before it can be about to leave."""


HEIGHTS = HeightSettings()


class SoleHeights:
    """Keeps the heights of both soles; period: s between two calls."""

    def __init__(self, period: float, settings: HeightSettings = HEIGHTS) -> None:
        self._period, self._s = period, settings
        self._load, self._down = np.zeros(2), np.full(2, np.inf)
        self.raised = np.zeros(2)
        """[m] of the left and the right sole now."""

    def update(self, support: str, share: Array, load: Array | None, steady: bool, softness: float = 1.0) -> None:
        """Go on by a period.

        share: (2,) of the weight that the plan puts on the left and the right sole; load: (2,) that they carry, None
        where nothing is known and heights fade; steady: whether the CoM is where the plan has it, so that no sole is
        needed for more than the plan says; softness: how many times as soft as nominal the servos are.
        """
        s = self._s
        rate = np.clip(-self.raised / self._period, -s.lowering, s.lowering)
        if load is not None:
            change = np.clip(load, 0.0, 1.0) - self._load
            self._load = self._load + self._period / (s.averaged + self._period) * change
            for i, side in enumerate(SIDES):
                air = support not in ("D", side.upper())
                self._down[i] = 0.0 if air else self._down[i] + self._period
                if air and load[i] > s.loaded:
                    rate[i] = s.raising
                elif air:
                    missing = s.spare * max(softness - 1.0, 0.0) - self.raised[i]
                    rate[i] = min(max(missing / self._period, -s.lowering), s.easing)
                elif self._down[i] > s.landed and share[i] < s.idle and steady:
                    rate[i] = s.easing if self._load[i] > s.eased else 0.0
                elif share[i] > s.due and load[i] < s.unloaded:
                    rate[i] = -s.lowering
        self.raised = np.clip(self.raised + rate * self._period, -s.most, s.most)
