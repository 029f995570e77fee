"""Keys of the operator's terminal: what they mean, and how to read them without waiting."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from naoimitate.core.errors import DriverError
from naoimitate.fsm.session import Event, State
from naoimitate.hw.guarded import GuardedDriver
from naoimitate.live.session import Session

HELP = "space: emergency stop   c: pause or go on   u: upper body only or all   r: reset after a fault   q: end"


@contextmanager
def listening() -> Iterator[bool]:
    """While this lasts keys come at once; gives whether there is a terminal that can do so."""
    try:
        import termios
        import tty
    except ImportError:  # no POSIX terminals here
        yield False
        return
    if not sys.stdin.isatty():
        yield False
        return
    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)
    try:
        yield True
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def pressed() -> str:
    """All keys pressed since the last call; none waits in a buffer of ours, an emergency stop least of all."""
    ready = select.select([sys.stdin], [], [], 0.0)[0]
    return os.read(sys.stdin.fileno(), 64).decode(errors="ignore") if ready else ""


def obey(keys: str, session: Session, driver: GuardedDriver) -> bool:
    """Do what the operator wants, the emergency stop first; returns whether the session is to end.

    Only a session in fault is reset: a robot that follows is not connected anew.
    """
    if " " in keys:
        driver.emergency_stop()
        return False
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
