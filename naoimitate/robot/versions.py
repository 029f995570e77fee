"""Versions of a robot: the masses and motors that differ, merged into its URDF and its data."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from typing import Any

from naoimitate.core.errors import RobotModelError
from naoimitate.robot.mirror import Mirror
from naoimitate.robot.urdf import parse

INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
SECTIONS = ("links", "speed", "effort")
"""What a version may change: links (mass, com, inertia), joint speeds rad/s, joint efforts N m."""


def changes_of(data: Mapping[str, Any], version: str | None) -> tuple[str, dict[str, dict[str, Any]]]:
    """Name and changes of a version, those of the version that it is based on included.

    None = the default version. RobotModelError for a version that the robot does not have.
    """
    versions = data["versions"]
    name = data["default_version"] if version is None else version
    if name not in versions:
        raise RobotModelError(f"{data['name']} has no version {name!r}: choose one of {', '.join(map(str, versions))}")
    own = versions[name] or {}
    changes: dict[str, dict[str, Any]] = {section: {} for section in SECTIONS}
    if "base" in own:
        earlier = list(versions)[: list(versions).index(name)]
        if own["base"] not in earlier:
            raise RobotModelError(
                f"version {name!r} is based on {own['base']!r}: name one of those before it ({earlier})"
            )
        changes = changes_of(data, own["base"])[1]
    for section, values in own.items():
        if section not in (*SECTIONS, "base"):
            raise RobotModelError(f"version {name!r} changes {section!r}: it can change {', '.join(SECTIONS)}")
        if section != "base":
            changes[section] |= values
    return name, changes


def apply_changes(urdf: str, changes: Mapping[str, Mapping[str, Any]], mirror: Mirror) -> str:
    """URDF text with the changes of a version made, on both sides."""
    if not any(changes.values()):
        return urdf
    robot = parse(urdf)
    links = {link.get("name"): link for link in robot.findall("link")}
    joints = {joint.get("name"): joint for joint in robot.findall("joint")}
    for name, values in changes["links"].items():
        _change_link(_named(links, name), values, side=1.0)
        if mirror.name(name) not in changes["links"]:
            _change_link(_named(links, mirror.name(name)), values, side=-1.0)
    for section, attribute in (("speed", "velocity"), ("effort", "effort")):
        for name, value in mirror.magnitudes(changes[section]).items():
            _child(_named(joints, name), "limit").set(attribute, str(value))
    return ElementTree.tostring(robot, encoding="unicode")


def _change_link(link: ElementTree.Element, values: Mapping[str, Any], side: float) -> None:
    """Write mass, com, inertia; side -1 mirrors them: com y, ixy and iyz change sign."""
    inertial = _child(link, "inertial")
    if "mass" in values:
        _child(inertial, "mass").set("value", str(values["mass"]))
    if "com" in values:
        x, y, z = values["com"]
        _child(inertial, "origin").set("xyz", f"{x} {side * y} {z}")
    for key, value in zip(INERTIA, values.get("inertia", ()), strict=False):
        _child(inertial, "inertia").set(key, str(side * value if key in ("ixy", "iyz") else value))


def _named(elements: Mapping[str | None, ElementTree.Element], name: str) -> ElementTree.Element:
    if name not in elements:
        raise RobotModelError(f"a version changes {name!r}, which robot.urdf does not have: correct the name")
    return elements[name]


def _child(element: ElementTree.Element, tag: str) -> ElementTree.Element:
    child = element.find(tag)
    if child is None:
        raise RobotModelError(f"{element.get('name', element.tag)!r} has no <{tag}> in robot.urdf: write one")
    return child
