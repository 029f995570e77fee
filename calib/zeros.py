"""Joint zeros of one robot specimen: how far its encoders are off, kept in a small file and used by drivers only.

``servo angle = model angle + zero``: a joint that reads 0.02 rad where the model's drawing says 0 has a zero of 0.02.
The imitator knows nothing of it: it plans for the robot of the drawing, and the driver moves this one.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from naoimitate.core.errors import CalibrationError
from naoimitate.core.frames import Array
from naoimitate.robot.model import RobotModel

FORMAT = "naoimitate-zeros/1"

LARGEST = 0.35
"""[rad], 20 deg. A joint that is further off is mounted wrongly, or the file is in degrees."""


@dataclass(frozen=True)
class JointZeros:
    """The zeros of one robot: specimen, a name for people; offsets (J,) rad in the model's joint order."""

    specimen: str
    offsets: Array

    def to_servos(self, q: Array) -> Array:
        """Servo angles (..., J) rad that put this robot's links where the model's are at q."""
        return np.asarray(q + self.offsets)

    def from_servos(self, servos: Array) -> Array:
        """The model's joint angles (..., J) rad of what this robot's encoders say."""
        return np.asarray(servos - self.offsets)


def no_zeros(robot: RobotModel) -> JointZeros:
    """A robot that is as drawn."""
    return JointZeros("as drawn", np.zeros(len(robot.joint_names)))


def save_zeros(zeros: JointZeros, robot: RobotModel, path: str | Path) -> None:
    """Write the zeros that are not 0 as YAML, by joint name."""
    named = zip(robot.joint_names, zeros.offsets, strict=True)
    document = {
        "format": FORMAT,
        "robot": robot.name,
        "specimen": zeros.specimen,
        "zeros_rad": {name: round(float(zero), 6) for name, zero in named if zero != 0.0},
    }
    Path(path).write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")


def load_zeros(path: str | Path, robot: RobotModel) -> JointZeros:
    """Read the zeros of a robot; joints that are not named are 0.

    Raises CalibrationError where the file is missing, damaged, of another robot, names a joint that the robot does not
    have, has a zero beyond ``LARGEST``, or moves joints of one motor apart.
    """
    document = _document(path)
    if document.get("robot") != robot.name:
        raise CalibrationError(f"{path}: zeros of {document.get('robot')!r}, but the robot is {robot.name!r}")
    named = document.get("zeros_rad") or {}
    if not isinstance(named, dict):
        raise CalibrationError(f"{path}: zeros_rad must be a table of joint names and rad")
    offsets = np.zeros(len(robot.joint_names))
    for name, value in named.items():
        if name not in robot.joint_names:
            raise CalibrationError(f"{path}: {robot.name} has no joint {name!r}; correct the name or delete the line")
        offsets[robot.joint_names.index(name)] = _angle(path, name, value)
    for leader, follower in robot.coupled:
        if offsets[leader] != offsets[follower]:
            a, b = robot.joint_names[leader], robot.joint_names[follower]
            raise CalibrationError(f"{path}: {a} and {b} have one motor, and so must have the same zero")
    return JointZeros(str(document.get("specimen", "")), offsets)


def _document(path: str | Path) -> dict[str, object]:
    try:
        document = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise CalibrationError(f"{path}: no such file of joint zeros") from None
    except (OSError, UnicodeDecodeError, yaml.YAMLError):
        raise CalibrationError(f"{path}: cannot be read as a file of joint zeros (YAML)") from None
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise CalibrationError(f"{path}: not a file of joint zeros; its first line must be `format: {FORMAT}`")
    return document


def _angle(path: str | Path, name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
        raise CalibrationError(f"{path}: the zero of {name} is {value!r}, not a number of rad within {LARGEST}")
    return float(value)
