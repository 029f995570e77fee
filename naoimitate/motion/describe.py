"""What is known about a motion, as plain values: for people, JSON and tests."""

from __future__ import annotations

from typing import Any

import numpy as np

from naoimitate.core.errors import CalibrationError
from naoimitate.core.frames import LANDMARK, LANDMARKS, SIDES, Motion
from naoimitate.human.body import measure
from naoimitate.human.contact import FEET

BONES = {
    "thigh": ("hip", "knee"),
    "shank": ("knee", "ankle"),
    "foot": ("ankle", "toe"),
    "upper_arm": ("shoulder", "elbow"),
    "forearm": ("elbow", "wrist"),
    "hand": ("wrist", "hand"),
}
"""Segments of the limbs and the landmarks at their ends; the foot ends at its ball, the hand at its knuckles."""
WIDTHS = {"hips": ("l_hip", "r_hip"), "shoulders": ("l_shoulder", "r_shoulder"), "trunk": ("pelvis", "chest")}
MODES = ("D", "L", "R", "F")
"""Support modes, as in ``Motion``."""


def describe(motion: Motion) -> dict[str, Any]:
    """Facts about a motion.

    name, source, frames; rate in Hz; start and end in s. person: stature, arms, legs and ankle height by the T-pose, m,
    empty with the reason in not_measured when there is none. segment_lengths: m. missing: share of the frames in which
    a landmark is, for those that are in some. lowest_foot: m over the floor, NaN where feet are never seen. support:
    share of each mode, empty when it is not known. tpose: where it comes from. notes.
    """
    person, reason = _person(motion)
    absent = np.asarray(~np.isfinite(motion.landmarks).all(axis=-1)).mean(axis=0)
    feet = motion.landmarks[:, FEET, 2]
    feet = feet[np.isfinite(feet)]
    support = motion.support
    return {
        "name": motion.name,
        "source": motion.source,
        "frames": len(motion),
        "rate": motion.rate,
        "start": float(motion.time[0]),
        "end": float(motion.time[-1]),
        "person": person,
        "not_measured": reason,
        "segment_lengths": segment_lengths(motion),
        "missing": {name: float(share) for name, share in zip(LANDMARKS, absent, strict=True) if share > 0.0},
        "lowest_foot": float(feet.min()) if len(feet) else float("nan"),
        "support": {} if support is None else {mode: float((support == mode).mean()) for mode in MODES},
        "tpose": motion.tpose_note,
        "notes": list(motion.notes),
    }


def segment_lengths(motion: Motion) -> dict[str, float]:
    """Median lengths of the segments, m, NaN where never seen: ``l_thigh``, ..., ``r_hand``, ``hips``, ``shoulders``,
    ``trunk``."""
    ends = {f"{s}_{bone}": (f"{s}_{a}", f"{s}_{b}") for s in SIDES for bone, (a, b) in BONES.items()} | WIDTHS
    return {name: _length(motion, a, b) for name, (a, b) in ends.items()}


def _length(motion: Motion, a: str, b: str) -> float:
    length = np.linalg.norm(motion.landmarks[:, LANDMARK[a]] - motion.landmarks[:, LANDMARK[b]], axis=-1)
    known = length[np.isfinite(length)]
    return float(np.median(known)) if len(known) else float("nan")


def _person(motion: Motion) -> tuple[dict[str, Any], str]:
    """The person's measures, or none and the reason."""
    if motion.tpose is None:
        return {}, "there is no T-pose; give its moment with --tpose-at"
    try:
        body = measure(motion.tpose)
    except CalibrationError as error:
        return {}, str(error)
    return {"stature": body.stature, "arms": body.arm, "legs": body.leg, "ankle_height": body.ankle_height}, ""
