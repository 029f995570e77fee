"""A sender of test streams: a performance becomes datagrams, the network loses and delays them, a socket sends them."""

from __future__ import annotations

import heapq
import itertools
import random
import socket
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from naoimitate.core.errors import StreamError
from naoimitate.live.performance import Performance
from naoimitate.live.sample import Encoder

DEFAULT_RATE = 60.0
"""Hz, where the motion is a single frame."""
HELD_BACK = (1.0, 3.0)
"""Intervals between frames by which a datagram comes late that is to be overtaken, from and to."""


@dataclass(frozen=True)
class Conditions:
    """What the network does to every datagram on its own.

    loss: share that never arrives. jitter: s, delays are even between 0 and this. duplicate: share that comes twice.
    reorder: share that is held back until later ones have gone. seed: of the chance.
    """

    loss: float = 0.0
    jitter: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    seed: int = 0


@dataclass
class Tally:
    """What a network did: datagrams that were given to it, lost, doubled, held back, and sent on."""

    given: int = 0
    lost: int = 0
    doubled: int = 0
    held_back: int = 0
    sent: int = 0


@dataclass(frozen=True)
class Address:
    """Where to send to: family of addresses, and the socket's address. text: for people."""

    family: socket.AddressFamily
    place: tuple[str | int | bytes, ...]
    text: str


def frames(performance: Performance, encoder: Encoder, rate: float) -> Iterator[tuple[float, list[bytes]]]:
    """The datagrams of every frame of a performance at ``rate`` Hz, with the frame's time, s."""
    count = int(performance.duration * rate + 1e-6) + 1
    for sequence in range(count):
        moment = sequence / rate
        yield moment, encoder.encode(performance.at(moment), sequence, moment)


def through(
    network: Conditions, source: Iterable[tuple[float, list[bytes]]], interval: float, tally: Tally
) -> Iterator[tuple[float, bytes]]:
    """Datagrams as a network delivers them: due times (s), never falling, and what is due.

    source: frames in the order of their times. interval: s between them. Counts into ``tally``.
    """
    chance, order = random.Random(network.seed), itertools.count()
    waiting: list[tuple[float, int, bytes]] = []
    for moment, datagrams in source:
        while waiting and waiting[0][0] < moment:
            yield _sent(waiting, tally)
        for datagram in datagrams:
            for due in _fate(network, chance, moment, interval, tally):
                heapq.heappush(waiting, (due, next(order), datagram))
    while waiting:
        yield _sent(waiting, tally)


def _fate(network: Conditions, chance: random.Random, moment: float, interval: float, tally: Tally) -> list[float]:
    """When a datagram of this moment comes: never, once or twice."""
    tally.given += 1
    if chance.random() < network.loss:
        tally.lost += 1
        return []
    late = 0.0
    if chance.random() < network.reorder:
        tally.held_back += 1
        late = chance.uniform(*HELD_BACK) * interval
    copies = 1
    if chance.random() < network.duplicate:
        tally.doubled += 1
        copies = 2
    return [moment + late + chance.uniform(0.0, network.jitter) for _ in range(copies)]


def _sent(waiting: list[tuple[float, int, bytes]], tally: Tally) -> tuple[float, bytes]:
    due, _, datagram = heapq.heappop(waiting)
    tally.sent += 1
    return due, datagram


def play(
    schedule: Iterable[tuple[float, bytes]],
    send: Callable[[bytes], None],
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Send every datagram when it is due, counted from now: waits are never added up, so no delay does either."""
    start = clock()
    for due, datagram in schedule:
        wait = start + due - clock()
        if wait > 0.0:
            sleep(wait)
        send(datagram)


def address(text: str, port: int) -> Address:
    """The UDP address that ``HOST``, ``HOST:PORT`` or ``[HOST]:PORT`` names; port: where the text has none.

    Raises StreamError where it names none.
    """
    host, given = text, ""
    if text.startswith("["):
        host, _, given = text[1:].partition("]")
        given = given.removeprefix(":")
    elif text.count(":") == 1:
        host, given = text.split(":")
    if given and not (given.isascii() and given.isdecimal() and 0 < int(given[:6]) < 65536):
        raise StreamError(f"{text!r} has no port from 1 to 65535: write HOST:PORT, like 127.0.0.1:{port}")
    try:
        found = socket.getaddrinfo(host or None, int(given or port), type=socket.SOCK_DGRAM) if host else []
    except (OSError, UnicodeError) as error:
        raise StreamError(f"no host is called {host!r}: write HOST:PORT, like 127.0.0.1:{port}") from error
    if not found:
        raise StreamError(f"{text!r} names no host: write HOST:PORT, like 127.0.0.1:{port}")
    family, _, _, _, place = found[0]
    shown = f"[{place[0]!s}]" if family == socket.AF_INET6 else str(place[0])
    return Address(family, place, f"{shown}:{place[1]!s}")


class UdpSender:
    """A UDP socket that sends to one address, whether or not somebody listens there; closed as a context manager.

    Raises StreamError where there is no way to the address.
    """

    def __init__(self, to: Address) -> None:
        self._to = to
        try:
            with socket.socket(to.family, socket.SOCK_DGRAM) as probe:
                probe.connect(to.place)
            self._socket = socket.socket(to.family, socket.SOCK_DGRAM)
        except OSError as error:
            raise self._unreachable(error) from error

    def __enter__(self) -> UdpSender:
        return self

    def __exit__(self, *exception: object) -> None:
        self._socket.close()

    def send(self, datagram: bytes) -> None:
        """Send a datagram. Raises StreamError where it cannot leave."""
        try:
            self._socket.sendto(datagram, self._to.place)
        except OSError as error:
            raise self._unreachable(error) from error

    def _unreachable(self, error: OSError) -> StreamError:
        return StreamError(f"cannot send to {self._to.text}: {error.strerror or error}; choose another with --to")
