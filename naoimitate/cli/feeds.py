"""Where a live session's frames come from: the network, a motion as if live, or a recorded session."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from naoimitate.live.loop import Turn
    from naoimitate.live.receiver import Datagram
    from naoimitate.live.recording import Recording
    from naoimitate.live.sample import StreamProtocol
    from naoimitate.live.session import Session
    from naoimitate.live.stream import Stream

TPOSE = 3.0
"""[s] of T-pose before a motion that is played as if live."""


@dataclass(frozen=True)
class Feed:
    """name: of the source, for the run file. protocol: its name. ready: what to tell the operator. turns: the session's
    turns with a period (s) and a recorder of datagrams. close: listen no more. header: of a recorded session, or empty.
    """

    name: str
    protocol: str
    stream: Stream
    ready: str
    turns: Callable[[Session, float, Callable[[Datagram], None]], Iterator[Turn]]
    close: Callable[[], None] = lambda: None
    header: dict[str, Any] = field(default_factory=dict)


def open_feed(source: str, bind: str, port: int | None, allow: str | None) -> Feed:
    """The feed of ``--source``. Raises NaoimitateError where there is none."""
    from naoimitate.live.recording import is_recording, read_recording

    kind, _, name = source.partition(":")
    if kind != "replay":
        return _network(protocol_named(source), bind, port, allow)
    if is_recording(Path(name)):
        return _recorded(name, read_recording(Path(name)), allow)
    return _performed(name)


def protocol_named(name: str) -> StreamProtocol:
    """A protocol; StreamError where there is none of this name."""
    from naoimitate.core.errors import StreamError
    from naoimitate.live.protocols.registry import PROTOCOLS

    if name not in PROTOCOLS:
        raise StreamError(f"no source {name}: there are {', '.join(PROTOCOLS)} and replay:FILE")
    return PROTOCOLS[name]


def new_stream(protocol: StreamProtocol, allow: str | None) -> Stream:
    """The stream of a protocol, which knows the others when it sees them."""
    from naoimitate.live.protocols.registry import PROTOCOLS
    from naoimitate.live.stream import Stream

    return Stream(protocol, tuple(PROTOCOLS.values()), allow)


def _network(protocol: StreamProtocol, bind: str, port: int | None, allow: str | None) -> Feed:
    from naoimitate.live.loop import listen
    from naoimitate.live.receiver import Receiver

    receiver, stream = Receiver(bind, protocol.port if port is None else port), new_stream(protocol, allow)
    return Feed(
        f"live:{protocol.name}",
        protocol.name,
        stream,
        f"listening for {protocol.title} on {bind} port {receiver.port}",
        lambda session, period, record: listen(session, stream, receiver, period, record),
        receiver.close,
    )


def _performed(name: str) -> Feed:
    """A motion, sent and received without a network."""
    from naoimitate.cli.source import read_motion
    from naoimitate.live.loop import listen
    from naoimitate.live.performance import Performance
    from naoimitate.live.playback import Playback
    from naoimitate.live.sender import DEFAULT_RATE, frames

    protocol = protocol_named("json")
    motion = read_motion(name, tpose_at="auto", fps=None, unit=None, up=None, skeleton=None)
    stream, performance = new_stream(protocol, None), Performance(motion, TPOSE)
    schedule = frames(performance, protocol.encoder(), motion.rate or DEFAULT_RATE)
    playback = Playback((moment, datagram) for moment, datagrams in schedule for datagram in datagrams)
    return Feed(
        f"replay:{motion.name}",
        protocol.name,
        stream,
        f"playing {motion.name} as if live, after a T-pose of {TPOSE:g} s",
        lambda session, period, record: listen(session, stream, playback, period, record),
    )


def _recorded(name: str, recording: Recording, allow: str | None) -> Feed:
    from naoimitate.core.errors import StreamError
    from naoimitate.live.recording import paced, play

    header = recording.header
    try:
        protocol = protocol_named(str(header.get("protocol")))
    except StreamError as error:
        raise StreamError(f"{name} holds a stream of {header.get('protocol')}, which is not known here") from error
    stream = new_stream(protocol, allow or header.get("allow"))
    return Feed(
        f"replay:{Path(name).name}",
        protocol.name,
        stream,
        f"playing {name}",
        lambda session, period, record: paced(play(recording, session, stream)),
        header=header,
    )
