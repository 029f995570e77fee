"""A motion as if it came live: the datagrams of a test sender, in this process, each when it is due."""

from __future__ import annotations

import time
from collections.abc import Iterator

from naoimitate.live.receiver import Datagram
from naoimitate.live.stream import Address

HERE: Address = ("replay", 0)


class Playback:
    """A source of datagrams. schedule: due times (s from the first ``wait``), never falling, and what is due."""

    def __init__(self, schedule: Iterator[tuple[float, bytes]]) -> None:
        self._schedule, self._begin = schedule, 0.0
        self._next = next(schedule, None)

    @property
    def ended(self) -> bool:
        """Whether everything has come."""
        return self._next is None

    def wait(self, timeout: float) -> bool:
        """Wait at most ``timeout`` s for a datagram; whether one is there."""
        now = time.monotonic()
        self._begin = self._begin or now
        if self._next is None:
            time.sleep(max(timeout, 0.0))
            return False
        left = self._begin + self._next[0] - now
        time.sleep(max(min(left, timeout), 0.0))
        return left <= timeout

    def read(self) -> list[Datagram]:
        """What has come since the last call."""
        found = []
        while self._next is not None and self._begin + self._next[0] <= (now := time.monotonic()):
            found.append(Datagram(now, HERE, self._next[1]))
            self._next = next(self._schedule, None)
        return found
