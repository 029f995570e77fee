"""From one posture of a person to another: bones turn by the shortest way, feet glide, nobody is squeezed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from naoimitate.core.frames import LANDMARK, SIDES, Array, HumanFrame, Motion
from naoimitate.human.tracks import minimum_jerk

_BONES = tuple(
    (LANDMARK[a], LANDMARK[b])
    for a, b in (
        ("pelvis", "chest"),
        ("chest", "head"),
        *(
            (a.format(s), b.format(s))
            for s in SIDES
            for a, b in (
                ("pelvis", "{}_hip"),
                ("chest", "{}_shoulder"),
                ("{}_shoulder", "{}_elbow"),
                ("{}_elbow", "{}_wrist"),
                ("{}_wrist", "{}_hand"),
            )
        ),
    )
)
"""From where to where, outwards from the pelvis. The feet have their own way, and the knees follow."""
Leg = tuple[int, int, int]
_LEGS: tuple[Leg, ...] = tuple((LANDMARK[f"{s}_hip"], LANDMARK[f"{s}_knee"], LANDMARK[f"{s}_ankle"]) for s in SIDES)
STRAIGHT = 0.05
"""m off the line from hip to ankle: a knee nearer to it does not tell to which side it bends."""


class Fade:
    """The way from frame ``a`` to frame ``b`` in ``duration`` s, with minimum jerk.

    Pelvis, ankles and toes move straight, so that feet which stand before and after stay on the floor; every other bone
    turns on the shortest arc between its directions and keeps its length; the knees bend as legs of these lengths must.
    """

    def __init__(self, a: HumanFrame, b: HumanFrame, duration: float) -> None:
        self._duration, self._a, self._b = duration, a, b
        self._straight = _two_frames(a, b)
        self._legs = [(leg, _leg_ends(a.landmarks, b.landmarks, leg)) for leg in _LEGS]

    def at(self, time: float) -> HumanFrame:
        """The person at a time from 0 to ``duration``, s."""
        share = float(minimum_jerk(np.asarray(time / self._duration)))
        frame = self._straight.at(share)
        a, b, p = self._a.landmarks, self._b.landmarks, frame.landmarks.copy()
        for start, end in _BONES:
            bone = _turned(a[end] - a[start], b[end] - b[start], share)
            if np.isfinite(p[start] + bone).all():
                p[end] = p[start] + bone
        for leg, ends in self._legs:
            p[leg[1]] = _between(p, leg, ends, share)
        landed = self._b.contacts if share > 0.0 else self._a.contacts
        return replace(frame, landmarks=p, contacts=landed, support=None)


def _two_frames(a: HumanFrame, b: HumanFrame) -> Motion:
    """Both frames as a motion of one second, whose interpolation is the straight way."""

    def both(x: Array | None, y: Array | None) -> Array | None:
        return None if x is None or y is None else np.stack([x, y])

    return Motion(
        name="blend",
        time=np.array([0.0, 1.0]),
        landmarks=np.stack([a.landmarks, b.landmarks]),
        orientations=both(a.orientations, b.orientations),
        com=both(a.com, b.com),
        hand_opening=both(a.hand_opening, b.hand_opening),
    )


def _turned(a: Array, b: Array, share: float) -> Array:
    """The bone (3,) on the arc from ``a`` to ``b``, its length mixed; opposite bones turn through the front."""
    la, lb = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    if not min(la, lb) > 1e-9:
        return (1.0 - share) * a + share * b
    ua, ub = a / la, b / lb
    aside = ub - (ua @ ub) * ua
    if np.linalg.norm(aside) < 1e-6:
        aside = np.eye(3)[int(np.argmin(np.abs(ua)))]
        aside = aside - (ua @ aside) * ua
    angle = share * np.arctan2(np.linalg.norm(np.cross(ua, ub)), ua @ ub)
    unit = np.cos(angle) * ua + np.sin(angle) * aside / np.linalg.norm(aside)
    return np.asarray(((1.0 - share) * la + share * lb) * unit)


@dataclass(frozen=True)
class _LegEnd:
    """A leg at one end of the blend: lengths (2,) m, side (3,) of its knee, rest (3,) m from there to the knee."""

    lengths: Array
    side: Array
    rest: Array


def _leg_ends(a: Array, b: Array, leg: Leg) -> tuple[_LegEnd, _LegEnd]:
    """Both ends; a knee that bends the wrong way at one end (straight legs do, a little) turns round on the way."""
    sides = _side(_aside(a, leg), _aside(b, leg))
    first, last = (
        _LegEnd(_lengths(p, leg), side, p[leg[1]] - _knee(p, leg, _lengths(p, leg), side))
        for p, side in zip((a, b), sides, strict=True)
    )
    return first, last


def _between(p: Array, leg: Leg, ends: tuple[_LegEnd, _LegEnd], share: float) -> Array:
    """The knee (3,) m of a leg whose hip and ankle are in their places."""
    a, b = ends
    side = _turned(a.side, b.side, share)
    return _knee(p, leg, (1.0 - share) * a.lengths + share * b.lengths, side) + (1.0 - share) * a.rest + share * b.rest


def _knee(p: Array, leg: Leg, lengths: Array, side: Array) -> Array:
    """Where the two bones (2,) m of a leg meet, on the given side (3,) of the line from hip to ankle."""
    hip, _, ankle = (p[row] for row in leg)
    reach = max(float(np.linalg.norm(ankle - hip)), 1e-9)
    along = (ankle - hip) / reach
    forward = min((lengths[0] ** 2 - lengths[1] ** 2 + reach**2) / (2.0 * reach), lengths[0])
    aside = side - (side @ along) * along
    height = np.sqrt(lengths[0] ** 2 - forward**2)
    return np.asarray(hip + forward * along + height * aside / max(float(np.linalg.norm(aside)), 1e-9))


def _lengths(p: Array, leg: Leg) -> Array:
    """Lengths (2,) m of a leg's bones."""
    return np.linalg.norm(np.diff(p[list(leg)], axis=0), axis=-1)


def _aside(p: Array, leg: Leg) -> Array:
    """Place (3,) m of the knee from the line between hip and ankle."""
    hip, knee, ankle = (p[row] for row in leg)
    along = (ankle - hip) / max(float(np.linalg.norm(ankle - hip)), 1e-9)
    return np.asarray(knee - hip - ((knee - hip) @ along) * along)


def _side(a: Array, b: Array) -> tuple[Array, Array]:
    """To which side knees of two postures bend that are (3,) m off their lines: a leg nearly straight tells nothing."""
    bent = [np.linalg.norm(aside) > STRAIGHT for aside in (a, b)]
    if not any(bent):
        return (a + b, a + b)
    return (a if bent[0] else b, b if bent[1] else a)
