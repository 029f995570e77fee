"""Putting a robot together: the URDF of one version and the data of both sides become one checked RobotModel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from naoimitate.core.errors import RobotModelError
from naoimitate.core.frames import SIDES
from naoimitate.robot.checks import check_model
from naoimitate.robot.model import Array, CouplingTable, Point, RobotModel
from naoimitate.robot.shapes import read_shapes, shape_pairs
from naoimitate.robot.urdf import Mechanism, read_mechanism, zero_frames

LIMBS = {
    "arm": ("shoulder", "elbow", "hand"),
    "leg": ("hip", "knee", "ankle", "sole"),
}
"""Points along a limb between which its length is measured."""
CHAINS = ("head", *(f"{side}_{limb}" for side in SIDES for limb in LIMBS))
POINTS = ("head", *(f"{side}_{point}" for side in SIDES for points in LIMBS.values() for point in (*points, "wrist")))


def build_model(version: str, urdf: str, data: dict[str, Any]) -> RobotModel:
    """RobotModel from the URDF of one version and data that are written out for both sides; checked."""
    require(data["points"], POINTS, "points")
    require(data["chains"], CHAINS, "chains")
    mechanism = read_mechanism(urdf)
    shapes = read_shapes(urdf, mechanism.frames)
    points = {name: _point(mechanism, name, value) for name, value in data["points"].items()}
    model = RobotModel(
        name=data["name"],
        version=version,
        urdf=urdf,
        joint_names=mechanism.joint_names,
        tree=mechanism.tree,
        lower=mechanism.lower,
        upper=mechanism.upper,
        speed=mechanism.speed,
        effort=mechanism.effort,
        coupled=mechanism.coupled,
        tables=tuple(_table(mechanism, table) for table in data["tables"]),
        points=points,
        chains={name: tuple(_joint(mechanism, j) for j in joints) for name, joints in data["chains"].items()},
        soles={side: np.array(outline, dtype=float) for side, outline in data["soles"].items()},
        shapes=shapes,
        pairs=shape_pairs(shapes, mechanism.tree.parent, mechanism.frames, data["collision"]["exclude"]),
        postures={name: _posture(mechanism, values) for name, values in data["postures"].items()},
        limb_length=_limb_lengths(mechanism, points),
        data=data,
    )
    check_model(model)
    return model


def require(section: Mapping[str, Any], keys: Sequence[str], where: str) -> None:
    """Raise RobotModelError when a section of robot.yaml lacks a key."""
    missing = [key for key in keys if key not in section]
    if missing:
        raise RobotModelError(f"{where}: {', '.join(missing)} missing, add to robot.yaml")


def _joint(mechanism: Mechanism, name: str) -> int:
    if name not in mechanism.joint_names:
        raise RobotModelError(f"robot.yaml names the joint {name!r}, which robot.urdf does not have: correct the name")
    return mechanism.joint_names.index(name)


def _point(mechanism: Mechanism, name: str, value: Mapping[str, Any]) -> Point:
    if value.get("link") not in mechanism.frames:
        raise RobotModelError(f"point {name!r} is on link {value.get('link')!r}, which robot.urdf does not have")
    frame = mechanism.frames[value["link"]]
    return Point(frame.joint, frame.pos + frame.rot @ np.array(value.get("at", (0.0, 0.0, 0.0)), dtype=float))


def _posture(mechanism: Mechanism, values: Mapping[str, float]) -> Array:
    q = np.zeros(len(mechanism.joint_names))
    for name, value in values.items():
        q[_joint(mechanism, name)] = value
    return q


def _table(mechanism: Mechanism, table: Mapping[str, Any]) -> CouplingTable:
    rows = np.array(table["rows"], dtype=float)
    return CouplingTable(_joint(mechanism, table["x"]), _joint(mechanism, table["y"]), rows)


def _limb_lengths(mechanism: Mechanism, points: Mapping[str, Point]) -> dict[str, float]:
    """Sum of the distances between a limb's points at the zero posture, m."""
    pos, rot = zero_frames(mechanism.tree)
    place = {name: pos[point.joint + 1] + rot[point.joint + 1] @ point.offset for name, point in points.items()}
    return {
        f"{side}_{limb}": sum(
            float(np.linalg.norm(place[f"{side}_{b}"] - place[f"{side}_{a}"])) for a, b in pairwise(names)
        )
        for side in SIDES
        for limb, names in LIMBS.items()
    }
