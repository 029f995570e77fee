"""The order of a sender's frames: the newest is used, a late one is left out, a sender that begins anew is believed.

Frames are known by the sender's counter, or by its time where it has none. A network that delays every frame on its own
brings late ones that look like a sender that has begun again, so a number lower than the last is a stranger only where
it cannot be late: it came before and more than ``OVERTAKEN`` ago, it lies further than ``LATE`` behind, or frames have
come for ``OVERTAKEN`` with none of them in order. Three strangers in a row that go on from each other are believed.
As long as no frame comes later than ``OVERTAKEN`` after it was sent, nothing ever goes back without a restart.
"""

from __future__ import annotations

import enum
import math
from collections import deque
from dataclasses import dataclass, field

BELIEVED = 3
"""Frames that must follow each other before a number that jumped is believed."""
OVERTAKEN = 0.25
"""[s] by which the network may delay a frame, or its double, beyond others."""
LATE = 1.0
"""[s] of frames behind the last one in which those lie that are only late."""
LARGEST_STEP = 1000
"""A counter that grows by more in a frame has jumped,"""
LONGEST_STEP = 10.0
"""[s] and a clock that does."""
MOST_NUMBERS = 1024
"""Numbers that are remembered: a second and more of every sender that we know."""
PACED = 256
"""Frames that the pace of a counter is measured on."""
USUAL_PACE = 240.0
"""[1/s] of a counter that nothing is known of yet: the fastest suits."""


class Place(enum.Enum):
    """Where a number lies in a run of numbers."""

    NEXT = enum.auto()
    LATE = enum.auto()
    AGAIN = enum.auto()
    """It came a moment ago."""
    STRANGE = enum.auto()


class Run:
    """Numbers that go on from each other, and when (s) they came.

    counted: whether they are counters, else s. pace: of a counter, 1/s, until it is known.
    """

    def __init__(self, number: float, arrival: float, counted: bool, pace: float = USUAL_PACE) -> None:
        self._first, self._last, self._counted = number, number, counted
        self._pace = pace if counted else 1.0
        self._came = {number: arrival}
        self._used = deque([(arrival, number)], maxlen=PACED)
        self.length = 1
        """Numbers that came in order."""
        self.lost = 0
        """Numbers of a counter, since the first, that have not come."""

    @property
    def pace(self) -> float:
        """Numbers a second."""
        (begin, first), (end, last) = self._used[0], self._used[-1]
        return (last - first) / (end - begin) if self._counted and end - begin > OVERTAKEN else self._pace

    def distance(self, number: float, arrival: float) -> float:
        """How far a number is from the one that is due at its arrival."""
        return abs(number - self._last - self.pace * (arrival - self._used[-1][0]))

    def place(self, number: float, arrival: float) -> Place:
        """Where a number lies that comes now."""
        if 0 < number - self._last <= (LARGEST_STEP if self._counted else LONGEST_STEP):
            return Place.NEXT
        if number in self._came:
            return Place.AGAIN if arrival - self._came[number] <= OVERTAKEN else Place.STRANGE
        return Place.LATE if -LATE * self.pace <= number - self._last < 0 else Place.STRANGE

    def take(self, number: float, arrival: float) -> Place:
        """Remember a number; returns its place. Strange ones are not remembered."""
        place = self.place(number, arrival)
        if place is Place.NEXT:
            self.lost += int(number - self._last) - 1 if self._counted else 0
            if arrival - self._used[-1][0] > OVERTAKEN:  # a pause says nothing of the pace
                self._pace = self.pace
                self._used.clear()
            self._used.append((arrival, number))
            self._last, self.length = number, self.length + 1
        elif place is Place.LATE and self._counted and number > self._first:
            self.lost -= 1
        if place in (Place.NEXT, Place.LATE):
            self._came[number] = arrival
            if len(self._came) > MOST_NUMBERS:
                del self._came[next(iter(self._came))]
        return place

    def holds(self, number: float) -> bool:
        """Whether a number lies within a second of the last one, either way."""
        return abs(number - self._last) <= LATE * self.pace


@dataclass
class Order:
    """Which frames of a sender are used.

    late: frames that were not, doubles among them. restarts: jumps that were believed.
    """

    late: int = 0
    restarts: int = 0
    _run: Run | None = field(default=None, init=False)
    _strangers: Run | None = field(default=None, init=False)
    _past: Run | None = field(default=None, init=False)
    _restarted: float = field(default=-math.inf, init=False)
    _astray: float = field(default=math.nan, init=False)
    """When the first frame came after the last used one."""
    _lost: int = field(default=0, init=False)

    def begin(self) -> None:
        """Another sender comes; what was counted stays."""
        self._lost, self._run, self._past, self._strangers, self._astray = self.lost, None, None, None, math.nan

    @property
    def lost(self) -> int:
        """Numbers of the senders' counters that have not come."""
        return self._lost + sum(run.lost for run in (self._run, self._past) if run is not None)

    def takes(self, number: float, arrival: float, counted: bool) -> bool:
        """Whether a frame that comes at ``arrival`` s is used. number: a counter where ``counted``, else s."""
        if self._run is None:
            self._run = Run(number, arrival, counted)
            return True
        used = not self._was_before(self._run, number, arrival) and self._continues(self._run, number, arrival, counted)
        if used:
            self._strangers, self._astray = None, math.nan
        else:
            self.late += 1
        return used

    def _was_before(self, run: Run, number: float, arrival: float) -> bool:
        """Whether a frame is a late one of the run before the restart."""
        past = self._past
        if past is None or arrival - self._restarted > LATE or not past.holds(number):
            return False
        if past.distance(number, arrival) >= run.distance(number, arrival):
            return False
        past.take(number, arrival)
        return True

    def _continues(self, run: Run, number: float, arrival: float, counted: bool) -> bool:
        """Whether a frame is the next one, or the last that a restart needs to be believed."""
        place = run.place(number, arrival)
        if math.isnan(self._astray):
            self._astray = arrival
        lost_track = arrival - self._astray > OVERTAKEN
        if place is not Place.NEXT and (place is Place.STRANGE or lost_track):
            return self._believes(run, number, arrival, counted)
        return run.take(number, arrival) is Place.NEXT

    def _believes(self, run: Run, number: float, arrival: float, counted: bool) -> bool:
        strangers = self._strangers
        place = Place.STRANGE if strangers is None else strangers.take(number, arrival)
        if strangers is None or place is Place.STRANGE:
            self._strangers = Run(number, arrival, counted, run.pace)
            return False
        if place is not Place.NEXT or strangers.length < BELIEVED:
            return False
        self._lost += self._past.lost if self._past is not None else 0
        self._past, self._run, self._restarted = run, strangers, arrival
        self.restarts += 1
        return True
