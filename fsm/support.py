"""The support machine: which feet carry the robot (Koenemann 2014, section V-B and Fig. 4), made complete.

The paper has three states: double, left, right. A real robot needs two more, in which the swing foot comes down while
the other still carries. The machine is pure: no arrays, no clock; everything that it needs is an argument.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

OFFSET_REACHED = 0.01
"""The normalised offset counts as 0 or 1 within this distance."""


class Mode(enum.Enum):
    """What the robot's feet do."""

    DOUBLE = "double"
    LEFT = "left"
    """The left foot carries, the right one swings."""
    RIGHT = "right"
    LANDING_ON_LEFT = "landing_on_left"
    """The left foot carries, the right one comes down."""
    LANDING_ON_RIGHT = "landing_on_right"

    @property
    def stance(self) -> str:
        """The feet that carry: ``D``, ``L`` or ``R``."""
        return {"d": "D", "l": "L", "r": "R"}[self.value.removeprefix("landing_on_")[0]]

    @property
    def landing(self) -> bool:
        """Whether the swing foot is coming down."""
        return self.value.startswith("landing")


_SINGLE = {"L": Mode.LEFT, "R": Mode.RIGHT}
_LANDING = {"L": Mode.LANDING_ON_LEFT, "R": Mode.LANDING_ON_RIGHT}
_OTHER = {"L": "R", "R": "L"}


@dataclass(frozen=True)
class SupportInput:
    """What the machine looks at.

    human: ``D``, ``L``, ``R`` or ``F`` (flight).
    offset: the robot's own normalised CoM offset, 0 over the left foot, 1 over the right.
    landed: the swing foot is down, flat, within tolerance.
    descending: the swing foot is on its last way down, too low to go back.
    stance_ok: (left, right): with the soles where they are, the CoM can come over that foot. A foot that cannot carry
        is left by lifting it again.
    ahead: ``L`` or ``R`` when a recording tells that the human will stand on that foot soon: the offset goes there
        while both feet are still down. Empty otherwise, and always in a live stream.
    may_lift: nothing else forbids a lift-off (a fault, an operator's clutch, a recording that waits).
    """

    human: str
    offset: float
    landed: bool = False
    descending: bool = False
    stance_ok: tuple[bool, bool] = (True, True)
    ahead: str = ""
    may_lift: bool = True


def wanted_stance(mode: Mode, given: SupportInput) -> str:
    """The feet on which the robot should stand next: ``D``, ``L`` or ``R``.

    The human's own, but for a foot that is needed, now or soon, and cannot carry where it is: then the other one, from
    which it is lifted and set down again (re-lift). A flight changes nothing: one foot at least stays down.
    """
    if mode is not Mode.DOUBLE:
        return mode.stance if given.human == "F" else given.human
    if given.human in ("L", "R"):
        return given.human if _can_carry(given.human, given) else _OTHER[given.human]
    if given.ahead and not _can_carry(given.ahead, given):
        return _OTHER[given.ahead]
    return "D"


def _can_carry(foot: str, given: SupportInput) -> bool:
    return given.stance_ok[0 if foot == "L" else 1]


def offset_target(mode: Mode, given: SupportInput, human_offset: float) -> float:
    """The offset to approach: forced to 0 or 1 for a single support, else the human's, clamped (section V-A)."""
    stance = wanted_stance(mode, given) if mode is Mode.DOUBLE else mode.stance
    if stance == "D":
        stance = given.ahead
    if not stance:
        return given.offset if given.human == "F" else min(max(human_offset, 0.0), 1.0)
    return 0.0 if stance == "L" else 1.0


def next_mode(mode: Mode, given: SupportInput) -> Mode:
    """One transition of the machine.

    DOUBLE -> LEFT (RIGHT): the human stands on that foot and the offset has reached 0 (1): Fig. 4.
    LEFT -> LANDING_ON_LEFT: the human no longer stands on the left foot alone (in flight the robot stays).
    LANDING_ON_LEFT -> DOUBLE: the swing foot is down, flat, within tolerance; only then may the offset move.
    LANDING_ON_LEFT -> LEFT: the human stands on the left foot again before the foot is on its last way down.
    """
    wanted = wanted_stance(mode, given)
    if mode is Mode.DOUBLE:
        reached = {"L": given.offset <= OFFSET_REACHED, "R": given.offset >= 1.0 - OFFSET_REACHED}
        return _SINGLE[wanted] if wanted != "D" and given.may_lift and reached[wanted] else mode
    if mode.landing:
        if given.landed:
            return Mode.DOUBLE
        return _SINGLE[mode.stance] if given.human == mode.stance and not given.descending else mode
    return _LANDING[mode.stance] if wanted != mode.stance else mode


class SupportFsm:
    """The machine with its present mode."""

    def __init__(self, mode: Mode = Mode.DOUBLE) -> None:
        self.mode = mode

    def step(self, given: SupportInput) -> Mode:
        """Take one transition and return the new mode."""
        self.mode = next_mode(self.mode, given)
        return self.mode
