"""The time law of a recorded motion: which moment of the person the robot imitates next.

``auto`` plays the person at full speed and waits only where the robot needs time: in the double support before a
lift-off, until the robot's CoM is over the stance foot; right after a touchdown, until the robot's foot is down; and it
slows where hands or the swing foot fall behind at their speed limits. It never stops while they stand on one foot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from naoimitate.balance.offset import OffsetLaw, Span, advance
from naoimitate.core.frames import Motion
from naoimitate.fsm import Mode
from naoimitate.fsm.support import OFFSET_REACHED

STANCE = Span(0.10, 0.26, -0.04, 0.14)
"""A usual stance of a small humanoid, for how long a weight shift takes."""


@dataclass(frozen=True)
class PaceSettings:
    """How ``auto`` slows down."""

    lag_free: float = 0.005
    """[m] of lag of a hand or the swing foot up to which the person is played at full speed."""
    lag_full: float = 0.030
    """[m] of lag at which the person is slowed most."""
    slowest: float = 0.08
    """Slowest rate while the person stands on one foot."""
    change: float = 3.0
    """[1/s] by which the rate changes in a second."""
    after_touchdown: float = 0.02
    """[s] after a touchdown (at most half of the double support) at which the person waits for the robot's foot."""
    patience: float = 10.0
    """[s] of waiting after which the robot gives up a support phase and goes on."""


@dataclass(frozen=True)
class Phase:
    """A stretch of time in which the person stands on the same feet."""

    support: str
    start: float
    end: float


@dataclass(frozen=True)
class Moment:
    """What to imitate next: the person's time (s), their support as the robot is to see it, and what comes."""

    time: float
    support: str
    ahead: str


def phases(motion: Motion) -> list[Phase]:
    """The support phases of a motion whose ``support`` is known, end to end."""
    assert motion.support is not None
    starts = [0, *(np.flatnonzero(motion.support[1:] != motion.support[:-1]) + 1), len(motion)]
    ends = [*(float(motion.time[i]) for i in starts[1:-1]), math.inf]
    return [Phase(str(motion.support[i]), float(motion.time[i]), end) for i, end in zip(starts[:-1], ends, strict=True)]


class ConstantPace:
    """The person at a constant speed factor."""

    def __init__(self, motion: Motion, start: float, factor: float) -> None:
        self._motion, self._factor, self.time = motion, factor, start

    def next(self, dt: float, mode: Mode, offset: float, lag: float, settled: bool = True) -> Moment:
        """The moment dt s later."""
        self.time += self._factor * dt
        return Moment(self.time, self._motion.at(self.time).support or "D", "")


class AutoPace:
    """The person, slowed where the robot needs the time."""

    def __init__(self, motion: Motion, start: float, law: OffsetLaw, settings: PaceSettings | None = None) -> None:
        self._phases, self._law, self._s = phases(motion), law, settings or PaceSettings()
        self._index = max(i for i, p in enumerate(self._phases) if p.start <= start or i == 0)
        self._rate, self._waited = 0.0, 0.0
        self._shift = _shift_times(law)
        self.time, self._end = start, motion.duration

    def next(self, dt: float, mode: Mode, offset: float, lag: float, settled: bool = True) -> Moment:
        """Advance by at most dt s, given the robot's support mode, offset, lag in m, and whether it has settled."""
        phase = self._phases[self._index]
        coming = self._coming()
        can = settled or mode is not Mode.DOUBLE
        ready = coming is None or (can and _ready(coming.support, mode, offset)) or self._waited > self._s.patience
        landed = phase.support != "D" or mode is Mode.DOUBLE or self._waited > self._s.patience
        stop = math.inf
        if not landed:
            stop = phase.start + min(self._s.after_touchdown, 0.5 * (phase.end - phase.start))
        elif not ready and coming is not None:
            stop = coming.start
        at_stop = self._advance(dt, self._wanted(phase, lag), stop)
        self._waited = self._waited + dt if at_stop else 0.0
        if at_stop and stop == phase.end and phase.support != "D":
            return Moment(self.time, "D", coming.support if coming else "")
        return Moment(self.time, self._phases[self._index].support, self._ahead(offset))

    def _advance(self, dt: float, wanted: float, stop: float) -> bool:
        """Move on towards ``stop``, never over it; returns whether the person stands there."""
        gap = stop - self.time
        wanted = min(wanted, math.sqrt(2.0 * self._s.change * max(gap, 0.0)))
        self._rate += min(max(wanted - self._rate, -4.0 * self._s.change * dt), self._s.change * dt)
        self._rate = min(max(self._rate, 0.0), 1.0)
        step = min(self._rate * dt, max(gap - 1e-6, 0.0), max(self._end - self.time, 0.0))
        self.time += step
        while self._index + 1 < len(self._phases) and self.time >= self._phases[self._index].end:
            self._index += 1
        return gap - step < 2e-3

    def _wanted(self, phase: Phase, lag: float) -> float:
        late = (lag - self._s.lag_free) / (self._s.lag_full - self._s.lag_free)
        return max(1.0 - max(late, 0.0), self._s.slowest)

    def _coming(self) -> Phase | None:
        """The next single support at whose start the robot must be ready."""
        following = self._phases[self._index + 1 : self._index + 2]
        return following[0] if following and following[0].support in ("L", "R") else None

    def _ahead(self, offset: float) -> str:
        """The next single support, once its weight shift has to begin to be done in time."""
        for phase in self._phases[self._index + 1 :]:
            if phase.support in ("L", "R"):
                target = 0.0 if phase.support == "L" else 1.0
                needed = abs(np.interp(target, *self._shift) - np.interp(offset, *self._shift)) + 0.3
                return phase.support if phase.start - self.time < needed else ""
        return ""


def _ready(support: str, mode: Mode, offset: float) -> bool:
    """Whether the robot can stand on that one foot from now on."""
    if mode is Mode.DOUBLE:
        return offset <= OFFSET_REACHED if support == "L" else offset >= 1.0 - OFFSET_REACHED
    return mode.stance == support


def _shift_times(law: OffsetLaw) -> tuple[np.ndarray, np.ndarray]:
    """Offsets and the time (s) at which the law, starting at 0, reaches them on an average stance."""
    offset, velocity, time, dt = 0.0, 0.0, 0.0, 0.01
    offsets, times = [offset], [time]
    while offset < 1.0 and time < 10.0:
        offset, velocity = advance(offset, velocity, 1.0, dt, law.push(offset, 1.0, STANCE))
        time += dt
        offsets.append(offset)
        times.append(time)
    return np.array(offsets), np.array(times)
