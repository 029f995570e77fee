"""Gravity compensation for position servos: command more than the posture, so that the sag ends up in the posture.

A position servo of stiffness k gives the torque ``k (q_command - q)``; it holds gravity only by hanging below its
command. With ``q_command = q + tau / k`` and tau the torque that gravity asks for at the posture q, it stands AT q.
Which torque that is depends on the feet: the weight goes into the ground through the stance sole, so the joints of the
stance leg carry everything above them, and those of a lifted leg just the leg.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from naoimitate.core.frames import SIDES, Array
from naoimitate.core.geometry import polygon_centroid
from naoimitate.core.physics import GRAVITY
from naoimitate.robot.kernel import center_of_mass, forward
from naoimitate.robot.model import RobotModel, Tree


class GravityCompensation:
    """Servo commands that stand at the planned posture instead of sagging below it; one object per robot."""

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        joints = len(robot.joint_names)
        self._pos, self._rot = np.zeros((joints + 1, 3)), np.zeros((joints + 1, 3, 3))
        self._com = np.zeros(3)
        self._moment, self._torque = np.zeros((joints, 4)), np.zeros(joints)
        self._feet = np.array([robot.points[f"{side}_sole"].joint for side in SIDES])
        self.sole_offset = np.array([_sole_centre(robot, side) for side in SIDES])
        self._sole = np.zeros((2, 3))
        self.share = np.zeros(2)
        """Share of the weight on the left and right sole in the posture that was asked for last."""
        self.torque(robot.postures["stand"], np.array([1.0, 0.0, 0.0, 0.0]), "D")  # compiles: no command waits for it

    def torque(self, q: Array, base_quat: Array, support: str) -> Array:
        """Torque (J,) N m that holds the posture still, clipped to the motors' limits.

        q: (J,) rad; base_quat: (4,) torso in the world; support: ``D``, ``L`` or ``R``, the feet that carry. The
        follower of a shared motor has 0, its leader the sum of both. In double support the feet share the weight as
        the centre of mass lies between the sole centres; each force acts where the sum of both passes through it.
        """
        robot = self._robot
        up = _up_in_base(base_quat)
        forward(robot.tree, q, self._pos, self._rot)
        center_of_mass(robot.tree, self._pos, self._rot, self._com)
        for side, foot in enumerate(self._feet):
            self._sole[side] = self._pos[foot + 1] + self._rot[foot + 1] @ self.sole_offset[side]
        share = self.share = share_of_weight(self._com, self._sole, up, support)
        _stance_torque(
            robot.tree, self._pos, self._rot, self._com, up, self._feet, self._sole, share, self._moment, self._torque
        )
        torque = self._torque.copy()
        for leader, follower in robot.coupled:
            torque[leader] += torque[follower]
            torque[follower] = 0.0
        return np.clip(torque, -robot.effort, robot.effort)

    def command(self, q: Array, base_quat: Array, support: str, stiffness: Array | float) -> Array:
        """Servo command (J,) rad that ends up at the posture q.

        stiffness: (J,) or one for all, N m/rad; the rest as ``torque``.
        """
        command = q + self.torque(q, base_quat, support) / stiffness
        for leader, follower in self._robot.coupled:
            command[follower] = command[leader]
        return np.asarray(command)


def share_of_weight(com: Array, soles: Array, up: Array, support: str) -> Array:
    """Share (2,) of the weight on the left and right sole: 1 for the stance foot, else as the CoM lies between them.

    com: (3,) m, soles: (2, 3) m sole centres, up: (3,) unit vector, all in one frame. With the feet in one place
    each takes half.
    """
    if support != "D":
        return np.array([1.0, 0.0]) if support == "L" else np.array([0.0, 1.0])
    line = soles[1] - soles[0]
    line = line - up * (up @ line)
    length = line @ line
    offset = 0.5 if length < 1e-8 else min(max(float((com - soles[0]) @ line / length), 0.0), 1.0)
    return np.array([1.0 - offset, offset])


def _sole_centre(robot: RobotModel, side: str) -> Array:
    """Centroid of a sole outline, (3,) m in the frame of the foot's link."""
    centroid = polygon_centroid(robot.soles[side])
    return np.asarray(robot.points[f"{side}_sole"].offset + np.array([*centroid, 0.0]))


def _up_in_base(quat: Array) -> Array:
    """World z (3,) in the torso frame: the last row of the rotation matrix of (w, x, y, z)."""
    w, x, y, z = quat
    return np.array([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])


@njit(cache=True)
def _stance_torque(
    tree: Tree,
    pos: Array,
    rot: Array,
    com: Array,
    up: Array,
    feet: Array,
    sole: Array,
    share: Array,
    moment: Array,
    torque: Array,
) -> None:
    """Fill torque (J,): dV/dq of the limbs minus what the ground gives back through the soles.

    For a joint with axis a at p, subtree mass m with first moment s: ``tau = a . ((s - m p) x g u)`` for the limb's
    weight, ``- a . ((c - p) x f u)`` for a sole force f u at c beyond the joint (u up, g gravity).
    """
    joints = len(torque)
    total = tree.mass.sum()
    for j in range(joints):
        moment[j, 3] = tree.mass[j + 1]
        moment[j, :3] = tree.mass[j + 1] * (pos[j + 1] + rot[j + 1] @ tree.com[j + 1])
    for j in range(joints - 1, -1, -1):
        if tree.parent[j] >= 0:
            moment[tree.parent[j]] += moment[j]
    middle = share[0] * sole[0] + share[1] * sole[1]
    shift = com - middle
    shift -= up * (up @ shift)
    for j in range(joints):
        lever = moment[j, :3] - moment[j, 3] * pos[j + 1]
        for side in range(2):
            if tree.ancestor[feet[side], j]:
                lever -= share[side] * total * (sole[side] + shift - pos[j + 1])
        axis = rot[j + 1] @ tree.axis[j]
        torque[j] = GRAVITY * (axis @ np.cross(lever, up))
