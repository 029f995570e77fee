"""What streams of joints lack: ends of head, hands and feet by proportions, open hands, and signs that go on."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from naoimitate.core.frames import LANDMARK, SEGMENT, SIDES, Array
from naoimitate.human.anthropometry import Anthropometry
from naoimitate.motion.person import HEAD_CENTRE

FIST = 0.5 * np.pi
"""rad; mean bend of the first two joints of the fingers of a closed hand."""
STATURES = (0.4, 2.8)
"""m; legs that would belong to other statures are no legs of people."""
_UNIT = Anthropometry(1.0)
_LEGS = tuple(tuple(LANDMARK[f"{side}_{joint}"] for joint in ("hip", "knee", "ankle")) for side in SIDES)


class End(NamedTuple):
    """Where the end of a segment is: rows of its landmark, its joint and its segment, and its place for a stature of 1.

    place: from the joint, in the segment's frame, statures.
    """

    landmark: int
    joint: int
    segment: int
    place: tuple[float, float, float]


def _end(name: str, joint: str, segment: str, place: tuple[float, float, float]) -> tuple[str, End]:
    return name, End(LANDMARK[name], LANDMARK[joint], SEGMENT[segment], place)


ENDS: dict[str, End] = dict(
    (
        _end("head", "head", "head", (0.0, 0.0, HEAD_CENTRE)),
        _end("l_hand", "l_wrist", "l_hand", (0.0, _UNIT.hand, 0.0)),
        _end("r_hand", "r_wrist", "r_hand", (0.0, -_UNIT.hand, 0.0)),
        _end("l_toe", "l_ankle", "l_foot", (_UNIT.ball, 0.0, _UNIT.ball_height - _UNIT.ankle_height)),
        _end("r_toe", "r_ankle", "r_foot", (_UNIT.ball, 0.0, _UNIT.ball_height - _UNIT.ankle_height)),
    )
)
"""Ends by the name of their landmark, as ``motion/person.py`` places them in files."""


def stature_of(landmarks: Array) -> float:
    """Stature (m) by the thighs and shanks of landmarks (19, 3) m; NaN when there is no leg of a person's size."""
    points = landmarks.tolist()
    legs = [math.dist(points[h], points[k]) + math.dist(points[k], points[a]) for h, k, a in _LEGS]
    found = [leg for leg in legs if leg == leg]
    stature = sum(found) / len(found) / (_UNIT.thigh + _UNIT.shank) if found else math.nan
    return stature if STATURES[0] < stature < STATURES[1] else math.nan


def place_of(name: str, stature: float) -> tuple[float, float, float]:
    """Where the end of a segment (one of ``ENDS``) is by proportions: m from its joint, in the segment's frame."""
    x, y, z = ENDS[name].place
    return x * stature, y * stature, z * stature


def add_ends(
    landmarks: Array, orientations: Array, names: Iterable[str], known: Mapping[str, tuple[float, float, float]]
) -> None:
    """Put landmarks named in ``names`` at the ends of their segments, in place.

    landmarks: (19, 3) m, where the head's row holds the joint that turns the head. orientations: (7, 4). known: places
    that the sender gave (m from the joint, in the segment's frame); the others are by proportions.
    """
    stature = stature_of(landmarks)
    for name in names:
        end = ENDS[name]
        place = known.get(name) or place_of(name, stature)
        landmarks[end.landmark] = _carried(landmarks[end.joint].tolist(), orientations[end.segment].tolist(), place)


def opening(bends: Array) -> float:
    """How open a hand is, 0 closed to 1 open, from bends (N,) rad of the first two joints of its fingers."""
    return min(max(1.0 - float(np.mean(bends)) / FIST, 0.0), 1.0)


def same_signs(orientations: Array, before: Array | None) -> Array:
    """Quaternions (N, 4) with the signs, which are free, that continue those of the frame before."""
    if before is None:
        return orientations
    opposite = np.einsum("ij,ij->i", orientations, before) < 0.0
    return np.where(opposite[:, None], -orientations, orientations) if opposite.any() else orientations


def _carried(
    origin: list[float], quaternion: list[float], place: tuple[float, float, float]
) -> tuple[float, float, float]:
    """A place in a turned frame as a point of the world; plain numbers, for arrays of three cost ten times as much."""
    w, a, b, c = quaternion
    x, y, z = place
    u, v, t = 2.0 * (b * z - c * y), 2.0 * (c * x - a * z), 2.0 * (a * y - b * x)
    return (
        origin[0] + x + w * u + b * t - c * v,
        origin[1] + y + w * v + c * u - a * t,
        origin[2] + z + w * t + a * v - b * u,
    )
