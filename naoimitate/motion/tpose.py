"""Finding T-poses in a clip, and added frames at its start that are no part of the motion."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from naoimitate.core.frames import LANDMARK, SIDES, Array
from naoimitate.motion.track import Track

ARM = np.radians(25.0)
"""How far an arm of a T-pose may be from the line across the body."""
ELBOW = np.radians(35.0)
LEG = np.radians(15.0)
"""How far a leg of a T-pose, and its trunk, may be from the vertical."""
KNEE = np.radians(25.0)
LEVEL = 0.06
"""m by which the ankles of a T-pose may differ in height."""
HOLD = 0.4
"""s that a T-pose in the middle of a motion is held."""
STILL = 0.25
"""m/s: wrists that hold a pose are slower."""

ON_A_SIDE = 0.95
"""Sine of the slope of the line from right to left, from which on somebody lies on a side."""
JUMP = 0.12
"""m that a landmark moves against the pelvis (or the pelvis itself) from an added frame to the next, at least."""
JUMP_FACTOR = 5.0
"""The same in median steps of the clip."""
SAME = 1e-4
"""m: landmarks that move less from frame to frame were copied, nobody stands so still."""
SUDDEN = 0.9
"""Who moves out of a T-pose that is held gains speed: the first step is less than this share of the second."""
TRANSIENT = 0.02
"""m by which the steps of a filter's transient change within ``LAG`` frames."""
LAG = 3
LONGEST_TRANSIENT = 8
"""Frames; the transients of CMU's DAZ-friendly conversion have 6."""
LATER = 1.5
"""A transient's changes are larger than those just after it by this factor."""


def angle(a: Array, b: Array) -> Array:
    """Angle between vectors (..., 3), rad; NaN where one has no length."""
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.sum(a * b, axis=-1) / (np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1))
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))


def across(landmarks: Array) -> Array:
    """Horizontal unit direction (..., 3) to the person's left, the mean of the lines of hips and shoulders, z up.

    NaN where these lines are nearly vertical: of somebody who lies on a side.
    """
    total = np.zeros((*landmarks.shape[:-2], 3))
    for part in ("hip", "shoulder"):
        line = landmarks[..., LANDMARK[f"l_{part}"], :] - landmarks[..., LANDMARK[f"r_{part}"], :]
        total += line / np.maximum(np.linalg.norm(line, axis=-1, keepdims=True), 1e-9)
    slope = np.abs(total[..., 2:]) / np.maximum(np.linalg.norm(total, axis=-1, keepdims=True), 1e-9)
    total[..., 2] = 0.0
    with np.errstate(invalid="ignore", divide="ignore"):
        level = total / np.linalg.norm(total, axis=-1, keepdims=True)
    return np.where(slope < ON_A_SIDE, level, np.nan)


def heading(landmarks: Array) -> float:
    """Yaw (rad) of the person's front in one posture (19, 3) m, z up; of somebody who lies, from hips to shoulders."""
    left = across(landmarks)
    if np.isfinite(left).all():
        return math.atan2(-left[0], left[1])
    body = landmarks[LANDMARK["l_shoulder"]] + landmarks[LANDMARK["r_shoulder"]] - 2.0 * landmarks[LANDMARK["pelvis"]]
    return math.atan2(body[1], body[0]) if np.isfinite(body).all() else 0.0


def is_tpose(landmarks: Array) -> npt.NDArray[np.bool_]:
    """Whether each posture (T, 19, 3) m, z up, is a T-pose: arms out and straight, body upright, feet level."""

    def line(a: str, b: str) -> Array:
        return np.asarray(landmarks[:, LANDMARK[b]] - landmarks[:, LANDMARK[a]])

    left, up = across(landmarks), np.array([0.0, 0.0, 1.0])
    good = np.abs(line("r_ankle", "l_ankle")[:, 2]) < LEVEL
    good &= angle(line("pelvis", "l_shoulder") + line("pelvis", "r_shoulder"), up) < LEG
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        good &= angle(line(f"{side}_shoulder", f"{side}_wrist"), sign * left) < ARM
        good &= angle(line(f"{side}_shoulder", f"{side}_elbow"), line(f"{side}_elbow", f"{side}_wrist")) < ELBOW
        good &= angle(line(f"{side}_hip", f"{side}_ankle"), -up) < LEG
        good &= angle(line(f"{side}_hip", f"{side}_knee"), line(f"{side}_knee", f"{side}_ankle")) < KNEE
    return np.asarray(good)


def added_frames(track: Track) -> int:
    """How many frames at the start are no motion: an added T-pose or rest pose, and a filter's transient after it.

    Told from the data: the first posture is one of the two, perhaps some times over, and from it to the next the
    person jumps. A transient lasts as long as the steps between frames change by more than they do later.
    """
    if len(track) < 3 or not (bool(is_tpose(track.landmarks[:1])[0]) or _is_rest(track)):
        return 0
    posture = track.landmarks - track.landmarks[:, LANDMARK["pelvis"], None]
    steps = np.diff(np.concatenate([posture, track.landmarks[:, LANDMARK["pelvis"], None]], axis=1), axis=0)
    moved = np.linalg.norm(steps, axis=-1)
    seen = np.isfinite(moved).sum(axis=1)
    size = np.nan_to_num(moved, nan=0.0).max(axis=1)
    copies = int(np.argmax((size > SAME) | (seen < seen.max())))
    steps, size = steps[copies:], size[copies:]
    if len(size) < 2 or size[0] < max(JUMP, JUMP_FACTOR * float(np.median(size[1:]))):
        return 0
    if copies and size[0] < SUDDEN * size[1]:
        return 0
    change = np.nan_to_num(np.linalg.norm(steps[LAG:] - steps[:-LAG], axis=-1), nan=0.0).max(axis=1)
    later = change[LONGEST_TRANSIENT : 2 * LONGEST_TRANSIENT]
    limit = max(TRANSIENT, LATER * float(np.median(later))) if len(later) else np.inf
    last = 0
    for frame in range(1, min(LONGEST_TRANSIENT, len(change))):
        if change[frame] > limit and frame - last <= 2:
            last = frame
    return copies + last + 1


def _is_rest(track: Track) -> bool:
    """Whether no segment is turned against the rest pose in the first frame."""
    turns = track.turns[0][np.isfinite(track.turns[0]).all(axis=(1, 2))]
    return bool(len(turns)) and bool(np.abs(turns - np.eye(3)).max() < 1e-3)


def held_tpose(landmarks: Array, rate: float) -> int | None:
    """The stillest frame of the longest T-pose that is held in a motion (T, 19, 3) m, z up, if there is one."""
    wrists = landmarks[:, [LANDMARK["l_wrist"], LANDMARK["r_wrist"]]]
    speed = np.zeros(len(landmarks))
    if len(landmarks) > 1:
        speed = np.linalg.norm(np.gradient(wrists, axis=0), axis=-1).max(axis=1) * rate
    with np.errstate(invalid="ignore"):
        held = is_tpose(landmarks) & (speed < STILL)
    edges = np.diff(np.concatenate([[0], held.astype(int), [0]]))
    stretches = list(zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True))
    first, end = max(stretches, key=lambda s: s[1] - s[0], default=(0, 0))
    if end - first < (HOLD * rate if len(landmarks) > 1 else 1):
        return None
    return int(first + np.argmin(speed[first:end]))
