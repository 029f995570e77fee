"""The live loop: every turn of a session goes to the driver, and the driver's troubles to the session."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from naoimitate.core.errors import DriverError
from naoimitate.fsm.session import Event, State
from naoimitate.hw.condition import Condition, GuardStatus
from naoimitate.hw.guarded import GuardedDriver
from naoimitate.live.receiver import Datagram, Source
from naoimitate.live.session import Session, Tick
from naoimitate.live.stream import Stream

SHORTEST = 0.002
"""[s] between two steps: a frame that comes sooner waits so long."""
LONGEST = 0.015
"""[s] between two steps: the run file has more than 50 frames a second whatever the driver's period."""
REFUSED = 1.0
"""[s] in which the gate refuses every command, after which the session is in fault."""
STANDING = 15.0
"""[s] that a robot gets to stand on both feet at the end."""


@dataclass(frozen=True)
class Turn:
    """A step of a session, not yet with the driver.

    now: s, on the clock of the session. arrival: s, of the datagram that caused the step, NaN without one.
    receive: s from arrival to use. observe: s to filter and watch the frame. imitate: s to find the command.
    """

    tick: Tick
    now: float
    arrival: float = math.nan
    receive: float = math.nan
    observe: float = 0.0
    imitate: float = 0.0

    @property
    def step_time(self) -> float:
        """s of the whole computation of the step."""
        return self.observe + self.imitate


@dataclass(frozen=True)
class Beat:
    """A turn that the driver has got, for those who watch or write.

    latency: s from the arrival of the datagram that caused the step to the driver, NaN without one. gate, hand_over: s
    that the safety gate took, and the driver to take the command.
    """

    turn: Turn
    latency: float = math.nan
    gate: float = 0.0
    hand_over: float = 0.0

    @property
    def tick(self) -> Tick:
        """The step of the session."""
        return self.turn.tick


@dataclass
class Loop:
    """A session and its driver.

    watch: called with every beat; one that raises is told of by ``complain`` and not called again. live: whether the
    driver's troubles are the session's; a recorded session goes its way, and troubles of its driver are raised.
    """

    session: Session
    driver: GuardedDriver
    watch: list[Callable[[Beat], None]] = field(default_factory=list)
    complain: Callable[[str], None] = lambda sentence: None
    live: bool = True
    _refused_since: float = field(default=math.nan, init=False)

    def run(
        self,
        turns: Iterator[Turn],
        duration: float = math.inf,
        ended: Callable[[], bool] = lambda: False,
        hurried: Callable[[], bool] = lambda: False,
    ) -> None:
        """Run for ``duration`` s, until ``ended``, or until there are no more turns; then let the robot stand.

        hurried: whether nobody wants to wait for that. The driver is connected before, and left connected. Raises
        DriverError for a trouble of the driver in a recorded session.
        """
        begin = now = math.nan
        for turn in turns:
            begin, now = (turn.now if math.isnan(begin) else begin), turn.now
            self._beat(turn)
            if now - begin >= duration or ended():
                break
        if not math.isnan(now):
            self._stand(now, hurried)

    def _stand(self, now: float, hurried: Callable[[], bool]) -> None:
        """End the session: blend to a stand, on both feet where the robot still obeys."""
        self.session.tell(Event.STOP)
        begin = time.monotonic()
        while self.session.state is State.STOPPING:
            time.sleep(0.01)
            passed = time.monotonic() - begin
            if hurried() or passed > STANDING:
                self.session.tell(Event.STOP)
            started = time.perf_counter()
            tick = self.session.step(now + passed)
            self._beat(Turn(tick, now + passed, imitate=time.perf_counter() - started))
        if self.session.state is State.FAULT:
            self.session.tell(Event.STOP)

    def _beat(self, turn: Turn) -> None:
        """Hand a turn's command over; a fault moves nothing."""
        if not self.live and any(event is Event.RESET for event, _ in turn.tick.told):
            self.driver.reset()
            self.driver.connect()
        gate = hand_over = 0.0
        if turn.tick.state is State.FAULT:
            with contextlib.suppress(DriverError):  # a robot that holds its pose may still fall: the guard watches
                self.driver.read()
        else:
            self.driver.write(turn.tick.command)
            gate, hand_over = self.driver.delays
            self._look_after(self.driver.status, turn.now)
        latency = time.monotonic() - turn.arrival if turn.tick.fresh else math.nan
        beat = Beat(turn, latency, gate, hand_over)
        for watcher in tuple(self.watch):
            try:
                watcher(beat)
            except Exception as error:  # whatever it is, the robot goes on
                self.watch.remove(watcher)
                with contextlib.suppress(Exception):
                    self.complain(str(error) or type(error).__name__)

    def _look_after(self, status: GuardStatus, now: float) -> None:
        """Tell the session of a robot that does not follow any more; it keeps its pose."""
        if not status.refusing or status.catching_up:
            self._refused_since = math.nan
        elif math.isnan(self._refused_since):
            self._refused_since = now
        trouble = ""
        if status.condition is not Condition.LIVE:
            trouble = status.problem or status.condition.value
        elif now - self._refused_since > REFUSED:
            trouble = f"commands are refused: {', '.join(status.refusing)}"
        if trouble and not self.live:
            raise DriverError(trouble)
        if trouble:
            self.session.tell(Event.FAULT, trouble)


def listen(
    session: Session,
    stream: Stream,
    source: Source,
    period: float,
    record: Callable[[Datagram], None] = lambda datagram: None,
) -> Iterator[Turn]:
    """Turns as datagrams come: one for each fresh frame, or after ``period`` s without one; ends with the source.

    record: called with every datagram before it is decoded.
    """
    last = time.monotonic()
    session.start()
    while not source.ended:
        _receive(stream, source, last, min(period, LONGEST), record)
        newest = stream.newest()
        arrival = math.nan
        if newest is not None:
            arrival, sample = newest
            session.see(sample.frame, arrival)
        last = time.monotonic()
        started = time.perf_counter()
        session.observe(last)
        observed = time.perf_counter()
        tick = session.imitate()
        yield Turn(tick, last, arrival, last - arrival, observed - started, time.perf_counter() - observed)


def _receive(stream: Stream, source: Source, last: float, period: float, record: Callable[[Datagram], None]) -> None:
    """Wait for a frame, or for the period after the ``last`` step (s); what came is taken."""
    due, soonest, before = last + period, last + SHORTEST, stream.counts.frames
    while True:
        now = time.monotonic()
        fresh = stream.counts.frames != before
        if now >= due or (fresh and now >= soonest and not source.wait(0.0)):
            return
        source.wait((soonest if fresh else due) - now)
        for datagram in source.read():
            record(datagram)
            stream.take(datagram.arrival, datagram.address, datagram.payload)
