"""The compact human model: torso frame, feet, and the posture of equation (1) (Koenemann 2014, section III)."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.core.errors import CalibrationError
from naoimitate.core.frames import LANDMARK, SEGMENT, HumanFrame
from naoimitate.core.geometry import matrix_from_quat

Array = npt.NDArray[np.float64]

EFFECTORS = ("l_hand", "l_foot", "r_hand", "r_foot")
"""Order of the rows of a posture: equation (1)."""
ANKLE_HEIGHT_BY_STATURE = 0.039
"""Ankle above the sole / stature (Drillis and Contini 1966, in Winter 2009, Fig. 4.1)."""
LEG_BY_STATURE = 0.491
"""(Hip-knee + knee-ankle) / stature: (0.530 - 0.039) (Drillis and Contini 1966)."""

_L_HIP, _R_HIP = LANDMARK["l_hip"], LANDMARK["r_hip"]
_SHOULDERS = (LANDMARK["l_shoulder"], LANDMARK["r_shoulder"])
_ELBOWS = (LANDMARK["l_elbow"], LANDMARK["r_elbow"])
_WRISTS = (LANDMARK["l_wrist"], LANDMARK["r_wrist"])
_HIPS = (_L_HIP, _R_HIP)
_KNEES = (LANDMARK["l_knee"], LANDMARK["r_knee"])
_ANKLES = (LANDMARK["l_ankle"], LANDMARK["r_ankle"])
_TOES = (LANDMARK["l_toe"], LANDMARK["r_toe"])
_FEET = (SEGMENT["l_foot"], SEGMENT["r_foot"])
_NEEDED = tuple(r for pair in (_SHOULDERS, _ELBOWS, _WRISTS, _HIPS, _KNEES, _ANKLES, _TOES) for r in pair)


@dataclass(frozen=True)
class Body:
    """A person's measures, from the T-pose.

    arm: (2,) m, shoulder-elbow plus elbow-wrist; leg: (2,) m, hip-knee plus knee-ankle plus ankle-sole; left, right.
    ankle_height: m, ankle joint above the sole. toe_pitch: (2,) rad, slope of the ankle-toe line below the sole.
    stature: m.
    """

    arm: tuple[float, float]
    leg: tuple[float, float]
    ankle_height: float
    toe_pitch: tuple[float, float]
    stature: float

    @property
    def limb_lengths(self) -> Array:
        """(4,) m in the order of ``EFFECTORS``."""
        return np.array([self.arm[0], self.leg[0], self.arm[1], self.leg[1]])


@dataclass(frozen=True)
class BodyState:
    """What imitation needs of one moment of a person.

    posture: (4, 3) m, equation (1) in the torso frame. torso: (3, 3) world from torso. mid_hip: (3,) m.
    soles: (2, 3) m, the points of the sole planes below the ankles. feet: (2, 3, 3) world from foot.
    foot_centres: (2, 3) m, ankle-toe midpoints. elbows: (2, 3) unit, shoulder to elbow in the torso frame.
    """

    posture: Array
    torso: Array
    mid_hip: Array
    soles: Array
    feet: Array
    foot_centres: Array
    elbows: Array


def measure(tpose: HumanFrame) -> Body:
    """Measure a person who stands in a T-pose, feet flat.

    Raises CalibrationError where a landmark is missing or a limb has no length.
    """
    missing = [name for name, row in LANDMARK.items() if row in _NEEDED and not np.isfinite(tpose.landmarks[row]).all()]
    if missing:
        raise CalibrationError(f"the T-pose lacks {', '.join(missing)}: choose another moment with --tpose-at")

    def length(*rows: int) -> float:
        return float(sum(np.linalg.norm(tpose.landmarks[b] - tpose.landmarks[a]) for a, b in itertools.pairwise(rows)))

    arms = [length(_SHOULDERS[i], _ELBOWS[i], _WRISTS[i]) for i in (0, 1)]
    legs = [length(_HIPS[i], _KNEES[i], _ANKLES[i]) for i in (0, 1)]
    if min(arms + legs) < 0.05 or length(_L_HIP, _R_HIP) < 0.01:
        raise CalibrationError("a limb of the T-pose is shorter than 5 cm: check the unit of length (--unit)")
    stature = sum(legs) / 2.0 / LEG_BY_STATURE
    ankle = ANKLE_HEIGHT_BY_STATURE * stature
    pitch = [_slope(tpose.landmarks[_TOES[i]] - tpose.landmarks[_ANKLES[i]]) for i in (0, 1)]
    return Body((arms[0], arms[1]), (legs[0] + ankle, legs[1] + ankle), ankle, (pitch[0], pitch[1]), stature)


def _slope(v: Array) -> float:
    return math.atan2(-float(v[2]), math.hypot(float(v[0]), float(v[1])))


def observe(body: Body, frame: HumanFrame) -> BodyState:
    """Equation (1) and its frames for one moment; every needed landmark must be finite.

    f = [p_LHand^LShoulder, p_LFoot^LHip, p_RHand^RShoulder, p_RFoot^RHip]. Hand: the wrist. Foot: the point of the sole
    plane below the ankle joint, which turns with the foot. Feet without an orientation get one from ankle, toe, knee.
    """
    state = BodyState(
        np.empty((4, 3)),
        np.empty((3, 3)),
        np.empty(3),
        np.empty((2, 3)),
        np.empty((2, 3, 3)),
        np.empty((2, 3)),
        np.empty((2, 3)),
    )
    p = np.ascontiguousarray(frame.landmarks, dtype=np.float64)
    for side in (0, 1):
        given = rotation_of(frame, _FEET[side])
        if given is not None:
            state.feet[side] = given
        else:
            _foot_frame(p[_ANKLES[side]], p[_TOES[side]], p[_KNEES[side]], body.toe_pitch[side], state.feet[side])
    _observe(
        p,
        body.ankle_height,
        state.posture,
        state.torso,
        state.mid_hip,
        state.soles,
        state.feet,
        state.foot_centres,
        state.elbows,
    )
    return state


def rotation_of(frame: HumanFrame, segment: int) -> Array | None:
    """Rotation (3, 3) world from segment; None where the frame has none, or a quaternion far from unit length."""
    if frame.orientations is None:
        return None
    known, rotation = _rotation(np.asarray(frame.orientations[segment], dtype=np.float64))
    return rotation if known else None


@njit(cache=True)
def _rotation(quaternion: Array) -> tuple[bool, Array]:
    """Whether a quaternion (4,) is about of unit length, and its matrix (3, 3)."""
    largest = 0.0
    for part in quaternion:
        largest = max(largest, abs(part))
        if math.isnan(part):
            return False, np.eye(3)
    if not 0.1 < largest < 10.0:
        return False, np.eye(3)
    return True, matrix_from_quat(quaternion)


@njit(cache=True)
def torso_frame(p: Array, out: Array) -> None:
    """Rotation (3, 3) world from torso: z from mid-hip to mid-shoulder, y the mean of the hip and shoulder lines."""
    up = p[_SHOULDERS[0]] + p[_SHOULDERS[1]] - p[_L_HIP] - p[_R_HIP]
    shoulders = p[_SHOULDERS[0]] - p[_SHOULDERS[1]]
    hips = p[_L_HIP] - p[_R_HIP]
    across = shoulders / max(float(np.linalg.norm(shoulders)), 1e-9) + hips / max(float(np.linalg.norm(hips)), 1e-9)
    z = up / max(float(np.linalg.norm(up)), 1e-9)
    x = np.cross(across, z)
    x /= max(float(np.linalg.norm(x)), 1e-9)
    out[:, 0] = x
    out[:, 1] = np.cross(z, x)
    out[:, 2] = z


@njit(cache=True)
def _foot_frame(ankle: Array, toe: Array, knee: Array, toe_pitch: float, out: Array) -> None:
    """Foot axes from the ankle-toe line, turned up by its slope in the T-pose, and the shank for the roll."""
    along = (toe - ankle) / max(float(np.linalg.norm(toe - ankle)), 1e-9)
    across = np.cross(knee - ankle, along)
    across /= max(float(np.linalg.norm(across)), 1e-9)
    above = np.cross(along, across)
    c, s = math.cos(toe_pitch), math.sin(toe_pitch)
    out[:, 0] = c * along + s * above
    out[:, 1] = across
    out[:, 2] = c * above - s * along


@njit(cache=True)
def _observe(
    p: Array,
    ankle_height: float,
    posture: Array,
    torso: Array,
    mid_hip: Array,
    soles: Array,
    feet: Array,
    centres: Array,
    elbows: Array,
) -> None:
    torso_frame(p, torso)
    mid_hip[:] = 0.5 * (p[_L_HIP] + p[_R_HIP])
    to_torso = np.ascontiguousarray(torso.T)
    for side in range(2):
        soles[side] = p[_ANKLES[side]] - ankle_height * feet[side, :, 2]
        centres[side] = 0.5 * (p[_ANKLES[side]] + p[_TOES[side]])
        posture[2 * side] = to_torso @ (p[_WRISTS[side]] - p[_SHOULDERS[side]])
        posture[2 * side + 1] = to_torso @ (soles[side] - p[_HIPS[side]])
        upper = to_torso @ (p[_ELBOWS[side]] - p[_SHOULDERS[side]])
        elbows[side] = upper / max(float(np.linalg.norm(upper)), 1e-9)
