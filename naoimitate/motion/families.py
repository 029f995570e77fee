"""Skeletons that many files share, what gives them away, and what is known to be wrong with them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from naoimitate.motion.clip import Clip, Skeleton

CMU = "CMU"
"""Beginning of the names of families whose recordings are those of CMU's data base."""
CGSPEED_MAX = "CMU, 3dsMax-friendly by cgspeed"
CGSPEED_MB = "CMU, MotionBuilder-friendly by cgspeed"

FAMILIES: tuple[tuple[str, frozenset[str]], ...] = (
    (CGSPEED_MAX, frozenset({"LHipJoint", "LeftHip", "LeftCollar", "lowerback", "Chest2", "LFingers"})),
    (CGSPEED_MB, frozenset({"LHipJoint", "LeftUpLeg", "LowerBack", "Spine1", "LeftFingerBase"})),
    ("CMU, DAZ-friendly by cgspeed", frozenset({"hip", "abdomen", "chest", "lButtock", "lThigh", "lShldr"})),
    ("CMU, Acclaim", frozenset({"lhipjoint", "lfemur", "ltibia", "lhumerus", "lradius", "thorax"})),
    ("Xsens MVNX", frozenset({"Pelvis", "T8", "RightUpperArm", "RightUpperLeg"})),
    ("Xsens BVH", frozenset({"Hips", "Chest4", "RightCollar", "RightAnkle"})),
    ("DeepMimic humanoid3d", frozenset({"root", "chest", "right_knee", "left_elbow"})),
    ("MotionBuilder Character1", frozenset({"Character1_Hips", "Character1_LeftUpLeg"})),
    ("Mixamo", frozenset({"mixamorig:Hips", "mixamorig:LeftUpLeg"})),
    ("iClone", frozenset({"CC_Base_Hip", "CC_Base_L_Thigh"})),
    ("Rokoko", frozenset({"LeftThigh", "LeftShin", "LeftForeArm", "LeftHand"})),
    ("Rokoko, Mixamo-like", frozenset({"Hips", "Spine4", "LeftUpLeg", "LeftForeArm", "LeftToe"})),
    ("LAFAN1", frozenset({"Hips", "LeftUpLeg", "LeftLeg", "LeftToe", "Spine2", "LeftShoulder", "LeftForeArm"})),
)
"""Name of a family, and joints that only it has together."""


@dataclass(frozen=True)
class DroppedBone:
    """A bone without length: it starts at ``joint``, where the joints ``beyond`` now are.

    share: its length by that of the bone that leads to ``joint``; its direction is nearly the same.
    """

    joint: str
    beyond: tuple[str, ...]
    share: float


THORAX = 1.0
"""Thorax / upper back in CMU's skeletons: 1.001 (02), 1.005 (07)."""
WRIST = 0.5
"""CMU's wrist bone / radius: exactly one half in every skeleton."""
DROPPED = {
    CGSPEED_MB: (
        DroppedBone("Spine1", ("LeftShoulder", "RightShoulder", "Neck"), THORAX),
        DroppedBone("LeftHand", ("LeftFingerBase", "LThumb"), WRIST),
        DroppedBone("RightHand", ("RightFingerBase", "RThumb"), WRIST),
    ),
    CGSPEED_MAX: (
        DroppedBone("Chest2", ("LeftCollar", "RightCollar", "lowerneck"), THORAX),
        DroppedBone("LeftWrist", ("lhand", "LThumb"), WRIST),
        DroppedBone("RightWrist", ("rhand", "RThumb"), WRIST),
    ),
}
"""Bones of CMU's skeletons that cgspeed's conversions lack, found by comparing trial 02_02 with its AMC file."""

BOWED_HEAD = (CGSPEED_MAX, CGSPEED_MB)
"""Families in whose added T-pose the head is bowed, by 16 deg (neck -16, 21 and 11); the rest pose looks ahead."""


def family_of(skeleton: Skeleton) -> str:
    """The family whose joints are all there, or an empty text."""
    names = set(skeleton.names)
    return next((family for family, signature in FAMILIES if signature <= names), "")


def restored(clip: Clip) -> Clip:
    """The clip with the thorax and wrist bones that cgspeed's conversions of CMU's recordings lack.

    Without them shoulders, arms and head are about 0.12 m too low. Unchanged where the bones are there.
    """
    names = clip.skeleton.names
    lengths = np.linalg.norm(clip.skeleton.offsets, axis=1)
    done = False
    for bone in DROPPED.get(family_of(clip.skeleton), ()):
        node = names.index(bone.joint) if bone.joint in names else 0
        beyond = [names.index(name) for name in bone.beyond if name in names]
        if node and beyond and lengths[beyond].max() < 0.02 * lengths[node]:
            clip, done = _lengthened(clip, node, beyond, bone.share), True
    if not done:
        return clip
    note = "The thorax and wrist bones that this conversion drops were put back: shoulders, arms and head are higher."
    return replace(clip, notes=(*clip.notes, note))


def _lengthened(clip: Clip, node: int, beyond: list[int], share: float) -> Clip:
    """The clip with a bone at ``node``, as the one that leads there times ``share``, before the joints ``beyond``."""
    bone = share * clip.skeleton.offsets[node]
    offsets, positions = clip.skeleton.offsets.copy(), clip.positions.copy()
    shift = clip.rotations[:, node] @ bone
    for i in beyond:
        offsets[i] += bone
        positions[:, clip.skeleton.below(i)] += shift[:, None]
    return replace(clip, skeleton=replace(clip.skeleton, offsets=offsets), positions=positions)
