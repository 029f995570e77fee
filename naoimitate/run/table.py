"""Table I of Koenemann et al. 2014: what the stages of a step cost, and how many iterations the solvers take."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from naoimitate.balance.pose import Pose
from naoimitate.balance.retarget import Answer, Retargeting
from naoimitate.core.frames import Array, Motion
from naoimitate.fsm import Mode
from naoimitate.imitator import Imitator
from naoimitate.robot.model import RobotModel
from naoimitate.settings import Settings

MS = 1000.0
FRAMES = 1000
"""Length of the timed sequence (the paper's section VI-C)."""
PAPER_TABLE = (
    ("Posture mapping, ms", "1.04 ± 0.35", "1.73"),
    ("Posture stabilization, ms", "1.85 ± 3.50", "27.08"),
    ("Total time, ms", "3.30 ± 3.57", "29.21"),
    ("# IK iterations", "54 ± 178", "1784"),
)
"""Rows of Table I: name, mean and standard deviation, maximum; on one core of an i5-2400 at 3 GHz."""


@dataclass(frozen=True)
class Table:
    """Per frame of the timed sequence: mapping, stabilisation, total (T,) s, and iterations (T,) of the stabilisation.

    The published mean is less than the fixed iterations of two arms and two legs, so it cannot count them.
    """

    mapping: Array
    stabilisation: Array
    total: Array
    iterations: Array

    def rows(self) -> list[tuple[str, str, str]]:
        """Mean and standard deviation, and maximum, in the order of ``PAPER_TABLE``."""
        values = (MS * self.mapping, MS * self.stabilisation, MS * self.total, self.iterations)
        digits = (2, 2, 2, 0)
        return [
            (name, f"{v.mean():.{d}f} ± {v.std():.{d}f}", f"{v.max():.{d}f}")
            for (name, _, _), v, d in zip(PAPER_TABLE, values, digits, strict=True)
        ]


class _Timed:
    """A way of retargeting the feet that notes how long its last step took, s, and its iterations."""

    def __init__(self, inner: Retargeting) -> None:
        self._inner = inner
        self.spent, self.iterations = 0.0, 0

    @property
    def mode(self) -> Mode:
        return self._inner.mode

    @property
    def offset(self) -> float:
        return self._inner.offset

    @property
    def settled(self) -> bool:
        return self._inner.settled

    def stand(self, *arguments: Any) -> Pose:
        return self._inner.stand(*arguments)

    def place(self, *arguments: Any) -> Pose:
        return self._inner.place(*arguments)

    def step(self, *arguments: Any) -> Answer:
        begin = clock.perf_counter()
        answer = self._inner.step(*arguments)
        self.spent = clock.perf_counter() - begin
        self.iterations = answer.iterations
        return answer


class _TimedImitator(Imitator):
    """An imitator that knows what the stabilisation of its last frame took."""

    def __init__(self, robot: RobotModel, settings: Settings) -> None:
        super().__init__(robot, settings)
        self.timed = _Timed(self._retargeting)
        self._retargeting = self.timed


def measure_steps(motion: Motion, robot: RobotModel, settings: Settings, rate: float) -> Table:
    """Time ``FRAMES`` frames of a motion seen at ``rate`` Hz, after the compiled functions are warm."""
    moments = np.arange(min(FRAMES, int(motion.duration * rate) + 1)) / rate
    _play(motion, robot, settings, moments[:50])
    rows = _play(motion, robot, settings, moments)
    total, stabilisation, iterations = np.array(rows[1:]).T
    mapping = 0 if settings.paper_ik is None else 2 * settings.paper_ik.leg_iterations
    return Table(total - stabilisation, stabilisation, total, iterations - mapping)


def _play(motion: Motion, robot: RobotModel, settings: Settings, moments: Array) -> list[tuple[float, float, int]]:
    imitator = _TimedImitator(robot, settings)
    assert motion.tpose is not None
    imitator.calibrate(motion.tpose)
    rows = []
    for moment in moments:
        frame = motion.at(float(moment))
        begin = clock.perf_counter()
        imitator.step(frame)
        rows.append((clock.perf_counter() - begin, imitator.timed.spent, imitator.timed.iterations))
    return rows


def markdown(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(row) + " |" for row in lines)
