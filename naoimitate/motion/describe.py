"""What is known about a motion, as plain values: for people, JSON and tests."""

from __future__ import annotations

from typing import Any

import numpy as np

from naoimitate.core.frames import LANDMARK, SIDES, Motion
from naoimitate.human.body import LEG_BY_STATURE
from naoimitate.motion.repair import missing

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


def describe(motion: Motion) -> dict[str, Any]:
    """Facts about a motion.

    name, source, frames; rate in Hz; start and end in s; stature and segment lengths in m, medians over the frames (NaN
    where never seen); landmarks that are missing, and in how many frames others are; T-pose note and notes.
    """
    lengths = segment_lengths(motion)
    legs = [lengths[f"{s}_{bone}"] for s in SIDES for bone in ("thigh", "shank")]
    gaps = np.asarray(~np.isfinite(motion.landmarks).all(axis=-1))
    never = missing(motion.landmarks)
    return {
        "name": motion.name,
        "source": motion.source,
        "frames": len(motion),
        "rate": motion.rate,
        "start": float(motion.time[0]),
        "end": float(motion.time[-1]),
        "stature": 0.5 * sum(legs) / LEG_BY_STATURE,
        "segment_lengths": lengths,
        "missing": never,
        "frames_with_gaps": int(
            gaps[:, [row for name, row in LANDMARK.items() if name not in never]].any(axis=1).sum()
        ),
        "tpose": motion.tpose_note,
        "notes": list(motion.notes),
    }


def segment_lengths(motion: Motion) -> dict[str, float]:
    """Lengths of the segments, m: ``l_thigh``, ..., ``r_hand``, ``hips``, ``shoulders``, ``trunk``."""
    ends = {f"{s}_{bone}": (f"{s}_{a}", f"{s}_{b}") for s in SIDES for bone, (a, b) in BONES.items()} | WIDTHS
    return {name: _length(motion, a, b) for name, (a, b) in ends.items()}


def _length(motion: Motion, a: str, b: str) -> float:
    length = np.linalg.norm(motion.landmarks[:, LANDMARK[a]] - motion.landmarks[:, LANDMARK[b]], axis=-1)
    known = length[np.isfinite(length)]
    return float(np.median(known)) if len(known) else float("nan")
