"""The right side of a robot from its left: names by prefix, signs of joint angles from the joint axes.

Reflection in the plane y = 0, M = diag(1, -1, 1), takes a rotation by q about a to one by -q about M a, that is by q
about (-a_x, a_y, -a_z). A right joint whose axis is that vector has the angle of its left twin, one with the opposite
axis has the negative angle. Nothing is mirrored that robot.yaml writes out for the right side.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from naoimitate.core.errors import RobotModelError
from naoimitate.robot.urdf import Mechanism, zero_frames

PLACE_TOLERANCE = 1e-4
"""Largest difference in m between a right joint's origin and its left twin's mirror image."""
AXIS_TOLERANCE = 1e-6
"""Largest difference from 1 of the cosine between a right joint's axis and its left twin's mirror image."""


class Mirror:
    """Left-right symmetry of one robot.

    prefixes: ``{"joints": [left, right], "links": [left, right]}`` or empty for a robot without symmetric names.
    """

    def __init__(self, mechanism: Mechanism, prefixes: Mapping[str, list[str]]) -> None:
        self._twin = _twins(mechanism.joint_names, prefixes.get("joints"))
        self._sign = _signs(mechanism, self._twin)
        self._twin |= _twins(mechanism.frames, prefixes.get("links"))

    def name(self, name: str) -> str:
        """The twin of a left joint or link; any other name is its own twin."""
        return self._twin.get(name, name)

    def names(self, names: Iterable[str]) -> list[str]:
        """The twins of joints or links, in order."""
        return [self.name(name) for name in names]

    def posture(self, values: Mapping[str, float]) -> dict[str, float]:
        """Joint angles by name, those of the right side added."""
        _known(values, self._sign)
        return {self.name(name): self._sign[name] * value for name, value in values.items()} | dict(values)

    def magnitudes(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Speeds, torques, ... by joint name, those of the right side added."""
        _known(values, self._sign)
        return {self.name(name): value for name, value in values.items()} | dict(values)

    def point(self, value: Mapping[str, Any]) -> dict[str, Any]:
        """A place ``at`` on a ``link``: the same on the other side."""
        x, y, z = value.get("at", (0.0, 0.0, 0.0))
        return {"link": self.name(value["link"]), "at": [x, -y, z]}

    def fingers(self, hand: Mapping[str, Any]) -> dict[str, Any]:
        """The shape of a hand: the same on the other side; a hinge's axis turns as a joint's (see above)."""

        def bone(value: Mapping[str, Any]) -> dict[str, Any]:
            moved = {"points": [[x, -y, z] for x, y, z in value["points"]]}
            if "axis" in value:
                x, y, z = value["axis"]
                moved["axis"] = [-x, y, -z]
            return {**value, **moved}

        x, y, z = hand["grip"]
        names = {key: self.name(hand[key]) for key in ("link", "fist")}
        digits = {name: bone(digit) for name, digit in hand["digits"].items()}
        return {**hand, **names, "grip": [x, -y, z], "palm": [bone(part) for part in hand["palm"]], "digits": digits}

    def table(self, table: Mapping[str, Any]) -> dict[str, Any]:
        """A coupling table (x, y, rows of x, y_min, y_max) for the twins of its joints."""
        x, y = table["x"], table["y"]
        _known((x, y), self._sign)
        rows = np.array(table["rows"], dtype=float)
        if self._sign[y] < 0.0:
            rows = np.column_stack((rows[:, 0], -rows[:, 2], -rows[:, 1]))
        if self._sign[x] < 0.0:
            rows = np.column_stack((-rows[::-1, 0], rows[::-1, 1:]))
        return {"x": self.name(x), "y": self.name(y), "rows": rows.tolist()}


def both_sides(data: Mapping[str, Any], mirror: Mirror) -> dict[str, Any]:
    """robot.yaml with everything of the right side written out."""
    full = dict(data)
    full["chains"] = _sided(data["chains"], mirror.names)
    full["points"] = _sided(data["points"], mirror.point)
    full["soles"] = _sided(data["soles"], lambda outline: [[x, -y] for x, y in reversed(outline)])
    full["postures"] = {name: mirror.posture(values or {}) for name, values in data["postures"].items()}
    full["stall_torque"] = mirror.magnitudes(data.get("stall_torque", {}))
    tables = list(data.get("tables", []))
    written = [(table["x"], table["y"]) for table in tables]
    twins = [mirror.table(table) for table in tables]
    full["tables"] = tables + [twin for twin in twins if (twin["x"], twin["y"]) not in written]
    if "fingers" in data:
        full["fingers"] = _sided(data["fingers"], mirror.fingers)
    groups = [list(group) for group in data.get("collision", {}).get("exclude", [])]
    full["collision"] = {"exclude": groups + [twin for g in groups if (twin := mirror.names(g)) not in groups]}
    return full


def _sided(section: Mapping[str, Any], mirrored: Callable[[Any], Any]) -> dict[str, Any]:
    """A section with keys ``l`` or ``l_...`` completed by the missing ``r`` or ``r_...``."""
    left = {key: value for key, value in section.items() if key == "l" or key.startswith("l_")}
    right = {"r" + key[1:]: mirrored(value) for key, value in left.items()}
    return {**section, **{key: value for key, value in right.items() if key not in section}}


def _known(names: Iterable[str], joints: Mapping[str, Any]) -> None:
    for name in names:
        if name not in joints:
            raise RobotModelError(f"robot.yaml names the joint {name!r}, which robot.urdf does not have: correct it")


def _twins(names: Iterable[str], prefixes: list[str] | None) -> dict[str, str]:
    if prefixes is None:
        return {}
    left, right = prefixes
    pairs = {name: right + name[len(left) :] for name in names if name.startswith(left)}
    return {name: twin for name, twin in pairs.items() if twin in set(names)}


def _signs(mechanism: Mechanism, twins: Mapping[str, str]) -> dict[str, float]:
    """Sign of every joint's angle in the mirror image of a posture."""
    pos, rot = zero_frames(mechanism.tree)
    axes = np.einsum("jab,jb->ja", rot[1:], mechanism.tree.axis)
    signs = {}
    for left, name in enumerate(mechanism.joint_names):
        twin = twins.get(name, name)
        right = mechanism.joint_names.index(twin)
        cosine = float(axes[left] * [-1.0, 1.0, -1.0] @ axes[right])
        apart = float(np.linalg.norm(pos[left + 1] * [1.0, -1.0, 1.0] - pos[right + 1]))
        if twin != name and (abs(abs(cosine) - 1.0) > AXIS_TOLERANCE or apart > PLACE_TOLERANCE):
            raise RobotModelError(
                f"joints {name!r} and {twin!r} are not mirror images at the zero posture: "
                "correct robot.urdf, or remove `mirror` and write out the right side in robot.yaml"
            )
        signs[name] = float(np.sign(cosine))
    return signs
