"""The run files that a live session leaves behind."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from naoimitate.core.frames import RobotCommand
    from naoimitate.hw.guarded import GuardedDriver
    from naoimitate.live.loop import Beat
    from naoimitate.live.session import Session
    from naoimitate.robot.model import RobotModel
    from naoimitate.run.journal import Journal, Moved


class Writer:
    """The run files of a session: a new one with every calibration, and whenever the robot begins from its stand.

    Raises RunFileError where an earlier session was cut off and its run not yet recovered.
    """

    def __init__(
        self, out: Path | None, session: Session, driver: GuardedDriver, robot: RobotModel, source: str
    ) -> None:
        from naoimitate.core.errors import RunFileError
        from naoimitate.run.journal import journal_path

        self._out, self._session, self._driver, self._robot, self._source = out, session, driver, robot, source
        self._journal: Journal | None = None
        self._begin: float | None = None
        self._last = 0.0
        self._runs: list[Path] = []
        if out is not None and journal_path(out).exists():
            raise RunFileError(f"{out} was cut off and is not yet whole: first run 'naoimitate recover {out}'")

    def take(self, beat: Beat) -> None:
        """One turn of the loop."""
        if self._out is None:
            return
        tick, now = beat.tick, beat.turn.now
        self._begin = now if self._begin is None else self._begin
        again = self._journal is not None and tick.command.time <= self._last
        if tick.began or again or (self._journal is None and tick.fresh):
            self._next(self._out)
        if self._journal is not None:
            from naoimitate.run.journal import Row

            human_time = tick.arrival - self._begin
            row = (self._sent(tick.command), human_time, tick.state.value, beat.latency, beat.turn.step_time)
            self._journal.add(Row(*row, self._moved()))
            self._last = tick.command.time

    def close(self) -> list[str]:
        """Make the run files; a line for each."""
        from naoimitate.run.journal import finish

        if self._journal is not None:
            self._journal.end()
        runs = [(path, finish(path)) for path in self._runs]
        return [f"{path}: {len(run)} frames, {run.duration:.2f} s" for path, run in runs if run is not None]

    def _sent(self, command: RobotCommand) -> RobotCommand:
        """What the robot was told in place of a command that the gate refused: the last one, or a step on the way."""
        sent = self._driver.command
        if sent is None or sent is command:
            return command
        return replace(
            command, q=sent.q, base_pos=sent.base_pos, base_quat=sent.base_quat, support=sent.support,
            com=sent.com, soles=sent.soles, offset=sent.offset,
        )  # fmt: skip

    def _moved(self) -> Moved | None:
        """How the simulated robot really is."""
        from naoimitate.run.journal import Moved

        state = self._driver.state
        if state is None or state.base_pos is None or state.base_quat is None:
            return None
        return Moved(state.q, state.base_pos, state.base_quat, state.fsr, state.fell)

    def _next(self, out: Path) -> None:
        """Begin another run file; the one before is made of its journal at the end of the session."""
        from naoimitate.run.columns import constants
        from naoimitate.run.journal import Journal
        from naoimitate.run.provenance import provenance

        if self._journal is not None:
            self._journal.end()
        number = len(self._runs) + 1
        path = out if number == 1 else out.with_name(f"{out.stem}-{number}{out.suffix}")
        imitator = self._session.imitator
        text = provenance(imitator.settings, source_sha256="", seed=0, speed="live")
        fixed = constants(self._robot, imitator.mapping, imitator.settings.retarget, self._source, text)
        self._journal = Journal(path, fixed)
        self._runs.append(path)
