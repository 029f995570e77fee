"""Human to humanoid posture mapping: equations (2) to (5) (Koenemann 2014, section IV)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from naoimitate.human.body import EFFECTORS, Body
from naoimitate.robot.kernel import forward
from naoimitate.robot.model import RobotModel

Array = npt.NDArray[np.float64]

_LIMBS = {"hand": "arm", "foot": "leg"}
_ROOTS = {"hand": "shoulder", "foot": "hip"}
_TIPS = {"hand": "hand", "foot": "sole"}


@dataclass(frozen=True)
class Mapping:
    """The references f_ref,H and f_ref,R, (4, 3) m, and the scale m, (4,), for l_hand, l_foot, r_hand, r_foot."""

    ref_human: Array
    ref_robot: Array
    scale: Array

    def targets(self, posture: Array) -> Array:
        """Robot posture targets (4, 3) m for a human posture (4, 3) m: f_R = f_ref,R + m (f_H - f_ref,H), (2)(3)(5)."""
        return np.asarray(self.ref_robot + self.scale[:, None] * (posture - self.ref_human))


def scales(robot: RobotModel, body: Body) -> Array:
    """Equation (4): m = l_limb,R / l_limb,H per kinematic chain, (4,)."""
    lengths = [robot.limb_length[f"{name[0]}_{_LIMBS[name[2:]]}"] for name in EFFECTORS]
    return np.array(lengths) / body.limb_lengths


def virtual_mapping(robot: RobotModel, body: Body, ref_human: Array) -> Mapping:
    """The mapping through a virtual T-pose: the human's reference direction at the robot's scale, limits ignored.

    With f_ref,R = m f_ref,H, (2) to (5) collapse to f_R = m f_H. A T-pose that the robot can reach would put targets
    out of reach elsewhere: a shoulder that stops short of the horizontal moves a hanging hand outwards by as much.
    """
    m = scales(robot, body)
    return Mapping(ref_human, m[:, None] * ref_human, m)


def reachable_mapping(robot: RobotModel, body: Body, ref_human: Array) -> Mapping:
    """The mapping through the robot's own calibration posture, as in the paper."""
    return Mapping(ref_human, robot_posture(robot, robot.postures["calibration"]), scales(robot, body))


def robot_posture(robot: RobotModel, q: Array) -> Array:
    """Equation (1) for the robot: (4, 3) m, hands from the shoulders and soles from the hips, torso frame."""
    n = len(robot.joint_names)
    pos, rot = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    forward(robot.tree, q, pos, rot)

    def place(name: str) -> Array:
        point = robot.points[name]
        return np.asarray(pos[point.joint + 1] + rot[point.joint + 1] @ point.offset)

    return np.array([place(f"{e[0]}_{_TIPS[e[2:]]}") - place(f"{e[0]}_{_ROOTS[e[2:]]}") for e in EFFECTORS])
