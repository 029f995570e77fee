"""From a skeleton's joints to a person's landmarks and segments, still in the file's unit and axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from naoimitate.core.frames import LANDMARK, LANDMARKS, SEGMENT, SEGMENTS, SIDES, Array
from naoimitate.human.contact import FEET
from naoimitate.motion.clip import Clip, Posture
from naoimitate.motion.recognise import Anatomy

HEAD_END = (0.05, 0.45)
"""A head's bone that ends between these shares of the leg away reaches the top of the head or the brow; its middle is
taken as the head's centre (real heads: 0.21, CMU's: 0.11)."""
CHEST_RANGE = (0.15, 1.02)
"""The joint from which the arms part is the chest when it is between these shares of the way from hips to shoulders."""


@dataclass(frozen=True)
class Track:
    """Landmarks (T, 19, 3) as ``LANDMARKS`` and rotations (T, 7, 3, 3) of the joints that turn the ``SEGMENTS``.

    tips: (T, 2, 3) of the toes, left and right, which no landmark is. NaN where the skeleton has none. The rotations
    are identity in the skeleton's rest pose.
    """

    landmarks: Array
    turns: Array
    tips: Array

    def __len__(self) -> int:
        return len(self.landmarks)

    def __getitem__(self, frames: slice) -> Track:
        return Track(self.landmarks[frames], self.turns[frames], self.tips[frames])

    @property
    def feet(self) -> Array:
        """Ankle, ball and tip of the toes of both feet, (T, 2, 3, 3)."""
        return np.concatenate([self.landmarks[:, FEET], self.tips[:, :, None]], axis=2)

    def mapped(self, turn: Array, scale: float) -> Track:
        """In other axes and units: points p become scale * turn @ p; the rest pose turns along."""
        return Track(scale * self.landmarks @ turn.T, turn @ self.turns @ turn.T, scale * self.tips @ turn.T)

    def turned(self, turn: Array) -> Track:
        """The person turned in the world, (3, 3); the rest pose stays."""
        return Track(self.landmarks @ turn.T, turn @ self.turns, self.tips @ turn.T)


def track(clip: Clip, anatomy: Anatomy) -> Track:
    """Landmarks and segment rotations of a whole clip."""
    return _extract(clip.positions, clip.rotations, clip.skeleton.rest, anatomy)


def track_of(clip: Clip, anatomy: Anatomy, posture: Posture) -> Track:
    """Landmarks and segment rotations of a single posture, T = 1."""
    return _extract(posture.positions[None], posture.rotations[None], clip.skeleton.rest, anatomy)


def _extract(positions: Array, rotations: Array, rest: Array, anatomy: Anatomy) -> Track:
    landmarks = np.full((len(positions), len(LANDMARKS), 3), np.nan)
    for name, node in anatomy.nodes.items():
        landmarks[:, LANDMARK[name]] = positions[:, node]
    landmarks[:, LANDMARK["pelvis"]] = 0.5 * (landmarks[:, LANDMARK["l_hip"]] + landmarks[:, LANDMARK["r_hip"]])
    if anatomy.chest != anatomy.pelvis and _is_chest(rest, anatomy):
        landmarks[:, LANDMARK["chest"]] = positions[:, anatomy.chest]
    if anatomy.head is not None:
        landmarks[:, LANDMARK["head"]] = _head(positions, rest, anatomy)
    turns = np.full((len(positions), len(SEGMENTS), 3, 3), np.nan)
    turns[:, SEGMENT["pelvis"]] = rotations[:, anatomy.pelvis]
    turns[:, SEGMENT["chest"]] = rotations[:, anatomy.chest]
    if anatomy.head is not None:
        turns[:, SEGMENT["head"]] = rotations[:, anatomy.head]
    for side, palm in zip(SIDES, anatomy.palms, strict=True):
        turns[:, SEGMENT[f"{side}_hand"]] = rotations[:, palm]
        turns[:, SEGMENT[f"{side}_foot"]] = rotations[:, anatomy.nodes[f"{side}_ankle"]]
    tips = np.full((len(positions), len(SIDES), 3), np.nan)
    for foot, tip in enumerate(anatomy.tips):
        if tip is not None:
            tips[:, foot] = positions[:, tip]
    return Track(landmarks, turns, tips)


def _is_chest(rest: Array, anatomy: Anatomy) -> bool:
    hips, shoulders = (
        0.5 * (rest[anatomy.nodes[f"l_{p}"]] + rest[anatomy.nodes[f"r_{p}"]]) for p in ("hip", "shoulder")
    )
    up = shoulders - hips
    share = (rest[anatomy.chest] - hips) @ up / max(float(up @ up), 1e-12)
    return bool(CHEST_RANGE[0] <= share <= CHEST_RANGE[1])


def _head(positions: Array, rest: Array, anatomy: Anatomy) -> Array:
    """Centre of the head: the middle of its bone; the joint itself where the bone has no plausible end."""
    assert anatomy.head is not None
    centre = positions[:, anatomy.head]
    return 0.5 * (centre + positions[:, anatomy.head_end]) if has_head_bone(rest, anatomy) else centre


def has_head_bone(rest: Array, anatomy: Anatomy) -> bool:
    """Whether the skeleton has a bone from the head's joint to the top of the head."""
    if anatomy.head is None or anatomy.head_end is None:
        return False
    leg = sum(
        float(np.linalg.norm(rest[anatomy.nodes[a]] - rest[anatomy.nodes[b]]))
        for a, b in (("l_hip", "l_knee"), ("l_knee", "l_ankle"))
    )
    length = float(np.linalg.norm(rest[anatomy.head_end] - rest[anatomy.head]))
    return HEAD_END[0] * leg < length < HEAD_END[1] * leg
