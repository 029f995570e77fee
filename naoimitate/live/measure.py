"""An operator measured from a stream: the first T-pose that they hold still."""

from __future__ import annotations

import time
from collections.abc import Callable

from naoimitate.calib.subject import Subject
from naoimitate.core.errors import CalibrationError
from naoimitate.live.eye import Eye
from naoimitate.live.receiver import Source
from naoimitate.live.stream import Stream

PERIOD = 0.1
"""[s] between two words to the operator."""


def measure_operator(stream: Stream, source: Source, say: Callable[[float], None], patience: float) -> Subject:
    """Wait for a T-pose and measure who holds it.

    say: told several times a second for how long (s) the pose still has to be held. Raises CalibrationError when nobody
    has held one within ``patience`` s.
    """
    eye, end = Eye(), time.monotonic() + patience
    while time.monotonic() < end and not source.ended:
        source.wait(PERIOD)
        for datagram in source.read():
            stream.take(datagram.arrival, datagram.address, datagram.payload)
            if (newest := stream.newest()) is None:
                continue
            arrival, sample = newest
            subject = eye.measure(eye.look(eye.receive(sample.frame, arrival)))
            if subject is not None:
                return subject
        say(eye.countdown)
    why = stream.complaint() or eye.complaint
    raise CalibrationError(f"no T-pose within {patience:g} s: {why or _nothing(stream)}")


def _nothing(stream: Stream) -> str:
    return "nobody held one still" if stream.counts.datagrams else "no packet came"
