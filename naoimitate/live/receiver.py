"""Datagrams from the network: one UDP socket, read without waiting.

A datagram's arrival is when the system got it, not when it is read (Linux; elsewhere they are one). The system's stamp
is of a clock that may be set while we listen, so it is believed only between what is known anyway: the datagram came
after the last time that none was there, less than a second ago, and not in the future.
"""

from __future__ import annotations

import errno
import select
import socket
import struct
import sys
import time
from typing import NamedTuple, Protocol

from naoimitate.core.errors import StreamError
from naoimitate.live.stream import Address

LARGEST = 65536
"""Bytes of the largest datagram."""
BUFFER = 1 << 21
"""Bytes that the system may keep for us: a quarter of a second of the largest streams."""
MOST = 4
"""Datagrams read at a time,"""
ENOUGH = 16384
"""and bytes after which no more are: whoever takes them looks at the clock in between, whatever a flood brings."""
OLDEST = 1.0
"""[s] that a datagram may have waited for us."""
_STAMP = 35
"""SO_TIMESTAMPNS of Linux (asm-generic/socket.h): the moment of arrival comes with every datagram."""
_AT_ONCE = 2e-5
"""[s] within which two clocks are looked at as one."""
_TIMESPEC = struct.Struct("@ll")


class Datagram(NamedTuple):
    """What came, from whom, and when (s, monotonic)."""

    arrival: float
    address: Address
    payload: bytes


class Source(Protocol):
    """Where datagrams come from."""

    @property
    def ended(self) -> bool:
        """Whether nothing will ever come again."""

    def wait(self, timeout: float) -> bool:
        """Wait at most ``timeout`` s for a datagram; whether one is there."""

    def read(self) -> list[Datagram]:
        """What has come since the last call."""


class Receiver:
    """Listens on one address and port. Raises StreamError where it cannot."""

    def __init__(self, bind: str, port: int) -> None:
        family = socket.AF_INET6 if ":" in bind else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
            self._socket.bind((bind, port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise StreamError(_why(error, bind, port)) from error
        self._socket.setblocking(False)
        self._stamped = sys.platform == "linux"
        if self._stamped:
            self._socket.setsockopt(socket.SOL_SOCKET, _STAMP, 1)
        self._empty = time.monotonic()
        self.port: int = self._socket.getsockname()[1]
        self.ended = False

    def wait(self, timeout: float) -> bool:
        """Wait at most ``timeout`` s for a datagram; whether one is there."""
        return bool(select.select([self._socket], [], [], max(timeout, 0.0))[0])

    def read(self) -> list[Datagram]:
        """What has come since the last call, the oldest first; of much only the beginning."""
        found: list[Datagram] = []
        size = 0
        while len(found) < MOST and size < ENOUGH:
            before = time.monotonic()
            try:
                payload, arrival, address = self._receive()
            except BlockingIOError:
                self._empty = before
                break
            except OSError:  # an error of an earlier packet, or a lasting one: nothing has come
                break
            size += len(payload)
            found.append(Datagram(arrival, (str(address[0]), int(address[1])), payload))
        return found

    def _receive(self) -> tuple[bytes, float, tuple[str, int]]:
        """The next datagram, when it came, and from whom."""
        if not self._stamped:
            payload, address = self._socket.recvfrom(LARGEST)
            return payload, time.monotonic(), address
        payload, notes, _, address = self._socket.recvmsg(LARGEST, socket.CMSG_SPACE(_TIMESPEC.size))
        now = time.monotonic()
        for level, kind, data in notes:
            if level == socket.SOL_SOCKET and kind == _STAMP and len(data) == _TIMESPEC.size:
                seconds, nanoseconds = _TIMESPEC.unpack(data)
                came = seconds + 1e-9 * nanoseconds - _ahead()
                return payload, min(max(came, self._empty, now - OLDEST), now), address
        return payload, now, address

    def close(self) -> None:
        """Listen no more."""
        self._socket.close()


def _ahead() -> float:
    """s that the system's clock is ahead of ours; looked at again where something came between the two looks."""
    for _ in range(3):
        before, stamp, after = time.monotonic(), time.time(), time.monotonic()
        if after - before < _AT_ONCE:
            break
    return stamp - after


def _why(error: Exception, bind: str, port: int) -> str:
    code = getattr(error, "errno", None)
    if code == errno.EADDRINUSE:
        return f"port {port} is in use: stop the other program, or choose another with --port"
    if code == errno.EACCES:
        return f"port {port} needs rights that this user has not: choose one above 1023 with --port"
    if isinstance(error, OverflowError):
        return f"{port} is no port: choose one of 1 to 65535 with --port"
    return f"cannot listen on {bind} port {port}: choose an address of this machine with --bind"
