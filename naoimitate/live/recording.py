"""A recording of a live session: every datagram with its arrival, what the operator did, the clock of every step.

A line of JSON says what it is and how the session was set up; then come records, each a kind, a time, and a content. A
torn end is left out. Played back, the same datagrams at the same times give the same commands, bit for bit.
"""

from __future__ import annotations

import json
import math
import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from naoimitate.core.errors import StreamError
from naoimitate.fsm.session import Event
from naoimitate.live.loop import Beat, Turn
from naoimitate.live.receiver import Datagram
from naoimitate.live.session import Session
from naoimitate.live.stream import Stream

FORMAT = "naoimitate-recording/1"
STEP, DATAGRAM, TOLD = 0, 1, 2
_HEAD = struct.Struct("<Bd")
_SENDER = struct.Struct("<BHI")
_TEXTS = struct.Struct("<BH")
LARGEST_HEADER = 65536
LARGEST_TIME = 1e10
"""s on any machine's clock."""
LONGEST_GAP = 3600.0
"""s between two steps."""
LONGEST_REASON = 1000
"""Bytes of a fault's reason."""


class Recorder:
    """Writes a recording. Raises StreamError where it cannot."""

    def __init__(self, path: Path, header: dict[str, Any]) -> None:
        try:
            self._file: BinaryIO = path.open("wb", buffering=1 << 16)
        except OSError as error:
            raise StreamError(f"cannot write {path}: {error.strerror}; choose another with --record") from error
        self._file.write(json.dumps({"format": FORMAT, **header}).encode() + b"\n")
        self._flushed = 0.0

    def datagram(self, datagram: Datagram) -> None:
        """A datagram that has come."""
        host = datagram.address[0].encode()[:255]
        self._file.write(_HEAD.pack(DATAGRAM, datagram.arrival))
        self._file.write(_SENDER.pack(len(host), datagram.address[1], len(datagram.payload)) + host + datagram.payload)

    def beat(self, beat: Beat) -> None:
        """A turn of the loop; twice a second everything so far is handed to the system."""
        now = beat.turn.now
        for event, reason in beat.tick.told:
            word, why = event.value.encode(), reason.encode()[:LONGEST_REASON]
            self._file.write(_HEAD.pack(TOLD, now) + _TEXTS.pack(len(word), len(why)) + word + why)
        self._file.write(_HEAD.pack(STEP, now))
        if now - self._flushed > 0.5:
            self._file.flush()
            self._flushed = now

    def close(self) -> None:
        """The end."""
        self._file.close()


class Told(NamedTuple):
    """What a session was told by its operator or its driver; see ``Session.tell``."""

    event: Event
    reason: str


class Step(NamedTuple):
    """A step of a session, and when (s) it was."""

    now: float


@dataclass(frozen=True)
class Recording:
    """header: what the recorder was told. events: what happened, in order."""

    header: dict[str, Any]
    events: list[Datagram | Told | Step]


def read_recording(path: Path) -> Recording:
    """Raises StreamError for a file that is no recording."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise StreamError(f"cannot read {path}: {error.strerror}") from error
    header = _header(data)
    if header is None:
        raise StreamError(f"{path} is no recording of a session: make one with 'naoimitate live --record'")
    try:
        return Recording(header, list(_events(data, data.find(b"\n") + 1)))
    except ValueError as error:
        raise StreamError(f"{path} is damaged ({error}): nothing of it can be trusted") from error


def is_recording(path: Path) -> bool:
    """Whether a file begins like a recording."""
    try:
        with path.open("rb") as file:
            return _header(file.read(LARGEST_HEADER)) is not None
    except OSError:
        return False


def play(recording: Recording, session: Session, stream: Stream) -> Iterator[Turn]:
    """The turns of a recorded session again, as fast as the computer can."""
    session.start()
    for event in recording.events:
        if isinstance(event, Datagram):
            stream.take(event.arrival, event.address, event.payload)
        elif isinstance(event, Told):
            session.tell(event.event, event.reason)
        else:
            newest = stream.newest()
            if newest is not None:
                session.see(newest[1].frame, newest[0])
            started = time.perf_counter()
            tick = session.step(event.now)
            yield Turn(tick, event.now, imitate=time.perf_counter() - started)


def paced(turns: Iterator[Turn]) -> Iterator[Turn]:
    """Turns of another time, each when it is due counted from the first one."""
    begin = first = 0.0
    for turn in turns:
        begin, first = (begin, first) if begin else (time.monotonic(), turn.now)
        time.sleep(max(0.0, begin + turn.now - first - time.monotonic()))
        yield turn


def _header(data: bytes) -> dict[str, Any] | None:
    """The first line of a recording; None where there is none."""
    end = data.find(b"\n", 0, LARGEST_HEADER)
    try:
        header = json.loads(data[:end]) if end > 0 else None
    except (ValueError, RecursionError):
        return None
    return header if isinstance(header, dict) and header.get("format") == FORMAT else None


def _events(data: bytes, at: int) -> Iterator[Datagram | Told | Step]:
    """Everything up to a torn end. Raises ValueError for what nobody has written."""
    last = math.nan
    while at + _HEAD.size <= len(data):
        kind, moment = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        if not abs(moment) < LARGEST_TIME:
            raise ValueError(f"a time of {moment} s")
        if kind == STEP and not (math.isnan(last) or last <= moment <= last + LONGEST_GAP):
            raise ValueError(f"a step at {moment} s after one at {last} s")
        if kind == STEP:
            last = moment
            yield Step(moment)
            continue
        if kind not in (DATAGRAM, TOLD):
            raise ValueError(f"a record of kind {kind}")
        form = _SENDER if kind == DATAGRAM else _TEXTS
        if at + form.size > len(data):
            return
        sizes = form.unpack_from(data, at)
        at += form.size
        lengths = (sizes[0], sizes[-1])
        if at + sum(lengths) > len(data):
            return
        first, second = data[at : at + lengths[0]], data[at + lengths[0] : at + sum(lengths)]
        at += sum(lengths)
        if kind == TOLD:
            yield Told(Event(first.decode(errors="replace")), second.decode(errors="replace"))
        else:
            yield Datagram(moment, (first.decode(errors="replace"), sizes[1]), second)
