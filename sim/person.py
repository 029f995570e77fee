"""Draw a person into a MuJoCo scene: capsules between the landmarks, same side colours as the robot's."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from naoimitate.core.frames import LANDMARK, SIDES, Array, Motion
from naoimitate.core.geometry import yaw_matrix
from naoimitate.sim.scene import MATERIALS, SIDE_COLOUR

BODY_COLOUR, SKIN = (0.42, 0.46, 0.52, 1.0), (0.86, 0.72, 0.60, 1.0)

TRUNK = (
    ("l_shoulder", "r_shoulder", 0.038),
    ("l_hip", "r_hip", 0.055),
    ("pelvis", "chest", 0.072),
    ("l_hip", "l_shoulder", 0.045),
    ("r_hip", "r_shoulder", 0.045),
    ("chest", "head", 0.030),
)
"""Capsules: from, to, radius as a fraction of the person's height."""

LIMBS = (
    ("shoulder", "elbow", 0.030),
    ("elbow", "wrist", 0.025),
    ("wrist", "hand", 0.025),
    ("hip", "knee", 0.046),
    ("knee", "ankle", 0.035),
    ("ankle", "toe", 0.026),
)
"""The same, on both sides; the outermost segments have the colour of their side."""

COLOURED = ("hand", "toe")
HEAD, NOSE = 0.062, 0.016
"""Radii of the head and of the nose that shows where it looks, fractions of the height."""
BONES = (
    ("l_ankle", "l_knee", 0.246),
    ("l_knee", "l_hip", 0.245),
    ("hip", "shoulder", 0.288),
    ("shoulder", "head", 0.122),
)
"""Bones on top of each other and their share of the height (Drillis and Contini 1966); crown and ankle are the rest."""
PELVIS = 0.53
"""Height of the pelvis as a fraction of the person's, where the source shows no feet."""

SETTLING = 4.0
"""s: the person is moved along so that over this time they stay beside the robot; quicker moves are theirs."""


def stage_person(motion: Motion, human_time: Array, time: Array, height: float, beside: Array) -> Array:
    """Landmarks (T, 19, 3) m of a person who acts beside the robot, as tall as the robot.

    human_time: (T,) s in the motion, NaN holds the moment before. time: (T,) s of the frames. height: m, of the robot.
    beside: (T, 2) m, where the person's pelvis should be on average. The person's heading in the first frame becomes
    +x; their lowest foot point of the whole clip stands on the floor.
    """
    moments = np.where(np.isnan(human_time), -np.inf, human_time)
    shown = np.array([motion.at(max(moment, 0.0)).landmarks for moment in np.maximum.accumulate(moments)])
    scale = height / person_height(shown)
    staged = np.asarray(scale * shown @ yaw_matrix(-_heading(shown[0])).T)
    staged[..., 2] -= _floor(staged, height)
    drift = slow_part(staged[:, LANDMARK["pelvis"], :2] - beside, time, SETTLING)
    staged[..., :2] -= drift[:, None, :]
    return staged


def person_height(landmarks: Array) -> float:
    """Standing height (m) of the person in frames (T, 19, 3), from the bones that are there; NaN without any."""
    points = {name: landmarks[:, row] for name, row in LANDMARK.items()}
    for name in ("hip", "shoulder"):
        points[name] = 0.5 * (points[f"l_{name}"] + points[f"r_{name}"])
    length, share = 0.0, 0.0
    for start, end, part in BONES:
        bone = np.linalg.norm(points[end] - points[start], axis=1)
        if np.isfinite(bone).any():
            length, share = length + float(np.nanmedian(bone)), share + part
    return length / share if share > 0.0 else np.nan


def draw_person(scene: Any, landmarks: Array) -> None:
    """Add a person to a scene that ``mjv_updateScene`` has filled; landmarks (19, 3) m, NaN parts are left out."""
    tall = person_height(landmarks[None])
    for start, end, radius in TRUNK:
        _capsule(scene, landmarks[LANDMARK[start]], landmarks[LANDMARK[end]], radius * tall, BODY_COLOUR)
    for side in SIDES:
        for start, end, radius in LIMBS:
            colour = MATERIALS[SIDE_COLOUR[side]] if end in COLOURED else BODY_COLOUR
            first, last = (landmarks[LANDMARK[f"{side}_{name}"]] for name in (start, end))
            _capsule(scene, first, last, radius * tall, colour)
    head = landmarks[LANDMARK["head"]]
    _ball(scene, head, HEAD * tall, SKIN)
    _ball(scene, head + HEAD * tall * _forward(landmarks), NOSE * tall, SKIN)


def _floor(staged: Array, height: float) -> float:
    """Height (m) of the floor under a staged person: below the lowest point of the feet in all frames."""
    feet = staged[:, [LANDMARK[f"{side}_{end}"] for side in SIDES for end in ("ankle", "toe")], 2]
    if np.isfinite(feet).any():
        return float(np.nanmin(feet)) - LIMBS[-1][2] * height
    return float(np.nanmedian(staged[:, LANDMARK["pelvis"], 2])) - PELVIS * height


def _forward(landmarks: Array) -> Array:
    """Where the chest faces, (3,) unit vector: shoulder line (right to left) x spine."""
    across = landmarks[LANDMARK["l_shoulder"]] - landmarks[LANDMARK["r_shoulder"]]
    spine = landmarks[LANDMARK["chest"]] - landmarks[LANDMARK["pelvis"]]
    forward = np.cross(across, spine)
    return np.asarray(forward / np.linalg.norm(forward))


def _heading(landmarks: Array) -> float:
    x, y, _ = np.nan_to_num(_forward(landmarks))
    return float(np.arctan2(y, x))


def slow_part(path: Array, time: Array, window: float) -> Array:
    """Mean (T, 2) of a path over ``window`` (s) around each moment; frames need not be evenly spaced in time."""
    half = 0.5 * window
    first, last = np.searchsorted(time, time - half), np.searchsorted(time, time + half, side="right")
    known = np.asarray(np.isfinite(path).all(axis=1))
    rows = np.column_stack([np.where(known[:, None], path, 0.0), known])
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(rows, axis=0)])
    window_sum = total[last] - total[first]
    return np.asarray(window_sum[:, :2] / np.maximum(window_sum[:, 2:], 1.0))


def _capsule(scene: Any, start: Array, end: Array, radius: float, colour: tuple[float, ...]) -> None:
    if not np.isfinite([start, end]).all():
        return
    geom = _new_geom(scene, mujoco.mjtGeom.mjGEOM_CAPSULE, start, radius, colour)
    mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_CAPSULE, radius, start, end)


def _ball(scene: Any, centre: Array, radius: float, colour: tuple[float, ...]) -> None:
    if np.isfinite(centre).all():
        _new_geom(scene, mujoco.mjtGeom.mjGEOM_SPHERE, centre, radius, colour)


def _new_geom(scene: Any, kind: int, pos: Array, radius: float, colour: tuple[float, ...]) -> Any:
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(geom, kind, np.full(3, radius), pos, np.eye(3).ravel(), np.array(colour, dtype=np.float32))
    scene.ngeom += 1
    return geom
