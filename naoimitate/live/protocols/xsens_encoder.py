"""A person's frames to MXTP datagrams, for test senders: pose, centre of mass, and now and then the scaling."""

from __future__ import annotations

import numpy as np

from naoimitate.core.frames import LANDMARKS, SIDES, Array, HumanFrame
from naoimitate.human.anthropometry import Anthropometry
from naoimitate.live.protocols import mxtp
from naoimitate.live.protocols.bones import between, quaternion, segment_turns
from naoimitate.live.protocols.mxtp import Header
from naoimitate.live.protocols.proportions import place_of, stature_of
from naoimitate.live.protocols.xsens_body import JOINT_OF, POINT_OF, POINT_SHARE, SIDE
from naoimitate.motion.mvnx import PARENTS

SCALING_EVERY = 240
"""Frames from one scaling to the next."""
CLAVICLE = 0.25
"""Origin of a shoulder segment, share of the way from the neck's foot to the shoulder joint."""
_BONES = {"UpperArm": "upper_arm", "ForeArm": "forearm", "Hand": "hand",
          "UpperLeg": "thigh", "LowerLeg": "shank", "Foot": "foot", "Toe": "foot"}  # fmt: skip
_NUMBERS = np.arange(1, len(mxtp.SEGMENTS) + 1, dtype=np.uint32)


class XsensEncoder:
    """Frames of one person to MXTP, as MVN sends them: z up, m, 23 segments, character 0."""

    def encode(self, frame: HumanFrame, sequence: int, time: float) -> list[bytes]:
        """MXTP13 every ``SCALING_EVERY`` frames, MXTP24 where the frame has a centre of mass, MXTP02 at last."""
        counter, milliseconds = sequence & 0xFFFFFFFF, round(1000.0 * time) & 0xFFFFFFFF

        def packed(kind: bytes, items: int, payload: bytes, part: int = 0, last: bool = True) -> bytes:
            return mxtp.make_datagram(
                Header(kind, counter, part, last, items, milliseconds, 0, len(mxtp.SEGMENTS)), payload
            )

        segments = _segments(frame, segment_turns(frame))
        out = []
        if sequence % SCALING_EVERY == 0:
            origins, points = _null_pose(segments), _points(frame, segments)
            out.append(packed(mxtp.SCALING, len(origins.origins), mxtp.write_scaling(origins), 0, False))
            out.append(packed(mxtp.SCALING, len(points.points), mxtp.write_scaling(points), 1))
        if frame.com is not None:
            out.append(packed(mxtp.COM, 0, mxtp.write_com(frame.com)))
        values = np.array([np.concatenate([place, quaternion(turn)]) for place, turn in segments.values()])
        return [*out, packed(mxtp.POSE, len(values), mxtp.write_poses(_NUMBERS, values))]


def _segments(frame: HumanFrame, turns: dict[str, Array]) -> dict[str, tuple[Array, Array]]:
    """Origin (3,) m and rotation (3, 3) of every segment, in MXTP's order."""
    stature = stature_of(frame.landmarks)
    pelvis, chest, head = (turns[name] for name in ("pelvis", "chest", "head"))
    spine = {name: between(pelvis, chest, share) for name, share in (("L5", 0.25), ("L3", 0.5), ("T12", 0.75))}
    lumbar = frame["pelvis"] + pelvis @ np.array([0.0, 0.0, 0.5 * Anthropometry(1.0).waist * stature])
    skull = frame["head"] - head @ np.array(place_of("head", stature))
    middle = 0.5 * (frame["l_shoulder"] + frame["r_shoulder"])
    out = {"Pelvis": (frame["pelvis"], pelvis), "T8": (frame["chest"], chest), "Head": (skull, head),
           "Neck": (0.5 * (middle + skull), between(chest, head, 0.5))}  # fmt: skip
    for share, name in enumerate(spine):
        out[name] = (lumbar + share / len(spine) * (frame["chest"] - lumbar), spine[name])
    for landmark in (name for name in LANDMARKS if name[1] == "_" and not name.endswith("_hand")):
        segment = JOINT_OF[landmark]
        bone = _BONES[segment.removeprefix(SIDE[landmark[0]])]
        out[segment] = (frame[landmark], turns[f"{landmark[0]}_{bone}"])
    for side in SIDES:
        out[f"{SIDE[side]}Shoulder"] = (middle + CLAVICLE * (frame[f"{side}_shoulder"] - middle), chest)
    return {name: out[name] for name in mxtp.SEGMENTS}


def _null_pose(segments: dict[str, tuple[Array, Array]]) -> mxtp.Scaling:
    """Origins of the segments in a T-pose over the world's origin, the lowest ones on the floor."""
    origins: dict[str, Array] = {}
    for name, (place, _) in segments.items():
        above = PARENTS[name]
        origins[name] = origins[above] + segments[above][1].T @ (place - segments[above][0]) if above else np.zeros(3)
    floor = np.array([0.0, 0.0, np.nanmin([place[2] for place in origins.values()])])
    return mxtp.Scaling({name: _vector(place - floor) for name, place in origins.items()}, {})


def _points(frame: HumanFrame, segments: dict[str, tuple[Array, Array]]) -> mxtp.Scaling:
    """The bony points that end head and hands, as far as the frame tells."""
    points = {}
    for landmark, key in POINT_OF.items():
        origin, turn = segments[JOINT_OF[landmark]]
        way = turn.T @ (frame[landmark] - origin) / POINT_SHARE[landmark]
        if np.isfinite(way).all():
            points[key] = _vector(way)
    return mxtp.Scaling({}, points)


def _vector(v: Array) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])
