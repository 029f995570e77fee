"""An operator measured from a stream: the first T-pose that they hold still."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from naoimitate.calib.subject import Subject, calibrate
from naoimitate.core.errors import CalibrationError
from naoimitate.live.clock import SenderClock
from naoimitate.live.filter import LandmarkFilter
from naoimitate.live.receiver import Source
from naoimitate.live.sample import with_pelvis
from naoimitate.live.stream import Stream
from naoimitate.live.tpose import TPoseWatch

PERIOD = 0.1
"""[s] between two words to the operator."""


def measure_operator(stream: Stream, source: Source, say: Callable[[float], None], patience: float) -> Subject:
    """Wait for a T-pose and measure who holds it.

    say: told several times a second for how long (s) the pose still has to be held. Raises CalibrationError when nobody
    has held one within ``patience`` s.
    """
    watch, clock, smooth = TPoseWatch(), SenderClock(), LandmarkFilter()
    end = time.monotonic() + patience
    while time.monotonic() < end and not source.ended:
        source.wait(PERIOD)
        for datagram in source.read():
            stream.take(datagram.arrival, datagram.address, datagram.payload)
            if (newest := stream.newest()) is None:
                continue
            arrival, sample = newest
            frame = with_pelvis(replace(sample.frame, time=clock.moment(sample.frame.time, arrival)))
            if (held := watch.see(smooth.step(frame))) is None:
                continue
            try:
                return calibrate(held)
            except CalibrationError:
                watch.reset()
        say(watch.left)
    why = stream.complaint() or ("no packet came" if not stream.counts.datagrams else "nobody held one still")
    raise CalibrationError(f"no T-pose within {patience:g} s: {why}")
