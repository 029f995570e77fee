"""The registry of live protocols. To add one, write its file and name its constant here."""

from __future__ import annotations

from naoimitate.live.protocols.plain import JSON
from naoimitate.live.protocols.rokoko import ROKOKO
from naoimitate.live.protocols.vmc import VMC
from naoimitate.live.protocols.xsens import XSENS
from naoimitate.live.sample import StreamProtocol

PROTOCOLS: dict[str, StreamProtocol] = {protocol.name: protocol for protocol in (XSENS, VMC, ROKOKO, JSON)}
"""Protocols by the names that ``--source`` and ``--protocol`` take."""
