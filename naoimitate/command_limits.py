"""What a command must keep to reach a robot, and the words for what it does not keep."""

from __future__ import annotations

import enum
from dataclasses import dataclass


class Refusal(enum.Enum):
    """Why a command was refused; the value is a word for people."""

    MALFORMED = "malformed"
    """A number is missing or not finite, the quaternion is not of unit length, the support is unknown."""
    ORDER = "order of time"
    """Its time does not follow the last accepted one's, or runs ahead of the real clock."""
    RANGE = "joint range"
    """A joint or hand is out of range, of a coupling table, or apart from its coupled partner."""
    SPEED = "joint speed"
    ACCELERATION = "acceleration"
    """A joint turns round at speed. Stopping at once is allowed."""
    MARGIN = "balance"
    """The centre of mass is too near the edge of the stance feet, or outside."""
    FLOOR = "feet on the floor"
    """A stance sole is off the floor or tilted, or a sole under it."""
    SLIP = "feet that slide"
    """Both feet carried, carry, and move against each other."""


PACE = frozenset((Refusal.SPEED, Refusal.ACCELERATION))
"""Refusals of a pose that is safe in itself, but too far from the one in force."""


@dataclass(frozen=True)
class CommandLimits:
    """What a command must keep to reach a robot: the bars of the scores, a little wider than what the method plans."""

    margin: float = 0.005
    """[m] of the CoM's ground projection inside the stance outlines."""
    height: float = 5e-4
    """[m] of a stance sole's outline over or under the floor, and of any sole under it."""
    slip: float = 5e-4
    """[m] by which feet that both carry may have moved against each other since they were set down."""
    speed_share: float = 0.9
    """Share of the motors' no-load speed."""
    change_share: float = 0.9
    """Share of the no-load speed by which a joint's speed may change from one command to the next: from full speed it
    may stop, but not turn round. It is a step and no acceleration: where a foot has to stay, the method ends a movement
    of the legs within a frame, whatever the frame rate. What it plans otherwise is smooth (``TaskLimits``)."""
    range_tolerance: float = 1e-9
    """[rad] beyond a joint's range: rounding."""
    coupled: float = 1e-6
    """[rad] between joints that one motor moves."""
    unit: float = 1e-6
    """By which a quaternion's length may differ from 1."""
    max_dt: float = 0.05
    """[s] of elapsed time that a single step may use up, however long the last accepted command is held."""
    catch_up_share: float = 0.3
    """Share of the no-load speed with which a robot catches up: about what an arm that waves needs..."""
    stance_share: float = 0.1
    """...and with its stance legs, which carry the body, so that it does not tip: about 0.6 rad/s."""
    stance_leap: float = 0.05
    """[rad] by which they may be behind at most where there is no calm step and all is made up for at once: a
    centimetre of the body."""
    overlap: float = 5e-4
    """[m] by which the body may touch itself while it catches up (or no more than before)."""
    clock_lead: float = 0.1
    """[s] of time to move in that may be given out before it has passed: a burst after a pause of the computer."""
