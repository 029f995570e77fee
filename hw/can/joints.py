"""The joint map: which motor moves which joint, and how the motor's angle and the joint's belong together.

It is the section ``can`` of robot.yaml. Hands are motors too: their joint angle is the opening, 0 closed to 1 open.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from naoimitate.calib.zeros import JointZeros, no_zeros
from naoimitate.core.errors import DriverError
from naoimitate.core.frames import SIDES, Array
from naoimitate.robot.model import RobotModel

HAND = -1
"""Stands for a joint's index where the motor opens a hand."""
HAND_SPEED = 2.0
"""Openings per s that a hand is moved with unless the map says otherwise."""


@dataclass(frozen=True)
class MotorEntry:
    """One motor as robot.yaml has it; ``lower``, ``upper`` and ``speed`` are the joint's where they are not given.

    motor angle = sign * gear * (joint angle + calibrated zero - zero).
    """

    id: int
    """Number of the motor on the bus."""
    sign: int = 1
    """1 or -1: whether the motor turns as the joint does."""
    gear: float = 1.0
    """Turns of the motor's angle per turn of the joint: 1 where the motor reports the angle behind its gears. For a
    hand: rad per full opening."""
    zero: float = 0.0
    """Joint angle (rad) at which the motor reads 0."""
    lower: float = float("nan")
    """rad, lowest joint angle that is sent."""
    upper: float = float("nan")
    """rad, highest joint angle that is sent."""
    speed: float = float("nan")
    """rad/s, fastest joint speed that is sent."""
    watchdog: float = 0.1
    """s without an answer after which the motor counts as silent."""
    hot: float = 75.0
    """deg C from which on an alarm tells of it, below what makes the motor switch off."""
    stiffness: float = 150.0
    """N m/rad at the joint when the stiffness is 1, for load compensation."""
    torque_constant: float = float("nan")
    """N m at the joint per A; without it torques are not measured."""


@dataclass(frozen=True)
class JointMap:
    """The motors of a robot as arrays; N motors, those of the J joints in the model's order, then the hands.

    names, nodes: of the motors. joint: (N,) index of the joint, HAND for a hand. hands: motor that opens the left and
    the right hand, or None. followers: (leader, follower) joints that share a motor. factor (N,) motor rad per joint
    rad, zero (N,) rad; lower, upper (N,) rad, speed (N,) rad/s, all of the joint; the rest as in ``MotorEntry``.
    """

    names: tuple[str, ...]
    nodes: tuple[int, ...]
    joint: npt.NDArray[np.int64]
    hands: tuple[int | None, int | None]
    followers: tuple[tuple[int, int], ...]
    factor: Array
    zero: Array
    lower: Array
    upper: Array
    speed: Array
    watchdog: Array
    hot: Array
    stiffness: Array
    torque_constant: Array

    def __len__(self) -> int:
        return len(self.nodes)

    def title(self, motor: int) -> str:
        """How people know a motor."""
        return f"motor {self.nodes[motor]} ({self.names[motor]})"

    def to_motor(self, angles: Array) -> Array:
        """Motor angles (N,) rad of joint angles (N,) rad."""
        return np.asarray(self.factor * (angles - self.zero))

    def from_motor(self, angles: Array) -> Array:
        """Joint angles (N,) rad of motor angles (N,) rad."""
        return np.asarray(angles / self.factor + self.zero)

    def gather(self, q: Array, opening: Array) -> Array:
        """Joint angles (N,) rad by motor from those of the model (J,) and the hand openings (2,)."""
        angles = np.asarray(q[self.joint])
        for motor, value in zip(self.hands, opening, strict=True):
            if motor is not None:
                angles[motor] = value
        return angles

    def scatter(self, values: Array) -> Array:
        """Values (J,) by joint from those by motor (N,); the follower of a shared motor has its leader's."""
        joints = np.full(len(self) - sum(hand is not None for hand in self.hands) + len(self.followers), np.nan)
        own = self.joint != HAND
        joints[self.joint[own]] = values[own]
        for leader, follower in self.followers:
            joints[follower] = joints[leader]
        return joints


def read_joint_map(robot: RobotModel, zeros: JointZeros | None = None) -> JointMap:
    """The joint map of a robot; zeros: what calibration found for this specimen, on top of robot.yaml's zeros.

    DriverError for a joint without a motor, and for a motor without a joint or twice on the bus.
    """
    section = robot.data.get("can")
    if not isinstance(section, dict):
        raise DriverError(
            f"{robot.name} has no joint map: add a section `can` to its robot.yaml, or use another driver"
        )
    joints, hands = _entries(section, "joints"), _entries(section, "hands")
    _check_names(robot, joints, hands)
    order = [(i, joints[name]) for i, name in enumerate(robot.joint_names) if name in joints]
    order += [(HAND, hands[name]) for name in hands]
    names = [robot.joint_names[i] for i, _ in order if i != HAND] + list(hands)
    return _build(robot, names, order, no_zeros(robot) if zeros is None else zeros)


def _entries(section: Mapping[str, Any], key: str) -> dict[str, MotorEntry]:
    """The motors of a part of the section, with its ``defaults`` filled in."""
    known = {field.name for field in fields(MotorEntry)}
    entries = {}
    for name, own in section.get(key, {}).items():
        values = {**section.get("defaults", {}), **own}
        if unknown := values.keys() - known:
            raise DriverError(f"robot.yaml, can: {name} has an unknown {min(unknown)!r}; known are {sorted(known)}")
        if "id" not in values or abs(values.get("sign", 1)) != 1 or not values.get("gear", 1.0) > 0.0:
            raise DriverError(f"robot.yaml, can: {name} needs an id, a sign of 1 or -1 and a positive gear")
        entries[name] = MotorEntry(**values)
    return entries


def _check_names(robot: RobotModel, joints: Mapping[str, MotorEntry], hands: Mapping[str, MotorEntry]) -> None:
    followers = {robot.joint_names[follower] for _, follower in robot.coupled}
    known = [(joints, robot.joint_names), (hands, robot.data.get("hands", {}).values())]
    for name in robot.joint_names:
        if name not in joints and name not in followers:
            raise DriverError(f"the joint {name} has no motor: add it to can, joints in the robot.yaml of {robot.name}")
    for name, names in [(name, names) for part, names in known for name in part]:
        if name not in names and name not in followers:
            raise DriverError(f"{robot.name} has no joint or hand {name!r}: correct the joint map")
        if name in followers:
            raise DriverError(f"{name} shares another joint's motor: remove it from the joint map")
    nodes = [entry.id for entry in [*joints.values(), *hands.values()]]
    if twice := {node for node in nodes if nodes.count(node) > 1}:
        raise DriverError(f"robot.yaml, can: two joints have the id {min(twice)}: give every motor its own")


def _build(robot: RobotModel, names: list[str], order: list[tuple[int, MotorEntry]], zeros: JointZeros) -> JointMap:
    entries = [entry for _, entry in order]
    joint = np.array([index for index, _ in order])
    by_side = robot.data.get("hands", {})
    hands = [names.index(by_side[side]) if by_side.get(side) in names else None for side in SIDES]

    def column(key: str) -> Array:
        return np.array([getattr(entry, key) for entry in entries], dtype=float)

    def limit(key: str, of_joint: Array, of_hand: float) -> Array:
        usual = np.where(joint == HAND, of_hand, of_joint[joint])
        return np.where(np.isnan(column(key)), usual, column(key))

    return JointMap(
        names=tuple(names),
        nodes=tuple(entry.id for entry in entries),
        joint=joint,
        hands=(hands[0], hands[1]),
        followers=robot.coupled,
        factor=column("sign") * column("gear"),
        zero=column("zero") - np.where(joint == HAND, 0.0, zeros.offsets[joint]),
        lower=limit("lower", robot.lower, 0.0),
        upper=limit("upper", robot.upper, 1.0),
        speed=limit("speed", robot.speed, HAND_SPEED),
        watchdog=column("watchdog"),
        hot=column("hot"),
        stiffness=column("stiffness"),
        torque_constant=column("torque_constant"),
    )
