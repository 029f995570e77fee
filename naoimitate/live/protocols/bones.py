"""How every segment of a person is turned, from landmarks and the orientations that a frame has: what senders need."""

from __future__ import annotations

import math

import numpy as np

from naoimitate.core.frames import SEGMENT, SIDES, Array, HumanFrame
from naoimitate.core.geometry import matrix_from_quat, quat_from_matrix
from naoimitate.human.anthropometry import Anthropometry

SIGN = {"l": 1.0, "r": -1.0}
OPPOSITE = -0.9999
"""Cosine of a bone that points against its parent's: it takes the parent's turn, for any axis would do."""
DOWN = np.array([0.0, 0.0, -1.0])
LEFT = np.array([0.0, 1.0, 0.0])
_UNIT = Anthropometry(1.0)
_TOE_PITCH = math.atan2(_UNIT.ankle_height - _UNIT.ball_height, _UNIT.ball)
"""rad, of the line from ankle to ball of a foot that stands flat."""
_LEVEL = np.array(
    [[math.cos(_TOE_PITCH), 0.0, -math.sin(_TOE_PITCH)], [0.0, 1.0, 0.0],
     [math.sin(_TOE_PITCH), 0.0, math.cos(_TOE_PITCH)]]
)  # fmt: skip
"""The foot's frame in that of the line from ankle to ball."""


def segment_turns(frame: HumanFrame) -> dict[str, Array]:
    """Rotations (3, 3), world from segment, identity in a T-pose: pelvis, chest, head, and of both sides upper_arm,
    forearm, hand, thigh, shank, foot. Given ones as they are, the others by the shortest turn from the segment above.

    NaN where landmarks are missing.
    """
    middle = 0.5 * (frame["l_shoulder"] + frame["r_shoulder"])
    pelvis = _given(frame, "pelvis", _axes(middle - frame["pelvis"], frame["l_hip"] - frame["r_hip"]))
    chest = _given(frame, "chest", _axes(middle - frame["pelvis"], frame["l_shoulder"] - frame["r_shoulder"]))
    turns = {"pelvis": pelvis, "chest": chest, "head": _given(frame, "head", chest)}
    for side in SIDES:
        turns.update(_arm(frame, side, chest))
        turns.update(_leg(frame, side, pelvis))
    return turns


def quaternion(turn: Array) -> Array:
    """Unit quaternion (w, x, y, z) of a rotation (3, 3), NaN where that is not known."""
    return quat_from_matrix(turn) if np.isfinite(turn).all() else np.full(4, np.nan)


def between(first: Array, second: Array, share: float) -> Array:
    """The rotation (3, 3) a share of the way from one to another."""
    a, b = quaternion(first), quaternion(second)
    b = -b if a @ b < 0.0 else b
    return np.asarray(matrix_from_quat((1.0 - share) * a + share * b))


def _given(frame: HumanFrame, segment: str, otherwise: Array) -> Array:
    if frame.orientations is None or not np.isfinite(frame.orientations[SEGMENT[segment]]).all():
        return otherwise
    return np.asarray(matrix_from_quat(np.ascontiguousarray(frame.orientations[SEGMENT[segment]], dtype=np.float64)))


def _arm(frame: HumanFrame, side: str, chest: Array) -> dict[str, Array]:
    along = SIGN[side] * LEFT
    upper = _swung(chest, along, frame[f"{side}_elbow"] - frame[f"{side}_shoulder"])
    fore = _swung(upper, along, frame[f"{side}_wrist"] - frame[f"{side}_elbow"])
    hand = _given(frame, f"{side}_hand", fore)
    return {f"{side}_upper_arm": upper, f"{side}_forearm": fore, f"{side}_hand": hand}


def _leg(frame: HumanFrame, side: str, pelvis: Array) -> dict[str, Array]:
    thigh = _swung(pelvis, DOWN, frame[f"{side}_knee"] - frame[f"{side}_hip"])
    shank = _swung(thigh, DOWN, frame[f"{side}_ankle"] - frame[f"{side}_knee"])
    toe = frame[f"{side}_toe"] - frame[f"{side}_ankle"]
    up = frame[f"{side}_knee"] - frame[f"{side}_ankle"]
    line = _axes(up, _cross(up, toe))  # z is made square to the line below: x has to be along it
    ahead = _unit(toe)
    line = np.column_stack([ahead, line[:, 1], _cross(ahead, line[:, 1])])
    return {
        f"{side}_thigh": thigh,
        f"{side}_shank": shank,
        f"{side}_foot": _given(frame, f"{side}_foot", line @ _LEVEL),
    }


def _axes(up: Array, left: Array) -> Array:
    """The frame with z along ``up`` and y as near to ``left`` as that allows."""
    z = _unit(up)
    x = _unit(_cross(left, z))
    return np.column_stack([x, _cross(z, x), z])


def _swung(parent: Array, axis: Array, bone: Array) -> Array:
    """The parent's frame, turned the shortest way until its ``axis`` points along the bone."""
    start, end = parent @ axis, _unit(bone)
    cosine = float(start @ end)
    if cosine < OPPOSITE:
        return parent
    x, y, z = _cross(start, end)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray((np.eye(3) + cross + cross @ cross / (1.0 + cosine)) @ parent)


def _unit(v: Array) -> Array:
    """Unit vector (3,); zero stays zero."""
    return np.asarray(v / max(float(np.linalg.norm(v)), 1e-12))


def _cross(a: Array, b: Array) -> Array:
    """Vector product (3,); ``np.cross`` takes ten times as long for one pair."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
