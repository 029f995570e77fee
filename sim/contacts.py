"""What touches what: the soles stand on points of their true outline, body shapes meet the floor and each other.

Among the body's shapes only ``RobotModel.pairs`` can touch. The floor meets all that has the bit ``FLOOR`` in its
conaffinity, the sole points and the shapes; those of the feet leave the floor to the sole points. Free objects of a
scene (with MuJoCo's usual contype and conaffinity, 1) meet each other and the bit ``OBJECTS``: floor, shapes, fingers.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from naoimitate.core.frames import SIDES, Array
from naoimitate.robot.model import RobotModel, Shape

SOLE_BALL = 0.003
"""Radius of the balls under a sole, m. Their lowest points lie in the sole plane at corners of the outline, so the
area that carries is the outline; MuJoCo would give a mesh just three contact points with a plane."""

OUTLINE_TOLERANCE = 0.001
"""Corners of the outline are left out while the area that carries shrinks inwards by no more than this, m."""

CONTACT_SOLREF = (0.005, 1.0)
"""Time constant (s) and damping ratio of contacts: a standing robot sinks in by less than 0.1 mm."""

SHAPE_GROUP, HIDDEN_GROUP = 0, 3
"""MuJoCo's geom groups: shapes are drawn; sole balls, and fists in whose place fingers are drawn, not."""

OBJECTS, FLOOR = 1, 2
"""Bits of MuJoCo's contype and conaffinity: free objects of a scene, and the floor."""


def add_shapes(spec: mujoco.MjSpec, bodies: dict[int, Any], robot: RobotModel, friction: float) -> None:
    """Add the body's shapes and the pairs of them that can touch."""
    feet = {robot.points[f"{side}_sole"].joint for side in SIDES}
    for shape in robot.shapes:
        geom = bodies[shape.joint].add_geom(name=shape.name, group=SHAPE_GROUP, **_geometry(shape))
        geom.contype, geom.conaffinity = 0, OBJECTS if shape.joint in feet else OBJECTS | FLOOR
        geom.friction[0] = friction
        geom.solref = CONTACT_SOLREF
        geom.mass = 0.0  # masses come from the URDF
    for first, second in robot.pairs:
        names = robot.shapes[first].name, robot.shapes[second].name
        pair = spec.add_pair(name=f"{names[0]}-{names[1]}", geomname1=names[0], geomname2=names[1])
        pair.friction[:2] = friction
        pair.solref = CONTACT_SOLREF


def _geometry(shape: Shape) -> dict[str, Any]:
    if shape.kind == "capsule":
        ends = np.concatenate([shape.p0, shape.p1])
        return {"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "fromto": ends, "size": [shape.radius, 0.0, 0.0]}
    if shape.kind == "sphere":
        return {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "pos": shape.p0, "size": [shape.radius, 0.0, 0.0]}
    return {"type": mujoco.mjtGeom.mjGEOM_BOX, "pos": shape.p0, "size": shape.half}


def add_soles(bodies: dict[int, Any], robot: RobotModel, friction: float) -> None:
    """Add the balls on which each sole stands, on a massless body ``l_plate``, ``r_plate`` in the sole frame.

    A body of its own, because force sensors measure all that its body bears: a foot that the other one presses
    sideways does not stand.
    """
    for side in SIDES:
        point = robot.points[f"{side}_sole"]
        plate = bodies[point.joint].add_body(name=plate_name(side), pos=point.offset)
        for number, corner in enumerate(carrying_corners(robot.soles[side])):
            ball = plate.add_geom(
                name=f"{side}_sole_{number}",
                type=mujoco.mjtGeom.mjGEOM_SPHERE,
                pos=[*corner, SOLE_BALL],
                size=[SOLE_BALL, 0.0, 0.0],
                group=HIDDEN_GROUP,
            )
            ball.contype, ball.conaffinity, ball.mass = 0, FLOOR, 0.0
            ball.friction[0] = friction
            ball.solref = CONTACT_SOLREF


def plate_name(side: str) -> str:
    """Name of the body that carries the balls under a sole."""
    return f"{side}_plate"


def carrying_corners(outline: Array) -> Array:
    """Corners (K, 2) m of a convex outline (N, 2) that hold the sole up; hull within OUTLINE_TOLERANCE of it."""
    kept = list(range(len(outline)))
    while len(kept) > 3:
        costs = [_lost_width(outline, kept[i - 1], kept[(i + 1) % len(kept)]) for i in range(len(kept))]
        best = int(np.argmin(costs))
        if costs[best] > OUTLINE_TOLERANCE:
            break
        del kept[best]
    return outline[kept]


def _lost_width(outline: Array, start: int, end: int) -> float:
    """How far the outline from corner start to corner end (going round) bulges over the straight line, m."""
    count = len(outline)
    between = [outline[(start + step) % count] for step in range((end - start) % count)]
    edge = outline[end] - outline[start]
    normal = np.array([edge[1], -edge[0]]) / np.linalg.norm(edge)
    return max(float(normal @ (corner - outline[start])) for corner in between)
