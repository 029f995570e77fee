"""Fingers of the simulated robot, from the ``fingers`` of its data: bent capsules on hinges, one servo a hand.

They have no mass to speak of (it is in the hand's link) and touch nothing of the robot and not the floor, where the
shape of the closed fist stands for them; the objects of a scene they grip. Names: joints ``l_finger_`` and the digit's
name, actuators ``l_fingers``, sites ``l_grip`` in the middle of what a hand holds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np

from naoimitate.core.errors import RobotModelError
from naoimitate.core.frames import SIDES, Array
from naoimitate.robot.model import RobotModel
from naoimitate.sim.contacts import CONTACT_SOLREF, FLOOR, HIDDEN_GROUP, OBJECTS, SHAPE_GROUP
from naoimitate.sim.coupling import couple_joints
from naoimitate.sim.force_sensors import SENSOR_GROUP
from naoimitate.sim.scene import SIDE_COLOUR

DIGIT_MASS, DIGIT_INERTIA = 1e-10, 1e-14
"""kg and kg m^2, of one finger: MuJoCo wants some; six of them are far below the last digit of a robot's mass."""

MOTOR_INERTIA, DIGIT_ARMATURE = 1e-4, 1e-5
"""kg m^2 at the hinge of the digit that the motor turns and of the others. A coreless 16 mm motor has a rotor of about
1e-7 kg m^2; times the square of a gear ratio of 36 (NAO's hand) 1.3e-4."""

SERVO_STIFFNESS, SERVO_DAMPING = 2.0, 0.04
"""Of the servo that closes a hand, N m/rad and N m s/rad: stiff, so that the grip is its torque limit."""

GRIP_DIMENSIONS = 4
"""MuJoCo's ``condim``: friction against sliding and against turning about the normal, as a soft fingertip has it."""

GRIP_SOLIMP = (0.99, 0.999)
"""MuJoCo's ``solimp``, smallest and largest: so hard that nothing creeps out of a hand that is waved."""

TURNING_FRICTION = 0.005
"""m: radius of the patch that a soft fingertip makes, roughly."""


@dataclass(frozen=True)
class Digit:
    """A finger or thumb: capsules of ``radius`` (m) along ``points`` (K, 3) m in the frame of the hand's link, as they
    are with the hand closed. It opens about ``axis`` (3,) through the first point."""

    name: str
    radius: float
    axis: Array
    points: Array


@dataclass(frozen=True)
class Hand:
    """One hand of a robot, as its data have it.

    link: URDF link that carries it. fist: name of the shape that stands for the closed hand. opening_angle: rad
    between closed and open, of all digits. opening_time: s from closed to open, with nothing in the way. torque: N m
    of the motor. friction: coefficient between hand and objects. grip: (3,) m, middle of what it holds. palm: radius
    (m) and points (K, 3) m of capsules that do not move.
    """

    link: str
    fist: str
    opening_angle: float
    opening_time: float
    torque: float
    friction: float
    grip: Array
    palm: tuple[tuple[float, Array], ...]
    digits: tuple[Digit, ...]


def read_hands(robot: RobotModel) -> dict[str, Hand]:
    """Hands by side, none for a robot without ``fingers``; RobotModelError for data that make no hand."""
    sections = robot.data.get("fingers") or {}
    try:
        hands = {side: _hand(sections[side]) for side in SIDES if side in sections}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise RobotModelError(f"fingers of {robot.name}: {error!r}; compare them with a built-in robot's") from error
    shapes = {shape.name for shape in robot.shapes}
    for side, hand in hands.items():
        if hand.fist not in shapes:
            raise RobotModelError(f"fingers {side!r}: the robot has no shape {hand.fist!r} that could be the fist")
        if not hand.digits or min(hand.opening_angle, hand.opening_time, hand.torque) <= 0.0:
            raise RobotModelError(f"fingers {side!r}: give digits, and an opening angle, time and torque above 0")
    return hands


def _hand(section: Mapping[str, Any]) -> Hand:
    numbers = {key: float(section[key]) for key in ("opening_angle", "opening_time", "torque", "friction")}
    return Hand(
        link=str(section["link"]),
        fist=str(section["fist"]),
        grip=_vectors(section["grip"], 1)[0],
        palm=tuple((float(bone["radius"]), _vectors(bone["points"], 2)) for bone in section["palm"]),
        digits=tuple(
            Digit(name, float(digit["radius"]), _vectors(digit["axis"], 1)[0], _vectors(digit["points"], 2))
            for name, digit in section["digits"].items()
        ),
        **numbers,
    )


def _vectors(value: Any, least: int) -> Array:
    """Rows (K, 3) of a vector or a list of at least so many."""
    rows = np.atleast_2d(np.array(value, dtype=float))
    if rows.shape[1] != 3 or len(rows) < least:
        raise ValueError(f"{value} should be {least} or more [x, y, z]")
    return rows


def add_fingers(spec: mujoco.MjSpec, robot: RobotModel) -> None:
    """Add palm, digits and servo of each hand; the fist's shape stays for the floor and the robot's own body."""
    for side, hand in read_hands(robot).items():
        link = spec.body(hand.link)
        if link is None:
            raise RobotModelError(f"fingers {side!r} are on link {hand.link!r}, which robot.urdf does not have")
        fist = spec.geom(hand.fist)
        fist.conaffinity, fist.group = FLOOR, HIDDEN_GROUP
        link.add_site(name=grip_name(side), pos=hand.grip, group=SENSOR_GROUP)
        for radius, points in hand.palm:
            _add_capsules(link, side, hand, radius, points)
        for digit in hand.digits:
            _add_digit(spec, link, side, hand, digit)
        _add_servo(spec, side, hand)


def _add_digit(spec: mujoco.MjSpec, link: Any, side: str, hand: Hand, digit: Digit) -> None:
    """A body of its own in the frame of the hand's link, coupled to the first digit."""
    body = link.add_body(name=joint_name(side, digit), explicitinertial=True)
    body.mass, body.inertia, body.ipos = DIGIT_MASS, [DIGIT_INERTIA] * 3, digit.points[0]
    leads = digit is hand.digits[0]
    body.add_joint(
        name=joint_name(side, digit),
        type=mujoco.mjtJoint.mjJNT_HINGE,
        pos=digit.points[0],
        axis=digit.axis,
        armature=MOTOR_INERTIA if leads else DIGIT_ARMATURE,
    )
    _add_capsules(body, side, hand, digit.radius, digit.points)
    if not leads:
        couple_joints(spec, joint_name(side, digit), joint_name(side, hand.digits[0]))


def _add_capsules(body: Any, side: str, hand: Hand, radius: float, points: Array) -> None:
    for start, end in pairwise(points):
        geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=np.concatenate([start, end]), group=SHAPE_GROUP)
        geom.size, geom.mass, geom.material = [radius, 0.0, 0.0], 0.0, SIDE_COLOUR[side]
        geom.contype, geom.conaffinity = 0, OBJECTS
        geom.priority = 1  # the skin of the hand decides about the grip, whatever the object is of
        geom.condim, geom.friction[:2] = GRIP_DIMENSIONS, [hand.friction, TURNING_FRICTION]
        geom.solref, geom.solimp[:2] = CONTACT_SOLREF, GRIP_SOLIMP


def _add_servo(spec: mujoco.MjSpec, side: str, hand: Hand) -> None:
    leader = joint_name(side, hand.digits[0])
    servo = spec.add_actuator(name=servo_name(side), target=leader, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    servo.set_to_position(kp=SERVO_STIFFNESS, kv=SERVO_DAMPING)
    servo.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
    servo.forcerange = [-hand.torque, hand.torque]


def joint_name(side: str, digit: Digit) -> str:
    """Name of the hinge and of the body of a digit."""
    return f"{side}_finger_{digit.name}"


def servo_name(side: str) -> str:
    """Name of the actuator that closes a hand."""
    return f"{side}_fingers"


def grip_name(side: str) -> str:
    """Name of the site in the middle of what a hand holds."""
    return f"{side}_grip"
