"""A recording of a live session: every datagram with its arrival, and the clock of every step.

A line of JSON says what it is; then come records, each a kind, a time, and for datagrams the sender and the bytes. A
torn end is left out. Played back, the same datagrams at the same times give the same commands, bit for bit.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from naoimitate.core.errors import StreamError
from naoimitate.live.receiver import Datagram
from naoimitate.live.session import Session, Tick
from naoimitate.live.stream import Stream

FORMAT = "naoimitate-recording/1"
STEP, DATAGRAM = 0, 1
_HEAD = struct.Struct("<Bd")
_SENDER = struct.Struct("<BHI")
LARGEST_HEADER = 65536


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

    def step(self, now: float) -> None:
        """A step of the session; twice a second everything so far is handed to the system."""
        self._file.write(_HEAD.pack(STEP, now))
        if now - self._flushed > 0.5:
            self._file.flush()
            self._flushed = now

    def close(self) -> None:
        """The end."""
        self._file.close()


@dataclass(frozen=True)
class Recording:
    """header: what the recorder was told. events: a datagram, or the time (s) of a step, in order."""

    header: dict[str, Any]
    events: list[Datagram | float]


def read_recording(path: Path) -> Recording:
    """Raises StreamError for a file that is no recording."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise StreamError(f"cannot read {path}: {error.strerror}") from error
    end = data.find(b"\n", 0, LARGEST_HEADER)
    try:
        header = json.loads(data[:end]) if end > 0 else {}
    except (ValueError, RecursionError):
        header = {}
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise StreamError(f"{path} is no recording of a session: make one with 'naoimitate live --record'")
    return Recording(header, list(_events(data, end + 1)))


def _events(data: bytes, at: int) -> Iterator[Datagram | float]:
    while at + _HEAD.size <= len(data):
        kind, time = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        if kind == STEP:
            yield time
            continue
        if kind != DATAGRAM or at + _SENDER.size > len(data):
            return
        host, port, size = _SENDER.unpack_from(data, at)
        at += _SENDER.size
        if at + host + size > len(data):
            return
        name = data[at : at + host].decode(errors="replace")
        yield Datagram(time, (name, port), data[at + host : at + host + size])
        at += host + size


def play(recording: Recording, session: Session, stream: Stream) -> Iterator[tuple[float, Tick]]:
    """The ticks of a recorded session again, with their times."""
    session.start()
    for event in recording.events:
        if isinstance(event, Datagram):
            stream.take(event.arrival, event.address, event.payload)
            continue
        newest = stream.newest()
        if newest is not None:
            session.see(newest[1].frame, newest[0])
        yield event, session.step(event)
