"""What a stream brings, and what every protocol offers: a decoder, an encoder for test senders, a way to know it by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from naoimitate.core.frames import LANDMARK, HumanFrame

LARGEST = 262144
"""Bytes that a packed payload may grow to: 256 kB."""


@dataclass(frozen=True)
class Sample:
    """One moment of one person as a sender gives it.

    frame: landmarks in the world of ``HumanFrame``: m, z up, NaN where the sender has none; its time is the sender's
    own clock, s, NaN where it has none. sequence: the sender's counter, None where the protocol has none. person:
    number of the character on the port.
    """

    frame: HumanFrame
    sequence: int | None = None
    person: int = 0


class Decoder(Protocol):
    """Bytes of one protocol to samples; keeps what a sample needs of earlier datagrams, and nothing without bound."""

    def feed(self, datagram: bytes) -> list[Sample]:
        """The samples that a datagram completes, often one or none.

        Raises DatagramError for bytes that are damaged or not of this protocol, and never anything else; what was kept
        of earlier datagrams stays as it was.
        """


class Encoder(Protocol):
    """Frames of one person to the datagrams of one protocol."""

    def encode(self, frame: HumanFrame, sequence: int, time: float) -> list[bytes]:
        """The datagrams of a frame; sequence counts up from 0, time in s from the first frame."""


@dataclass(frozen=True)
class StreamProtocol:
    """One entry of the registry ``protocols.PROTOCOLS``.

    name: as in ``--source`` and ``--protocol``. title: for people. port: its usual UDP port. decoder, encoder: make a
    new one. recognises: whether a datagram looks like this protocol, for a clear word about a wrong ``--source``.
    """

    name: str
    title: str
    port: int
    decoder: Callable[[], Decoder]
    encoder: Callable[[], Encoder]
    recognises: Callable[[bytes], bool]


def with_pelvis(frame: HumanFrame) -> HumanFrame:
    """The frame, its pelvis between the hips where the sender has none."""
    p = frame.landmarks
    if np.isfinite(p[LANDMARK["pelvis"]]).all():
        return frame
    p = np.array(p, dtype=np.float64)
    p[LANDMARK["pelvis"]] = 0.5 * (p[LANDMARK["l_hip"]] + p[LANDMARK["r_hip"]])
    return replace(frame, landmarks=p)
