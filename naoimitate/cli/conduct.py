"""A live session from ready to its end: keys, panel, files, and what to say afterwards."""

from __future__ import annotations

import math
import time
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from collections.abc import Iterator

    from naoimitate.cli.feeds import Feed
    from naoimitate.command_gate import CommandGate
    from naoimitate.hw.guarded import GuardedDriver
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
    from naoimitate.core.errors import StreamError
    from naoimitate.live.loop import Loop

    feed, driver = rig.feed, rig.driver
    writer = Writer(out, rig.session, driver, rig.robot, feed.name)
    loop = Loop(rig.session, driver, [writer.take])
    if recorder is not None:
        loop.watch.append(recorder.beat)
    turns = feed.turns(rig.session, driver.period, recorder.datagram if recorder else lambda datagram: None)
    try:
        rig.session.warm_up()
        driver.connect()
        with rig.watch:
            click.echo(f"ready: {feed.ready}")
            _run(rig, loop, turns, math.inf if duration is None else duration)
    except KeyboardInterrupt:
        click.echo("ended by the operator", err=True)
    finally:
        driver.stop()
        feed.close()
        if recorder is not None:
            recorder.close()
        click.echo("\n".join([*writer.close(), *_summary(rig)]))
    if complaint := feed.stream.complaint():
        raise StreamError(complaint)


def _run(rig: Rig, loop: Loop, turns: Iterator[Turn], duration: float) -> None:
    """The loop, with keys and a panel where there is a terminal, else with a line for what happens."""
    from naoimitate.live.keys import listening, obey, pressed
    from naoimitate.live.panel import Panel

    with listening() as keys:
        if not keys:
            loop.watch.append(Notices(rig.feed, rig.session).take)
            loop.run(turns, duration)
            return
        with Panel(rig.session, rig.feed.stream, rig.driver, rig.gate) as panel:
            loop.watch.append(panel.take)
            loop.run(turns, duration, lambda: obey(pressed(), rig.session, rig.driver))


class Notices:
    """Tells on standard error, a line each, what an operator without a panel has to know: states and troubles."""

    def __init__(self, feed: Feed, session: Session) -> None:
        self._feed, self._session, self._said, self._begin = feed, session, "", time.monotonic()

    def take(self, beat: Beat) -> None:
        """One turn of the loop."""
        from naoimitate.fsm.session import State

        state = beat.tick.state.value
        if beat.tick.state is State.FAULT:
            state += f": {self._session.reason}"
        if time.monotonic() - self._begin > PATIENCE and not self._feed.stream.counts.frames:
            state = self._feed.stream.complaint() or f"nothing comes: still {self._feed.ready}"
        if state != self._said:
            self._said = state
            click.echo(state, err=True)


def _summary(rig: Rig) -> list[str]:
    counts, status = rig.feed.stream.counts, rig.driver.status
    refused = ", ".join(f"{count} {reason}" for reason, count in sorted(status.refused.items())) or "none refused"
    return [
        f"{counts.datagrams} datagrams, {counts.frames} frames used in order, {counts.late} late, {counts.lost} lost, "
        f"{counts.damaged} damaged, {counts.foreign} of other senders",
        f"{status.accepted} commands passed the gate; {refused}; the robot: {status.condition.value}",
    ]
