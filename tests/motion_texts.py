"""Writes the known person of ``skeleton_writer`` as ASF and AMC, as MVNX, and a DeepMimic motion of its own."""

from __future__ import annotations

import json

import numpy as np
from scipy.spatial.transform import Rotation
from skeleton_writer import COLLAR, NECK, SIGN, Y_UP, segment_turns

from naoimitate.core.frames import LANDMARK, Motion
from naoimitate.motion.builtin import BODY

CMU_UNIT = 0.0254 / 0.45
AXIS = (10.0, -20.0, 30.0)
"""deg: own axes of every bone of the ASF skeleton, so that C M C^-1 matters."""
Bone = tuple[str, str, str, np.ndarray]
"""Name, bone above, segment, from its start to its end in the T-pose, m."""


def asf_bones() -> list[Bone]:
    """CMU's bones in the body of the procedural person."""

    def at(x: float, y: float, z: float) -> np.ndarray:
        return np.array([x, y, z])

    bones = [
        ("lowerback", "root", "pelvis", at(0, 0, BODY.waist)),
        ("upperback", "lowerback", "chest", at(0, 0, BODY.chest)),
        ("thorax", "upperback", "chest", at(0, 0, BODY.trunk - BODY.chest)),
        ("lowerneck", "thorax", "head", at(0, 0, NECK)),
        ("head", "lowerneck", "head", at(0, 0, 2.0 * (BODY.neck - NECK))),
    ]
    for s, sign in SIGN.items():
        bones += [
            (f"{s}hipjoint", "root", "pelvis", at(0, 0.5 * sign * BODY.hips, 0)),
            (f"{s}femur", f"{s}hipjoint", f"{s}_thigh", at(0, 0, -BODY.thigh)),
            (f"{s}tibia", f"{s}femur", f"{s}_shank", at(0, 0, -BODY.shank)),
            (f"{s}foot", f"{s}tibia", f"{s}_foot", at(BODY.ball, 0, BODY.ball_height - BODY.ankle_height)),
            (f"{s}toes", f"{s}foot", f"{s}_foot", at(0.05, 0, 0)),
            (f"{s}clavicle", "thorax", "chest", at(0, 0.5 * sign * BODY.shoulders, 0)),
            (f"{s}humerus", f"{s}clavicle", f"{s}_upper_arm", at(0, sign * BODY.upper_arm, 0)),
            (f"{s}radius", f"{s}humerus", f"{s}_forearm", at(0, sign * BODY.forearm, 0)),
            (f"{s}wrist", f"{s}radius", f"{s}_hand", at(0, sign * BODY.hand, 0)),
            (f"{s}hand", f"{s}wrist", f"{s}_hand", at(0, sign * 0.03, 0)),
        ]
    return bones


def asf() -> str:
    """The skeleton in CMU's units and with CMU's headers."""
    lines = [":version 1.10", ":name person", ":units", "  mass 1.0", "  length 0.45", "  angle deg", ":documentation"]
    lines += ["   written for a test", ":root", "   order TX TY TZ RX RY RZ", "   axis XYZ", "   position 0 0 0"]
    lines += ["   orientation 0 0 0", ":bonedata"]
    for number, (name, _, _, bone) in enumerate(asf_bones(), 1):
        length = float(np.linalg.norm(bone))
        direction = Y_UP @ bone / length
        lines += ["  begin", f"     id {number}", f"     name {name}", f"     direction {_row(direction)}"]
        lines += [f"     length {length / CMU_UNIT:.8f}", f"     axis {_row(np.array(AXIS))} XYZ", "    dof rx ry rz"]
        lines += ["    limits (-180 180)", "           (-180 180)", "           (-180 180)", "  end"]
    lines += [":hierarchy", "  begin"]
    for above in dict.fromkeys(b[1] for b in asf_bones()):
        lines.append("    " + " ".join([above, *(b[0] for b in asf_bones() if b[1] == above)]))
    return "\n".join([*lines, "  end", ""])


def amc(motion: Motion, step: int = 1) -> str:
    """Every ``step``-th frame of the motion for the skeleton of ``asf``."""
    M, C = Rotation.from_matrix(Y_UP), Rotation.from_euler("xyz", AXIS, degrees=True)
    turns = {name: M * turn * M.inv() for name, turn in segment_turns(motion, slice(None, None, step)).items()}
    world = {"root": turns["pelvis"], **{name: turns[segment] for name, _, segment, _ in asf_bones()}}
    place = motion.landmarks[::step, LANDMARK["pelvis"]] @ Y_UP.T / CMU_UNIT
    table = {"root": np.hstack([place, world["root"].as_euler("xyz", degrees=True)])}
    for name, above, _, _ in asf_bones():
        local = C.inv() * world[above].inv() * world[name] * C
        table[name] = local.as_euler("xyz", degrees=True)
    lines = ["#!OML:ASF person.asf", ":FULLY-SPECIFIED", ":DEGREES"]
    for frame in range(len(place)):
        lines += [str(frame + 1), *(f"{name} {_row(values[frame])}" for name, values in table.items())]
    return "\n".join([*lines, ""])


def mvnx(motion: Motion, step: int = 1, rate: float = 100.0) -> str:
    """Every ``step``-th frame of the motion as MVNX, with a T-pose, contacts and the centre of mass."""
    turns, frames = segment_turns(motion, slice(None, None, step)), motion.landmarks[::step]
    segments = _mvnx_segments(frames, turns)
    still = {name: Rotation.identity(1) for name in turns}
    tpose = np.full((1, *frames.shape[1:]), np.nan)
    _fill_tpose(tpose)
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4">']
    lines += [f'<subject label="p" frameRate="{rate:g}" segmentCount="{len(segments)}">', "<segments>"]
    ends = {"Head": ("pTopOfHead", np.array([0.0, 0.0, 2.0 * (BODY.neck - NECK)]))}
    for s, side in (("l", "Left"), ("r", "Right")):
        ends[f"{side}Hand"] = (f"p{side}TopOfHand", np.array([0.0, SIGN[s] * BODY.hand, 0.0]))
    for number, name in enumerate(segments, 1):
        label, point = ends.get(name, ("pOrigin", np.zeros(3)))
        lines.append(
            f'<segment label="{name}" id="{number}"><points><point label="{label}"><pos_b>{_row(point)}</pos_b>'
        )
        lines.append("</point></points></segment>")
    lines += ["</segments>", "<footContactDefinition>"]
    for i, label in enumerate(("LeftFoot_Heel", "LeftFoot_Toe", "RightFoot_Heel", "RightFoot_Toe")):
        lines.append(f'<contactDefinition label="{label}" index="{i}"/>')
    lines += ["</footContactDefinition>", "<frames>", *_mvnx_frame(_mvnx_segments(tpose, still), 0, "tpose", "1 1 1 1")]
    for i in range(len(frames)):
        mode = str(motion.support[::step][i])
        planted = " ".join(["1" if mode in "DL" else "0"] * 2 + ["1" if mode in "DR" else "0"] * 2)
        lines += _mvnx_frame(segments, i, "normal", planted)
    return "\n".join([*lines, "</frames>", "</subject>", "</mvnx>", ""])


def _fill_tpose(out: np.ndarray) -> None:
    """Landmarks of a T-pose that the segments of MVNX start at, feet at z = 0."""
    hip = BODY.leg
    chest = hip + BODY.waist + BODY.chest
    shoulder = hip + BODY.waist + BODY.trunk
    out[0, LANDMARK["pelvis"]], out[0, LANDMARK["chest"]] = [0, 0, hip], [0, 0, chest]
    for s, sign in SIGN.items():
        y = 0.5 * sign * BODY.hips
        for name, z in (("hip", hip), ("knee", hip - BODY.thigh), ("ankle", BODY.ankle_height)):
            out[0, LANDMARK[f"{s}_{name}"]] = [0, y, z]
        out[0, LANDMARK[f"{s}_toe"]] = [BODY.ball, y, BODY.ball_height]
        reach = np.cumsum([0.5 * BODY.shoulders, BODY.upper_arm, BODY.forearm])
        for name, far in zip(("shoulder", "elbow", "wrist"), reach, strict=True):
            out[0, LANDMARK[f"{s}_{name}"]] = [0, sign * far, shoulder]


def _mvnx_segments(frames: np.ndarray, turns: dict[str, Rotation]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Origin (T, 3) and quaternion (T, 4) of the 23 segments."""

    def at(name: str) -> np.ndarray:
        return frames[:, LANDMARK[name]]

    middle = 0.5 * (at("l_shoulder") + at("r_shoulder"))
    waist = at("pelvis") + turns["pelvis"].apply([0.0, 0.0, BODY.waist])
    places = {
        "Pelvis": (at("pelvis"), "pelvis"),
        "L5": (waist, "chest"),
        "L3": (waist, "chest"),
        "T12": (waist, "chest"),
    }
    places |= {"T8": (at("chest"), "chest"), "Neck": (middle, "head")}
    places["Head"] = (middle + turns["head"].apply([0.0, 0.0, NECK]), "head")
    for side, s in (("Right", "r"), ("Left", "l")):
        places[f"{side}Shoulder"] = (middle + turns["chest"].apply(COLLAR * [1.0, SIGN[s], 1.0]), "chest")
        for name, joint, segment in (
            ("UpperArm", "shoulder", "upper_arm"),
            ("ForeArm", "elbow", "forearm"),
            ("Hand", "wrist", "hand"),
        ):
            places[f"{side}{name}"] = (at(f"{s}_{joint}"), f"{s}_{segment}")
    for side, s in (("Right", "r"), ("Left", "l")):
        for name, joint, segment in (
            ("UpperLeg", "hip", "thigh"),
            ("LowerLeg", "knee", "shank"),
            ("Foot", "ankle", "foot"),
            ("Toe", "toe", "foot"),
        ):
            places[f"{side}{name}"] = (at(f"{s}_{joint}"), f"{s}_{segment}")
    quats = {name: np.roll(turn.as_quat(), 1, axis=-1) for name, turn in turns.items()}
    return {name: (np.asarray(place), quats[segment]) for name, (place, segment) in places.items()}


def _mvnx_frame(segments: dict[str, tuple[np.ndarray, np.ndarray]], i: int, kind: str, planted: str) -> list[str]:
    places, quats = ([part[k][i] for part in segments.values()] for k in (0, 1))
    return [
        f'<frame time="{10 * i}" index="{i}" type="{kind}">',
        f"<orientation>{_row(np.concatenate(quats))}</orientation>",
        f"<position>{_row(np.concatenate(places))}</position>",
        f"<footContacts>{planted}</footContacts>",
        f"<centerOfMass>{_row(places[0])}</centerOfMass>",
        "</frame>",
    ]


def deepmimic(frames: int = 40) -> str:
    """The standard humanoid in the rest pose at 0.9 m, bending its right knee and swinging the arm of that side."""
    identity = [1.0, 0.0, 0.0, 0.0]
    rows = []
    for i in range(frames):
        swing = 0.3 * np.sin(0.2 * i)
        arm = [float(np.cos(swing / 2)), 0.0, 0.0, float(np.sin(swing / 2))]
        right = [*identity, -abs(swing), *identity, *arm, 0.0]
        left = [*identity, 0.0, *identity, *identity, 0.0]
        rows.append([0.02, 0.01 * i, 0.9, 0.0, *identity, *identity, *identity, *right, *left])
    return json.dumps({"Loop": "none", "Frames": rows})


def _row(values: np.ndarray) -> str:
    return " ".join(f"{v:.6f}" for v in values)
