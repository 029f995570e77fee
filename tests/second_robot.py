"""A second humanoid, generated: another size, other joints, other names; it shows that no code knows one robot.

Kinematics of the ROBOTIS OP3 (0.51 m, 3.15 kg: joint origins, axes and foot box as in MuJoCo Menagerie's model, Apache
2.0); masses, limits and shapes are made up round figures. Unlike the first robot: hips with their own yaw and no
coupling, arms of three joints that are a T at the zero posture, no wrist, axes that oppose each other left and right,
turned joint frames, welded links with mass, points beside the joints, no coupling table.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

Vector = tuple[float, float, float]
SPEED, EFFORT = 5.0, 5.0
"""rad/s and N m, all joints."""


PARTS = yaml.safe_load("""
# joint: the link behind it is called joint_link. size: of the solid box that gives the inertia. flip: the right joint's
# axis is the left one's, reversed; else both are the same vector. shape: kind, sizes, centre.
head:
  head_pan: {parent: body, origin: [-0.001, 0, 0.1365], axis: [0, 0, 1], range: [-1.5, 1.5],
    mass: 0.02, size: [0.03, 0.03, 0.03], com: [0, 0, 0.01]}
  head_tilt: {parent: head_pan, origin: [0.010, 0.019, 0.0285], rpy: [0, 0.1, 0], axis: [0, -1, 0], range: [-0.8, 0.8],
    mass: 0.14, size: [0.09, 0.09, 0.07], com: [0, -0.018, 0.02],
    shape: [sphere, [0.05, 0, 0], [0, -0.019, 0.02]]}
left:
  sho_pitch: {parent: body, origin: [-0.001, 0.060, 0.111], axis: [0, 1, 0], flip: true, range: [-2.5, 2.5],
    mass: 0.03, size: [0.03, 0.03, 0.03], com: [0, 0.01, 0]}
  sho_roll: {parent: sho_pitch, origin: [0.019, 0.0285, -0.010], axis: [-1, 0, 0], range: [-1.0, 1.5],
    mass: 0.15, size: [0.04, 0.08, 0.04], com: [-0.018, 0.04, 0],
    shape: [capsule, [0.022, 0.05, 0], [-0.018, 0.045, 0]]}
  el: {parent: sho_roll, origin: [0, 0.0904, -0.0001], rpy: [0, 0.15, 0], axis: [1, 0, 0], range: [-0.3, 2.3],
    mass: 0.11, size: [0.04, 0.08, 0.04], com: [-0.018, 0.03, 0.002],
    shape: [capsule, [0.02, 0.06, 0], [-0.018, 0.045, 0]]}
  hip_yaw: {parent: body, origin: [0, 0.035, 0], axis: [0, 0, -1], range: [-0.8, 0.8],
    mass: 0.02, size: [0.03, 0.03, 0.02], com: [0, 0, -0.01]}
  hip_roll: {parent: hip_yaw, origin: [-0.024, 0, -0.0285], axis: [-1, 0, 0], range: [-0.6, 0.6],
    mass: 0.17, size: [0.05, 0.04, 0.04], com: [0.024, 0, -0.01]}
  hip_pitch: {parent: hip_roll, origin: [0.0241, 0.019, 0], axis: [0, 1, 0], flip: true, range: [-1.6, 0.6],
    mass: 0.12, size: [0.04, 0.04, 0.11], com: [0, -0.018, -0.06],
    shape: [capsule, [0.024, 0, 0.06], [0, -0.019, -0.055]]}
  knee: {parent: hip_pitch, origin: [0, 0, -0.11015], axis: [0, 1, 0], flip: true, range: [-0.05, 2.2],
    mass: 0.08, size: [0.03, 0.04, 0.11], com: [0, -0.018, -0.055],
    shape: [capsule, [0.022, 0, 0.06], [0, -0.019, -0.05]]}
  ank_pitch: {parent: knee, origin: [0, 0, -0.110], axis: [0, -1, 0], flip: true, range: [-1.2, 1.2],
    mass: 0.17, size: [0.05, 0.04, 0.04], com: [-0.01, -0.018, 0.01]}
  ank_roll: {parent: ank_pitch, origin: [-0.0241, -0.019, 0], axis: [1, 0, 0], range: [-0.6, 0.6],
    mass: 0.14, size: [0.127, 0.08, 0.02], com: [0.024, 0.008, -0.022],
    shape: [box, [0.127, 0.08, 0.02], [0.024, 0.0125, -0.0205]]}
""")
BODY_MASS, HAND_MASS = 0.95, 0.03

DATA = {
    "name": "second",
    "default_version": "standard",
    "versions": {
        "standard": None,
        "heavy": {"links": {"l_knee_link": {"mass": 0.2, "com": [0.001, -0.017, -0.05]}}, "speed": {"l_knee": 4.0}},
    },
    "mirror": {"joints": ["l_", "r_"], "links": ["l_", "r_"]},
    "chains": {
        "head": ["head_pan", "head_tilt"],
        "l_arm": ["l_sho_pitch", "l_sho_roll", "l_el"],
        "l_leg": ["l_hip_yaw", "l_hip_roll", "l_hip_pitch", "l_knee", "l_ank_pitch", "l_ank_roll"],
    },
    "points": {
        "head": {"link": "head_tilt_link", "at": [0, -0.019, 0.02]},
        "l_shoulder": {"link": "l_sho_roll_link", "at": [-0.018, 0, 0]},
        "l_elbow": {"link": "l_el_link", "at": [-0.018, 0, 0]},
        "l_wrist": {"link": "l_hand_link"},
        "l_hand": {"link": "l_hand_link", "at": [0.04, 0, 0]},
        "l_hip": {"link": "l_hip_pitch_link", "at": [0, -0.019, 0]},
        "l_knee": {"link": "l_knee_link", "at": [0, -0.019, 0]},
        "l_ankle": {"link": "l_ank_roll_link", "at": [0.0241, 0, 0]},
        "l_sole": {"link": "l_ank_roll_link", "at": [0.0241, 0, -0.0305]},
    },
    "soles": {"l": [[-0.0636, -0.0275], [0.0634, -0.0275], [0.0634, 0.0525], [-0.0636, 0.0525]]},
    "collision": {
        "exclude": [
            ["body_link", "head_pan_link", "head_tilt_link"],
            ["body_link", "l_sho_pitch_link", "l_sho_roll_link"],
            ["body_link", "l_hip_yaw_link", "l_hip_roll_link", "l_hip_pitch_link"],
            ["l_knee_link", "l_ank_pitch_link", "l_ank_roll_link"],
        ]
    },
    "postures": {
        "zero": {},
        "stand": {"l_sho_roll": 1.2, "l_el": 0.3, "l_hip_pitch": -0.239, "l_knee": 0.5, "l_ank_pitch": 0.261},
        "calibration": {"l_hip_pitch": -0.239, "l_knee": 0.5, "l_ank_pitch": 0.261},
    },
}

# Landing set: by naoimitate.balance.landing_tool on a grid of 2 cm, yaws 0.2 rad apart, with a reserve of 8 mm.
DATA["landing"] = yaml.safe_load("""
directions_deg: [0, 22.5, 45, 67.5, 90, 112.5, 135, 157.5, 180, 202.5, 225, 247.5, 270, 292.5, 315, 337.5]
yaws: [-0.4, 0.0, 0.4]
reach:
  - [0.112, 0.1411, 0.1476, 0.1443, 0.132, 0.1596, 0.1617, 0.1488, 0.112, 0.0646, 0.0061, -0.0743, -0.068, -0.0175, 0.0344, 0.0799]
  - [0.112, 0.1488, 0.1617, 0.1488, 0.132, 0.1488, 0.1617, 0.1488, 0.112, 0.0723, 0.0203, -0.036, -0.088, -0.036, 0.0203, 0.0723]
  - [0.112, 0.1488, 0.1617, 0.1596, 0.132, 0.1443, 0.1476, 0.1411, 0.112, 0.0799, 0.0344, -0.0175, -0.068, -0.0743, 0.0061, 0.0646]
""")  # noqa: E501


def write_second_robot(folder: Path) -> Path:
    """Write robot.urdf and robot.yaml into a folder and return it."""
    (folder / "robot.urdf").write_text(urdf(), encoding="utf-8")
    (folder / "robot.yaml").write_text(yaml.safe_dump(DATA, sort_keys=False), encoding="utf-8")
    return folder


def urdf() -> str:
    """The URDF text; the right side is the mirror image of the left."""
    body = ("box", (0.08, 0.09, 0.13), (-0.01, 0, 0.06))
    fist = ("sphere", (0.024, 0, 0), (0.03, 0, 0))
    parts = [_link("body_link", BODY_MASS, (0.08, 0.1, 0.16), (-0.01, 0, 0.06), body)]
    parts += [_moving(name, part, "", 1.0) for name, part in PARTS["head"].items()]
    for prefix, side in (("l_", 1.0), ("r_", -1.0)):
        parts += [_moving(name, part, prefix, side) for name, part in PARTS["left"].items()]
        place = _origin((-0.018, side * 0.09, 0), (0, 0, side * math.pi / 2))
        parts.append(_joint(f"{prefix}hand", "fixed", f"{prefix}el_link", f"{prefix}hand_link", place))
        parts.append(_link(f"{prefix}hand_link", HAND_MASS, (0.05, 0.03, 0.03), (0.02, 0, 0), fist))
    return '<?xml version="1.0"?>\n<robot name="second">\n' + "\n".join(parts) + "\n</robot>\n"


def _moving(joint: str, part: dict[str, Any], prefix: str, side: float) -> str:
    """A joint and its link; side -1 mirrors: y of points, and roll and yaw, change sign."""
    flip = part.get("flip", False)
    lower, upper = part["range"]
    if side < 0 and (flip or part["axis"][1] == 0):
        lower, upper = -upper, -lower
    axis = [-a if side < 0 and flip else a for a in part["axis"]]
    parent = part["parent"] if part["parent"] in ("body", "head_pan") else prefix + part["parent"]
    roll, pitch, yaw = part.get("rpy", (0, 0, 0))
    place = _origin(_mirrored(part["origin"], side), (side * roll, pitch, side * yaw))
    limit = f'<limit lower="{lower}" upper="{upper}" velocity="{SPEED}" effort="{EFFORT}"/>'
    shape = part.get("shape")
    if shape is not None:
        shape = (shape[0], shape[1], _mirrored(shape[2], side))
    link = _link(f"{prefix}{joint}_link", part["mass"], part["size"], _mirrored(part["com"], side), shape)
    extra = f'{place}<axis xyz="{_text(axis)}"/>{limit}'
    return _joint(prefix + joint, "revolute", f"{parent}_link", f"{prefix}{joint}_link", extra) + "\n" + link


def _joint(name: str, kind: str, parent: str, child: str, extra: str) -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{extra}</joint>'


def _link(name: str, mass: float, size: Vector, com: Vector, shape: tuple[str, Vector, Vector] | None) -> str:
    """A link with the inertia of a solid box of its size (m) about its centre of mass."""
    xx, yy, zz = (mass / 12.0 * (sum(s * s for s in size) - own * own) for own in size)
    inertia = f'<inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/>'
    body = f'<inertial>{_origin(com)}<mass value="{mass}"/>{inertia}</inertial>'
    return f'<link name="{name}">{body}{_collision(name, shape)}</link>'


def _collision(link: str, shape: tuple[str, Vector, Vector] | None) -> str:
    """Sizes of a capsule: radius, then its length along y (arms) or z (legs)."""
    if shape is None:
        return ""
    kind, size, centre = shape
    rpy, geometry = (0.0, 0.0, 0.0), f'<box size="{_text(size)}"/>'
    if kind == "sphere":
        geometry = f'<sphere radius="{size[0]}"/>'
    elif kind == "capsule":
        rpy = (math.pi / 2, 0.0, 0.0) if size[1] else rpy
        geometry = f'<cylinder radius="{size[0]}" length="{size[1] or size[2]}"/>'
    return f'<collision name="{link}_shape">{_origin(centre, rpy)}<geometry>{geometry}</geometry></collision>'


def _mirrored(point: Vector, side: float) -> Vector:
    return point[0], side * point[1], point[2]


def _origin(xyz: Vector, rpy: Vector = (0.0, 0.0, 0.0)) -> str:
    return f'<origin xyz="{_text(xyz)}" rpy="{_text(rpy)}"/>'


def _text(vector: Sequence[float]) -> str:
    return " ".join(repr(float(x)) for x in vector)
