"""What Rokoko's joints are called, and which of them are our landmarks and turn our segments."""

from __future__ import annotations

import itertools

import numpy as np

from naoimitate.core.frames import LANDMARK, SEGMENTS, Array

SIDE = {"l": "left", "r": "right"}
_LIMBS = {
    "shoulder": "UpperArm", "elbow": "LowerArm", "wrist": "Hand", "hand": "MiddleProximal",
    "hip": "UpLeg", "knee": "Leg", "ankle": "Foot", "toe": "Toe",
}  # fmt: skip
"""Sided landmarks and their joints. Rokoko's ``Shoulder`` is the collar bone; a joint starts the bone it names."""
JOINT_OF = {
    "pelvis": "hip",
    "chest": "chest",
    "head": "head",
    **{f"{s}_{part}": f"{side}{joint}" for s, side in SIDE.items() for part, joint in _LIMBS.items()},
}
"""Landmark to joint. The head's joint is that about which it turns, its centre lies beyond."""
_SEGMENT_PART = {"hand": "Hand", "foot": "Foot"}
SEGMENT_JOINT = {
    name: f"{SIDE[name[0]]}{_SEGMENT_PART[name[2:]]}" if name[1] == "_" else {"pelvis": "hip"}.get(name, name)
    for name in SEGMENTS
}
"""Segment to the joint that turns it, in the order of ``SEGMENTS``."""
FINGERS = ("Index", "Middle", "Ring", "Little")
PHALANGES = ("Proximal", "Medial", "Distal", "Tip")
FIST = 2.8
"""rad by which the two outer joints of a closed finger bend together: 100 and 60 deg of their usual ranges."""


def leg_length(landmarks: Array) -> float:
    """Mean length hip-knee-ankle of both legs in one posture (19, 3), m; NaN where a joint is missing."""
    legs = [
        sum(
            float(np.linalg.norm(landmarks[LANDMARK[f"{s}_{a}"]] - landmarks[LANDMARK[f"{s}_{b}"]]))
            for a, b in itertools.pairwise(("hip", "knee", "ankle"))
        )
        for s in SIDE
    ]
    return 0.5 * sum(legs)
