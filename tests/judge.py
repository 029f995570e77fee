"""A judge of commands: what every frame of an imitation must keep, whatever the person does."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from people import person, tpose

from naoimitate.core.frames import GivenUp, HumanFrame, RobotCommand
from naoimitate.core.geometry import convex_hull, polygon_margin, yaw_matrix
from naoimitate.imitator import Imitator
from naoimitate.motion.builtin import builtin_motion
from naoimitate.robot.model import RobotModel
from naoimitate.run.limits import COUPLED_TOLERANCE, SPEED_FRACTION
from naoimitate.run.replay import replay
from naoimitate.settings import Settings

MARGIN, SLIP, LEVEL = 0.005, 0.5e-3, 0.5e-3
"""m: least static margin, largest travel of a stance sole, largest height of it."""

CLEAR = 0.005

ARM_UP = (3.0, 0.1, 0.2, 0.0)

LEFT_LIFTED = {"feet": [[0.0, 0.1, 0.2, 0.0, 0.0, 0.0], [0.0, -0.1, 0.0, 0.0, 0.0, 0.0]], "com": [0.04, -0.1]}


@dataclass
class Judge:
    """Takes every command of one stream and checks all of it anew, from joint angles and torso pose alone."""

    robot: RobotModel
    commands: list[RobotCommand] = field(default_factory=list)
    planted: list[np.ndarray | None] = field(default_factory=lambda: [None, None])

    def take(self, command: RobotCommand) -> RobotCommand:
        self._numbers(command)
        self._ranges(command)
        pose = replay(self.robot, command.q[None], command.base_pos[None], command.base_quat[None])
        carries = [sole[0] for sole, mode in zip(pose.soles, "RL", strict=True) if command.support != mode]
        margin = polygon_margin(convex_hull(np.concatenate(carries)[:, :2]), *pose.com[0, :2])
        assert margin >= MARGIN, f"margin {1000 * margin:.1f} mm at {command.time:.2f} s"
        assert command.com == pytest.approx(pose.com[0], abs=1e-6)
        for side, mode in enumerate("RL"):
            self._sole(side, pose.soles[side][0], command.support != mode)
        if self.commands:
            self._motion(self.commands[-1], command)
        self.commands.append(command)
        return command

    def _numbers(self, command: RobotCommand) -> None:
        for name in ("q", "base_pos", "base_quat", "com", "soles", "posture"):
            assert np.isfinite(getattr(command, name)).all(), name
        assert np.linalg.norm(command.base_quat) == pytest.approx(1.0)
        assert command.support in "DLR" and command.human_support in "DLRF"
        assert 0.0 <= command.offset <= 1.0 and np.isfinite(command.human_offset)

    def _ranges(self, command: RobotCommand) -> None:
        q, robot = command.q, self.robot
        assert (q >= robot.lower - 1e-9).all() and (q <= robot.upper + 1e-9).all()
        for table in robot.tables:
            low, high = table.bounds(q[table.x])
            assert low - 1e-9 <= q[table.y] <= high + 1e-9
        for leader, follower in robot.coupled:
            assert abs(q[leader] - q[follower]) <= COUPLED_TOLERANCE

    def _sole(self, side: int, outline: np.ndarray, carries: bool) -> None:
        if not carries:
            if outline[:, 2].min() >= CLEAR:
                self.planted[side] = None
            return
        assert np.abs(outline[:, 2]).max() <= LEVEL
        before = self.planted[side]
        if before is None:
            self.planted[side] = outline
        else:
            assert np.linalg.norm(outline - before, axis=1)[:].max() <= SLIP, "a stance foot slips"

    def _motion(self, before: RobotCommand, command: RobotCommand) -> None:
        dt = command.time - before.time
        assert 0.0 < dt <= 0.05 + 1e-9
        fastest = (np.abs(command.q - before.q) / self.robot.speed).max() / dt
        assert fastest <= SPEED_FRACTION, f"a joint at {fastest:.2f} of its speed"
        assert {before.support, command.support} != {"L", "R"}, "both feet at once"

    @property
    def supports(self) -> str:
        """The modes in order, without repetition."""
        modes = [c.support for c in self.commands]
        return "".join(m for i, m in enumerate(modes) if i == 0 or m != modes[i - 1])

    @property
    def given_up(self) -> GivenUp:
        """Every bit that was set."""
        bits = GivenUp(0)
        for command in self.commands:
            bits |= command.given_up
        return bits


def imitate(
    robot: RobotModel, frames: Iterable[HumanFrame], choice: Settings | None = None, dt: float | None = None
) -> Judge:
    """Calibrate on a T-pose and imitate the frames, everything checked."""
    imitator, judge = Imitator(robot, choice), Judge(robot)
    imitator.calibrate(tpose())
    for frame in frames:
        judge.take(imitator.step(frame, dt))
    return judge


def stream(name: str, rate: float, start: float = 0.0, end: float = np.inf) -> list[HumanFrame]:
    """A built-in motion as a camera of this rate sees it: landmarks and orientations, nothing else."""
    motion = builtin_motion(name)
    times = np.arange(start, min(end, motion.duration), 1.0 / rate)
    return [replace(motion.at(float(t)), support=None, contacts=None, com=None) for t in times]


def still(count: int, dt: float = 0.02, frame: HumanFrame | None = None, start: float = 0.0) -> list[HumanFrame]:
    """The same posture for some time."""
    return [replace(frame or person(), time=start + k * dt) for k in range(count)]


def steps(count: int, seed: int, seconds: float = 4.0, dt: float = 0.025) -> list[tuple[str, list[HumanFrame]]]:
    """A person who sets one foot after the other anywhere: too far, too narrow, toes turned; and what they stand on."""
    rng, time, phases = np.random.default_rng(seed), 0.0, []
    feet = np.array([[0.0, 0.1, 0.0, 0.0, 0.0, 0.0], [0.0, -0.1, 0.0, 0.0, 0.0, 0.0]])
    for k in range(count):
        swing, stance = k % 2, 1 - k % 2
        sign = 1.0 if swing == 0 else -1.0
        there = yaw_matrix(feet[stance, 3]) @ [rng.uniform(-0.35, 0.35), sign * rng.uniform(0.08, 0.45), 0.0]
        feet[swing, :3] = feet[stance, :3] + there
        feet[swing, 3] = feet[stance, 3] + rng.uniform(-0.7, 0.7)
        for support in ("LR"[stance], "D"):
            held = feet.copy()
            held[swing, 2] = 0.12 if support != "D" else 0.0
            com = feet[stance, :2] if support != "D" else feet[:, :2].mean(axis=0)
            frame = replace(person(feet=held, com=com, height=0.68), support=support)
            phases.append((support, still(round(seconds / dt), dt, frame, time)))
            time += seconds
    return phases
