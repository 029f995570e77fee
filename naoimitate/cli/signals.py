"""Signals in a live session: the first asks for its end, a second one hurries; two others are emergency stops."""

from __future__ import annotations

import signal
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any

ENDING = tuple(s for name in ("SIGINT", "SIGTERM", "SIGHUP") if (s := getattr(signal, name, None)) is not None)
EMERGENCY = tuple(s for name in ("SIGQUIT", "SIGUSR1") if (s := getattr(signal, name, None)) is not None)
"""Ctrl-\\ in a terminal, and one for other programs."""


class Signals:
    """Handlers while it is open; emergency: called in the middle of whatever goes on.

    Until ``polled`` is set, a signal of the end is a KeyboardInterrupt; afterwards it is only counted.
    """

    def __init__(self, emergency: Callable[[], None]) -> None:
        self._emergency = emergency
        self._before: dict[int, Any] = {}
        self.polled = False
        self.count = 0
        """Signals of the end so far."""

    def __enter__(self) -> Signals:
        for number in ENDING:
            self._before[number] = signal.signal(number, self._end)
        for number in EMERGENCY:
            self._before[number] = signal.signal(number, lambda _, __: self._emergency())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _end(self, number: int, frame: FrameType | None) -> None:
        self.count += 1
        if not self.polled:
            raise KeyboardInterrupt
