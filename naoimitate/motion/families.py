"""Skeletons that many files share, what gives them away, and what is known to be wrong with them."""

from __future__ import annotations

from dataclasses import replace

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

_DROPPED = {
    CGSPEED_MB: ("Spine1", ("LeftShoulder", "RightShoulder", "Neck"), (("LeftHand", ("LeftFingerBase", "LThumb")), ("RightHand", ("RightFingerBase", "RThumb")))),
    CGSPEED_MAX: ("Chest2", ("LeftCollar", "RightCollar", "lowerneck"), (("LeftWrist", ("lhand", "LThumb")), ("RightWrist", ("rhand", "RThumb")))),
}  # fmt: skip
"""What cgspeed's conversions dropped of CMU's skeletons: the joint whose bone (thorax) has no length, the joints at its
end; the joints whose bones (wrists) have none, and those at their ends. Measured against the AMC file of trial 02_02."""
THORAX = 1.0
"""Thorax / upper back in CMU's skeletons: 1.001 (02), 1.005 (07), about the same direction."""
WRIST = 0.5
"""CMU's wrist bone / radius: exactly one half in every skeleton."""


def family_of(skeleton: Skeleton) -> str:
    """The family whose joints are all there, or an empty text."""
    names = set(skeleton.names)
    return next((family for family, signature in FAMILIES if signature <= names), "")


def restored(clip: Clip) -> Clip:
    """The clip with the thorax and wrist bones that cgspeed's conversions of CMU's recordings lack.

    Without them shoulders, arms and head are about 0.12 m too low. Unchanged when the bones are there.
    """
    family = family_of(clip.skeleton)
    if family not in _DROPPED:
        return clip
    thorax, above, wrists = _DROPPED[family]
    names = clip.skeleton.names
    lengths = np.linalg.norm(clip.skeleton.offsets, axis=1)
    bones = [(thorax, above, THORAX)] + [(wrist, beyond, WRIST) for wrist, beyond in wrists]
    for joint, moved, share in bones:
        if joint not in names:
            continue
        node = names.index(joint)
        nodes = [names.index(name) for name in moved if name in names]
        if any(lengths[i] > 0.02 * lengths[node] for i in nodes):
            continue
        clip = _lengthened(clip, node, nodes, share)
    note = "The thorax bone that this conversion drops was put back: shoulders, arms and head are higher by its length."
    return clip if clip.positions is None else replace(clip, notes=(*clip.notes, note))


def _lengthened(clip: Clip, node: int, moved: list[int], share: float) -> Clip:
    """A bone at ``node``, as long as ``share`` of the bone that leads there, between it and the joints ``moved``."""
    bone = share * clip.skeleton.offsets[node]
    offsets, positions = clip.skeleton.offsets.copy(), clip.positions.copy()
    shift = clip.rotations[:, node] @ bone
    for i in moved:
        offsets[i] += bone
        positions[:, clip.skeleton.below(i)] += shift[:, None]
    return replace(clip, skeleton=replace(clip.skeleton, offsets=offsets), positions=positions)
