"""Writes motion files of a known person in the skeletons, names, rest poses, units and axes of many programs.

The person is a procedural one (``naoimitate.human.procedural``), so every landmark of the file is known exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from naoimitate.core.frames import LANDMARK, SEGMENT, SIDES, Motion
from naoimitate.motion.builtin import BODY

SIGN = {"l": 1.0, "r": -1.0}
NECK = 0.04
"""m from mid-shoulder to the head's joint; its bone ends as far above the head's centre as this joint is below."""
COLLAR = np.array([0.02, 0.03, -0.02])
"""m from mid-shoulder to the left collar's joint."""
Y_UP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""World to a file with y up and the person facing z."""
Z_UP = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""World to a file with z up and the person facing -y."""


@dataclass(frozen=True)
class Slot:
    """A joint of the person: the joint above it, the segment that it turns, its place in the segment above, m."""

    above: str
    segment: str
    place: np.ndarray


def slots() -> dict[str, Slot]:
    """All joints that any skeleton has, parents first; places as in a T-pose."""

    def at(x: float, y: float, z: float) -> np.ndarray:
        return np.array([x, y, z])

    found = {
        "pelvis": Slot("", "pelvis", at(0, 0, 0)),
        "spine": Slot("pelvis", "chest", at(0, 0, BODY.waist)),
        "chest": Slot("spine", "chest", at(0, 0, BODY.chest)),
        "neck": Slot("chest", "head", at(0, 0, BODY.trunk - BODY.chest)),
        "head": Slot("neck", "head", at(0, 0, NECK)),
        "head_end": Slot("head", "", at(0, 0, 2.0 * (BODY.neck - NECK))),
    }
    for s, sign in SIGN.items():
        collar = COLLAR * [1.0, sign, 1.0]
        found[f"{s}_collar"] = Slot("chest", "chest", collar + at(0, 0, BODY.trunk - BODY.chest))
        found[f"{s}_shoulder"] = Slot(f"{s}_collar", f"{s}_upper_arm", at(0, 0.5 * sign * BODY.shoulders, 0) - collar)
        found[f"{s}_elbow"] = Slot(f"{s}_shoulder", f"{s}_forearm", at(0, sign * BODY.upper_arm, 0))
        found[f"{s}_wrist"] = Slot(f"{s}_elbow", f"{s}_hand", at(0, sign * BODY.forearm, 0))
        found[f"{s}_knuckle"] = Slot(f"{s}_wrist", f"{s}_hand", at(0, sign * BODY.hand, 0))
        found[f"{s}_hip_base"] = Slot("pelvis", "pelvis", at(0, 0, 0))
        found[f"{s}_hip"] = Slot(f"{s}_hip_base", f"{s}_thigh", at(0, 0.5 * sign * BODY.hips, 0))
        found[f"{s}_knee"] = Slot(f"{s}_hip", f"{s}_shank", at(0, 0, -BODY.thigh))
        found[f"{s}_ankle"] = Slot(f"{s}_knee", f"{s}_foot", at(0, 0, -BODY.shank))
        found[f"{s}_toe"] = Slot(f"{s}_ankle", f"{s}_foot", at(BODY.ball, 0, BODY.ball_height - BODY.ankle_height))
    return found


def _sided(**names: str) -> dict[str, str]:
    """Names of both sides from patterns with {Left}, {left}, {L} or {l} in them."""
    words = {"l": {"Left": "Left", "left": "left", "L": "L", "l": "l"}}
    words["r"] = {"Left": "Right", "left": "right", "L": "R", "l": "r"}
    return {f"{s}_{slot}": pattern.format(**words[s]) for slot, pattern in names.items() for s in SIDES}


MIXAMO_LIKE = {
    "pelvis": "Hips", "spine": "Spine", "chest": "Spine1", "neck": "Neck", "head": "Head",
    **_sided(collar="{Left}Shoulder", shoulder="{Left}Arm", elbow="{Left}ForeArm", wrist="{Left}Hand",
             hip="{Left}UpLeg", knee="{Left}Leg", ankle="{Left}Foot", toe="{Left}ToeBase"),
}  # fmt: skip
FLAVOURS: dict[str, dict[str, str]] = {
    "plain": MIXAMO_LIKE,
    "mixamo": {slot: f"mixamorig:{name}" for slot, name in MIXAMO_LIKE.items()}
    | _sided(knuckle="mixamorig:{Left}HandMiddle1"),
    "character1": {slot: f"Character1_{name}" for slot, name in MIXAMO_LIKE.items()},
    "lafan1": MIXAMO_LIKE | {"chest": "Spine2"} | _sided(toe="{Left}Toe"),
    "rokoko": MIXAMO_LIKE
    | {"chest": "Spine4"}
    | _sided(hip="{Left}Thigh", knee="{Left}Shin", toe="{Left}Toe", knuckle="{Left}Finger3Proximal"),
    "rokoko mixamo-like": MIXAMO_LIKE | {"chest": "Spine4"} | _sided(toe="{Left}Toe"),
    "cmu with its thorax": MIXAMO_LIKE
    | {"spine": "LowerBack"}
    | _sided(hip_base="{L}HipJoint", knuckle="{Left}FingerBase"),
    "hip and collar": {"pelvis": "Hips", "spine": "Chest", "chest": "Chest2", "neck": "Neck", "head": "Head"}
    | _sided(collar="{Left}Collar", shoulder="{Left}Shoulder", elbow="{Left}Elbow", wrist="{Left}Wrist",
             hip="{Left}Hip", knee="{Left}Knee", ankle="{Left}Ankle", toe="{Left}Toe"),
    "no collar": {"pelvis": "Hips", "spine": "Spine", "chest": "Chest", "neck": "Neck", "head": "Head"}
    | _sided(shoulder="{Left}Shoulder", elbow="{Left}Elbow", wrist="{Left}Wrist", hip="{Left}Hip",
             knee="{Left}Knee", ankle="{Left}Ankle", toe="{Left}Toe"),
    "xsens": {"pelvis": "Hips", "spine": "Chest", "chest": "Chest4", "neck": "Neck", "head": "Head"}
    | _sided(collar="{Left}Collar", shoulder="{Left}Shoulder", elbow="{Left}Elbow", wrist="{Left}Wrist",
             hip="{Left}Hip", knee="{Left}Knee", ankle="{Left}Ankle", toe="{Left}Toe"),
    "daz": {"pelvis": "hip", "spine": "abdomen", "chest": "chest", "neck": "neck", "head": "head"}
    | _sided(collar="{l}Collar", shoulder="{l}Shldr", elbow="{l}ForeArm", wrist="{l}Hand", knuckle="{l}Mid1",
             hip_base="{l}Buttock", hip="{l}Thigh", knee="{l}Shin", ankle="{l}Foot"),
    "iclone": {"pelvis": "CC_Base_Hip", "spine": "CC_Base_Waist", "chest": "CC_Base_Spine02",
               "neck": "CC_Base_NeckTwist01", "head": "CC_Base_Head"}
    | _sided(collar="CC_Base_{L}_Clavicle", shoulder="CC_Base_{L}_Upperarm", elbow="CC_Base_{L}_Forearm",
             wrist="CC_Base_{L}_Hand", knuckle="CC_Base_{L}_Mid1", hip_base="CC_Base_{L}_Pelvis",
             hip="CC_Base_{L}_Thigh", knee="CC_Base_{L}_Calf", ankle="CC_Base_{L}_Foot", toe="CC_Base_{L}_ToeBase"),
    "blender": {"pelvis": "hips", "spine": "spine", "chest": "chest", "neck": "neck", "head": "head"}
    | _sided(collar="shoulder.{L}", shoulder="upper_arm.{L}", elbow="forearm.{L}", wrist="hand.{L}",
             hip="thigh.{L}", knee="shin.{L}", ankle="foot.{L}", toe="toe.{L}"),
    "unreal": {"pelvis": "pelvis", "spine": "spine_01", "chest": "spine_03", "neck": "neck_01", "head": "head"}
    | _sided(collar="clavicle_{l}", shoulder="upperarm_{l}", elbow="lowerarm_{l}", wrist="hand_{l}",
             knuckle="middle_01_{l}", hip="thigh_{l}", knee="calf_{l}", ankle="foot_{l}", toe="ball_{l}"),
    "biped": {"pelvis": "Bip01 Pelvis", "spine": "Bip01 Spine", "chest": "Bip01 Spine1", "neck": "Bip01 Neck",
              "head": "Bip01 Head"}
    | _sided(collar="Bip01 {L} Clavicle", shoulder="Bip01 {L} UpperArm", elbow="Bip01 {L} Forearm",
             wrist="Bip01 {L} Hand", hip="Bip01 {L} Thigh", knee="Bip01 {L} Calf", ankle="Bip01 {L} Foot",
             toe="Bip01 {L} Toe0"),
}  # fmt: skip
"""Names of the joints in the skeletons of many programs; a slot without a name is not in the skeleton."""
NAMELESS = {slot: f"joint{i}" for i, slot in enumerate(s for s in slots() if s != "head_end" and "hip_base" not in s)}
"""A skeleton whose names say nothing."""


@dataclass(frozen=True)
class Style:
    """How a program writes its files.

    names: slot to name. rest: the rest pose's name. unit: metres per unit. axes: (3, 3) file from world. order: of the
    Euler angles. six_channels: joints have position channels, too. root_offset: the root's OFFSET, file units.
    without: slots to leave out. rate: frames per second in the header.
    """

    names: dict[str, str] = field(default_factory=lambda: FLAVOURS["plain"])
    rest: str = "t"
    unit: float = 0.01
    axes: np.ndarray = field(default_factory=lambda: Y_UP)
    order: str = "ZXY"
    six_channels: bool = False
    root_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    without: tuple[str, ...] = ()
    rate: float = 100.0


def rest_turns(rest: str) -> dict[str, Rotation]:
    """How the segments are turned in a rest pose: ``t``, ``a`` (arms 45 deg down), ``hanging``, ``spread`` legs, or all
    bones along ``x``."""
    turns = {slot.segment: Rotation.identity() for slot in slots().values() if slot.segment}
    for side, sign in SIGN.items():
        arm = {"a": -45.0, "hanging": -88.0}.get(rest, 0.0)
        for segment in ("upper_arm", "forearm", "hand"):
            turns[f"{side}_{segment}"] = Rotation.from_euler("x", sign * arm, degrees=True)
        for segment in ("thigh", "shank", "foot"):
            turns[f"{side}_{segment}"] = Rotation.from_euler("x", sign * 20.0 * (rest == "spread"), degrees=True)
    if rest == "x":
        bones = {"pelvis": [0, 0, 1], "chest": [0, 0, 1], "head": [0, 0, 1]}
        for side, sign in SIGN.items():
            bones |= {f"{side}_{s}": [0, sign, 0] for s in ("upper_arm", "forearm", "hand")}
            bones |= {f"{side}_{s}": [0, 0, -1] for s in ("thigh", "shank")}
            bones[f"{side}_foot"] = slots()[f"{side}_toe"].place
        turns = {name: _from_to(np.array(bone, dtype=float), np.array([1.0, 0.0, 0.0])) for name, bone in bones.items()}
    return turns


def _from_to(a: np.ndarray, b: np.ndarray) -> Rotation:
    """Smallest rotations from a direction (3,) to directions (..., 3)."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b, axis=-1, keepdims=True)
    axis = np.cross(np.broadcast_to(a, b.shape), b)
    w = 1.0 + b @ a
    flat = w < 1e-9
    aside = np.cross(a, [0.3, 0.5, 0.8])
    axis = np.where(flat[..., None], aside, axis)
    return Rotation.from_quat(np.concatenate([axis, w[..., None]], axis=-1))


def segment_turns(motion: Motion, frames: slice) -> dict[str, Rotation]:
    """World from segment of every segment of the person, limbs by their bones and without a twist of their own."""
    landmarks, quats = motion.landmarks[frames], np.roll(motion.orientations[frames], -1, axis=-1)
    turns = {name: Rotation.from_quat(quats[:, row]) for name, row in SEGMENT.items()}
    for side, sign in SIGN.items():
        for name, a, b, rest in (
            ("thigh", "hip", "knee", [0.0, 0.0, -1.0]),
            ("shank", "knee", "ankle", [0.0, 0.0, -1.0]),
            ("upper_arm", "shoulder", "elbow", [0.0, sign, 0.0]),
            ("forearm", "elbow", "wrist", [0.0, sign, 0.0]),
        ):
            bone = landmarks[:, LANDMARK[f"{side}_{b}"]] - landmarks[:, LANDMARK[f"{side}_{a}"]]
            turns[f"{side}_{name}"] = _from_to(np.array(rest), bone)
    return turns


def bvh(motion: Motion, style: Style, step: int = 1, added: bool = False) -> str:
    """A BVH file of every ``step``-th frame; added: with a T-pose at the origin as frame 0."""
    tree = _tree(style)
    turns, root = segment_turns(motion, slice(None, None, step)), motion.landmarks[::step, LANDMARK["pelvis"]]
    if added:
        turns = {name: Rotation.concatenate([Rotation.identity(), turn]) for name, turn in turns.items()}
        root = np.concatenate([[[0.3, -0.2, BODY.leg]], root])
    rest = rest_turns(style.rest)
    M = Rotation.from_matrix(style.axes * np.linalg.det(style.axes))  # a mirror image turns like its negative
    world = {slot: M * turns[part.segment] * rest[part.segment].inv() * M.inv() for slot, part in tree.items()}
    rows = [root @ style.axes.T / style.unit]
    for slot in _depth_first(tree):
        above = tree[slot].above
        local = world[slot] if not above else world[above].inv() * world[slot]
        if style.six_channels and above:
            rows.append(np.tile(_offset(tree, slot, rest, style), (len(root), 1)))
        rows.append(local.as_euler(style.order, degrees=True))
    motion_lines = "\n".join(" ".join(f"{v:.6f}" for v in row) for row in np.hstack(rows))
    header = "HIERARCHY\n" + _node(tree, next(iter(tree)), rest, style, "")
    return f"{header}MOTION\nFrames: {len(root)}\nFrame Time: {1.0 / style.rate:.7f}\n{motion_lines}\n"


def _tree(style: Style) -> dict[str, Slot]:
    """The slots that the skeleton has; what is left out is merged into the next one below."""
    tree: dict[str, Slot] = {}
    every = slots()
    for slot, part in every.items():
        if slot not in style.names or slot in style.without or any(w in _above(every, slot) for w in style.without):
            continue
        above, place = part.above, part.place
        while above and above not in tree:
            place, above = place + every[above].place, every[above].above
        tree[slot] = Slot(above, part.segment, place)
    return tree


def _above(every: dict[str, Slot], slot: str) -> list[str]:
    path = []
    while slot := every[slot].above:
        path.append(slot)
    return path


def _depth_first(tree: dict[str, Slot], slot: str = "") -> list[str]:
    order = [slot] if slot else []
    for child, part in tree.items():
        if part.above == slot:
            order += _depth_first(tree, child)
    return order


def _offset(tree: dict[str, Slot], slot: str, rest: dict[str, Rotation], style: Style) -> np.ndarray:
    part = tree[slot]
    if not part.above:
        return np.array(style.root_offset)
    return style.axes @ rest[tree[part.above].segment].apply(part.place) / style.unit


def _node(tree: dict[str, Slot], slot: str, rest: dict[str, Rotation], style: Style, indent: str) -> str:
    part = tree[slot]
    kind, children = ("ROOT" if not part.above else "JOINT"), [c for c, p in tree.items() if p.above == slot]
    place = " Xposition Yposition Zposition" if not part.above or style.six_channels else ""
    channels = place + "".join(f" {axis}rotation" for axis in style.order)
    offset = _numbers(_offset(tree, slot, rest, style))
    text = f"{indent}{kind} {style.names[slot]}\n{indent}{{\n{indent}\tOFFSET {offset}\n"
    text += f"{indent}\tCHANNELS {len(channels.split())}{channels}\n"
    text += "".join(_node(tree, child, rest, style, indent + "\t") for child in children)
    if not children:
        end = style.axes @ rest[part.segment].apply(_end(slot)) / style.unit
        text += f"{indent}\tEnd Site\n{indent}\t{{\n{indent}\t\tOFFSET {_numbers(end)}\n{indent}\t}}\n"
    return text + f"{indent}}}\n"


def _end(slot: str) -> np.ndarray:
    """Where the bone of a last joint ends: the next slot, or a little further on for toes and knuckles."""
    pairs = (("wrist", "knuckle"), ("ankle", "toe"), ("knee", "ankle"), ("elbow", "wrist"))
    nexts = {"head": "head_end", **{f"{s}_{a}": f"{s}_{b}" for s in SIDES for a, b in pairs}}
    if slot in nexts:
        return slots()[nexts[slot]].place
    return np.array([0.05, 0.0, 0.0]) if slot.endswith("toe") else np.array([0.0, SIGN.get(slot[0], 0.0) * 0.03, 0.0])


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{v:.6f}" for v in values)
