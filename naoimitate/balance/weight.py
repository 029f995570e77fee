"""The weight between the feet: the offset as the CoM really has it, and when a foot may be lifted."""

from __future__ import annotations

import math
from typing import NamedTuple

from naoimitate.balance.offset import OffsetLaw, Span, advance
from naoimitate.fsm.support import OFFSET_REACHED

LIFT_STILL = 0.06
"""[s] for which the offset has been where it belongs before a foot is lifted: the servos have unloaded it by then..."""
PROMPT, SETTLED = 0.2, 0.4
"""[s] ...but not between these times after it has come there in a brisk shift: the body, carried on over soft ankles,
swings back then, and the other foot is set down once more."""
COM_LATE = 0.003
"""[m] by which the CoM may be off its place before the offset waits for it..."""
PATIENCE = 0.15
"""[s] ...and the time in which as much again is let pass: a CoM that cannot get there must not wait for ever."""
COM_THERE = 0.006
"""[m] by which it may be off its place over one foot when the other one is lifted."""
HURRY = 0.45
"""Share of its speed that a leg's joint may use before the weight is shifted more slowly."""
LOADED, TOO_LOADED = 1.0, 1.3
"""Shares of the bound of a joint's torque between which the weight is shifted on to it more and more slowly..."""
STOP = 0.1
"""[s] in which the body can stop: a joint of a leg whose range ends sooner slows the shift, too..."""
SLOWEST = 0.2
"""...down to this share of the speed: the legs straighten meanwhile."""


class Body(NamedTuple):
    """What the last step has made of the body.

    calm: it moves little enough for a foot to be lifted. steady: its zero moment point is where its CoM is. speed:
    share of its speed that the fastest joint of the legs uses. load: share of its bound that their largest torque has,
    or will have when the weight has been shifted. end: s until the first joint of the legs, each at its speed, is at
    the end of its range or of its coupling table.
    """

    calm: bool = True
    steady: bool = True
    speed: float = 0.0
    load: float = 0.0
    end: float = math.inf

    @property
    def pace(self) -> float:
        """The share of its speed at which the weight may be shifted."""
        room = (TOO_LOADED - self.load) / (TOO_LOADED - LOADED)
        return min(1.0, HURRY / max(self.speed, HURRY)) * min(max(min(room, self.end / STOP), SLOWEST), 1.0)


class Weight:
    """The normalised offset on its way; times are added up in ``step``."""

    def __init__(self, law: OffsetLaw, offset: float) -> None:
        self._law, self.offset, self.speed = law, offset, 0.0
        self._arrived, self._still, self._waited, self._onward = 0.0, 0.0, 0.0, SETTLED
        self.there = False
        """Whether the CoM is where it belongs."""

    @property
    def settled(self) -> bool:
        """Whether the CoM has been where it belongs, the body at rest, for so long that nothing sways any more."""
        return self._still > LIFT_STILL and self._arrived > (SETTLED if self._law.brisk else LIFT_STILL)

    def may_lift(self, steady: bool) -> bool:
        """Whether the weight is off the other foot, and will be while that is lifted.

        steady: whether the zero moment point is where the CoM is. Right after a shift it is farther out: the better, if
        the shift came in one go; one that was turned back on its way has made the body swing before.
        """
        prompt = self._arrived < PROMPT and self._onward > SETTLED
        return (self._still > LIFT_STILL and prompt) or (self.settled and steady)

    def step(self, target: float, span: Span, error: float, rests: bool, pace: float, dt: float) -> tuple[float, float]:
        """The offset to reach in dt s on its way to a target, and its speed (1/s).

        error: m, of the CoM off its place. rests: whether the body is on both feet and at rest but for the shift. pace:
        the share of its speed at which the shift may go.
        """
        wanted = self.offset if self._is_late(error, dt) else target
        self.there = abs(self.offset - target) < OFFSET_REACHED and error < COM_THERE
        self._arrived = self._arrived + dt if self.there else 0.0
        self._still = self._still + dt if self.there and rests else 0.0
        push = self._law.push(self.offset, wanted, span)
        return advance(self.offset, self.speed, wanted, dt, push._replace(speed=push.speed * pace))

    def _is_late(self, error: float, dt: float) -> bool:
        """Whether the CoM is behind; for longer and longer only if it is farther off."""
        self._waited = self._waited + dt if error > COM_LATE else 0.0
        return error > COM_LATE * (1.0 + self._waited / PATIENCE)

    def move(self, offset: float, dt: float) -> None:
        """The CoM has come to an offset within dt s."""
        speed = (offset - self.offset) / dt
        self._onward = self._onward + dt if speed * self.speed >= 0.0 else 0.0
        self.speed, self.offset = speed, offset

    def stand(self, offset: float) -> None:
        """The feet stand elsewhere, and the CoM rests at an offset between them."""
        self.speed, self.offset = 0.0, offset
