"""Faults of simulated motors on demand: ``NODE:KIND@SECONDS``, such as ``12:silent@3`` or ``LKneePitch:hot@0``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from naoimitate.core.errors import DriverError

KINDS = {
    "stuck": "does not move any more, and does not know it",
    "silent": "does not answer any more; it still obeys",
    "crc": "answers with wrong checksums",
    "hot": "gets hotter by 20 degrees a second, and switches itself off at 90",
    "bus-off": "sends error frames, leaves the bus for a second, and is off when it comes back",
}
"""What a motor with that fault does."""


@dataclass(frozen=True)
class StubFault:
    """A motor's number, one of ``KINDS``, and when it begins, s after the start of the simulated motors."""

    node: int
    kind: str
    start: float = 0.0


def parse_fault(text: str, nodes: Mapping[str, int]) -> StubFault:
    """Read ``NODE:KIND[@SECONDS]``; nodes: numbers of the motors by the name of their joint. DriverError if unclear."""
    node, _, rest = text.partition(":")
    kind, _, start = rest.partition("@")
    number = nodes.get(node, int(node) if node.isdecimal() else -1)
    if number not in nodes.values():
        raise DriverError(f"fault {text!r}: there is no motor {node!r}; give a number or a joint of the joint map")
    if kind not in KINDS:
        raise DriverError(f"fault {text!r}: unknown kind {kind!r}; give one of {', '.join(KINDS)}")
    try:
        return StubFault(number, kind, float(start or 0.0))
    except ValueError:
        raise DriverError(f"fault {text!r}: {start!r} is no time in seconds") from None
