"""The gate between a method and a driver: no command reaches a robot that is impossible, too fast or would tip it.

Nothing that a command says about itself is believed: balance and feet are computed again from its joints and torso. The
gate is a pure function with the state that it needs; a refused command means that the last accepted one is held, which
is safe, since it passed.

A method that goes on while its commands are refused may be too far away to be followed at once when they are good
again. ``catch_up`` then gives the robot a way of its own: calm steps towards it, each as safe as any command.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.balance.legs import LegLimits, Legs, build_legs
from naoimitate.between import Between
from naoimitate.command_limits import PACE, CommandLimits, Refusal
from naoimitate.core.frames import Array, RobotCommand
from naoimitate.core.geometry import matrix_from_quat
from naoimitate.gate import GateModel, build_gate, outline_travel, range_excess, speed_ratio, support_margin
from naoimitate.robot.kernel import center_of_mass, forward
from naoimitate.robot.model import RobotModel, Tree

__all__ = ["CommandGate", "CommandLimits", "Feet", "GateState", "Refusal", "Verdict"]

CARRIES = {"D": (True, True), "L": (True, False), "R": (False, True)}
"""Which feet, left and right, carry the robot in each support."""


class Feet(NamedTuple):
    """What a pose does to the floor, computed from joints and torso; soles in the world: left, right.

    margin: m, of the CoM inside the stance outlines. off: m, largest distance of a stance outline point from the floor.
    under: m, deepest sole point under the floor. pos: (2, 3) m and rot: (2, 3, 3), the soles.
    """

    margin: float
    off: float
    under: float
    pos: Array
    rot: Array


@dataclass(frozen=True)
class GateState:
    """What the gate remembers. Make the first one with ``CommandGate.begin``.

    q: (J,) rad, where the robot is told to be. velocity: (J,) rad/s of the last accepted step, 0 after a refusal.
    time: s, of the last accepted command; -inf before the first. held: s of real time since it was accepted. lead: s by
    which the clock of the commands has run ahead of the real one. planted: the soles (2, 3) m, (2, 3, 3) as they were
    when both carried for the first time since one did not; None while one does not. accepted: the command in force.
    newest: the last well-formed command, accepted or not.
    """

    q: Array
    velocity: Array
    time: float = -math.inf
    held: float = 0.0
    lead: float = 0.0
    planted: tuple[Array, Array] | None = None
    accepted: RobotCommand | None = None
    newest: RobotCommand | None = None


class Verdict(NamedTuple):
    """The state after a command; what may be handed over, the command or a step towards it; why not the command."""

    state: GateState
    accepted: RobotCommand | None
    refusals: tuple[Refusal, ...]


class CommandGate:
    """The limits of one robot, compiled once; ``check`` is pure."""

    def __init__(self, robot: RobotModel, limits: CommandLimits | None = None) -> None:
        self.limits = limits or CommandLimits()
        self.postures: Mapping[str, Array] = robot.postures
        """Of the robot, by name, (J,) rad."""
        self._model, self._legs, self._tree = build_gate(robot), build_legs(robot, LegLimits()), robot.tree
        self._coupled, self._between = robot.coupled, Between(robot)
        self._stance = {support: _carrying(robot, support) for support in CARRIES}
        limits = self.limits
        self._calm = {
            support: robot.speed * np.where(carrying, limits.stance_share, limits.catch_up_share)
            for support, carrying in self._stance.items()
        }
        self._warm_up(robot.postures["stand"])

    def _warm_up(self, stand: Array) -> None:
        """Compile everything, so that no command waits for it."""
        feet = self.feet(stand, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), "D")
        _slip(self._legs, feet.pos, feet.rot, feet)
        _motion(self._model, stand, stand, np.zeros_like(stand), 1.0)
        range_excess(self._model, stand)
        self._between.nearest(stand)

    def begin(self, q: Array) -> GateState:
        """The state of a robot that stands still at q (J,) rad, as it was measured."""
        return GateState(q=np.array(q, dtype=np.float64), velocity=np.zeros(len(q)))

    def check(self, state: GateState, command: RobotCommand, dt: float) -> Verdict:
        """Whether a command may follow the last accepted one; dt: s of real time since the last check.

        Speeds are taken over the commands' own time, at most ``max_dt``, and that time may not outrun the real one:
        a command is neither refused because the computer was late with the one before nor accepted because it says so.
        """
        dt = max(dt, 0.0) if math.isfinite(dt) else 0.0
        state = replace(state, held=state.held + dt)
        if not self._well_formed(command, len(state.q)):
            return self._refused(state, [Refusal.MALFORMED])
        state = replace(state, newest=_kept(command))
        elapsed = command.time - state.time if math.isfinite(state.time) else self.limits.max_dt
        lead = max(0.0, state.lead + min(elapsed, self.limits.max_dt) - state.held) if state.accepted else 0.0
        if elapsed <= 0.0 or lead > self.limits.clock_lead:
            return self._refused(state, [Refusal.ORDER])
        elapsed = min(elapsed, self.limits.max_dt)
        refusals = [] if self._in_range(command) else [Refusal.RANGE]
        refusals += self._too_sudden(state, command.q, elapsed)
        feet = self.feet(command.q, command.base_pos, command.base_quat, command.support)
        refusals += self._unstable(state, feet, command.support)
        if refusals:
            return self._refused(state, refusals)
        return Verdict(self._after(state, command, feet, elapsed, lead), command, ())

    def catch_up(self, state: GateState, command: RobotCommand, dt: float) -> Verdict:
        """As ``check``; but a robot that was held while its method went on goes after it by calm steps.

        Only after a method that went on by possible steps: a jump is held, not followed. Each step passes ``check``
        itself, on the feet that carry the robot until it is there, and keeps the body from touching itself: a foot that
        the method lifted meanwhile stays down until the method has set it down again. Where there is no such step the
        last command is held.
        """
        verdict = self.check(state, command, dt)
        held, before = state.accepted, state.newest
        if held is None or before is None or before is held or not set(verdict.refusals) <= PACE:
            return verdict
        may = self._calm_step(held, before, command)
        if (np.abs(command.q - held.q) <= may).all():
            return verdict
        newest = verdict.state.newest
        if may.any():
            step = self._between.step(held, command, may)
            taken = self.check(state, step, dt)
            if taken.accepted is not None and not self._touches(step.q, held.q):
                return Verdict(replace(taken.state, newest=newest), step, (Refusal.SPEED,))
        if verdict.accepted is None or self._leap(held, command) <= self.limits.stance_leap:
            return verdict
        return self._refused(replace(state, held=state.held + max(dt, 0.0), newest=newest), [Refusal.SPEED])

    def _calm_step(self, held: RobotCommand, before: RobotCommand, command: RobotCommand) -> Array:
        """How far (J,) rad a robot that was held may turn its joints in one step; 0 where the method itself has jumped.

        Every joint as far as the method has just turned it, and by its calm speed on top, so that the robot comes
        nearer whatever the method does.
        """
        time = min(command.time - before.time, self.limits.max_dt)
        if time <= 0.0 or speed_ratio(self._model, command.q, before.q, time) > self.limits.speed_share:
            return np.zeros_like(command.q)
        most = self.limits.speed_share * self._model.speed * time
        return np.minimum(np.abs(command.q - before.q) + self._calm[held.support] * time, most)

    def _leap(self, held: RobotCommand, command: RobotCommand) -> float:
        """How far (rad) the joints of the legs that carry are from those of a command."""
        carrying = self._stance[held.support]
        return float(np.abs(command.q - held.q)[carrying].max())

    def _touches(self, q: Array, before: Array) -> bool:
        """Whether the body touches itself at q (J,) rad, and more than at the pose before."""
        nearest = self._between.nearest(q)
        return nearest < -self.limits.overlap and nearest < self._between.nearest(before)

    def feet(self, q: Array, base_pos: Array, base_quat: Array, support: str) -> Feet:
        """Balance and feet of a pose: q (J,) rad, torso (3,) m, (4,) in the world, on the feet of ``support``."""
        return Feet(*_feet(self._tree, self._legs, q, base_pos, base_quat, *CARRIES[support]))

    def _well_formed(self, command: RobotCommand, joints: int) -> bool:
        numbers = (command.q, (joints,)), (command.base_pos, (3,)), (command.base_quat, (4,))
        if command.support not in CARRIES or not math.isfinite(command.time):
            return False
        if not all(isinstance(v, np.ndarray) and v.shape == shape and np.isfinite(v).all() for v, shape in numbers):
            return False
        return abs(math.sqrt(command.base_quat @ command.base_quat) - 1.0) <= self.limits.unit

    def _in_range(self, command: RobotCommand) -> bool:
        if range_excess(self._model, command.q) > self.limits.range_tolerance:
            return False
        if any(abs(command.q[a] - command.q[b]) > self.limits.coupled for a, b in self._coupled):
            return False
        return command.hand_opening is None or not any(not 0.0 <= x <= 1.0 for x in command.hand_opening if x == x)

    def _too_sudden(self, state: GateState, q: Array, elapsed: float) -> list[Refusal]:
        limits = self.limits
        speed, change = _motion(self._model, q, state.q, state.velocity, elapsed)
        refusals = [Refusal.SPEED] if speed > limits.speed_share else []
        return [*refusals, Refusal.ACCELERATION] if change > limits.change_share else refusals

    def _unstable(self, state: GateState, feet: Feet, support: str) -> list[Refusal]:
        limits = self.limits
        refusals = [Refusal.MARGIN] if feet.margin < limits.margin else []
        if feet.off > limits.height or feet.under > limits.height:
            refusals.append(Refusal.FLOOR)
        if support == "D" and state.planted is not None and _slip(self._legs, *state.planted, feet) > limits.slip:
            refusals.append(Refusal.SLIP)
        return refusals

    def _refused(self, state: GateState, refusals: list[Refusal]) -> Verdict:
        return Verdict(replace(state, velocity=np.zeros_like(state.q)), None, tuple(refusals))

    def _after(self, state: GateState, command: RobotCommand, feet: Feet, elapsed: float, lead: float) -> GateState:
        planted = (state.planted or (feet.pos, feet.rot)) if command.support == "D" else None
        first = state.accepted is None  # from where the robot was measured, which is no step of a movement
        velocity = np.zeros_like(state.q) if first else (command.q - state.q) / elapsed
        return GateState(command.q.copy(), velocity, command.time, 0.0, lead, planted, state.newest, state.newest)


def _kept(command: RobotCommand) -> RobotCommand:
    """The command's pose for later, whatever its maker does with its arrays."""
    return replace(command, q=command.q.copy(), base_pos=command.base_pos.copy(), base_quat=command.base_quat.copy())


def _carrying(robot: RobotModel, support: str) -> npt.NDArray[np.bool_]:
    """Which joints (J,) belong to the legs that carry, or share a motor with one that does."""
    carrying = np.zeros(len(robot.joint_names), dtype=np.bool_)
    for chain, carries in zip(("l_leg", "r_leg"), CARRIES[support], strict=True):
        carrying[list(robot.chains[chain])] = carries
    for pair in robot.coupled:
        carrying[list(pair)] = carrying[list(pair)].any()
    return carrying


@njit(cache=True)
def _motion(model: GateModel, q: Array, before: Array, velocity: Array, dt: float) -> tuple[float, float]:
    """Speed and change of speed of the worst joint, as shares of the no-load speed."""
    change = 0.0
    for j in range(q.shape[0]):
        change = max(change, abs((q[j] - before[j]) / dt - velocity[j]) / model.speed[j])
    return speed_ratio(model, q, before, dt), change


@njit(cache=True)
def _feet(
    tree: Tree, legs: Legs, q: Array, base_pos: Array, base_quat: Array, left: bool, right: bool
) -> tuple[float, float, float, Array, Array]:
    """The fields of ``Feet``."""
    n = q.shape[0]
    link_pos, link_rot = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    forward(tree, q, link_pos, link_rot)
    com = np.empty(3)
    center_of_mass(tree, link_pos, link_rot, com)
    R = matrix_from_quat(base_quat)
    pos, rot = np.empty((2, 3)), np.empty((2, 3, 3))
    off, under = 0.0, 0.0
    for side in range(2):
        row = legs.sole_joint[side] + 1
        pos[side] = base_pos + R @ (link_pos[row] + link_rot[row] @ legs.sole_point[side])
        rot[side] = R @ link_rot[row]
        for k in range(legs.outline.shape[1]):
            x, y = legs.outline[side, k]
            z = pos[side, 2] + rot[side, 2, 0] * x + rot[side, 2, 1] * y
            under = max(under, -z)
            if (side == 0 and left) or (side == 1 and right):
                off = max(off, abs(z))
    return support_margin(legs, pos, rot, left, right, base_pos + R @ com), off, under, pos, rot


@njit(cache=True)
def _slip(legs: Legs, pos: Array, rot: Array, feet: Feet) -> float:
    """How far (m) an outline point of the right sole has moved, seen from the left sole."""
    was = rot[0].T @ (pos[1] - pos[0]), rot[0].T @ rot[1]
    now = feet.rot[0].T @ (feet.pos[1] - feet.pos[0]), feet.rot[0].T @ feet.rot[1]
    return outline_travel(legs, 1, was[0], was[1], now[0], now[1])
