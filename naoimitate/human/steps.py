"""How feet leave the floor and come back: slow swings that are flat near the floor, and walking strides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from naoimitate.core.frames import Array
from naoimitate.human.anthropometry import Anthropometry
from naoimitate.human.tracks import Move, Track, bump, minimum_jerk

FootPose = tuple[float, float, float, float, float, float]
"""Of a foot: x, y, z m of the sole point below the ankle, yaw, pitch (toes down), roll rad."""
Landing = tuple[float, float, float]
"""Where a foot stands: x, y m of the sole point below the ankle, yaw rad."""


def planted(at: Landing) -> FootPose:
    """The pose of a foot that stands flat on the floor."""
    x, y, yaw = at
    return (x, y, 0.0, yaw, 0.0, 0.0)


@dataclass(frozen=True)
class Swing:
    """One foot in the air, from lift to landing, both s: straight up, through the poses of ``via``, straight down flat.

    foot: ``l`` or ``r``. land_at: where it comes down. height: m over the floor on the way up and on the way down.
    rise: s that the way up takes, and the way down. via: (from s, to s, pose) in the air; without any, the foot goes
    straight over to its landing.
    """

    foot: str
    lift: float
    land: float
    land_at: Landing
    height: float
    rise: float
    via: tuple[tuple[float, float, FootPose], ...] = ()

    def change(self, time: Array, start: FootPose) -> Array:
        """What the swing adds to the foot's pose ``start``, (T, 6)."""
        up, down = self.lift + self.rise, self.land - self.rise
        goal = planted(self.land_at)
        arrive = self.via[-1][1] if self.via else up
        moves: tuple[Move, ...] = (
            (self.lift, up, (*start[:2], self.height, *start[3:])),
            *self.via,
            (arrive, down, (*goal[:2], self.height, *goal[3:])),
            (down, self.land, goal),
        )
        return Track(start, moves)(time) - start


@dataclass(frozen=True)
class Stride:
    """One foot in a walking stride: heel up first, toes up before it comes down flat; lift and land in s.

    foot: ``l`` or ``r``. land_at: where it comes down. height: m that the whole foot is lifted in the middle.
    """

    foot: str
    lift: float
    land: float
    land_at: Landing
    body: Anthropometry
    height: float = 0.05
    toes_down: float = 0.30
    toes_up: float = 0.15

    def change(self, time: Array, start: FootPose) -> Array:
        """What the stride adds to the foot's pose ``start``, (T, 6); neither toe tip nor heel goes below the floor."""
        s = (time - self.lift) / (self.land - self.lift)
        down, up = self.toes_down * bump(s / 0.75), self.toes_up * bump((s - 0.35) / 0.65)
        change = np.multiply.outer(minimum_jerk(s), np.subtract(planted(self.land_at), start))
        change[:, 2] += self.height * bump(s)
        change[:, 2] += (self.body.foot - self.body.heel) * np.sin(down) + self.body.heel * np.sin(up)
        change[:, 4] += down - up
        return np.asarray(change)
