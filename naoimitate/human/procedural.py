"""A procedural person: a few parameters a moment become landmarks and orientations of the whole body.

The body is built from the feet and the centre of mass: feet, height of the pelvis, lean of the trunk and arm angles
are given; the pelvis is moved over the floor until the whole-body centre of mass (``segments``) is where it is wanted;
knees and elbows follow from analytic two-bone kinematics. Everything works on whole motions, (T, ...) arrays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from naoimitate.core.errors import UnreachablePose
from naoimitate.core.frames import LANDMARK, LANDMARKS, SEGMENT, SEGMENTS, SIDES, Array
from naoimitate.human.anthropometry import Anthropometry
from naoimitate.human.segments import center_of_mass

PELVIS_SHARE = 0.6
"""Part of the trunk's lean and turn that happens at the hips; the rest is bending of the spine."""
SIGN = {"l": 1.0, "r": -1.0}
"""Side of the body in y."""
ELBOW_POLE = (-0.5, 0.5, -0.7)
"""Where elbows point, chest frame (left arm; y mirrored for the right): backwards, outwards and down."""
COM_ITERATIONS = 25
COM_TOLERANCE = 1e-9
"""m; the iteration contracts about fivefold a round, because the legs move less than the pelvis."""


@dataclass(frozen=True)
class Parameters:
    """What a person does, T moments.

    feet: (T, 2, 6) left and right: x, y, z m of the sole point below the ankle, then yaw, pitch, roll of the foot, rad.
    com: (T, 2) m, where the centre of mass is over the floor.
    height: (T,) m of mid-hip above the floor.
    trunk: (T, 3) rad, yaw to the left, pitch forwards, roll to the right, of the chest.
    arms: (T, 2, 4) rad, left and right, of the line from shoulder to wrist against the chest: swung forwards from
        hanging (pi overhead), then spread to the own side (pi/2 lateral); elbow bent; elbow swivelled up and out.
    head: (T, 2) rad, yaw to the left and pitch down, against the chest.
    heading: (T,) rad, where all above the feet faces, 0 along +x, to the left; the trunk turns and leans against it.
    """

    feet: Array
    com: Array
    height: Array
    trunk: Array
    arms: Array
    head: Array
    heading: Array | float = 0.0


def pose(body: Anthropometry, parameters: Parameters) -> tuple[Array, Array]:
    """Landmarks (T, 19, 3) m and segment orientations (T, 7, 4) (w, x, y, z) of a person who does this.

    Raises UnreachablePose when a leg is too short for its foot.
    """
    feet = [_turn(parameters.feet[:, i, 3:]) for i in range(2)]
    faced = np.multiply.outer(np.broadcast_to(parameters.heading, len(parameters.com)), (1.0, 0.0, 0.0))
    pelvis, chest = _turn(PELVIS_SHARE * parameters.trunk + faced), _turn(parameters.trunk + faced)
    head = chest * _turn(np.column_stack([parameters.head, np.zeros(len(parameters.head))]))
    landmarks = np.full((len(parameters.com), len(LANDMARKS), 3), np.nan)
    orientations = {"pelvis": pelvis, "chest": chest, "head": head, "l_foot": feet[0], "r_foot": feet[1]}
    _set_trunk(body, landmarks, pelvis, chest, head)
    for i, side in enumerate(SIDES):
        orientations[f"{side}_hand"] = _set_arm(body, landmarks, side, chest, parameters.arms[:, i])
        _set_foot(body, landmarks, side, feet[i], parameters.feet[:, i, :3])
    _place_pelvis(body, landmarks, [pelvis.apply([1.0, 0.0, 0.0]) + foot.apply([1.0, 0.0, 0.0]) for foot in feet],
                  parameters)  # fmt: skip
    quaternions = np.empty((len(landmarks), len(SEGMENTS), 4))
    for name, rotation in orientations.items():
        quaternions[:, SEGMENT[name]] = np.roll(rotation.as_quat(), 1, axis=-1)
    return landmarks, quaternions


def arm_towards(body: Anthropometry, side: str, wrist: Array) -> Array:
    """Arm angles (4,) rad, as in ``Parameters``, that bring the wrist to a point (3,) m from the shoulder, chest frame.

    Raises UnreachablePose when the arm is too short or the point too near.
    """
    upper, fore, distance = body.upper_arm, body.forearm, float(np.linalg.norm(wrist))
    cosine = (distance**2 - upper**2 - fore**2) / (2.0 * upper * fore)
    if not -1.0 <= cosine <= 1.0:
        raise UnreachablePose(f"the {side} wrist cannot be {distance:.3f} m from its shoulder: choose a nearer point")
    x, y, z = np.asarray(wrist) / distance
    return np.array([np.arctan2(x, -z), np.arcsin(SIGN[side] * y), np.arccos(cosine), 0.0])


def _turn(yaw_pitch_roll: Array) -> Rotation:
    """Rotations from (T, 3) yaw, pitch, roll, rad: about z, then the new y, then the new x."""
    return Rotation.from_euler("ZYX", yaw_pitch_roll)


def _set_trunk(body: Anthropometry, landmarks: Array, pelvis: Rotation, chest: Rotation, head: Rotation) -> None:
    """Pelvis (at the origin), chest, shoulders, hips and head."""
    waist = pelvis.apply([0.0, 0.0, body.waist])
    neck = waist + chest.apply([0.0, 0.0, body.trunk])
    landmarks[:, LANDMARK["pelvis"]] = 0.0
    landmarks[:, LANDMARK["chest"]] = waist + chest.apply([0.0, 0.0, body.chest])
    landmarks[:, LANDMARK["head"]] = neck + head.apply([0.0, 0.0, body.neck])
    for side, sign in SIGN.items():
        landmarks[:, LANDMARK[f"{side}_hip"]] = pelvis.apply([0.0, 0.5 * sign * body.hips, 0.0])
        landmarks[:, LANDMARK[f"{side}_shoulder"]] = neck + chest.apply([0.0, 0.5 * sign * body.shoulders, 0.0])


def _set_arm(body: Anthropometry, landmarks: Array, side: str, chest: Rotation, arm: Array) -> Rotation:
    """Elbow, wrist and hand of one arm, (T, 4) rad as in ``Parameters``; returns the hand's orientation."""
    swing, spread, flexion, swivel = arm.T
    sign, upper, fore = SIGN[side], body.upper_arm, body.forearm
    towards = np.column_stack([np.sin(swing) * np.cos(spread), sign * np.sin(spread), -np.cos(swing) * np.cos(spread)])
    pole = _perpendicular(np.array(ELBOW_POLE) * [1.0, sign, 1.0], towards)
    pole = Rotation.from_rotvec(sign * swivel[:, None] * towards).apply(pole)
    distance = np.sqrt(upper**2 + fore**2 + 2.0 * upper * fore * np.cos(flexion))
    along = (distance**2 + upper**2 - fore**2) / (2.0 * distance)
    aside = upper * fore * np.sin(flexion) / distance
    elbow, wrist = along[:, None] * towards + aside[:, None] * pole, distance[:, None] * towards
    forearm = (wrist - elbow) / fore
    shoulder = landmarks[:, LANDMARK[f"{side}_shoulder"]]
    for name, point in (("elbow", elbow), ("wrist", wrist), ("hand", wrist + body.hand * forearm)):
        landmarks[:, LANDMARK[f"{side}_{name}"]] = shoulder + chest.apply(point)
    return chest * _shortest_turn(np.array([0.0, sign, 0.0]), forearm)


def _set_foot(body: Anthropometry, landmarks: Array, side: str, foot: Rotation, sole: Array) -> None:
    landmarks[:, LANDMARK[f"{side}_ankle"]] = sole + foot.apply([0.0, 0.0, body.ankle_height])
    landmarks[:, LANDMARK[f"{side}_toe"]] = sole + foot.apply([body.ball, 0.0, body.ball_height])


def _place_pelvis(body: Anthropometry, landmarks: Array, knee_poles: list[Array], parameters: Parameters) -> None:
    """Move everything above the feet to its height and over the floor until the centre of mass is right."""
    feet = [LANDMARK[f"{side}_{name}"] for side in SIDES for name in ("ankle", "toe")]
    upper = [row for row in range(len(LANDMARKS)) if row not in feet]
    landmarks[:, upper, 2] += parameters.height[:, None]
    landmarks[:, upper, :2] += parameters.com[:, None]
    for _ in range(COM_ITERATIONS):
        for side, pole in zip(SIDES, knee_poles, strict=True):
            landmarks[:, LANDMARK[f"{side}_knee"]] = _knee(body, landmarks, side, pole)
        error = parameters.com - center_of_mass(landmarks)[:, :2]
        if np.abs(error).max() < COM_TOLERANCE:
            return _check_reach(body, landmarks)
        landmarks[:, upper, :2] += error[:, None]
    raise UnreachablePose("the centre of mass cannot be brought to where the script wants it: move it nearer to a foot")


def _check_reach(body: Anthropometry, landmarks: Array) -> None:
    for side in SIDES:
        leg = landmarks[:, LANDMARK[f"{side}_ankle"]] - landmarks[:, LANDMARK[f"{side}_hip"]]
        short = np.linalg.norm(leg, axis=-1) - body.thigh - body.shank
        if short.max() >= 0.0:
            raise UnreachablePose(f"the {side} leg is {short.max():.3f} m too short at frame {short.argmax()}: lower"
                                  " the pelvis or bring the foot nearer")  # fmt: skip


def _knee(body: Anthropometry, landmarks: Array, side: str, pole: Array) -> Array:
    """Knee of one leg from its hip and ankle, (T, 3) m, on the side of ``pole``."""
    hip, ankle = landmarks[:, LANDMARK[f"{side}_hip"]], landmarks[:, LANDMARK[f"{side}_ankle"]]
    leg = ankle - hip
    distance = np.linalg.norm(leg, axis=-1, keepdims=True)
    bent = np.minimum(distance, body.thigh + body.shank)
    along = (bent**2 + body.thigh**2 - body.shank**2) / (2.0 * bent)
    aside = np.sqrt(np.maximum(body.thigh**2 - along**2, 0.0))
    towards = leg / distance
    return np.asarray(hip + along * towards + aside * _perpendicular(pole, towards))


def _perpendicular(pole: Array, axis: Array) -> Array:
    """Unit part of ``pole`` that is perpendicular to the unit vectors ``axis``, (T, 3)."""
    rest = pole - np.sum(pole * axis, axis=-1, keepdims=True) * axis
    return np.asarray(rest / np.linalg.norm(rest, axis=-1, keepdims=True))


def _shortest_turn(start: Array, end: Array) -> Rotation:
    """The smallest rotations that take the unit vector ``start`` (3,) to ``end`` (T, 3); not opposite ones."""
    quaternion = np.column_stack([np.cross(start, end), 1.0 + end @ start])
    return Rotation.from_quat(quaternion)
