"""A person's frames to VMC datagrams, for test senders: bundles of bones of a Unity humanoid in its T-pose's frames."""

from __future__ import annotations

import numpy as np

from naoimitate.core.frames import SIDES, Array, HumanFrame
from naoimitate.human.anthropometry import Anthropometry
from naoimitate.live.protocols import osc
from naoimitate.live.protocols.bones import SIGN, between, quaternion, segment_turns
from naoimitate.live.protocols.humanoid import BONES, FINGERS, PHALANGES, ROOT, SIDE, above
from naoimitate.live.protocols.proportions import FIST, place_of, stature_of
from naoimitate.live.protocols.unity import from_world, quaternions_from_world

LARGEST = 1472
"""Bytes of a bundle, so that it travels in one piece: Ethernet's 1500 less the headers of IP and UDP."""
PHALANX = 0.04
"""m, the first phalanx of every finger."""
_BONES = {"UpperArm": ("shoulder", "upper_arm"), "LowerArm": ("elbow", "forearm"), "Hand": ("wrist", "hand"),
          "UpperLeg": ("hip", "thigh"), "LowerLeg": ("knee", "shank"), "Foot": ("ankle", "foot"),
          "Toes": ("toe", "foot"), "MiddleProximal": ("hand", "hand")}  # fmt: skip
_NOWHERE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


class VmcEncoder:
    """Frames of one person to VMC 2.0: time, state, root, then the bones that the frame has."""

    def encode(self, frame: HumanFrame, sequence: int, time: float) -> list[bytes]:
        """The bundles of a frame; the protocol has no counter."""
        placed = _bones(frame)
        known = {name for name, (place, turn) in placed.items() if np.isfinite(place).all() and np.isfinite(turn).all()}
        present = {ROOT: (np.zeros(3), np.eye(3)), **{name: placed[name] for name in BONES if name in known}}
        packed = [
            osc.message("/VMC/Ext/T", float(time)),
            osc.message("/VMC/Ext/OK", 1),
            osc.message("/VMC/Ext/Root/Pos", ROOT, *_NOWHERE),
        ]
        packed += [_message(name, present) for name in present if name != ROOT]
        return osc.bundles(packed, LARGEST)


def _message(name: str, present: dict[str, tuple[Array, Array]]) -> bytes:
    """A bone against the next one above it that is sent."""
    (origin, frame), (place, turn) = present[above(name, present)], present[name]
    local = from_world(frame.T @ (place - origin)), quaternions_from_world(quaternion(frame.T @ turn))
    return osc.message("/VMC/Ext/Bone/Pos", name, *(float(number) for part in local for number in part))


def _bones(frame: HumanFrame) -> dict[str, tuple[Array, Array]]:
    """Places (3,) m and rotations (3, 3) of the bones in the world; NaN where landmarks are missing."""
    turns, stature = segment_turns(frame), stature_of(frame.landmarks)
    lumbar = frame["pelvis"] + turns["pelvis"] @ np.array([0.0, 0.0, Anthropometry(1.0).waist * stature])
    skull = frame["head"] - turns["head"] @ np.array(place_of("head", stature))
    out = {
        "Hips": (frame["pelvis"], turns["pelvis"]),
        "Spine": (lumbar, between(turns["pelvis"], turns["chest"], 0.5)),
        "UpperChest": (frame["chest"], turns["chest"]),
        "Head": (skull, turns["head"]),
    }
    for side in SIDES:
        for bone, (joint, segment) in _BONES.items():
            out[SIDE[side] + bone] = (frame[f"{side}_{joint}"], turns[f"{side}_{segment}"])
    if frame.hand_opening is not None:
        for side, share in zip(SIDES, frame.hand_opening, strict=True):
            out.update(_fingers(side, frame[f"{side}_hand"], turns[f"{side}_hand"], (1.0 - float(share)) * FIST))
    return out


def _fingers(side: str, knuckle: Array, hand: Array, bend: float) -> dict[str, tuple[Array, Array]]:
    """Four fingers from one knuckle, bent by an angle (rad) at both joints towards the palm."""
    s, c = SIGN[side] * np.sin(bend), np.cos(bend)
    bent = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    middle = knuckle + hand @ bent @ np.array([0.0, SIGN[side] * PHALANX, 0.0])
    out = {SIDE[side] + finger + PHALANGES[0]: (knuckle, hand @ bent) for finger in FINGERS}
    return {**out, **{SIDE[side] + finger + PHALANGES[1]: (middle, hand @ bent @ bent) for finger in FINGERS}}
