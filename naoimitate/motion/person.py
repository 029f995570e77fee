"""From a track and its reference T-pose to a whole person: every landmark, and segments with proper frames."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from naoimitate.core.frames import LANDMARK, SEGMENT, Array, HumanFrame
from naoimitate.human.anthropometry import Anthropometry
from naoimitate.motion.reference import SIGN, Reference
from naoimitate.motion.track import Track

HEAD_CENTRE = 0.053
"""Centre of the head above its joint / stature (Xsens' skeletons: half of 0.106)."""
_WORDS = {"hand": "the knuckles", "toe": "the balls of the feet", "head": "the head's centre", "chest": "the chest"}


@dataclass(frozen=True)
class Person:
    """What the landmarks of one recording need: its reference, and which landmarks are placed by proportions.

    attached: landmark to its anchor, its segment, and its place (3,) m from the anchor in the segment's frame.
    trunk: landmarks of the trunk (chest, head) that are placed on it.
    """

    reference: Reference
    attached: dict[str, tuple[str, str, Array]]
    trunk: tuple[str, ...]

    @property
    def note(self) -> str:
        """A sentence about the derived landmarks, or an empty text."""
        names = {name.split("_")[-1] for name in (*self.attached, *self.trunk)}
        said = ", ".join(words for name, words in _WORDS.items() if name in names)
        return f"Placed by a person's proportions, for the skeleton does not tell: {said}." if said else ""


def person(reference: Reference, head_is_joint: bool) -> Person:
    """Decide which landmarks have to be placed by proportions.

    head_is_joint: the head landmark of the track is the joint about which the head turns, not the head's centre.
    """
    size = Anthropometry(reference.stature)
    attached: dict[str, tuple[str, str, Array]] = {}
    for side, sign in SIGN.items():
        attached[f"{side}_hand"] = (f"{side}_wrist", f"{side}_hand", np.array([0.0, sign * size.hand, 0.0]))
        toe = np.array([size.ball, 0.0, size.ball_height - size.ankle_height])
        attached[f"{side}_toe"] = (f"{side}_ankle", f"{side}_foot", toe)
    gone = {name for name, row in LANDMARK.items() if np.isnan(reference.landmarks[row]).any()}
    attached = {name: rule for name, rule in attached.items() if name in gone}
    if head_is_joint:
        attached["head"] = ("head", "head", np.array([0.0, 0.0, _head_above_joint(reference, size)]))
    return Person(reference, attached, tuple(name for name in ("chest", "head") if name in gone))


def _head_above_joint(reference: Reference, size: Anthropometry) -> float:
    """Height of the head's centre over its joint, m; some skeletons have that joint down between the shoulders."""
    joint = reference.landmarks[LANDMARK["head"], 2]
    shoulders = 0.5 * (reference.landmarks[LANDMARK["l_shoulder"], 2] + reference.landmarks[LANDMARK["r_shoulder"], 2])
    return max(HEAD_CENTRE * reference.stature, float(shoulders + size.neck - joint))


def landmarks_of(who: Person, track: Track) -> Array:
    """All landmarks (T, 19, 3) m of a track."""
    landmarks, size = track.landmarks.copy(), Anthropometry(who.reference.stature)
    for name, (anchor, segment, place) in who.attached.items():
        fixed = who.reference.turns[SEGMENT[segment]].T @ place
        landmarks[:, LANDMARK[name]] = track.landmarks[:, LANDMARK[anchor]] + track.turns[:, SEGMENT[segment]] @ fixed
    hips = landmarks[:, LANDMARK["pelvis"]]
    shoulders = 0.5 * (landmarks[:, LANDMARK["l_shoulder"]] + landmarks[:, LANDMARK["r_shoulder"]])
    trunk = shoulders - hips
    if "chest" in who.trunk:
        landmarks[:, LANDMARK["chest"]] = hips + (size.waist + size.chest) / (size.waist + size.trunk) * trunk
    if "head" in who.trunk:
        up = trunk / np.maximum(np.linalg.norm(trunk, axis=-1, keepdims=True), 1e-9)
        landmarks[:, LANDMARK["head"]] = shoulders + size.neck * up
    return landmarks


def orientations_of(who: Person, track: Track) -> Array:
    """Orientations (T, 7, 4) (w, x, y, z) of the segments, identity in the T-pose; signs go on, NaN where unknown."""
    turns = track.turns @ np.swapaxes(who.reference.turns, -1, -2)
    out = np.full((*turns.shape[:2], 4), np.nan)
    known = np.isfinite(turns).all(axis=(-1, -2))
    if known.any():
        out[known] = np.roll(Rotation.from_matrix(turns[known]).as_quat(canonical=True), 1, axis=-1)
    flips = np.where(np.sum(out[1:] * out[:-1], axis=-1) < 0.0, -1.0, 1.0)
    out[1:] *= np.cumprod(flips, axis=0)[..., None]
    return out


def reference_frame(who: Person) -> HumanFrame:
    """The straightened T-pose as a frame: facing x, mid-hip over the origin, soles at z = 0."""
    track = Track(who.reference.landmarks[None], who.reference.turns[None], np.full((1, 2, 3), np.nan))
    landmarks = landmarks_of(who, track)[0]
    ankles = landmarks[[LANDMARK["l_ankle"], LANDMARK["r_ankle"]], 2]
    landmarks[:, 2] += Anthropometry(who.reference.stature).ankle_height - ankles.mean()
    return HumanFrame(0.0, landmarks, orientations_of(who, track)[0])


def placed(frame: HumanFrame, place: Array) -> HumanFrame:
    """A calibration posture moved over a place (2,) m on the floor."""
    shift = np.append(np.asarray(place) - frame.landmarks[LANDMARK["pelvis"], :2], 0.0)
    return replace(frame, landmarks=frame.landmarks + shift)
