"""The stream contract: the newest frame of one sender wins, nothing waits, and what is wrong is counted.

Pure: time comes with the datagrams. A frame older than the last used one is dropped, unless three in a row go on from
each other: then the sender has begun again. Of several senders the first one is listened to until it has been silent
for a second.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from naoimitate.core.errors import DatagramError
from naoimitate.live.sample import Decoder, Sample, StreamProtocol

Address = tuple[str, int]

BELIEVED = 3
"""Frames that must follow each other before a counter that jumped is believed."""
LARGEST_STEP = 1000
"""A counter that grows by more in a frame has jumped."""
SILENCE = 1.0
"""[s] after which another sender may take over."""
RECENT = 256
"""Arrivals that rate and jitter are measured on."""


@dataclass
class Counts:
    """What has come so far."""

    datagrams: int = 0
    frames: int = 0
    late: int = 0
    """Frames older than the last one that was used, duplicates among them."""
    lost: int = 0
    """Numbers that the sender's counter has skipped."""
    damaged: int = 0
    """Datagrams that the protocol refuses."""
    foreign: int = 0
    """Datagrams of other senders."""
    restarts: int = 0
    """Times that the counter began anew."""
    others: dict[str, int] = field(default_factory=dict)
    """Damaged datagrams that look like another protocol."""


class Stream:
    """The newest frame of one person of one sender."""

    def __init__(
        self, protocol: StreamProtocol, known: tuple[StreamProtocol, ...], allow: str | None = None, person: int = 0
    ) -> None:
        self._protocol, self._known, self._allow, self._person = protocol, known, allow, person
        self._decoder: Decoder = protocol.decoder()
        self.counts = Counts()
        self.sender: Address | None = None
        self._heard = -math.inf
        self._last: int | float | None = None
        self._strangers: list[int | float] = []
        self._arrivals: deque[float] = deque(maxlen=RECENT)
        self._newest: tuple[float, Sample] | None = None

    def take(self, arrival: float, address: Address, datagram: bytes) -> None:
        """Take a datagram that came at ``arrival`` s from an address; never raises."""
        self.counts.datagrams += 1
        if not self._listens_to(arrival, address):
            self.counts.foreign += 1
            return
        try:
            samples = self._decoder.feed(datagram)
        except DatagramError:
            self._refuse(datagram)
            return
        self.sender, self._heard = address, arrival
        for sample in samples:
            if sample.person == self._person and self._is_new(sample):
                self.counts.frames += 1
                self._arrivals.append(arrival)
                self._newest = arrival, sample

    def newest(self) -> tuple[float, Sample] | None:
        """The newest frame since the last call, with its arrival; None where none has come."""
        newest, self._newest = self._newest, None
        return newest

    @property
    def rate(self) -> float:
        """Frames a second, lately; 0 with fewer than two."""
        if len(self._arrivals) < 2 or self._arrivals[-1] <= self._arrivals[0]:
            return 0.0
        return (len(self._arrivals) - 1) / (self._arrivals[-1] - self._arrivals[0])

    @property
    def jitter(self) -> float:
        """Mean deviation (s) of the gaps between frames from their mean."""
        gaps = [b - a for a, b in zip(self._arrivals, list(self._arrivals)[1:], strict=False)]
        mean = sum(gaps) / len(gaps) if gaps else 0.0
        return sum(abs(gap - mean) for gap in gaps) / len(gaps) if gaps else 0.0

    def complaint(self) -> str:
        """What is wrong with what comes, in a sentence; empty where it is understood, or nothing comes."""
        c, title = self.counts, self._protocol.title
        if c.frames or not c.datagrams:
            return ""
        if c.others:
            other = max(c.others, key=lambda other: c.others[other])
            return f"this looks like {other}, not {title}: choose its --source"
        if c.damaged:
            return f"{c.damaged} datagrams came that are not {title}: look at the sender's protocol"
        if c.foreign:
            return f"{c.foreign} datagrams came, none of them from {self._allow}: look at --allow"
        return f"{title} comes, but no whole person of it: let the sender stream poses, and of the first person"

    def _listens_to(self, arrival: float, address: Address) -> bool:
        if self._allow is not None and address[0] != self._allow:
            return False
        if self.sender in (None, address):
            return True
        if arrival - self._heard <= SILENCE:
            return False
        self._decoder, self._last, self._strangers = self._protocol.decoder(), None, []
        return True

    def _refuse(self, datagram: bytes) -> None:
        self.counts.damaged += 1
        for other in self._known:
            if other.name != self._protocol.name and other.recognises(datagram):
                self.counts.others[other.title] = self.counts.others.get(other.title, 0) + 1

    def _is_new(self, sample: Sample) -> bool:
        """Whether a sample is newer than the last used one; counts what was lost, late, or began again."""
        number = sample.frame.time if sample.sequence is None else sample.sequence
        if not math.isfinite(number):
            return True
        if self._last is None or self._follows(self._last, number, sample):
            if self._last is not None and sample.sequence is not None:
                self.counts.lost += int(number - self._last) - 1
            self._last, self._strangers = number, []
            return True
        if number == self._last:
            self.counts.late += 1
            return False
        in_a_row = bool(self._strangers) and self._follows(self._strangers[-1], number, sample)
        self._strangers = [*self._strangers, number] if in_a_row else [number]
        if len(self._strangers) >= BELIEVED:
            self.counts.restarts += 1
            self._last, self._strangers = number, []
            return True
        self.counts.late += 1
        return False

    @staticmethod
    def _follows(last: float, number: float, sample: Sample) -> bool:
        most = LARGEST_STEP if sample.sequence is not None else LARGEST_STEP * 0.01
        return 0 < number - last <= most
