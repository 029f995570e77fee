"""The person's support mode: of a whole recorded motion (``annotate``), and frame by frame (``SupportEstimator``)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from naoimitate.core.frames import LANDMARK, Array, Motion
from naoimitate.human.body import ANKLE_HEIGHT_BY_STATURE, LEG_BY_STATURE
from naoimitate.human.contact import MOVING, Contacts, find_contacts
from naoimitate.human.floor import Floor
from naoimitate.human.live_support import SupportEstimator

_LEG = (("hip", "knee"), ("knee", "ankle"))

__all__ = ["SupportEstimator", "annotate", "last_mode", "raw_support"]


def annotate(motion: Motion, feet: Array | None = None) -> Motion:
    """The motion with its floor brought to z = 0, level, and its support known: ``D``, ``L``, ``R`` or ``F`` a frame.

    feet: (T, 2, 3, 3) m, as in ``find_contacts``. Contacts that the source gives are used. While feet slide or pivot
    the last mode is kept. A motion whose support is known already is returned as it is. The T-pose is not moved: it is
    a posture, not a place.
    """
    if motion.support is not None:
        return motion
    motion = replace(motion, landmarks=np.where(np.isfinite(motion.landmarks), motion.landmarks, np.nan))
    found = raw_support(motion, feet)
    level = _on_level_floor(motion, found.floor)
    return replace(level, support=last_mode(found.classes), contacts=found.planted)


def raw_support(motion: Motion, feet: Array | None = None) -> Contacts:
    """Planted feet, floor, and the raw class of every frame of a motion, ``M`` (feet moving) included."""
    return find_contacts(motion.time, motion.landmarks, motion.contacts, feet)


def last_mode(classes: npt.NDArray[np.str_]) -> npt.NDArray[np.str_]:
    """Support modes (T,) of raw classes: ``M`` keeps the mode before it; at the start it takes the first one after it.

    Where nothing but ``M`` is found, ``D``.
    """
    known = classes != MOVING
    if not known.any():
        return np.full(len(classes), "D")
    before = np.maximum.accumulate(np.where(known, np.arange(len(classes)), -1))
    return np.asarray(classes[np.where(before < 0, np.argmax(known), before)])


def _on_level_floor(motion: Motion, floor: Floor) -> Motion:
    """The motion, lifted so that its floor is z = 0 at the origin, and turned about that point until it is level."""
    up = np.array([-floor.slope[0], -floor.slope[1], 1.0])
    turn = Rotation.align_vectors([[0.0, 0.0, 1.0]], [up / np.linalg.norm(up)])[0]
    height = _floor_height(motion.landmarks, floor)

    def moved(points: Array | None) -> Array | None:
        if points is None:
            return None
        return np.asarray(turn.apply((points - [0.0, 0.0, height]).reshape(-1, 3)).reshape(points.shape))

    degrees = np.degrees(turn.magnitude())
    landmarks = moved(motion.landmarks)
    assert landmarks is not None
    return replace(
        motion,
        landmarks=landmarks,
        com=moved(motion.com),
        orientations=_turned(turn, motion.orientations),
        notes=(*motion.notes, f"The floor was {height:+.3f} m high and tilted by {degrees:.1f} deg; it is z = 0 now."),
    )


def _floor_height(landmarks: Array, floor: Floor) -> float:
    """Height of the floor itself over the origin, m: below the ankles by their height in a person of this stature."""
    heights = floor.heights.mean(axis=0)
    leg = sum(_median_length(landmarks, f"{side}_{a}", f"{side}_{b}") for side in "lr" for a, b in _LEG) / 2.0
    candidates = np.array([heights[0] - ANKLE_HEIGHT_BY_STATURE * leg / LEG_BY_STATURE, heights[1]])
    known = candidates[np.isfinite(candidates)]
    return float(known[0]) if len(known) else 0.0


def _median_length(landmarks: Array, a: str, b: str) -> float:
    """Median distance of two landmarks over a motion (T, 19, 3) m, NaN where they were never seen together."""
    lengths = np.linalg.norm(landmarks[:, LANDMARK[a]] - landmarks[:, LANDMARK[b]], axis=-1)
    return float(np.median(lengths[np.isfinite(lengths)])) if np.isfinite(lengths).any() else float("nan")


def _turned(turn: Rotation, quaternions: Array | None) -> Array | None:
    """Orientations (T, 7, 4) (w, x, y, z) after a turn of the world; missing ones (NaN) stay missing."""
    if quaternions is None:
        return None
    turned = np.full_like(quaternions, np.nan)
    known = np.isfinite(quaternions).all(axis=-1)
    xyzw = (turn * Rotation.from_quat(np.roll(quaternions[known], -1, axis=-1))).as_quat()
    turned[known] = np.roll(xyzw, 1, axis=-1)
    return turned
