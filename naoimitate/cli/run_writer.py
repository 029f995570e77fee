"""The run files that a live session leaves behind."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from naoimitate.hw.guarded import GuardedDriver
    from naoimitate.live.loop import Beat
    from naoimitate.live.session import Session
    from naoimitate.robot.model import RobotModel
    from naoimitate.run.journal import Journal, Row


class Writer:
    """The run files of a session: a new one with every calibration."""

    def __init__(
        self, out: Path | None, session: Session, driver: GuardedDriver, robot: RobotModel, source: str
    ) -> None:
        self._out, self._session, self._driver, self._robot, self._source = out, session, driver, robot, source
        self._journal: Journal | None = None
        self._begin: float | None = None
        self._written: list[str] = []
        self._count = 0

    def take(self, beat: Beat) -> None:
        """One turn of the loop."""
        if self._out is None:
            return
        self._begin = beat.turn.now if self._begin is None else self._begin
        if beat.tick.began or (self._journal is None and beat.tick.fresh):
            self._next()
        if self._journal is not None:
            self._journal.add(self._row(beat, beat.tick.arrival - self._begin))

    def _row(self, beat: Beat, human_time: float) -> Row:
        """A turn as a frame of the run file."""
        from naoimitate.run.journal import Moved, Row

        tick, state = beat.tick, self._driver.state
        moved = None
        if state is not None and state.base_pos is not None and state.base_quat is not None:
            moved = Moved(state.q, state.base_pos, state.base_quat, state.fell)
        return Row(tick.command, human_time, tick.state.value, beat.latency, beat.turn.step_time, moved)

    def close(self) -> list[str]:
        """Finish the last run file; a line for each."""
        self._finish()
        return self._written

    def _next(self) -> None:
        from naoimitate.run.columns import constants
        from naoimitate.run.journal import Journal
        from naoimitate.run.provenance import provenance

        assert self._out is not None
        self._finish()
        self._count += 1
        name = self._out.name if self._count == 1 else f"{self._out.stem}-{self._count}{self._out.suffix}"
        imitator = self._session.imitator
        text = provenance(imitator.settings, source_sha256="", seed=0, speed="live")
        fixed = constants(self._robot, imitator.mapping, imitator.settings.retarget, self._source, text)
        self._journal = Journal(self._out.with_name(name), fixed)

    def _finish(self) -> None:
        if self._journal is not None:
            run = self._journal.close()
            if run is not None:
                self._written.append(f"{self._journal.out}: {len(run)} frames, {run.duration:.2f} s")
            self._journal = None
