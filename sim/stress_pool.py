"""Many disturbed motions, played side by side in processes; the order and the results do not depend on how many."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager
from typing import NamedTuple

from naoimitate.core.errors import NaoimitateError
from naoimitate.robot.model import RobotModel
from naoimitate.sim.disturbance import Disturbance
from naoimitate.sim.stress_play import Outcome, Plan, play


class Trial(NamedTuple):
    """A plan, by its index, under a disturbance."""

    plan: int
    disturbance: Disturbance


class _Bench(NamedTuple):
    """What every trial needs; sent to each process once."""

    robot: RobotModel
    plans: tuple[Plan, ...]
    known_stiffness: bool
    closed: bool

    def play(self, trial: Trial) -> Outcome:
        plan = self.plans[trial.plan]
        return play(self.robot, plan, trial.disturbance, known_stiffness=self.known_stiffness, closed=self.closed)


class Pool(AbstractContextManager["Pool"]):
    """Plays trials with ``jobs`` processes, with one in this process; a context manager."""

    def __init__(
        self,
        robot: RobotModel,
        plans: Sequence[Plan],
        *,
        jobs: int = 1,
        known_stiffness: bool = False,
        closed: bool = False,
    ) -> None:
        self._bench = _Bench(robot, tuple(plans), known_stiffness, closed)
        self._executor: ProcessPoolExecutor | None = None
        if jobs > 1:
            context = multiprocessing.get_context("spawn")  # a fork would take the locks of our threads along
            self._executor = ProcessPoolExecutor(jobs, context, _set_up, (self._bench,))

    def play(self, trials: Sequence[Trial]) -> Iterator[Outcome]:
        """The outcomes, in the order of the trials, each as soon as it is there."""
        if self._executor is None:
            yield from map(self._bench.play, trials)
            return
        try:
            yield from self._executor.map(_play, trials)
        except BrokenProcessPool as error:
            raise NaoimitateError("a simulating process died: is there memory for fewer --jobs?") from error

    def __exit__(self, *_: object) -> None:
        if self._executor is not None:
            self._executor.shutdown(cancel_futures=True)


_bench: _Bench | None = None
"""In a process of the pool: what it was sent."""


def _set_up(bench: _Bench) -> None:
    global _bench
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the one that asked for the work, which ends us
    _bench = bench


def _play(trial: Trial) -> Outcome:
    assert _bench is not None
    return _bench.play(trial)
