"""Unity's humanoid: its bones, their order and parents, and forward kinematics through those that a sender has.

Rotations are against the parent in the avatar's T-pose (VRM 0's normalised bones), so that the world's rotation of a
bone is the turn since the T-pose.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from naoimitate.core.frames import SIDES

SIDE = {"l": "Left", "r": "Right"}
ROOT = "root"
_ARM = {"Shoulder": "", "UpperArm": "Shoulder", "LowerArm": "UpperArm", "Hand": "LowerArm"}
_LEG = {"UpperLeg": "", "LowerLeg": "UpperLeg", "Foot": "LowerLeg", "Toes": "Foot"}
BODY: dict[str, str] = {
    "Hips": ROOT, "Spine": "Hips", "Chest": "Spine", "UpperChest": "Chest", "Neck": "UpperChest", "Head": "Neck",
    **{side + bone: side + above if above else "UpperChest" for side in SIDE.values() for bone, above in _ARM.items()},
    **{side + bone: side + above if above else "Hips" for side in SIDE.values() for bone, above in _LEG.items()},
}  # fmt: skip
"""Bones of the body, parents before children, and the bone above each; a sender may leave some out."""
FINGERS = ("Index", "Middle", "Ring", "Little")
PHALANGES = ("Proximal", "Intermediate")
BONES: dict[str, str] = {
    **BODY,
    **{side + finger + part: side + ("Hand" if part == PHALANGES[0] else finger + PHALANGES[0])
       for side in SIDE.values() for finger in FINGERS for part in PHALANGES},
}  # fmt: skip
"""The body's and the fingers' bones."""
_JOINTS = {"shoulder": "UpperArm", "elbow": "LowerArm", "wrist": "Hand", "hand": "MiddleProximal",
           "hip": "UpperLeg", "knee": "LowerLeg", "ankle": "Foot", "toe": "Toes"}  # fmt: skip
BONES_OF: dict[str, tuple[str, ...]] = {
    "chest": ("UpperChest", "Chest"), "head": ("Head",),
    **{f"{s}_{joint}": (SIDE[s] + bone,) for s in SIDES for joint, bone in _JOINTS.items()},
}  # fmt: skip
"""Bones at whose joint a landmark is, or from whose joint it is placed (head); the first that the sender has counts."""
TURNED_BY: dict[str, tuple[str, ...]] = {
    "pelvis": ("Hips",), "chest": ("UpperChest", "Chest", "Spine"), "head": ("Head",),
    **{f"{s}_{bone.lower()}": (SIDE[s] + bone,) for s in SIDES for bone in ("Hand", "Foot")},
}  # fmt: skip
"""Bones that turn one of our segments; the first that the sender has counts."""
REST = (0.0, 0.0, 0.0, 1.0)

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class Joint(NamedTuple):
    """Place (3,) m and turn (x, y, z, w) of a bone."""

    place: Vector
    turn: Quaternion


def forward(root: Joint, local: Mapping[str, Joint]) -> dict[str, Joint]:
    """The world's place and turn of every bone in ``local``; bones that are missing there are skipped."""
    world = {ROOT: root}
    for name in BONES:
        if name in local:
            world[name] = _joined(world[above(name, world)], local[name])
    return world


def above(name: str, present: Mapping[str, object]) -> str:
    """The next bone above one that is present; the root always is."""
    parent = BONES[name]
    while parent not in present:
        parent = BONES[parent]
    return parent


def _joined(parent: Joint, child: Joint) -> Joint:
    """A child's frame through its parent's; plain numbers, for arrays of three and four cost ten times as much."""
    (x, y, z), (a, b, c, w) = child.place, parent.turn
    u, v, t = 2.0 * (b * z - c * y), 2.0 * (c * x - a * z), 2.0 * (a * y - b * x)
    p, q, r = parent.place
    i, j, k, s = child.turn
    return Joint(
        (p + x + w * u + b * t - c * v, q + y + w * v + c * u - a * t, r + z + w * t + a * v - b * u),
        (w * i + a * s + b * k - c * j, w * j - a * k + b * s + c * i, w * k + a * j - b * i + c * s,
         w * s - a * i - b * j - c * k),
    )  # fmt: skip
