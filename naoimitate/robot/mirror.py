"""The right side of a robot from its left: names by prefix, signs of joint angles from the joint axes.

Reflection in the plane y = 0, M = diag(1, -1, 1), takes a rotation by q about a to one by -q about M a, that is by q
about (-a_x, a_y, -a_z). A right joint whose axis is that vector has the angle of its left twin, one with the opposite
axis has the negative angle. Nothing is mirrored that robot.yaml writes out for the right side.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from naoimitate.core.errors import RobotModelError
from naoimitate.robot.model import Array
from naoimitate.robot.urdf import Mechanism, zero_frames

PLACE_TOLERANCE = 1e-4
"""Largest difference in m between a right joint's origin and its left twin's mirror image."""


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

    def sign(self, joint: str) -> float:
        """+1 where twins have equal angles in a symmetric posture, -1 where opposite ones (a joint on the middle
        axis keeps its angle: a posture's mirror image is never made for it)."""
        return self._sign.get(joint, 1.0)

    def posture(self, values: Mapping[str, float]) -> dict[str, float]:
        """Joint angles by name with those of the right side added."""
        mirrored = {self.name(name): self.sign(name) * value for name, value in values.items()}
        return mirrored | dict(values)

    def magnitudes(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Speeds, torques, ... by joint or link name with those of the right side added."""
        return {self.name(name): value for name, value in values.items()} | dict(values)

    def names(self, names: Iterable[str]) -> list[str]:
        """The twins of joints or links, in order."""
        return [self.name(name) for name in names]

    def rows(self, x: str, y: str, rows: Array) -> Array:
        """Coupling rows (K, 3) of x, y_min, y_max for the twins of x and y."""
        if self.sign(y) < 0.0:
            rows = np.column_stack((rows[:, 0], -rows[:, 2], -rows[:, 1]))
        return rows if self.sign(x) > 0.0 else np.column_stack((-rows[::-1, 0], rows[::-1, 1:]))


def sided(section: Mapping[str, Any], mirror_value: Any) -> dict[str, Any]:
    """A section with keys ``l...`` completed by ``r...``, where ``mirror_value(value)`` is the right one's value."""
    out = dict(section)
    for key, value in section.items():
        if key == "l" or key.startswith("l_"):
            out.setdefault("r" + key[1:], mirror_value(value))
    return out


def _twins(names: Iterable[str], prefixes: list[str] | None) -> dict[str, str]:
    if prefixes is None:
        return {}
    left, right = prefixes
    pairs = {name: right + name[len(left) :] for name in names if name.startswith(left)}
    return {name: twin for name, twin in pairs.items() if twin in set(names)}


def _signs(mechanism: Mechanism, twins: Mapping[str, str]) -> dict[str, float]:
    pos, rot = zero_frames(mechanism.tree)
    axes = np.einsum("jab,jb->ja", rot[1:], mechanism.tree.axis)
    signs = {}
    for name, twin in twins.items():
        left, right = mechanism.joint_names.index(name), mechanism.joint_names.index(twin)
        cosine = float(axes[left] * [-1.0, 1.0, -1.0] @ axes[right])
        apart = float(np.linalg.norm(pos[left + 1] * [1.0, -1.0, 1.0] - pos[right + 1]))
        if abs(abs(cosine) - 1.0) > 1e-6 or apart > PLACE_TOLERANCE:
            raise RobotModelError(
                f"joints {name!r} and {twin!r} are not mirror images at the zero posture: "
                "correct robot.urdf, or remove `mirror` and write out the right side in robot.yaml"
            )
        signs[name] = float(np.sign(cosine))
    return signs
