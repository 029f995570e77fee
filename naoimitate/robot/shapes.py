"""The body as convex shapes: the collision elements of the URDF, and which pairs of them must not overlap."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from naoimitate.core.errors import RobotModelError
from naoimitate.robot.model import BASE, Array, Shape
from naoimitate.robot.urdf import Element, Frame, parse


def read_shapes(urdf: str, frames: Mapping[str, Frame]) -> tuple[Shape, ...]:
    """All collision elements in the frames of the moving links, in the order of the file.

    A cylinder stands for the capsule with hemispheres at its ends. Raises RobotModelError for meshes, for boxes that
    are turned against the axes of their link, and for sizes that are missing.
    """
    return tuple(
        _shape(collision, frames[link.get("name", "")], link.get("name", ""))
        for link in parse(urdf).findall("link")
        for collision in link.findall("collision")
    )


def shape_pairs(
    shapes: tuple[Shape, ...],
    parent: npt.NDArray[np.int64],
    frames: Mapping[str, Frame],
    exclude: list[list[str]],
) -> npt.NDArray[np.int64]:
    """(P, 2) indices of shapes that must not overlap: all but those of one link, of parent and child, of one group.

    parent: (J,) as in ``Tree``. exclude: groups of URDF links. RobotModelError for a link that does not exist.
    """
    groups = [_joints_of(frames, group) for group in exclude]

    def may_overlap(a: int, b: int) -> bool:
        return (
            a == b
            or (a != BASE and parent[a] == b)
            or (b != BASE and parent[b] == a)
            or any(a in group and b in group for group in groups)
        )

    indexed = combinations(enumerate(shapes), 2)
    pairs = [(i, j) for (i, a), (j, b) in indexed if not may_overlap(a.joint, b.joint)]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _joints_of(frames: Mapping[str, Frame], links: list[str]) -> set[int]:
    for link in links:
        if link not in frames:
            raise RobotModelError(f"collision: exclude names link {link!r}, which robot.urdf does not have")
    return {frames[link].joint for link in links}


def _shape(collision: Element, frame: Frame, link: str) -> Shape:
    """One collision element; without a name it is called after its link."""
    name = collision.get("name", link)
    origin, geometry = collision.find("origin"), collision.find("geometry/*")
    rot = frame.rot @ pin.rpy.rpyToMatrix(_numbers(origin, "rpy", "0 0 0"))
    centre = frame.pos + frame.rot @ _numbers(origin, "xyz", "0 0 0")
    kind = "" if geometry is None else geometry.tag
    radius = float(_numbers(geometry, "radius", "0")[0])
    none = np.zeros(3)
    if kind == "sphere":
        return Shape(name, frame.joint, "sphere", centre, centre, radius, none)
    if kind == "cylinder":
        arm = 0.5 * float(_numbers(geometry, "length", "0")[0]) * rot[:, 2]
        return Shape(name, frame.joint, "capsule", centre - arm, centre + arm, radius, none)
    if kind == "box" and np.allclose(rot, np.eye(3), atol=1e-9):
        return Shape(name, frame.joint, "box", centre, centre, 0.0, 0.5 * _numbers(geometry, "size", "0 0 0"))
    raise RobotModelError(
        f"collision {name!r} of link {link!r}: use a sphere, a cylinder, or a box along the link's axes"
    )


def _numbers(element: Element | None, key: str, default: str) -> Array:
    """Numbers of an XML attribute."""
    text = default if element is None else element.get(key, default)
    try:
        return np.array([float(word) for word in text.split()])
    except ValueError as error:
        raise RobotModelError(f"robot.urdf: {key}={text!r} are not numbers, correct them") from error
