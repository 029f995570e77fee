"""The line from the computer to the servos: late, and sometimes dead."""

from __future__ import annotations

from collections import deque

from naoimitate.core.frames import Array

ROUNDING = 1e-6
"""Moments closer than this are the same, s."""


class CommandLine:
    """Passes on servo commands ``delay`` s late, and none of those given from ``dead_from`` s on for ``dead_time`` s.

    The far end always has the newest command that has arrived; before the first one does, it has the first, in which
    the robot was standing.
    """

    def __init__(self, delay: float = 0.0, dead_from: float = 0.0, dead_time: float = 0.0) -> None:
        self._delay, self._dead_from, self._dead_until = delay, dead_from, dead_from + dead_time
        self._under_way: deque[tuple[float, Array]] = deque()
        self._newest: Array | None = None

    def through(self, time: float, command: Array) -> Array:
        """Give a command (J,) rad at a time (s, increasing); return the one that the servos have then."""
        if self._newest is None:
            self._newest = command
        if not self._dead_from - ROUNDING <= time < self._dead_until - ROUNDING:
            self._under_way.append((time + self._delay, command))
        while self._under_way and self._under_way[0][0] <= time + ROUNDING:
            self._newest = self._under_way.popleft()[1]
        return self._newest
