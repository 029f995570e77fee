"""A recording with its person recognised, in metres, z up; what it lacks is not filled in yet."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from naoimitate.core.frames import LANDMARK, SIDES, Array
from naoimitate.motion.clip import Clip
from naoimitate.motion.families import restored
from naoimitate.motion.recognise import leg_length, recognise
from naoimitate.motion.tpose import added_frames
from naoimitate.motion.track import Track, has_head_bone, track, track_of
from naoimitate.motion.units import Y_UP, metres_per_unit, up_axis

MIRROR = np.diag([-1.0, 1.0, 1.0])
"""Turns left-handed axes into right-handed ones."""
BACKWARDS = -0.3
"""Cosine between toes and front below which the toes point backwards."""


@dataclass(frozen=True)
class Options:
    """What the user says about a file; None where the file shall tell. See ``load_motion``."""

    fps: float | None = None
    unit: float | None = None
    up: str | None = None
    skeleton: Path | None = None
    tpose_at: float | str = "auto"


@dataclass(frozen=True)
class Scene:
    """A recording, (T, ...), in metres, z up.

    rest: the skeleton's rest pose. tpose: the file's own calibration posture, or None. head_is_joint: the head landmark
    is the joint about which the head turns. family: what the skeleton is. com: (T, 3) m or None. added: frames at the
    start that are no motion. notes: what was found, a sentence each.
    """

    motion: Track
    rest: Track
    tpose: Track | None
    head_is_joint: bool
    family: str
    com: Array | None
    added: int
    notes: tuple[str, ...]


def scene_of(clip: Clip, options: Options) -> Scene:
    """Recognise the person of a clip.

    Raises MotionFormatError when there is none, or when the unit or the up axis asked for cannot be.
    """
    clip = restored(clip)
    anatomy = recognise(clip)
    motion, rest = track(clip, anatomy), track_of(clip, anatomy, clip.rest)
    up, up_note = up_axis(motion, rest, clip.up, options.up)
    unit, unit_note = metres_per_unit(leg_length(clip.skeleton, anatomy.nodes), clip.unit, options.unit)
    turn = Y_UP if up == "y" else np.eye(3)
    mirrored = _toes_point_backwards(motion.landmarks)
    if mirrored:
        turn = turn @ MIRROR
    notes = [f"{clip.format} file, skeleton: {anatomy.family}.", *clip.notes, unit_note, up_note]
    if mirrored:
        notes.append("The file's axes are left-handed (toes point backwards): mirrored.")
    motion = motion.mapped(turn, unit)
    return Scene(
        motion=motion,
        rest=rest.mapped(turn, unit),
        tpose=None if clip.tpose is None else track_of(clip, anatomy, clip.tpose).mapped(turn, unit),
        head_is_joint=anatomy.head is not None and not has_head_bone(clip.skeleton.rest, anatomy),
        family=anatomy.family,
        com=None if clip.com is None else unit * clip.com @ turn.T,
        added=added_frames(motion),
        notes=tuple(notes),
    )


def _toes_point_backwards(landmarks: Array) -> bool:
    """Whether the toes are behind the ankles most of the time, by the sides that the joints' names say."""

    def line(a: str, b: str) -> Array:
        return np.asarray(landmarks[:, LANDMARK[b]] - landmarks[:, LANDMARK[a]])

    ahead = np.cross(line("r_hip", "l_hip"), line("pelvis", "l_shoulder") + line("pelvis", "r_shoulder"))
    toes = sum((line(f"{s}_ankle", f"{s}_toe") for s in SIDES), np.zeros(3))
    cosine = np.sum(ahead * toes, axis=-1) / (np.linalg.norm(ahead, axis=-1) * np.linalg.norm(toes, axis=-1))
    known = cosine[np.isfinite(cosine)]
    return bool(len(known)) and float(np.median(known)) < BACKWARDS
