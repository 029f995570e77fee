"""The end of a connection: begun once, carried out by a thread of its own, and waited for by whoever needs it.

So nothing that interrupts the one who ends it leaves the robot as it is, and an emergency stop need not wait.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

GRACE = 0.05
"""[s] that an emergency stop waits for the driver to let go of the robot; what takes longer goes on by itself."""
LOOK = 0.002
"""[s] between two looks meanwhile."""
AGAIN = 0.05
"""[s] after which a driver that is still connecting is stopped again."""


class LettingGo:
    """Letting go of the robot of one connection. stop: ends it; again: the same for a driver that is connecting."""

    def __init__(self, stop: Callable[[], None], again: Callable[[], None]) -> None:
        self._stop, self._again = stop, again
        self._begun, self._done, self._arrived = threading.Lock(), threading.Event(), threading.Event()

    def begin(self) -> bool:
        """Whether the caller is the first who wants it, and shall ``go``."""
        return self._begun.acquire(blocking=False)

    def go(self) -> None:
        """Let go, in a thread that outlives the program's last one."""
        threading.Thread(target=self._run, name="letting go").start()

    def arrived(self) -> None:
        """The driver's ``connect`` has ended."""
        self._arrived.set()

    def wait(self) -> None:
        """Until the robot is let go of."""
        self._done.wait()

    def wait_briefly(self) -> None:
        """The same for ``GRACE`` at most, without a lock, which an interrupted thread might hold."""
        end = time.monotonic() + GRACE
        while not self._done.is_set() and time.monotonic() < end:
            time.sleep(LOOK)

    def _run(self) -> None:
        """Stop, and again while the driver is connecting: what comes before it has begun with that does not count."""
        self._stop()
        while not self._arrived.wait(AGAIN):
            self._again()
        self._done.set()
