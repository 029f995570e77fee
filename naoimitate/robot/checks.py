"""What a robot's data must satisfy before anything is computed with them; every finding is one RobotModelError."""

from __future__ import annotations

import numpy as np

from naoimitate.core.errors import RobotModelError
from naoimitate.robot.model import BASE, RobotModel

COUPLING_TOLERANCE = 1e-6
"""rad; coupled joints of a posture are equal within this."""
LEGAL_POSTURES = ("stand", "calibration")
"""Postures that the program takes itself; the others may be for tests, or for the robot's own programs."""


def check_model(model: RobotModel) -> None:
    """Raise RobotModelError for chains, soles, coupling tables, shapes or postures that cannot be right."""
    _check_chains(model)
    _check_soles(model)
    _check_tables(model)
    _check_shapes(model)
    _check_postures(model)


def _check_chains(model: RobotModel) -> None:
    for name, chain in model.chains.items():
        before = [BASE, *chain[:-1]]
        for joint, parent in zip(chain, before, strict=True):
            if model.tree.parent[joint] != parent:
                raise RobotModelError(
                    f"chain {name!r}: joint {model.joint_names[joint]!r} does not follow the one before it; "
                    "write every joint from the base outwards"
                )
    for limb, end in (("arm", "hand"), ("leg", "sole")):
        for side in "lr":
            if model.points[f"{side}_{end}"].joint != model.chains[f"{side}_{limb}"][-1]:
                raise RobotModelError(f"point {side}_{end} is not on the last link of chain {side}_{limb}: correct one")


def _check_soles(model: RobotModel) -> None:
    for side in "lr":
        outline = model.soles.get(side)
        if outline is None or outline.ndim != 2 or outline.shape[0] < 3 or outline.shape[1] != 2:
            raise RobotModelError(f"sole {side!r}: give an outline of at least 3 points [x, y] in m")
        edge = np.roll(outline, -1, axis=0) - outline
        following = np.roll(edge, -1, axis=0)
        turn = edge[:, 0] * following[:, 1] - edge[:, 1] * following[:, 0]
        if np.all(turn < 0.0):
            raise RobotModelError(f"sole {side!r}: the outline runs clockwise, reverse the order of its points")
        around = np.sum(np.arctan2(turn, np.sum(edge * following, axis=1)))
        if not np.all(turn > 0.0) or not np.isclose(around, 2.0 * np.pi):
            raise RobotModelError(f"sole {side!r}: the outline is not convex, give the points of its convex hull")


def _check_tables(model: RobotModel) -> None:
    for table in model.tables:
        names = f"table {model.joint_names[table.x]} -> {model.joint_names[table.y]}"
        if table.rows.ndim != 2 or table.rows.shape[1] != 3 or np.any(np.diff(table.rows[:, 0]) <= 0.0):
            raise RobotModelError(f"{names}: rows must be [x, y_min, y_max] with increasing x")
        if np.any(table.rows[:, 1] > table.rows[:, 2]):
            raise RobotModelError(f"{names}: a row has y_min above y_max, swap them")


def _check_shapes(model: RobotModel) -> None:
    names = [shape.name for shape in model.shapes]
    for shape in model.shapes:
        if names.count(shape.name) > 1:
            raise RobotModelError(f"two shapes are called {shape.name!r}: give every collision its own name")
        size = shape.half.min() if shape.kind == "box" else shape.radius
        if size <= 0.0:
            raise RobotModelError(f"shape {shape.name!r} has no size: give its radius or box size in m")


def _check_postures(model: RobotModel) -> None:
    for name in ("zero", *LEGAL_POSTURES):
        if name not in model.postures:
            raise RobotModelError(f"posture {name!r} missing, add it to robot.yaml")
    for name, q in model.postures.items():
        for leader, follower in model.coupled:
            if abs(q[leader] - q[follower]) > COUPLING_TOLERANCE:
                raise RobotModelError(f"posture {name!r}: {model.joint_names[follower]!r} must equal its leader")
    for name in LEGAL_POSTURES:
        _check_legal(model, name)


def _check_legal(model: RobotModel, name: str) -> None:
    q = model.postures[name]
    outside = np.flatnonzero((q < model.lower) | (q > model.upper))
    if outside.size:
        raise RobotModelError(f"posture {name!r}: {model.joint_names[outside[0]]!r} is outside its limits")
    for table in model.tables:
        low, high = table.bounds(q[table.x])
        if not low <= q[table.y] <= high:
            raise RobotModelError(f"posture {name!r}: {model.joint_names[table.y]!r} is outside its coupling table")
