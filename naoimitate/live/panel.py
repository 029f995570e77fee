"""What the operator sees: state, countdown, support, margin, delays and losses, a few times a second."""

from __future__ import annotations

import contextlib
import math
import threading
from collections import deque
from types import TracebackType

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from naoimitate.command_gate import CommandGate
from naoimitate.core.frames import RobotCommand
from naoimitate.fsm.session import State
from naoimitate.hw.guarded import GuardedDriver
from naoimitate.live.keys import HELP
from naoimitate.live.loop import Beat
from naoimitate.live.session import Session
from naoimitate.live.stream import Stream

RECENT = 1000
"""Steps that the delays are taken from."""
PERIOD = 0.25
"""[s] between two pictures: drawing takes time from the robot."""
STAGES = ("receive", "filter", "imitate", "gate", "hand over", "datagram to driver")
"""Of a frame on its way; the last is the whole."""
SIDES = {"L": "left", "R": "right"}


class Panel:
    """A table in the terminal that another thread keeps up to date; the bell rings when the robot begins to follow."""

    def __init__(self, session: Session, stream: Stream, driver: GuardedDriver, gate: CommandGate) -> None:
        self._session, self._stream, self._driver, self._gate = session, stream, driver, gate
        self._stages: dict[str, deque[float]] = {stage: deque(maxlen=RECENT) for stage in STAGES}
        self._last: Beat | None = None
        self._console = Console(stderr=True)
        self._live = Live(self.table(), console=self._console, auto_refresh=False)
        self._halt = threading.Event()
        self._thread = threading.Thread(target=self._draw, name="panel", daemon=True)

    def __enter__(self) -> Panel:
        self._live.start()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._halt.set()
        self._thread.join()
        self._live.stop()

    def take(self, beat: Beat) -> None:
        """One turn of the loop."""
        turn = beat.turn
        if not math.isnan(turn.arrival):
            stages = (turn.receive, turn.observe, turn.imitate, beat.gate, beat.hand_over)
            for stage, seconds in zip(STAGES, (*stages, sum(stages)), strict=True):
                self._stages[stage].append(seconds)
        before, self._last = self._last, beat
        if before is not None and before.tick.state is State.BLENDING and beat.tick.state is State.TRACKING:
            self._console.bell()

    def table(self) -> Table:
        """Everything at a glance."""
        table = Table(show_header=False, title="naoimitate live", caption=HELP)
        for row in self._rows():
            table.add_row(*map(Text, row))  # as it is: what a sender says may look like markup
        return table

    def _rows(self) -> list[tuple[str, str]]:
        counts, status, beat = self._stream.counts, self._driver.status, self._last
        state = self._session.state.value
        if self._session.state is State.CALIBRATING:
            state += f": hold a T-pose for {self._session.countdown:.1f} s"
        if self._session.state is State.CLUTCHED:
            state += ": nothing moves until you press c or hold a T-pose"
        if self._session.eye.complaint:
            state += f": {self._session.eye.complaint}"
        if self._session.reason:
            state += f": {self._session.reason}"
        rows = [("state", state)]
        if beat is not None:
            c = beat.tick.command
            rows.append(("support", f"person {c.human_support}, robot {c.support}, offset {c.offset:.2f}"))
            rows.append(("the robot", why_it_waits(c) or "stands like the person"))
            margin = self._gate.feet(c.q, c.base_pos, c.base_quat, c.support).margin
            rows.append(("balance", f"{1e3 * margin:.0f} mm inside the feet"))
            rows.append(("given up", c.given_up.name or "nothing"))
        rate = self._stream.rate if beat is None else self._stream.rate_at(beat.turn.now)
        jitter = 1e3 * self._stream.jitter
        rows.append(("stream", f"{rate:.0f} Hz, jitter {jitter:.1f} ms, {counts.lost} lost, {counts.late} late"))
        rows.append(("other packets", f"{counts.damaged} damaged, {counts.foreign} of other senders"))
        complaint = self._stream.complaint()
        rows.extend([("trouble", complaint)] if complaint else [])
        if rate > 0.0:
            rows.append(("filter's delay", f"{1e3 * self._session.eye.filter.delay(rate):.0f} ms at 1 Hz"))
        rows.extend((stage, _delays(seconds)) for stage, seconds in self._stages.items())
        rows.append(("robot", f"{status.condition.value}, {sum(status.refused.values())} commands refused"))
        rows.extend(("alarm", alarm) for alarm in status.alarms)
        return rows

    def _draw(self) -> None:
        while not self._halt.wait(PERIOD):
            with contextlib.suppress(RuntimeError, OSError):  # what is shown changes meanwhile, or the terminal goes
                self._live.update(self.table(), refresh=True)


def why_it_waits(command: RobotCommand) -> str:
    """Why the robot stands on other feet than the person; empty where it does not."""
    person, robot = command.human_support, command.support
    if person == robot:
        return ""
    if robot == "D":
        return "keeps a foot down: nobody stands" if person == "F" else f"shifts its weight to the {SIDES[person]} foot"
    return f"brings its {SIDES['R' if robot == 'L' else 'L']} foot down"


def _delays(seconds: deque[float]) -> str:
    if not seconds:
        return "-"
    p50, p99 = np.percentile(np.array(seconds), [50, 99]) * 1e3
    return f"p50 {p50:.2f} ms, p99 {p99:.2f} ms"
