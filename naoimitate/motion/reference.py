"""The posture that a person's segments are measured against: a T-pose, straightened from the best posture there is."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from naoimitate.core.frames import LANDMARK, SEGMENT, SIDES, Array
from naoimitate.core.geometry import yaw_matrix
from naoimitate.human.body import LEG_BY_STATURE
from naoimitate.motion.tpose import across, angle
from naoimitate.motion.track import Track

SNAP = np.radians(25.0)
"""A rest pose that stands within this angle of an axis of its file stands along that axis."""
REST_LEG = np.radians(45.0)
REST_ARM = np.radians(100.0)
REST_BEND = np.radians(60.0)
"""Within these a rest pose is that of a person: legs from straight down, upper arms from sideways, elbows and knees."""
TOES_OUT = np.radians(60.0)
"""Feet that seem to point further aside tell nothing."""
SIGN = {"l": 1.0, "r": -1.0}
DOWN = np.array([0.0, 0.0, -1.0])
_BODY = ("pelvis", "chest", "head")


@dataclass(frozen=True)
class Reference:
    """A straightened T-pose: facing x, mid-hip at the origin.

    landmarks: (19, 3) m, NaN where the skeleton has none. turns: (7, 3, 3) of the joints that turn the segments, in
    this pose, so that a segment's frame is turn(t) turns^T. stature: m, by the legs.
    """

    landmarks: Array
    turns: Array
    stature: float


def from_frame(track: Track, frame: int, rest: Track) -> Reference:
    """Straighten the posture of one frame, z up, in which the person stands with flat feet.

    Where the feet point is told by the rest pose, in which they point ahead, or by the line from ankle to toe.
    Somebody who lies on a side is straightened along the own body.
    """
    landmarks, turns = track.landmarks[frame], track.turns[frame]
    left = across(landmarks)
    up = np.array([0.0, 0.0, 1.0])
    standing = np.column_stack([np.cross(left, up), left, up])
    axes = standing if np.isfinite(left).all() else _body_axes(landmarks)
    reference = _straightened(landmarks, turns, standing if axes is None else axes, feet_hang=False)
    return _feet_ahead(reference, from_rest(rest))


def _feet_ahead(reference: Reference, rest: Reference | None) -> Reference:
    """The reference with feet that point ahead, so that a foot's frame in the posture shows where it points."""
    turns = reference.turns.copy()
    for side in SIDES:
        row = SEGMENT[f"{side}_foot"]
        ahead = reference.landmarks[LANDMARK[f"{side}_toe"]] - reference.landmarks[LANDMARK[f"{side}_ankle"]]
        if rest is not None:
            ahead = (turns[row] @ rest.turns[row].T)[:, 0]
        yaw = math.atan2(ahead[1], ahead[0])
        if abs(yaw) < TOES_OUT:
            turns[row] = yaw_matrix(-yaw) @ turns[row]
    return replace(reference, turns=turns)


def from_rest(rest: Track) -> Reference | None:
    """Straighten the rest pose; None when nobody stands like that (all bones along one axis, limbs folded)."""
    landmarks, turns = rest.landmarks[0], rest.turns[0]
    axes = _body_axes(landmarks)
    if axes is None or not _is_human(landmarks @ axes):
        return None
    return _straightened(landmarks, turns, axes, feet_hang=True)


def best_standing_frame(landmarks: Array) -> int:
    """The frame (T, 19, 3) m, z up, in which the person stands most upright, on straight legs and level feet."""

    def line(a: str, b: str) -> Array:
        return np.asarray(landmarks[:, LANDMARK[b]] - landmarks[:, LANDMARK[a]])

    cost = 10.0 * np.abs(line("r_ankle", "l_ankle")[:, 2])
    cost += angle(line("pelvis", "l_shoulder") + line("pelvis", "r_shoulder"), -DOWN)
    for side in SIDES:
        cost += angle(line(f"{side}_hip", f"{side}_knee"), DOWN) + angle(line(f"{side}_knee", f"{side}_ankle"), DOWN)
        cost += 0.3 * angle(line(f"{side}_shoulder", f"{side}_elbow"), line(f"{side}_elbow", f"{side}_wrist"))
    cost = np.where(np.isfinite(cost), cost, np.inf)
    return int(np.argmin(cost))


def _body_axes(landmarks: Array) -> Array | None:
    """World axes (3, 3) of a posture as columns: forward, left, up of the body; the file's axes where they are near."""
    shoulders = landmarks[LANDMARK["l_shoulder"]] + landmarks[LANDMARK["r_shoulder"]]
    up = _snapped(0.5 * shoulders - landmarks[LANDMARK["pelvis"]])
    left = landmarks[LANDMARK["l_hip"]] - landmarks[LANDMARK["r_hip"]]
    left = left - (left @ up) * up
    if not np.isfinite(up).all() or np.linalg.norm(left) < 1e-6:
        return None
    left = _snapped(left)
    left = left - (left @ up) * up
    left /= np.linalg.norm(left)
    return np.column_stack([np.cross(left, up), left, up])


def _snapped(v: Array) -> Array:
    """The axis of the file that a direction nearly has, else the direction itself, unit length."""
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = v / np.linalg.norm(v)
    axis = np.zeros(3)
    largest = int(np.argmax(np.abs(unit)))
    axis[largest] = np.sign(unit[largest])
    return axis if unit @ axis > np.cos(SNAP) else unit


def _is_human(body: Array) -> bool:
    """Whether a posture (19, 3) in body axes stands: legs down, arms not up, no limb folded, toes in front."""
    good = True
    for side, sign in SIGN.items():
        hip, knee, ankle, toe, shoulder, elbow, wrist = (
            body[LANDMARK[f"{side}_{n}"]] for n in ("hip", "knee", "ankle", "toe", "shoulder", "elbow", "wrist")
        )
        good &= bool(angle(ankle - hip, DOWN) < REST_LEG) and bool(angle(ankle - knee, knee - hip) < REST_BEND)
        good &= bool(angle(elbow - shoulder, np.array([0.0, sign, 0.0])) < REST_ARM)
        good &= bool(angle(wrist - elbow, elbow - shoulder) < REST_BEND)
        good &= bool(np.isnan(toe).any() or toe[0] > ankle[0])
    return good


def _straightened(landmarks: Array, turns: Array, axes: Array, feet_hang: bool) -> Reference:
    """Turn every limb, bone by bone and by the smallest rotation, into the T-pose; the trunk stays as it is.

    feet_hang: the feet may be rolled with spread legs, as in a rest pose; else they stand flat.
    """
    body = (landmarks - landmarks[LANDMARK["pelvis"]]) @ axes
    turned = axes.T @ turns
    out, leg = body.copy(), 0.0
    for side, sign in SIGN.items():
        hip, knee, ankle, toe = (LANDMARK[f"{side}_{n}"] for n in ("hip", "knee", "ankle", "toe"))
        _stretch(body, out, (hip, knee, ankle), DOWN)
        foot = _flat(body[ankle] - body[knee], body[toe] - body[ankle]) if feet_hang else np.eye(3)
        out[toe] = out[ankle] + foot @ (body[toe] - body[ankle])
        turned[SEGMENT[f"{side}_foot"]] = foot @ turned[SEGMENT[f"{side}_foot"]]
        shoulder, elbow, wrist, hand = (LANDMARK[f"{side}_{n}"] for n in ("shoulder", "elbow", "wrist", "hand"))
        arm = _stretch(body, out, (shoulder, elbow, wrist), np.array([0.0, sign, 0.0]))
        out[hand] = out[wrist] + arm @ (body[hand] - body[wrist])
        turned[SEGMENT[f"{side}_hand"]] = arm @ turned[SEGMENT[f"{side}_hand"]]
        leg += 0.5 * float(np.linalg.norm(out[hip] - out[knee]) + np.linalg.norm(out[knee] - out[ankle]))
    return Reference(out, turned, leg / LEG_BY_STATURE)


def _stretch(body: Array, out: Array, limb: tuple[int, int, int], direction: Array) -> Array:
    """Lay the two bones of a limb along a direction in ``out``; returns the rotation that its end went through."""
    start, middle, end = limb
    follow = np.eye(3)
    for a, b in ((start, middle), (middle, end)):
        bone = body[b] - body[a]
        follow = _smallest_turn(follow @ bone, direction) @ follow
        out[b] = out[a] + np.linalg.norm(bone) * direction
    return follow


def _flat(shank: Array, toe: Array) -> Array:
    """Rotation (3, 3) that lays the foot flat: none, but for a foot that is rolled with its spread leg.

    Then its toe, which points inwards or outwards with the spread, comes to point ahead (CMU's rest poses).
    """
    spread = math.atan2(shank[1], -shank[2])
    c, s = math.cos(spread), math.sin(spread)
    roll = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    rolled = not np.isnan(toe).any() and abs((roll @ toe)[1]) < abs(toe[1])
    return roll if rolled else np.eye(3)


def _smallest_turn(a: Array, b: Array) -> Array:
    """The smallest rotation (3, 3) that brings the direction of ``a`` to that of ``b``."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -0.9999:
        aside = np.cross(a, [1.0, 0.0, 0.0] if abs(a[0]) < 0.9 else [0.0, 0.0, 1.0])
        aside /= np.linalg.norm(aside)
        return np.asarray(2.0 * np.outer(aside, aside) - np.eye(3))
    K = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.asarray(np.eye(3) + K + K @ K / (1.0 + cosine))
