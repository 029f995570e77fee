"""Which feet are planted in a recorded motion, and the support mode that follows, looking at the whole of it.

The rule is that of mocap/INDEX.yaml (method): a foot is planted when one of its points is near the floor and slow, and
stays planted until all its points are high or fast; short gaps and short contacts are noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.signal import butter, filtfilt

from naoimitate.core.frames import LANDMARK, SIDES, Array
from naoimitate.human.floor import SLOW, Floor, Mask, fit_floor

MOVING = "M"
"""Raw class of a frame in which no foot is planted, but one is near the floor: it slides, pivots or rolls off."""
FEET = [[LANDMARK[f"{side}_{name}"] for name in ("ankle", "toe")] for side in SIDES]
"""Rows of the landmarks of the left and the right foot."""
_CLASSES = np.array([MOVING, "R", "L", "D", "F"])
_BODY = [row for name, row in LANDMARK.items() if name.split("_")[-1] not in ("ankle", "toe", "hand")]


@dataclass(frozen=True)
class ContactRule:
    """When a foot is planted, from mocap/INDEX.yaml but for the tip.

    touch, leave: m, planted below and lifted above this height of a point over its floor.
    slow, fast: m/s, planted below and lifted above this speed of a point.
    tip: the tip of the toes is this share of the ankle-ball distance beyond the ball, on their line: the landmarks end
        at the ball, but people land on and push off from their toes.
    tip_touch: m, as touch, for the tip: less, because the line is only a guess at where bent toes are.
    tip_speed: factor on slow and fast for the tip, which turns about the ankle on a longer arm than the ball.
    gap, blip: s, shorter gaps are closed and shorter contacts dropped.
    flight: m, nobody stands when no foot is planted and both are higher than this.
    """

    touch: float = 0.030
    leave: float = 0.050
    slow: float = 0.25
    fast: float = 0.45
    tip: float = 0.40
    tip_touch: float = 0.020
    tip_speed: float = 1.15
    gap: float = 0.1
    blip: float = 0.11
    flight: float = 0.050

    def near(self, heights: Array, speed: Array) -> Mask:
        """Feet (..., 2) that touch the floor, from heights m and speeds m/s of their points (..., 2, 3)."""
        touch = np.array([self.touch, self.touch, self.tip_touch])
        return np.asarray(((heights < touch) & (speed < self.slow * self._speeds)).any(axis=-1))

    def held(self, heights: Array, speed: Array) -> Mask:
        """Feet (..., 2) that may still stand when they stood before."""
        return np.asarray(((heights < self.leave) & (speed < self.fast * self._speeds)).any(axis=-1))

    @property
    def _speeds(self) -> Array:
        return np.array([1.0, 1.0, self.tip_speed])


MEASURED = ContactRule(tip_touch=0.030, tip_speed=1.0)
"""The rule for feet whose tips the source measures or models."""


@dataclass(frozen=True)
class Contacts:
    """What was found in a whole motion.

    classes: (T,) ``D``, ``L``, ``R``, ``F`` or ``M`` (feet moving). planted: (T, 2) bool, left and right. floor: the
    fitted floor. heights: (T, 2, 3) m of ankle, ball and tip over it.
    """

    classes: npt.NDArray[np.str_]
    planted: Mask
    floor: Floor
    heights: Array


def foot_points(landmarks: Array, tip: float) -> Array:
    """Ankle, ball and tip of the toes of both feet, (..., 19, 3) m -> (..., 2, 3, 3) m."""
    known = np.where(np.isfinite(landmarks[..., FEET, :]), landmarks[..., FEET, :], np.nan)
    ankle, ball = known[..., 0, :], known[..., 1, :]
    return np.stack([ankle, ball, ball + tip * (ball - ankle)], axis=-2)


def find_contacts(
    time: Array,
    landmarks: Array,
    given: Mask | None = None,
    feet: Array | None = None,
    rule: ContactRule | None = None,
) -> Contacts:
    """Find the floor and the planted feet of a motion, (T,) s, (T, 19, 3) m.

    given: (T, 2) bool, the source's own contacts. feet: (T, 2, 3, 3) m, ankle, ball and tip of the toes as the source
    knows them, NaN where it does not; without it they are taken from the landmarks, and the tips are guessed.
    """
    rule = rule or (ContactRule() if feet is None else MEASURED)
    points = smooth(time, foot_points(landmarks, rule.tip) if feet is None else feet)
    speed = speeds(time, points)
    floor = _floor(points, speed, landmarks)
    heights = floor.above(points)
    raw = _planted(rule, heights, speed) if given is None else given
    planted = np.stack([_without_noise(time, raw[:, side], rule) for side in (0, 1)], axis=1)
    return Contacts(classes(planted, heights, rule), planted, floor, heights)


def classes(planted: Mask, heights: Array, rule: ContactRule) -> npt.NDArray[np.str_]:
    """``D``, ``L``, ``R``, ``F``, ``M`` of planted feet (..., 2) and heights of their points (..., 2, 3) m."""
    seen = np.isfinite(heights)
    high = (~seen | (heights > rule.flight)).all(axis=(-1, -2)) & seen.any(axis=(-1, -2))
    standing = planted @ np.array([2, 1])
    return np.asarray(_CLASSES[np.where((standing == 0) & high, 4, standing)])


def lowest(points: Array, landmarks: Array) -> Mask:
    """Points of the feet (T, 2, K, 3) m below which no part of the body is: those that can be on the floor."""
    clearance = 0.10  # m; joint centres of a lying or kneeling person may be this much below a foot's
    others = np.where(np.isfinite(landmarks[:, _BODY, 2]), landmarks[:, _BODY, 2], np.inf).min(axis=1)
    feet = np.where(np.isfinite(points[..., 2]), points[..., 2], np.inf).min(axis=(1, 2))
    low = points[..., 2] < np.minimum(others, feet)[:, None, None] + clearance
    return np.asarray(low & np.isfinite(points).all(axis=-1))


def _floor(points: Array, speed: Array, landmarks: Array) -> Floor:
    """The floor under slow low feet; without such feet, under low feet; without those, under the whole body."""
    low = lowest(points, landmarks)
    slow = low & (speed < SLOW)
    if low.any():
        return fit_floor(points, slow if slow.any() else low)
    bottom = np.where(np.isfinite(landmarks[..., 2]), landmarks[..., 2], np.inf).min()
    return Floor(np.zeros(2), np.full((2, points.shape[2]), bottom if np.isfinite(bottom) else np.nan))


def smooth(time: Array, points: Array, cutoff: float = 8.0) -> Array:
    """Zero-phase second-order Butterworth low-pass at ``cutoff`` Hz of (T, ...) m.

    Gaps (NaN) are bridged, then put back. Recordings that are too short or too slow for it are returned as they are.
    """
    rate = (len(time) - 1) / (time[-1] - time[0]) if len(time) > 1 else 0.0
    if len(time) < 4 or rate <= 2.2 * cutoff:
        return points
    flat = points.reshape(len(points), -1).copy()
    gaps = ~np.isfinite(flat)
    for column, gap in zip(flat.T, gaps.T, strict=True):
        if gap.any() and not gap.all():
            column[gap] = np.interp(time[gap], time[~gap], column[~gap])
    known = ~gaps.all(axis=0)
    b, a = butter(2, cutoff, fs=rate)
    flat[:, known] = filtfilt(b, a, flat[:, known], axis=0, padlen=min(len(flat) - 1, 9))
    flat[gaps] = np.nan
    return flat.reshape(points.shape)


def speeds(time: Array, points: Array) -> Array:
    """Speed of points (T, ..., 3) m, (T, ...) m/s; zero for a single frame."""
    if len(time) < 2:
        return np.zeros(points.shape[:-1])
    return np.asarray(np.linalg.norm(np.gradient(points, time, axis=0), axis=-1))


def _planted(rule: ContactRule, heights: Array, speed: Array) -> Mask:
    """Feet (T, 2) that touched since they last left; a foot that is not seen stays as it was."""
    frame = np.arange(len(heights))[:, None]
    touches = rule.near(heights, speed)
    leaves = ~rule.held(heights, speed) & ~touches & np.isfinite(heights).any(axis=-1)
    touched = np.maximum.accumulate(np.where(touches, frame, -1), axis=0)
    left = np.maximum.accumulate(np.where(leaves, frame, -1), axis=0)
    return np.asarray(touched > left)


def _without_noise(time: Array, planted: Mask, rule: ContactRule) -> Mask:
    """Contacts (T,) of one foot with short gaps closed and short contacts dropped, but not at the ends."""
    for value, shortest in ((False, rule.gap), (True, rule.blip)):
        starts = np.flatnonzero(np.r_[True, planted[1:] != planted[:-1]])
        ends = np.r_[starts[1:], len(planted)]
        fixed = planted.copy()
        for start, end in zip(starts, ends, strict=True):
            inside = start > 0 and end < len(planted)
            if inside and planted[start] == value and time[end] - time[start] < shortest - 1e-9:
                fixed[start:end] = not value
        planted = fixed
    return planted
