"""Frames of a person as Rokoko Studio would send them, for test senders."""

from __future__ import annotations

from typing import Any

import lz4.frame
import msgspec
import numpy as np

from naoimitate.core.frames import LANDMARK, SEGMENT, Array, HumanFrame
from naoimitate.human.body import LEG_BY_STATURE
from naoimitate.live.protocols.rokoko_joints import FIST, JOINT_OF, PHALANGES, SEGMENT_JOINT, SIDE, leg_length
from naoimitate.live.protocols.unity import from_world, quaternions_from_world, quaternions_to_world
from naoimitate.motion.person import HEAD_CENTRE

NECK = 0.5
"""Length of the neck by the height of the head's centre over its joint; only the direction is read."""
TOE_END = 0.07
"""m of the toes beyond the ball."""
BONES = (0.044, 0.026, 0.020)
"""m, the bones of a middle finger."""
DIGITS = 5
"""Of positions and rotations: 10 um."""
ACTOR_COLOR = (255, 128, 0)

_TRUNK, _LEG, _ARM = (0.0, 0.0, 1.0, 0.0), (0.0, 0.70710678, 0.0, 0.70710678), (-0.5, -0.5, 0.5, -0.5)
"""Joint frames (x, y, z, w) in a T-pose: those of spine, left upper leg and left upper arm in Rokoko's Unity plugin,
here for all joints of the trunk and limb, the right ones mirrored; receivers calibrate on a T-pose."""


class RokokoEncoder:
    """One actor with all joints of the body, and a bent middle finger where the hand's opening is known.

    packed: in an LZ4 frame, as Studio sends unless JSON is chosen.
    """

    def __init__(self, packed: bool = True) -> None:
        self._packed = packed

    def encode(self, frame: HumanFrame, sequence: int, time: float) -> list[bytes]:
        """One datagram; missing landmarks are missing joints."""
        scene = {"timestamp": float(time), "actors": [_actor(frame)], "props": []}
        rate = sequence / float(time) if time > 0.0 else 0.0
        text = msgspec.json.encode({"version": "3,0", "fps": round(rate, 2), "scene": scene})
        return [lz4.frame.compress(text, store_size=False) if self._packed else text]


def _actor(frame: HumanFrame) -> dict[str, Any]:
    stature = leg_length(frame.landmarks) / LEG_BY_STATURE
    positions = _positions(frame, stature)
    gloves = [frame.hand_opening is not None and bool(np.isfinite(opening)) for opening in _openings(frame)]
    meta = {"hasGloves": any(gloves), "hasLeftGlove": gloves[0], "hasRightGlove": gloves[1]}
    actor = {"name": "naoimitate", "color": ACTOR_COLOR, "meta": {**meta, "hasBody": True, "hasFace": False}}
    if np.isfinite(stature):
        hip = float(np.nan_to_num(frame["pelvis"][2]))
        actor["dimensions"] = {"totalHeight": stature, "hipHeight": hip}
    rotations = _rotations(frame)
    known = {name: place for name, place in positions.items() if np.isfinite(place).all()}
    actor["body"] = {name: _joint(place, rotations.get(_bone(name))) for name, place in known.items()}
    return actor


def _joint(place: Array, turn: Array | None) -> dict[str, dict[str, float]]:
    joint = {"position": dict(zip("xyz", from_world(place).round(DIGITS).tolist(), strict=True))}
    if turn is not None and np.isfinite(turn).all():
        joint["rotation"] = dict(zip("xyzw", quaternions_from_world(turn).round(DIGITS).tolist(), strict=True))
    return joint


def _positions(frame: HumanFrame, stature: float) -> dict[str, Array]:
    """Places (3,) m of the joints in our world."""
    places = {joint: frame[name] for name, joint in JOINT_OF.items()}
    middle = 0.5 * (frame["l_shoulder"] + frame["r_shoulder"])
    above = HEAD_CENTRE * stature * _unit(frame["head"] - middle)
    places["head"] = frame["head"] - above
    places["neck"] = places["head"] - NECK * above
    places["spine"] = 0.5 * (frame["pelvis"] + frame["chest"])
    for s, side in SIDE.items():
        places[f"{side}Shoulder"] = 0.5 * (middle + frame[f"{s}_shoulder"])
        ahead = np.asarray((frame[f"{s}_toe"] - frame[f"{s}_ankle"]) * np.array([1.0, 1.0, 0.0]))
        places[f"{side}ToeEnd"] = frame[f"{s}_toe"] + TOE_END * _unit(ahead)
    for s, opening in zip(SIDE, _openings(frame), strict=True):
        if np.isfinite(opening):
            places.update(_finger(frame, s, float(opening)))
    return places


def _finger(frame: HumanFrame, s: str, opening: float) -> dict[str, Array]:
    """The middle finger of a hand, bent twice by equal angles towards the palm."""
    along = _unit(frame[f"{s}_hand"] - frame[f"{s}_wrist"])
    other = np.array([1.0, 0.0, 0.0] if abs(along[0]) < 0.9 else [0.0, 1.0, 0.0])
    aside = _unit(np.asarray(np.cross(along, other), dtype=np.float64))
    bend, place, places = 0.5 * (1.0 - opening) * FIST, frame[f"{s}_hand"], {}
    for i, (part, length) in enumerate(zip(PHALANGES, (*BONES, 0.0), strict=True)):
        places[f"{SIDE[s]}Middle{part}"] = place
        place = place + length * (np.cos(i * bend) * along + np.sin(i * bend) * aside)
    return places


def _openings(frame: HumanFrame) -> Array:
    return np.full(2, np.nan) if frame.hand_opening is None else frame.hand_opening


def _rotations(frame: HumanFrame) -> dict[str, Array]:
    """Rotations (w, x, y, z) of the bones in our world; none where the frame has no orientations."""
    if frame.orientations is None:
        return {}
    parents = frame.orientations[_SWING_PARENTS]
    bones = frame.landmarks[_SWING_ENDS] - frame.landmarks[_SWING_STARTS]
    swung = _product(_between(_turned(parents, _SWING_REST), bones), parents)
    turns = _product(np.concatenate([frame.orientations, swung]), _TPOSE)
    return dict(zip(_BONES, turns, strict=True))


def _bone(joint: str) -> str:
    """The bone whose rotation a joint shares."""
    for side in SIDE.values():
        if joint.startswith(side):
            part = joint.removeprefix(side)
            if part == "Shoulder":
                return "chest"
            if part.startswith("Toe"):
                return f"{side}Foot"
            return joint if joint in _BONES else f"{side}Hand"
    return {"spine": "hip", "neck": "chest"}.get(joint, joint)


def _unit(v: Array) -> Array:
    """Vectors (..., 3) or (..., 4) at length 1; NaN where they have none."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def _product(a: Array, b: Array) -> Array:
    """Products (N, 4) of quaternions (w, x, y, z): b is applied first."""
    w = a[:, :1] * b[:, :1] - np.sum(a[:, 1:] * b[:, 1:], axis=-1, keepdims=True)
    return np.concatenate([w, a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])], axis=-1)


def _turned(q: Array, v: Array) -> Array:
    """Vectors (N, 3) turned by quaternions (N, 4)."""
    return np.asarray(v + 2.0 * np.cross(q[:, 1:], np.cross(q[:, 1:], v) + q[:, :1] * v))


def _between(a: Array, b: Array) -> Array:
    """The smallest rotations (N, 4) that bring unit vectors a (N, 3) to the directions of b; NaN for opposite ones."""
    b = _unit(b)
    return _unit(np.concatenate([1.0 + np.sum(a * b, axis=-1, keepdims=True), np.cross(a, b)], axis=-1))


_SWINGS = tuple(
    (f"{side}{bone}", f"{s}_{start}", f"{s}_{end}", parent, (0.0, aside if parent == "chest" else 0.0, down))
    for s, side, aside in (("l", "left", 1.0), ("r", "right", -1.0))
    for bone, start, end, parent, down in (
        ("UpperArm", "shoulder", "elbow", "chest", 0.0),
        ("LowerArm", "elbow", "wrist", "chest", 0.0),
        ("UpLeg", "hip", "knee", "pelvis", -1.0),
        ("Leg", "knee", "ankle", "pelvis", -1.0),
    )
)
"""Bones without an orientation of their own: from, to, the segment that they hang on, their direction in a T-pose."""
_SWING_STARTS = [LANDMARK[swing[1]] for swing in _SWINGS]
_SWING_ENDS = [LANDMARK[swing[2]] for swing in _SWINGS]
_SWING_PARENTS = [SEGMENT[swing[3]] for swing in _SWINGS]
_SWING_REST = np.array([swing[4] for swing in _SWINGS])
_BONES = (*SEGMENT_JOINT.values(), *(swing[0] for swing in _SWINGS))


def _tpose_frame(bone: str) -> tuple[float, ...]:
    """Joint frame (x, y, z, w) of a bone in a T-pose; right ones are mirror images in Unity's y-z plane."""
    if bone in ("hip", "chest", "head"):
        return _TRUNK
    x, y, z, w = _LEG if bone.endswith(("Leg", "Foot")) else _ARM
    return (x, y, z, w) if bone.startswith("left") else (x, -y, -z, w)


_TPOSE = quaternions_to_world(np.array([_tpose_frame(bone) for bone in _BONES]))
