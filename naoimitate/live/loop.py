"""The live loop: datagrams in, commands out, one thread; the only place with a clock."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from naoimitate.core.errors import StreamError
from naoimitate.fsm.session import State
from naoimitate.hw.guarded import Condition, GuardedDriver, GuardStatus
from naoimitate.live.receiver import Datagram, Receiver
from naoimitate.live.session import Session, Tick
from naoimitate.live.stream import Stream

SHORTEST = 0.002
"""[s] between two steps: a frame that comes sooner waits so long."""
REFUSED = 1.0
"""[s] without a command that passes the gate, after which the session is in fault."""


@dataclass(frozen=True)
class Beat:
    """One turn of the loop, for those who watch or write: the tick, when, and how long it took.

    now: s, monotonic. latency: s from the arrival of the datagram that caused the step to the driver, NaN without one.
    step_time: s of wall time in the session.
    """

    tick: Tick
    now: float
    latency: float
    step_time: float


@dataclass
class Loop:
    """A session between a stream and a driver.

    watch: called with every beat. record: called with every datagram, before it is decoded. ended: asked in every turn.
    """

    session: Session
    stream: Stream
    receiver: Receiver
    driver: GuardedDriver
    watch: list[Callable[[Beat], None]] = field(default_factory=list)
    record: Callable[[Datagram], None] | None = None

    def run(self, duration: float = math.inf, ended: Callable[[], bool] = lambda: False) -> None:
        """Run for ``duration`` s, or until ``ended``; the driver is connected, and is left connected.

        Raises StreamError at the end when nothing that came was understood.
        """
        begin = last = time.monotonic()
        self.session.start()
        while not ended() and last - begin < duration:
            self._receive(last)
            newest = self.stream.newest()
            if newest is not None:
                arrival, sample = newest
                self.session.see(sample.frame, arrival)
            now = time.monotonic()
            started = time.perf_counter()
            tick = self.session.step(now)
            spent = time.perf_counter() - started
            if tick.state is not State.FAULT:
                self.driver.write(tick.command)
                self._look_after(self.driver.status)
            latency = time.monotonic() - newest[0] if newest is not None and tick.fresh else math.nan
            last = now
            beat = Beat(tick, now, latency, spent)
            for watcher in self.watch:
                watcher(beat)
        self.session.stop()
        complaint = self.stream.complaint()
        if complaint:
            raise StreamError(complaint)

    def _look_after(self, status: GuardStatus) -> None:
        """Tell the session of a robot that does not follow any more, and let go of it; a fault moves nothing."""
        if status.condition is not Condition.LIVE:
            self.session.fault(status.problem or status.condition.value)
        elif status.held > REFUSED:
            self.session.fault(f"commands are refused: {', '.join(status.refusing)}")
            self.driver.emergency_stop()

    def _receive(self, last: float) -> None:
        """Wait for a frame, or for the driver's period; what came is taken."""
        due, soonest, before = last + self.driver.period, last + SHORTEST, self.stream.counts.frames
        while True:
            now = time.monotonic()
            fresh = self.stream.counts.frames != before
            if now >= due or (fresh and now >= soonest):
                return
            self.receiver.wait((soonest if fresh else due) - now)
            for datagram in self.receiver.read():
                if self.record is not None:
                    self.record(datagram)
                self.stream.take(datagram.arrival, datagram.address, datagram.payload)
