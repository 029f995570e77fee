"""The stream contract: the newest frame of one sender wins, nothing waits, and what is wrong is counted.

Pure: time comes with the datagrams. Which frames are in order says ``order``. Of several senders the first one that
shows a person is listened to until it has shown nobody for a second; until then each has a decoder of its own.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass, field

import numpy as np

from naoimitate.core.errors import DatagramError
from naoimitate.core.frames import LANDMARK, SIDES, HumanFrame
from naoimitate.live.order import Order
from naoimitate.live.sample import Decoder, Sample, StreamProtocol

Address = tuple[str, int]

SILENCE = 1.0
"""[s] without a person after which another sender may take over."""
SENDERS = 8
"""Senders that are decoded at a time while none shows a person; who spoke longest ago makes room."""
RECENT = 256
"""Arrivals that jitter is measured on."""
RATED = 1.0
"""[s] before now in which the frames came that the rate is measured on."""
LACKING = 1.0
"""[s] for which landmarks must be missing before it is said."""
LONGEST_REASON = 200
"""Characters of a reason: it may quote what the sender wrote."""
NEEDED = tuple(
    f"{side}_{name}" for side in SIDES for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "toe")
)
"""Landmarks without which nobody can be imitated."""
_NEEDED = [LANDMARK[name] for name in NEEDED]


@dataclass
class Counts:
    """What has come so far."""

    datagrams: int = 0
    frames: int = 0
    late: int = 0
    """Frames older than the last one that was used, duplicates among them."""
    lost: int = 0
    """Numbers of the sender's counter that have not come, not even late."""
    damaged: int = 0
    """Datagrams that the protocol refuses."""
    foreign: int = 0
    """Datagrams of other senders."""
    restarts: int = 0
    """Times that the counter began anew."""
    others: dict[str, int] = field(default_factory=dict)
    """Damaged datagrams that look like another protocol."""


class Stream:
    """The newest frame of one person of one sender. One thread takes datagrams, others may read all but ``newest``."""

    def __init__(
        self, protocol: StreamProtocol, known: tuple[StreamProtocol, ...], allow: str | None = None, person: int = 0
    ) -> None:
        self._protocol, self._known, self._allow, self._person = protocol, known, allow, person
        self._decoders: OrderedDict[Address, Decoder] = OrderedDict()
        self.counts = Counts()
        self.sender: Address | None = None
        """Who is listened to."""
        self._heard = -math.inf
        self._order = Order()
        self._arrivals: tuple[float, ...] = ()
        self._newest: tuple[float, Sample] | None = None
        self._reason = ""
        self._missing: tuple[str, ...] = ()
        self._lacking, self._seen = math.nan, math.nan

    def take(self, arrival: float, address: Address, datagram: bytes) -> None:
        """Take a datagram that came at ``arrival`` s from an address; never raises."""
        self.counts.datagrams += 1
        if not self._listens_to(arrival, address):
            self.counts.foreign += 1
            return
        decoder = self._decoders.get(address) or self._protocol.decoder()
        try:
            samples = decoder.feed(datagram)
        except DatagramError as error:
            self._refuse(datagram, error)
            return
        self._keep(address, decoder)
        for sample in samples:
            if sample.person == self._person:
                self._see(arrival, address, sample)

    def newest(self) -> tuple[float, Sample] | None:
        """The newest frame since the last call, with its arrival; None where none has come."""
        newest, self._newest = self._newest, None
        return newest

    @property
    def rate(self) -> float:
        """Frames a second when the last one came; 0 with fewer than two."""
        arrivals = self._arrivals
        return self.rate_at(arrivals[-1]) if arrivals else 0.0

    def rate_at(self, now: float) -> float:
        """Frames a second in the last second before ``now`` s; falls to 0 when none come any more."""
        recent = [arrival for arrival in self._arrivals if now - RATED <= arrival]
        if len(recent) < 2 or recent[-1] <= recent[0]:
            return 0.0
        gap = (recent[-1] - recent[0]) / (len(recent) - 1)
        return (len(recent) - 1) / (recent[-1] - recent[0] + max(now - recent[-1] - gap, 0.0))

    @property
    def jitter(self) -> float:
        """Mean deviation (s) of the gaps between frames from their mean."""
        gaps = np.diff(self._arrivals)
        return float(np.abs(gaps - gaps.mean()).mean()) if len(gaps) else 0.0

    def complaint(self) -> str:
        """What is wrong with what comes, in a sentence; empty where it is understood, or nothing comes."""
        c, title, others = self.counts, self._protocol.title, dict(self.counts.others)
        if self._seen - self._lacking >= LACKING:
            return self._lack()
        if c.frames or not c.datagrams:
            return ""
        other = max(others, key=lambda other: others[other], default="")
        if other and 2 * others[other] >= c.damaged:
            return f"this looks like {other}, not {title}: choose its --source"
        if c.damaged:
            return f"{c.damaged} datagrams came that are not {title}: {self._reason}"
        if c.foreign:
            return f"{c.foreign} datagrams came, none of them from {self._allow}: look at --allow"
        return f"{title} comes, but no whole person of it: let the sender stream poses, and of the first person"

    def _lack(self) -> str:
        """What the person lacks, and that others speak, too."""
        missing = self._missing
        what = "anything of the person" if len(missing) == len(NEEDED) else ", ".join(missing)
        text = f"the sender does not see {what}: nobody can be imitated without"
        if self.sender is None or not self.counts.foreign or self._allow is not None:
            return text
        return f"{text}; other senders than {self.sender[0]} are left out: choose one with --allow"

    def _listens_to(self, arrival: float, address: Address) -> bool:
        if self._allow is not None and address[0] != self._allow:
            return False
        return self.sender in (None, address) or arrival - self._heard > SILENCE

    def _keep(self, address: Address, decoder: Decoder) -> None:
        """Keep the decoder of whoever speaks, and of no crowd; that of the sender stays."""
        self._decoders[address] = decoder
        for kept in (address, self.sender):
            if kept is not None and kept in self._decoders:
                self._decoders.move_to_end(kept)
        if len(self._decoders) > SENDERS:
            self._decoders.popitem(last=False)

    def _refuse(self, datagram: bytes, error: DatagramError) -> None:
        self.counts.damaged += 1
        text = str(error)[:LONGEST_REASON]
        self._reason = "".join(letter if letter.isprintable() else "?" for letter in text)
        for other in self._known:
            if other.name != self._protocol.name and other.recognises(datagram):
                self.counts.others[other.title] = self.counts.others.get(other.title, 0) + 1

    def _see(self, arrival: float, address: Address, sample: Sample) -> None:
        """A frame of our person: who shows somebody is listened to from now on."""
        missing = _missing(sample.frame)
        self._look(arrival, missing)
        if address != self.sender and len(missing) < len(NEEDED):
            self.sender = address
            self._order.begin()
            self._decoders = OrderedDict({address: self._decoders[address]})
        if address != self.sender:
            return
        self._heard = arrival
        if self._is_new(arrival, sample):
            self.counts.frames += 1
            self._arrivals = (*self._arrivals[1 - RECENT :], arrival)
            self._newest = arrival, sample

    def _look(self, arrival: float, missing: tuple[str, ...]) -> None:
        """Note what a frame lacks, and since when."""
        if not missing:
            self._lacking = math.nan
        elif math.isnan(self._lacking):
            self._lacking = arrival
        self._seen, self._missing = arrival, missing

    def _is_new(self, arrival: float, sample: Sample) -> bool:
        """Whether a sample is newer than the last used one; counts what was lost, late, or began again."""
        number = sample.frame.time if sample.sequence is None else sample.sequence
        if not math.isfinite(number):
            return True
        used = self._order.takes(number, arrival, sample.sequence is not None)
        self.counts.late, self.counts.lost = self._order.late, self._order.lost
        self.counts.restarts = self._order.restarts
        return used


def _missing(frame: HumanFrame) -> tuple[str, ...]:
    """The needed landmarks that a frame lacks."""
    rows = frame.landmarks[_NEEDED]
    if np.isfinite(rows.sum()):
        return ()
    return tuple(name for name, row in zip(NEEDED, rows, strict=True) if not np.isfinite(row).all())
