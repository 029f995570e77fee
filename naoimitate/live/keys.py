"""Keys of the operator's terminal: what they mean, and a thread that reads them, so that none has to wait."""

from __future__ import annotations

import os
import select
import sys
import threading
from collections import deque
from types import TracebackType

from naoimitate.core.errors import DriverError
from naoimitate.fsm.session import Event, State
from naoimitate.hw.guarded import GuardedDriver
from naoimitate.live.session import Session

HELP = "space: emergency stop   c: pause or go on   u: upper body only or all   r: reset after a fault   q: end"
EMERGENCY = " "
PERIOD = 0.1
"""[s] after which the thread looks whether it is still wanted."""


class Keys:
    """Reads the terminal while it is open. The emergency stop is carried out at once, whatever else goes on."""

    def __init__(self, driver: GuardedDriver) -> None:
        self._driver = driver
        self._pressed: deque[str] = deque()
        self._halt = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def open(self) -> bool:
        """Whether there is a terminal that can do so."""
        return self._thread is not None

    def __enter__(self) -> Keys:
        try:
            import termios
            import tty
        except ImportError:  # no POSIX terminals here
            return self
        if sys.stdin is None or not sys.stdin.isatty():
            return self
        self._before = termios.tcgetattr(sys.stdin)
        tty.setcbreak(sys.stdin)
        self._thread = threading.Thread(target=self._read, name="keys", daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._thread is None:
            return
        import termios

        self._halt.set()
        self._thread.join()
        self._thread = None
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)

    def pressed(self) -> str:
        """All keys since the last call but the emergency stop."""
        return "".join(self._pressed.popleft() for _ in range(len(self._pressed)))

    def _read(self) -> None:
        while not self._halt.is_set():
            if not select.select([sys.stdin], [], [], PERIOD)[0]:
                continue
            keys = os.read(sys.stdin.fileno(), 64).decode(errors="ignore")
            if not keys:  # the terminal has gone
                return
            if EMERGENCY in keys:
                self._driver.emergency_stop()
            self._pressed.extend(keys.replace(EMERGENCY, ""))


def obey(keys: str, session: Session, driver: GuardedDriver) -> bool:
    """Do what the operator wants; returns whether the session is to end.

    Only a session in fault is reset: a robot that follows is not connected anew.
    """
    for key in keys:
        if key == "c":
            session.tell(Event.CLUTCH)
        elif key == "u":
            session.tell(Event.BODY)
        elif key == "r" and session.state is State.FAULT:
            _reset(session, driver)
        elif key == "q":
            return True
    return False


def _reset(session: Session, driver: GuardedDriver) -> None:
    """Connect again; a robot that cannot be is still in fault, for the reason that the panel shows."""
    session.reason = "hold the robot: it is let down, and stands up again"
    try:
        driver.reset()
        driver.connect()
    except DriverError as error:
        session.reason = str(error)
    else:
        session.tell(Event.RESET)
