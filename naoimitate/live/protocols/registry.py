"""The registry of live protocols. To add one, write its file and name its constant here."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from naoimitate.live.sample import StreamProtocol

_HOME = "naoimitate.live.protocols."
_CONSTANTS = {"xsens": "XSENS", "vmc": "VMC", "rokoko": "ROKOKO", "plain": "JSON"}
_FOUND: list[StreamProtocol] = [
    getattr(import_module(_HOME + module), constant)
    for module, constant in _CONSTANTS.items()
    if find_spec(_HOME + module)
]
PROTOCOLS: dict[str, StreamProtocol] = {protocol.name: protocol for protocol in _FOUND}
"""Protocols by the names that ``--source`` and ``--protocol`` take."""


def looks_like(datagram: bytes) -> StreamProtocol | None:
    """The protocol that a datagram seems to be of, for a clear word about a wrong ``--source``; None when of none."""
    return next((protocol for protocol in PROTOCOLS.values() if protocol.recognises(datagram)), None)
