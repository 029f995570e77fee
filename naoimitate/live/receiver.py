"""Datagrams from the network: one UDP socket, read without waiting."""

from __future__ import annotations

import errno
import select
import socket
import time
from typing import NamedTuple, Protocol

from naoimitate.core.errors import StreamError
from naoimitate.live.stream import Address

LARGEST = 65536
"""Bytes of the largest datagram."""
BUFFER = 1 << 21
"""Bytes that the system may keep for us: a quarter of a second of the largest streams."""
MOST = 256
"""Datagrams read at a time: a flood does not keep the robot waiting."""


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
        self.port: int = self._socket.getsockname()[1]
        self.ended = False

    def wait(self, timeout: float) -> bool:
        """Wait at most ``timeout`` s for a datagram; whether one is there."""
        return bool(select.select([self._socket], [], [], max(timeout, 0.0))[0])

    def read(self) -> list[Datagram]:
        """What has come since the last call."""
        found: list[Datagram] = []
        while len(found) < MOST:
            try:
                payload, address = self._socket.recvfrom(LARGEST)
            except BlockingIOError:
                break
            except OSError:  # an error of an earlier packet, told by the system: nothing has come
                continue
            found.append(Datagram(time.monotonic(), (str(address[0]), int(address[1])), payload))
        return found

    def close(self) -> None:
        """Listen no more."""
        self._socket.close()


def _why(error: Exception, bind: str, port: int) -> str:
    code = getattr(error, "errno", None)
    if code == errno.EADDRINUSE:
        return f"port {port} is in use: stop the other program, or choose another with --port"
    if code == errno.EACCES:
        return f"port {port} needs rights that this user has not: choose one above 1023 with --port"
    if isinstance(error, OverflowError):
        return f"{port} is no port: choose one of 1 to 65535 with --port"
    return f"cannot listen on {bind} port {port}: choose an address of this machine with --bind"
