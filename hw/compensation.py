"""Load compensation for position servos: command more than the posture, so that the sag ends up in the posture.

A position servo of stiffness k gives the torque ``k (q_command - q)``; it holds a load only by hanging below its
command. With ``q_command = q + tau / k`` and tau the torque that weight and acceleration ask for at the posture q, it
stands AT q. Which torque that is depends on the feet: the force goes into the ground through the stance sole, so the
joints of the stance leg carry everything above them, and those of a lifted leg just the leg.

Links are point masses m at c, which an acceleration a makes feel the force ``m (g u + a)``, u up (d'Alembert). The
ground's force is their sum, and acts at the zero moment point, where their moments cancel.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from naoimitate.core.frames import SIDES, Array
from naoimitate.core.geometry import polygon_centroid
from naoimitate.core.physics import GRAVITY
from naoimitate.robot.kernel import forward
from naoimitate.robot.model import RobotModel, Tree


class LoadCompensation:
    """Servo commands that stand at the planned posture instead of sagging below it; one object per robot."""

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        joints = len(robot.joint_names)
        self._pos, self._rot = np.zeros((joints + 1, 3)), np.zeros((joints + 1, 3, 3))
        self._wrench, self._torque = np.zeros((joints + 1, 2, 3)), np.zeros(joints)
        self._still = np.zeros((joints + 1, 3))
        self._feet = np.array([robot.points[f"{side}_sole"].joint for side in SIDES])
        self.sole_offset = np.array([_sole_centre(robot, side) for side in SIDES])
        self._sole = np.zeros((2, 3))
        self.share = np.zeros(2)
        """Share of the ground's force on the left and right sole in the posture that was asked for last."""
        self.torque(robot.postures["stand"], np.array([1.0, 0.0, 0.0, 0.0]), "D")  # compiles: no command waits for it

    def torque(self, q: Array, base_quat: Array, support: str, acceleration: Array | None = None) -> Array:
        """Torque (J,) N m that a posture takes, clipped to the motors' limits.

        q: (J,) rad; base_quat: (4,) torso in the world; support: ``D``, ``L`` or ``R``, the feet that carry;
        acceleration: (J + 1, 3) m/s^2 of the links' centres of mass along the torso's axes, None at rest. The follower
        of a shared motor has 0, its leader the sum of both. In double support the feet share the force as the zero
        moment point lies between the sole centres; each part acts where the sum of both passes through that point.
        """
        robot = self._robot
        up = _up_in_base(base_quat)
        forward(robot.tree, q, self._pos, self._rot)
        for side, foot in enumerate(self._feet):
            self._sole[side] = self._pos[foot + 1] + self._rot[foot + 1] @ self.sole_offset[side]
        moving = self._still if acceleration is None else acceleration
        floor = self._sole.mean(axis=0) if support == "D" else self._sole["LR".index(support)]
        zmp, twist = _load(robot.tree, self._pos, self._rot, up, moving, floor, self._wrench)
        share = self.share = share_of_weight(zmp, self._sole, up, support)
        _stance_torque(
            robot.tree, self._pos, self._rot, zmp, twist, up, self._feet, self._sole, share, self._wrench, self._torque
        )
        torque = self._torque.copy()
        for leader, follower in robot.coupled:
            torque[leader] += torque[follower]
            torque[follower] = 0.0
        return np.clip(torque, -robot.effort, robot.effort)

    def command(
        self, q: Array, base_quat: Array, support: str, stiffness: Array | float, acceleration: Array | None = None
    ) -> Array:
        """Servo command (J,) rad that ends up at the posture q.

        stiffness: (J,) or one for all, N m/rad; the rest as ``torque``.
        """
        command = q + self.torque(q, base_quat, support, acceleration) / stiffness
        for leader, follower in self._robot.coupled:
            command[follower] = command[leader]
        return np.asarray(command)


def share_of_weight(point: Array, soles: Array, up: Array, support: str) -> Array:
    """Share (2,) of the weight on the left and right sole: 1 for the stance foot, else as a point lies between them.

    point: (3,) m, where the weight acts, soles: (2, 3) m sole centres, up: (3,) unit vector, all in one frame. With the
    feet in one place each takes half.
    """
    if support != "D":
        return np.array([1.0, 0.0]) if support == "L" else np.array([0.0, 1.0])
    line = soles[1] - soles[0]
    line = line - up * (up @ line)
    length = line @ line
    offset = 0.5 if length < 1e-8 else min(max(float((point - soles[0]) @ line / length), 0.0), 1.0)
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
def _load(
    tree: Tree, pos: Array, rot: Array, up: Array, acceleration: Array, floor: Array, wrench: Array
) -> tuple[Array, float]:
    """Fill wrench (J + 1, 2, 3); the zero moment point (3,) m in the plane of the floor, and the moment left there.

    All in the base frame. wrench: force (N) of the links from each one on outwards, and its moment (N m) about the
    base's origin; the base's own row is the whole robot's. floor: (3,) m, a point of the floor. The moment, N m, is
    about the upright: friction bears it.
    """
    for k in range(len(wrench)):
        force = tree.mass[k] * (GRAVITY * up + acceleration[k])
        wrench[k, 0], wrench[k, 1] = force, np.cross(pos[k] + rot[k] @ tree.com[k], force)
    for j in range(len(wrench) - 2, -1, -1):
        wrench[tree.parent[j] + 1] += wrench[j + 1]
    force, moment = wrench[0, 0], wrench[0, 1] - np.cross(floor, wrench[0, 0])
    zmp = floor + np.cross(up, moment) / (up @ force)
    return zmp, up @ (moment - np.cross(zmp - floor, force))


@njit(cache=True)
def _stance_torque(
    tree: Tree,
    pos: Array,
    rot: Array,
    zmp: Array,
    twist: float,
    up: Array,
    feet: Array,
    sole: Array,
    share: Array,
    wrench: Array,
    torque: Array,
) -> None:
    """Fill torque (J,): what moves the links beyond each joint, minus what the ground gives back through the soles.

    For a joint with axis a at p, with force f and moment n about the origin beyond it: ``tau = a . (n - p x f)``, and
    ``- s a . ((c - p) x F + t u)`` for the share s of the ground's force F at c beyond the joint and of its twist t.
    """
    middle = share[0] * sole[0] + share[1] * sole[1]
    shift = zmp - middle
    shift -= up * (up @ shift)
    ground = wrench[0, 0]
    for j in range(len(torque)):
        p = pos[j + 1]
        moment = wrench[j + 1, 1] - np.cross(p, wrench[j + 1, 0])
        for side in range(2):
            if tree.ancestor[feet[side], j]:
                moment -= share[side] * (np.cross(sole[side] + shift - p, ground) + twist * up)
        torque[j] = (rot[j + 1] @ tree.axis[j]) @ moment
