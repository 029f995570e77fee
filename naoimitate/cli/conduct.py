"""A live session from ready to its end: keys, panel, files, and what to say afterwards."""

from __future__ import annotations

import math
import time
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from collections.abc import Iterator

    from naoimitate.cli.feeds import Feed
    from naoimitate.cli.signals import Signals
    from naoimitate.command_gate import CommandGate
    from naoimitate.hw.guarded import GuardedDriver
    from naoimitate.live.keys import Keys
    from naoimitate.live.loop import Beat, Loop, Turn
    from naoimitate.live.recording import Recorder
    from naoimitate.live.session import Session
    from naoimitate.live.setup import Setup
    from naoimitate.robot.model import RobotModel

PATIENCE = 3.0
"""[s] for which nothing may come, or nothing that is understood, before the operator is told."""


@dataclass(frozen=True)
class Rig:
    """Everything that a session is made of; watch: open while it lasts."""

    feed: Feed
    setup: Setup
    session: Session
    driver: GuardedDriver
    gate: CommandGate
    robot: RobotModel
    watch: AbstractContextManager[object] = field(default_factory=nullcontext)


def conduct(rig: Rig, duration: float | None, out: Path | None, recorder: Recorder | None) -> None:
    """Run a session until its ``duration`` (s from ready), its feed, or its operator ends it.

    Raises StreamError at the end when nothing that came was understood.
    """
    from naoimitate.cli.run_writer import Writer
    from naoimitate.cli.signals import Signals
    from naoimitate.core.errors import StreamError
    from naoimitate.live.keys import Keys
    from naoimitate.live.loop import Loop

    feed, driver = rig.feed, rig.driver
    with ExitStack() as ends:
        signals = ends.enter_context(Signals(driver.emergency_stop))
        ends.callback(lambda: _say(_summary(rig)))
        writer = Writer(out, rig.session, driver, rig.robot, feed.name)
        ends.callback(lambda: _say(writer.close()))
        if recorder is not None:
            ends.callback(recorder.close)
        ends.callback(feed.close)
        keys = ends.enter_context(Keys(driver))
        ends.callback(driver.stop)
        loop = Loop(rig.session, driver, [writer.take], _complain, live=not feed.header)
        if recorder is not None:
            loop.watch.append(recorder.beat)
        turns = feed.turns(rig.session, driver.period, recorder.datagram if recorder else lambda datagram: None)
        try:
            rig.session.warm_up()
            driver.connect()
            ends.enter_context(rig.watch)
            click.echo(f"ready: {feed.ready}")
            signals.polled = True
            _run(rig, loop, turns, keys, signals, math.inf if duration is None else duration)
        except KeyboardInterrupt:
            pass
        finally:
            signals.polled = True  # what follows is done to its end
        if signals.count:
            click.echo("ended by the operator", err=True)
    complaint = feed.stream.complaint()
    if complaint and rig.session.subject is None:
        raise StreamError(complaint)


def _run(rig: Rig, loop: Loop, turns: Iterator[Turn], keys: Keys, signals: Signals, duration: float) -> None:
    """The loop, with a panel where there is a terminal, else with a line for what happens."""
    from naoimitate.live.keys import obey
    from naoimitate.live.panel import Panel

    def ended() -> bool:
        return signals.count > 0 or obey(keys.pressed(), rig.session, rig.driver)

    def hurried() -> bool:
        return signals.count > 1 or "q" in keys.pressed()

    if not keys.open:
        loop.watch.append(Notices(rig.feed, rig.session).take)
        loop.run(turns, duration, ended, hurried)
        return
    with Panel(rig.session, rig.feed.stream, rig.driver, rig.gate) as panel:
        loop.watch.append(panel.take)
        loop.run(turns, duration, ended, hurried)


def _say(lines: list[str]) -> None:
    for line in lines:
        click.echo(line)


def _complain(sentence: str) -> None:
    click.echo(f"naoimitate: {sentence}", err=True)


class Notices:
    """Tells on standard error, a line each, what an operator without a panel has to know: states and troubles."""

    def __init__(self, feed: Feed, session: Session) -> None:
        self._feed, self._session, self._said, self._begin = feed, session, "", time.monotonic()

    def take(self, beat: Beat) -> None:
        """One turn of the loop."""
        from naoimitate.fsm.session import State

        state = beat.tick.state.value
        why = self._session.reason if beat.tick.state is State.FAULT else self._session.eye.complaint
        state += f": {why}" if why else ""
        if time.monotonic() - self._begin > PATIENCE:
            nothing = "" if self._feed.stream.counts.frames else f"nothing comes: still {self._feed.ready}"
            state = self._feed.stream.complaint() or nothing or state
        if state != self._said:
            self._said = state
            click.echo(state, err=True)


def _summary(rig: Rig) -> list[str]:
    counts, status = rig.feed.stream.counts, rig.driver.status
    if not counts.datagrams and not status.accepted:
        return []
    refused = ", ".join(f"{count} {reason}" for reason, count in sorted(status.refused.items())) or "none refused"
    return [
        f"{counts.datagrams} datagrams, {counts.frames} frames used in order, {counts.late} late, {counts.lost} lost, "
        f"{counts.damaged} damaged, {counts.foreign} of other senders",
        f"{status.accepted} commands passed the gate; {refused}; the robot: {status.condition.value}",
    ]
