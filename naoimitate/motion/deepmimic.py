"""DeepMimic motions: JSON frames of [duration, root position, quaternions and hinge angles], y up, facing x."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import Array
from naoimitate.motion.clip import Clip, Skeleton, forward
from naoimitate.motion.text import decode

Joint = tuple[str, int, str, tuple[float, float, float]]
"""Name, parent (-1 root), type (none, spherical, revolute, fixed), attachment (3,) m in the parent."""

HUMANOID3D: tuple[Joint, ...] = (
    ("root", -1, "none", (0.0, 0.0, 0.0)),
    ("chest", 0, "spherical", (0.0, 0.236151, 0.0)),
    ("neck", 1, "spherical", (0.0, 0.223894, 0.0)),
    ("right_hip", 0, "spherical", (0.0, 0.0, 0.084887)),
    ("right_knee", 3, "revolute", (0.0, -0.421546, 0.0)),
    ("right_ankle", 4, "spherical", (0.0, -0.409870, 0.0)),
    ("right_shoulder", 1, "spherical", (-0.02405, 0.24350, 0.18311)),
    ("right_elbow", 6, "revolute", (0.0, -0.274788, 0.0)),
    ("right_wrist", 7, "fixed", (0.0, -0.258947, 0.0)),
    ("left_hip", 0, "spherical", (0.0, 0.0, -0.084887)),
    ("left_knee", 9, "revolute", (0.0, -0.421546, 0.0)),
    ("left_ankle", 10, "spherical", (0.0, -0.409870, 0.0)),
    ("left_shoulder", 1, "spherical", (-0.02405, 0.24350, -0.18311)),
    ("left_elbow", 12, "revolute", (0.0, -0.274788, 0.0)),
    ("left_wrist", 13, "fixed", (0.0, -0.258947, 0.0)),
)
"""The joints of data/characters/humanoid3d.txt of DeepMimic (Peng et al. 2018)."""
NUMBERS = {"none": 7, "spherical": 4, "revolute": 1, "fixed": 0}
"""How many numbers a frame has for a joint of each type; the root's are its position and quaternion."""
CHILDREN = ("spherical", "revolute", "fixed")
"""Types of joints below the root."""


def read_deepmimic(path: Path, data: bytes, skeleton: Path | None) -> Clip:
    """Read a DeepMimic motion; its skeleton is ``skeleton``, the file beside it, or the standard humanoid3d.

    Raises MotionFormatError when it is damaged or does not fit the skeleton.
    """
    frames, notes = _frames(decode(data))
    joints, note = _joints(path, skeleton)
    width = 1 + sum(NUMBERS[j[2]] for j in joints)
    if any(not isinstance(f, list) or len(f) != width for f in frames):
        raise MotionFormatError(f"the frames do not have the {width} numbers of the skeleton: name it with --skeleton")
    try:
        table = np.array(frames, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise MotionFormatError("the DeepMimic file has frames that are not numbers: get the complete file") from error
    nodes = Skeleton(
        names=tuple(j[0] for j in joints),
        parents=np.array([j[1] for j in joints]),
        offsets=np.array([j[3] for j in joints]),
        ends=np.array([j[2] == "fixed" for j in joints]),
    )
    positions, rotations = forward(nodes, table[:, 1:4], _rotations(table, joints))
    rate, time = _clock(table[:, 0])
    return Clip(
        "DeepMimic",
        nodes,
        positions,
        rotations,
        rate=rate,
        time=time,
        unit=1.0,
        up="y",
        notes=(*notes, note),
    )


def _frames(text: str) -> tuple[list[Any], list[str]]:
    """The frames, and a sentence when the file is cut off after some of them."""
    content, notes = _json(text), []
    if content is None and '"Frames"' in text:
        ends = [m.end() for m in re.finditer(r"\]", text)][-2:]  # the last frame that is complete, or the one before
        whole = (_json(text[:end] + "]}") for end in reversed(ends))
        content = next((c for c in whole if c is not None), None)
        notes = ["The file is cut off; its complete frames were read."]
    frames = content.get("Frames") if isinstance(content, dict) else None
    if not isinstance(frames, list) or not frames:
        raise MotionFormatError("the DeepMimic file has no complete frame, or is damaged: get the complete file")
    return frames, notes


def _json(text: str) -> Any:
    """The content of a JSON text, None when it is none."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def _clock(durations: Array) -> tuple[float | None, Array | None]:
    """Mean rate and time of every frame; None where the file's durations are no durations."""
    steps = durations[:-1]
    if not np.isfinite(steps).all() or (steps <= 0.0).any() or not len(steps):
        first = float(durations[0])
        return (1.0 / first if np.isfinite(first) and first > 0.0 else None), None
    time = np.concatenate([[0.0], np.cumsum(steps)])
    return float(len(steps) / time[-1]), time


def _joints(path: Path, skeleton: Path | None) -> tuple[tuple[Joint, ...], str]:
    """The skeleton's joints and where they are from."""
    if skeleton is not None:
        return _parse(skeleton), f"The skeleton is that of {skeleton.name}."
    for candidate in sorted(path.parent.glob("*humanoid3d*skeleton*.txt")) + sorted(path.parent.glob("humanoid3d.txt")):
        return _parse(candidate), f"The skeleton is that of {candidate.name}."
    return HUMANOID3D, "The skeleton is the standard humanoid3d."


def _parse(path: Path) -> tuple[Joint, ...]:
    try:
        entries = json.loads(decode(path.read_bytes()))["Skeleton"]["Joints"]
        joints = tuple(
            (
                str(j["Name"]),
                int(j["Parent"]),
                str(j["Type"]),
                (float(j["AttachX"]), float(j["AttachY"]), float(j["AttachZ"])),
            )
            for j in entries
        )
    except OSError as error:
        raise MotionFormatError(f"the skeleton {path} cannot be read: {error.strerror}") from error
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise MotionFormatError(f"the skeleton {path.name} is not a DeepMimic character: name another") from error
    tree = all(0 <= parent < i and kind in CHILDREN for i, (_, parent, kind, _) in enumerate(joints) if i)
    if not joints or joints[0][1:3] != (-1, "none") or not tree:
        raise MotionFormatError(f"the skeleton {path.name} has joints of an unknown type: name another")
    return joints


def _rotations(table: Array, joints: tuple[Joint, ...]) -> Array:
    """Rotations of the joints against their parents, (T, J, 3, 3); hinges turn about their z axis."""
    local = np.tile(np.eye(3), (len(table), len(joints), 1, 1))
    column = 4
    for i, (_, _, kind, _) in enumerate(joints):
        if kind == "revolute":
            local[:, i] = _turned(Rotation.from_rotvec, table[:, column, None] * np.array([0.0, 0.0, 1.0]))
            column += 1
        elif kind in ("none", "spherical"):
            local[:, i] = _turned(Rotation.from_quat, np.roll(table[:, column : column + 4], -1, axis=1))
            column += 4
    return local


def _turned(make: Any, values: Array) -> Array:
    """Rotation matrices (T, 3, 3), NaN where the numbers are no rotation."""
    size = np.linalg.norm(values, axis=1)
    good = np.isfinite(size) & ((size > 1e-6) if make == Rotation.from_quat else True)
    turned = np.full((len(values), 3, 3), np.nan)
    if good.any():
        turned[good] = make(values[good]).as_matrix()
    return turned
