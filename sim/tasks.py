"""Tele-operated tasks in a scene: what an operator does, carried out by the simulated robot, and whether it succeeds.

After section VI-D of Koenemann 2014: pick up a ball that is out of reach from where the robot stands, and drop it into
a bucket. The operator is a built-in motion that goes through the ``Imitator`` as a live person does, without feedback:
they know where things are. The places are those for the first built-in robot; another arm grasps elsewhere.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

from naoimitate.core.errors import CalibrationError, UnknownTask
from naoimitate.core.falling import has_fallen, swing_load, tilt
from naoimitate.core.frames import Array, Motion, RobotCommand
from naoimitate.imitator import Imitator
from naoimitate.mapping import Mapping
from naoimitate.robot.model import RobotModel
from naoimitate.settings import Settings
from naoimitate.sim.driver import MujocoDriver
from naoimitate.sim.scenes import BALL, BallAndBucket
from naoimitate.sim.settings import SimSettings

DEFAULT = SimSettings()

OPERATED = Settings(hand_orientation="upright")
"""How the robot imitates an operator who grasps: hands upright, as in the paper."""

BLEND = 1.0
"""s in which the robot goes over from its own stand to the operator's."""

REST_TIME, REST_WAY = 0.5, 0.002
"""A ball that moves by less than so many m in the last so many s lies still."""

LIFTED = 0.03
"""m over its stand from which a ball counts as picked up."""


@dataclass(frozen=True)
class Task:
    """A task: its name, one sentence about it, the built-in motion of its operator, and what stands where."""

    name: str
    about: str
    motion: str
    scene: BallAndBucket


TASKS = {
    task.name: task
    for task in (
        Task(
            "lean",
            "on the left foot, the right leg far back: a ball that is too far away for two feet; pick, drop",
            "lean-and-pick",
            BallAndBucket(ball=(0.351, 0.046, 0.341), bucket=(0.16, -0.22)),
        ),
        Task(
            "step",
            "two steps to a ball that is too far away, reach, pick, drop",
            "step-and-pick",
            BallAndBucket(ball=(0.360, -0.149, 0.352), bucket=(0.21, -0.23)),
        ),
    )
}


def task_of(name: str) -> Task:
    """A task by its name; raises UnknownTask, which lists them."""
    if name not in TASKS:
        raise UnknownTask(f"no scene is called {name!r}: choose one of {', '.join(TASKS)}")
    return TASKS[name]


class Moved(NamedTuple):
    """Robot and ball after one command, or as columns after T; see ``Attempt``."""

    q: Array
    base_pos: Array
    base_quat: Array
    fsr: Array
    hand_opening: Array
    ball: Array
    positions: Array


@dataclass(frozen=True)
class Attempt:
    """A task as it went, T frames.

    commands: what the robot was told. step_time: (T,) s that each took to compute. mapping: of the operator to the
    robot. moved: as it really went, q (T, J) rad, base_pos (T, 3) m, base_quat (T, 4), fsr (T, 2, 4) N under the left
    and right sole, hand_opening (T, 2), ball (T, 3) m, positions (T, n) of the whole world: ``qpos`` of ``model``.
    swing_load: (T,) share of the weight on a foot planned in the air. fell: (T,) bool, the measure ``survival``: True
    from the first frame on in which the torso has tipped or a swing foot carries a tenth (``core.falling``).
    """

    task: Task
    commands: tuple[RobotCommand, ...]
    step_time: Array
    mapping: Mapping
    model: mujoco.MjModel
    moved: Moved
    swing_load: Array
    fell: npt.NDArray[np.bool_]

    @property
    def time(self) -> Array:
        """(T,) s."""
        return np.array([command.time for command in self.commands])

    @property
    def picked(self) -> int | None:
        """The first frame with the ball clearly off its stand, None when it never was."""
        high = np.flatnonzero(self.moved.ball[:, 2] > self.task.scene.ball[2] + LIFTED)
        return int(high[0]) if len(high) else None

    @property
    def dropped(self) -> bool:
        """Whether the ball lies still in the bucket at the end."""
        late = self.moved.ball[self.time > self.time[-1] - REST_TIME]
        return self.task.scene.holds(late[-1]) and bool(np.ptp(late, axis=0).max() < REST_WAY)

    @property
    def success(self) -> bool:
        """Picked up, dropped into the bucket, and no fall."""
        return self.picked is not None and self.dropped and not self.fell.any()


def perform(
    task: Task,
    robot: RobotModel,
    motion: Motion,
    settings: SimSettings = DEFAULT,
    *,
    progress: Callable[[float], None] | None = None,
) -> Attempt:
    """Let the simulated robot do what the operator does in a task's scene, as fast as the computer can.

    motion: the operator's. settings: of servos and feet. progress: told the share that is done. Raises
    CalibrationError for a motion without a T-pose.
    """
    if motion.tpose is None:
        raise CalibrationError(f"{motion.name} has no T-pose: an operator must be measured first")
    driver = MujocoDriver(robot, settings, real_time=False, scene=task.scene.add)
    driver.connect()
    imitator = Imitator(robot, OPERATED)
    subject = imitator.calibrate(motion.tpose)
    imitator.step(motion.at(0.0), driver.period)  # loads what is compiled: no part of the steps' own time
    imitator.use(subject)
    imitator.stand()
    imitator.blend(BLEND)
    commands, step_times, moments = [], [], []
    for frame in range(round(motion.duration / driver.period) + 1):
        begin = clock.perf_counter()
        commands.append(imitator.step(motion.at(frame * driver.period), driver.period))
        step_times.append(clock.perf_counter() - begin)
        driver.write(commands[-1])
        moments.append(_advance(driver))
        if progress is not None:
            progress(frame * driver.period / motion.duration)
    moved = Moved(*(np.array(column) for column in zip(*moments, strict=True)))
    weight = robot.mass * -float(driver.model.opt.gravity[2])
    swing, fell = _survival(commands, moved, weight)
    return Attempt(
        task, tuple(commands), np.array(step_times), imitator.mapping, driver.model, moved, swing_load=swing, fell=fell
    )


def _advance(driver: MujocoDriver) -> Moved:
    """Let a period pass."""
    state, opening, positions = driver.advance(driver.period), driver.hand_opening, driver.snapshot[1]
    ball = int(driver.model.joint(BALL).qposadr[0])
    assert state.base_pos is not None and state.base_quat is not None
    return Moved(state.q, state.base_pos, state.base_quat, state.fsr, opening, positions[ball : ball + 3], positions)


def _survival(commands: list[RobotCommand], moved: Moved, weight: float) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Load (T,) of the swing foot as a share of the weight (N), and ``fell`` (T,)."""
    lean = tilt(np.array([command.base_quat for command in commands]), moved.base_quat)
    height = moved.base_pos[:, 2] / np.array([command.base_pos[2] for command in commands])
    swing = swing_load(np.array([command.support for command in commands]), moved.fsr.sum(axis=2), weight)
    return swing, has_fallen(lean, height, swing)
