"""Keys of the operator's terminal: what they mean, and how to read them without waiting."""

from __future__ import annotations

import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager

HELP = "space: emergency stop   c: pause or go on   r: reset after a fault   q: end"


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
    """The next key that was pressed, or nothing."""
    return sys.stdin.read(1) if select.select([sys.stdin], [], [], 0.0)[0] else ""
