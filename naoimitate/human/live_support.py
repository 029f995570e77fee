"""The person's support mode frame by frame, without looking ahead: for live streams."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from naoimitate.core.frames import Array, HumanFrame
from naoimitate.human.contact import MOVING, ContactRule, classes, foot_points, lowest
from naoimitate.human.floor import BAND, SIDES_DIFFER, SLOW, Mask

REST = 0.010
"""m: a foot that was never nearer to the floor than this has not shown its own heights yet; the other's are taken."""


@dataclass(frozen=True)
class LiveRule:
    """How the causal estimate differs from the one that sees the whole motion.

    contact: when a foot is planted. speed_time: s, time constant of the speed's filter. debounce: s that a changed
    contact must last before it counts. sink: s, time constant with which the floor follows a foot that rests below it:
    nobody stands in the floor. rise: s, the same when the lower foot rests a little above it: somebody must stand.
    learn: s, the same for the height of each single point. pause: s without a frame after which speeds start anew.
    jump: m/s, feet that move faster were moved by the source, not the person. lost: s without any planted foot after
    which feet that rest must have found another floor: nobody flies that long.
    """

    contact: ContactRule = field(default_factory=ContactRule)
    speed_time: float = 0.02
    debounce: float = 0.02
    sink: float = 0.03
    rise: float = 0.1
    learn: float = 2.0
    pause: float = 0.3
    jump: float = 15.0
    lost: float = 1.0


class SupportEstimator:
    """Estimates which feet a person stands on; feed it every frame once, in order of time.

    floor: (2, 2) m, heights of ankle and toe of the left and right foot when they stand, where known (``standing``);
    otherwise the lower foot of the first frame is taken to stand.
    """

    def __init__(self, rule: LiveRule | None = None, floor: Array | None = None) -> None:
        self._rule = rule or LiveRule()
        self._floor = np.full((2, 2), np.nan) if floor is None else np.array(floor, dtype=float)
        self._rested = np.isfinite(self._floor).all(axis=1)
        self._time = -np.inf
        self._points = np.full((2, 3, 3), np.nan)
        self._velocity = np.zeros((2, 3, 3))
        self._speed = np.zeros((2, 3))
        self._touching = np.zeros(2, dtype=bool)
        self._planted = np.zeros(2, dtype=bool)
        self._changing = np.zeros(2)
        self._unsupported = 0.0
        self.raw = MOVING
        """Class of the last frame: ``D``, ``L``, ``R``, ``F``, or ``M`` while feet slide, pivot or cannot be seen."""
        self.mode = "D"
        """Support mode of the last frame: as ``raw``, but ``M`` keeps the mode before."""

    @classmethod
    def standing(cls, frame: HumanFrame, rule: LiveRule | None = None) -> SupportEstimator:
        """An estimator for a person who stands on both feet in this frame, as in a T-pose of the same stream."""
        return cls(rule, foot_points(frame.landmarks, 0.0)[:, :2, 2])

    def update(self, frame: HumanFrame) -> str:
        """The support mode ``D``, ``L``, ``R`` or ``F`` at this frame; a frame that is not newer changes nothing."""
        elapsed = frame.time - self._time
        if not elapsed > 0.0:
            return self.mode
        dt = elapsed if elapsed < self._rule.pause else 0.0
        self._time = frame.time
        points = foot_points(frame.landmarks, self._rule.contact.tip)
        jumped = self._follow(points, dt)
        if not jumped:
            resting = (self._speed < SLOW) & lowest(points[None], frame.landmarks[None])[0]
            self._settle_floor(points[..., 2], resting, dt)
            self._judge(points, frame.contacts, dt)
        return self.mode

    def _follow(self, points: Array, dt: float) -> bool:
        """Take the feet's new positions and filter their velocities; true when the source made them jump."""
        change = points - self._points
        self._points = points
        seen = np.isfinite(change)
        measured = np.where(seen, change, 0.0) / dt if dt > 0.0 else np.zeros_like(change)
        jumped = bool((np.abs(measured) > self._rule.jump).any())
        share = -np.expm1(-dt / self._rule.speed_time)
        steady = seen & (dt > 0.0) & (not jumped)
        self._velocity = np.where(steady, self._velocity + share * (measured - self._velocity), 0.0)
        self._speed = np.where(np.isfinite(points[..., 0]), np.sqrt(np.square(self._velocity).sum(axis=-1)), np.nan)
        return jumped

    def _settle_floor(self, z: Array, resting: Mask, dt: float) -> None:
        """Let the floor follow feet at heights z (2, 3) m that rest on it."""
        z, resting = z[:, :2], resting[:, :2]
        unknown = ~np.isfinite(self._floor)
        if self._unsupported > self._rule.lost and resting.any():
            unknown[:] = True
        seen = np.isfinite(z)
        lower = np.where(seen, z, np.inf).min(axis=0)
        self._floor = np.where(unknown & np.isfinite(lower), lower, self._floor)
        above = z - self._floor
        resting &= above < BAND
        lowest_foot = np.where(resting, above, np.inf).min()
        if 0.0 < lowest_foot < BAND:
            self._floor += lowest_foot * -np.expm1(-dt / self._rule.rise)
        share = np.where(above < 0.0, -np.expm1(-dt / self._rule.sink), -np.expm1(-dt / self._rule.learn))
        self._floor = self._floor + np.where(resting, share * (z - self._floor), 0.0)
        self._rested |= ((resting & (np.abs(above) < REST)) | ~seen).all(axis=1) & seen.any(axis=1)
        self._floor = np.where((self._rested[::-1] & ~self._rested)[:, None], self._floor[::-1], self._floor)
        self._floor = np.minimum(self._floor, self._floor[::-1] + SIDES_DIFFER)

    def _judge(self, points: Array, contacts: Mask | None, dt: float) -> None:
        """Contacts, then the class and the mode."""
        rule, tip = self._rule.contact, self._rule.contact.tip
        ankle, ball = self._floor[:, 0], self._floor[:, 1]
        heights = points[..., 2] - np.stack([ankle, ball, ball + tip * (ball - ankle)], axis=-1)
        touching = rule.near(heights, self._speed) | (self._touching & rule.held(heights, self._speed))
        seen = np.isfinite(heights).any(axis=-1)
        self._touching = np.where(seen, touching, self._touching) if contacts is None else np.asarray(contacts)
        changed = self._touching != self._planted
        self._changing = np.where(changed, self._changing + dt, 0.0)
        sure = (self._changing >= self._rule.debounce) | (dt == 0.0)
        self._planted = np.where(sure, self._touching, self._planted)
        self._unsupported = 0.0 if self._planted.any() else self._unsupported + dt
        self.raw = str(classes(self._planted, heights, rule))
        if self.raw != MOVING:
            self.mode = self.raw
