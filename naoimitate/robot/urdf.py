"""From URDF text to flat arrays: joints, masses and frames as pinocchio reads them, in the order of the file."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from naoimitate.core.errors import RobotModelError
from naoimitate.robot.model import BASE, Array, Tree

Element = ElementTree.Element
NUMBERS = {"value", "ixx", "ixy", "ixz", "iyy", "iyz", "izz", "xyz", "rpy", "lower", "upper", "velocity", "effort"}
"""Attributes that hold numbers."""


class Frame(NamedTuple):
    """A URDF link as seen from the moving link that carries it: joint (-1 = base), rotation (3, 3), pos (3,) m."""

    joint: int
    rot: Array
    pos: Array


class Mechanism(NamedTuple):
    """What the URDF says; fields as in ``RobotModel``, and ``frames``: every URDF link by name."""

    joint_names: tuple[str, ...]
    tree: Tree
    lower: Array
    upper: Array
    speed: Array
    effort: Array
    coupled: tuple[tuple[int, int], ...]
    frames: dict[str, Frame]


def parse(urdf: str) -> Element:
    """XML tree of a URDF text; RobotModelError when it is no XML or no robot."""
    try:
        robot = ElementTree.fromstring(urdf.encode())
    except ElementTree.ParseError as error:
        raise RobotModelError(f"robot.urdf is not valid XML ({error}): correct the file") from error
    if robot.tag != "robot":
        raise RobotModelError(f"robot.urdf has the root element <{robot.tag}>: it must be <robot>")
    return robot


def read_mechanism(urdf: str) -> Mechanism:
    """Read a URDF text. Joints come in the order of the file, parents first; fixed joints weld their links together.

    Raises RobotModelError for a joint that is not revolute, a name that is given twice, a broken tree, limits that are
    reversed, and a moving link without mass or with an impossible inertia.
    """
    robot = parse(urdf)
    _check_structure(robot)
    model = _build(robot)
    names = _order(robot, model)
    ids = [model.getJointId(name) for name in names]
    row = {joint_id: j for j, joint_id in enumerate(ids)} | {1: BASE}
    frames = {
        frame.name: Frame(
            row[frame.parentJoint], np.array(frame.placement.rotation), np.array(frame.placement.translation)
        )
        for frame in model.frames
        if frame.type == pin.FrameType.BODY
    }
    lower, upper = model.lowerPositionLimit[7:], model.upperPositionLimit[7:]
    speed, effort = model.velocityLimit[6:], model.effortLimit[6:]
    place = [model.joints[joint_id].idx_v - 6 for joint_id in ids]
    mechanism = Mechanism(
        joint_names=names,
        tree=_tree(model, ids, row),
        lower=lower[place],
        upper=upper[place],
        speed=speed[place],
        effort=effort[place],
        coupled=_coupled(robot, names),
        frames=frames,
    )
    _check_limits(mechanism)
    _check_masses(model, [1, *ids])
    return mechanism


def zero_frames(tree: Tree) -> tuple[Array, Array]:
    """Link frames in the base frame at q = 0: pos (J + 1, 3) m, rot (J + 1, 3, 3), row 0 the base."""
    count = len(tree.parent)
    pos, rot = np.zeros((count + 1, 3)), np.tile(np.eye(3), (count + 1, 1, 1))
    for j, parent in enumerate(tree.parent + 1):
        pos[j + 1] = pos[parent] + rot[parent] @ tree.pos[j]
        rot[j + 1] = rot[parent] @ tree.rot[j]
    return pos, rot


def _check_structure(robot: Element) -> None:
    """Names, joint types and the tree, so that the reader behind us has nothing to complain about."""
    links = [link.get("name", "") for link in robot.findall("link")]
    names = [joint.get("name", "") for joint in robot.findall("joint")]
    for name in {*links, *names}:
        if (links + names).count(name) > 1:
            raise RobotModelError(f"robot.urdf gives the name {name!r} twice, to links or joints: rename one of them")
    _check_numbers(robot)
    children = [_check_joint(joint, links) for joint in robot.findall("joint")]
    roots = [link for link in links if link not in children]
    if len(roots) != 1 or len(set(children)) != len(children):
        raise RobotModelError(
            f"robot.urdf is no tree with one base link (roots: {roots}): give each link one parent joint"
        )


def _check_numbers(robot: Element) -> None:
    """Masses, inertias, limits, axes and places: a number must be one, and finite."""
    for owner in robot.findall("link") + robot.findall("joint"):
        for element in owner.iter():
            for key in NUMBERS & set(element.keys()):
                if not all(_is_finite(word) for word in element.get(key, "").split()):
                    raise RobotModelError(
                        f"robot.urdf, {owner.tag} {owner.get('name')!r}: "
                        f"<{element.tag} {key}={element.get(key)!r}> is no number, correct it"
                    )


def _is_finite(word: str) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def _check_joint(joint: Element, links: list[str]) -> str:
    """Child link of a joint that can be used."""
    name, kind = joint.get("name", ""), joint.get("type")
    if kind not in ("revolute", "fixed") or (kind == "revolute" and joint.find("limit") is None):
        raise RobotModelError(
            f"joint {name!r} ({kind}): only fixed joints and revolute joints with a <limit> can be used"
        )
    ends = []
    for tag in ("parent", "child"):
        element = joint.find(tag)
        ends.append("" if element is None else element.get("link", ""))
        if ends[-1] not in links:
            raise RobotModelError(f"joint {name!r}: its {tag} link {ends[-1]!r} does not exist, correct the name")
    return ends[1]


def _build(robot: Element) -> Any:
    """Pinocchio model with a free-flyer root (a fixed one would drop the mass of the base), without geometry."""
    skeleton = ElementTree.fromstring(ElementTree.tostring(robot))
    for link in skeleton.findall("link"):
        for geometry in link.findall("visual") + link.findall("collision"):
            link.remove(geometry)
    try:
        return pin.buildModelFromXML(ElementTree.tostring(skeleton, encoding="unicode"), pin.JointModelFreeFlyer())
    except (ValueError, RuntimeError) as error:
        raise RobotModelError(
            f"robot.urdf cannot be read ({' '.join(str(error).split())}): correct the file"
        ) from error


def _order(robot: Element, model: Any) -> tuple[str, ...]:
    """Names of the moving joints as the file lists them, but each after its parent."""
    waiting = [joint.get("name", "") for joint in robot.findall("joint") if joint.get("type") == "revolute"]
    placed = {"universe", "root_joint"}
    names: list[str] = []
    while waiting:
        name = next(n for n in waiting if model.names[model.parents[model.getJointId(n)]] in placed)
        waiting.remove(name)
        placed.add(name)
        names.append(name)
    return tuple(names)


def _tree(model: Any, ids: list[int], row: dict[int, int]) -> Tree:
    parent = np.array([row[model.parents[i]] for i in ids], dtype=np.int64)
    ancestor = np.eye(len(ids), dtype=np.bool_)
    for j, before in enumerate(parent):
        if before != BASE:
            ancestor[j] |= ancestor[before]
    bodies = [model.inertias[i] for i in [1, *ids]]
    return Tree(
        parent=parent,
        pos=np.array([model.jointPlacements[i].translation for i in ids]),
        rot=np.array([model.jointPlacements[i].rotation for i in ids]),
        axis=np.array([model.joints[i].createData().S[3:].ravel() for i in ids]),
        mass=np.array([body.mass for body in bodies]),
        com=np.array([body.lever for body in bodies]),
        ancestor=ancestor,
    )


def _coupled(robot: Element, names: tuple[str, ...]) -> tuple[tuple[int, int], ...]:
    """(leader, follower) of every mimic element; one motor for two joints means equal angles."""
    pairs = []
    for joint in robot.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is None:
            continue
        name, leader = joint.get("name", ""), mimic.get("joint", "")
        if leader not in names or float(mimic.get("multiplier", 1)) != 1.0 or float(mimic.get("offset", 0)) != 0.0:
            raise RobotModelError(f"joint {name!r} mimics {leader!r}: only an existing joint, multiplier 1, offset 0")
        pairs.append((names.index(leader), names.index(name)))
    return tuple(pairs)


def _check_limits(mechanism: Mechanism) -> None:
    for j, name in enumerate(mechanism.joint_names):
        if not mechanism.lower[j] < mechanism.upper[j]:
            raise RobotModelError(f"joint {name!r}: its lower limit is not below its upper limit, swap them")
        if not (mechanism.speed[j] > 0.0 and mechanism.effort[j] > 0.0):
            raise RobotModelError(f"joint {name!r}: velocity and effort limits must be above 0, write them")
    for leader, follower in mechanism.coupled:
        if mechanism.speed[leader] != mechanism.speed[follower]:
            raise RobotModelError(f"joint {mechanism.joint_names[follower]!r}: its speed differs from its leader's")


def _check_masses(model: Any, ids: list[int]) -> None:
    """Every moving link needs a mass and an inertia that a real body can have (Wensing et al. 2018, triangle rule)."""
    for i in ids:
        body = model.inertias[i]
        link = "the base link" if i == 1 else f"the link behind joint {model.names[i]!r}"
        moments = np.linalg.eigvalsh(body.inertia)
        if body.mass <= 0.0:
            raise RobotModelError(f"{link} has no mass: write its <inertial>")
        if moments[0] <= 0.0 or moments[0] + moments[1] < moments[2]:
            raise RobotModelError(f"{link} has an inertia that no body can have: correct it")
