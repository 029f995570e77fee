"""Slow walking, as an operator walks whom a small robot is to follow: to the side, round on the spot, and ahead.

Every step is quasi-static: the weight comes over one foot, and only then the other one is lifted, set down flat at its
new place, and trusted with the weight in turn. The person's steps are so short that the robot's, scaled down by the
length of the legs, are places where it can stand on either foot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from naoimitate.core.frames import SIDES
from naoimitate.human.script import Script
from naoimitate.human.steps import Landing, Swing
from naoimitate.human.tracks import Track
from naoimitate.motion.stand import BODY, SETTLE, SHIFT, STANCE, STAND, stepping

Stance = tuple[Landing, Landing]
"""Where the left and the right foot stand."""

FIRST = 4.4
"""s of the first lift."""
LIFTED = 2.0
"""s that a foot is in the air."""
RISE = 0.35
"""s that its way up takes, and its way down."""
CLEARANCE = 0.06
"""m of a foot on its way over the floor."""
PERIOD = LIFTED + SETTLE + SHIFT + SETTLE
"""s from one lift to the next."""
LOW = STAND - 0.085
"""m of mid-hip while walking: the leg behind, or aside, still reaches the floor."""
END = SETTLE + SHIFT + 2.0
"""s from the last landing to the end: back to the middle, and a stand."""

NARROW, WIDE = 0.08, 0.11
"""m, half the distance of the feet: where a step is to make it wider, and where the toes are to turn in."""
ASIDE = 0.08
"""m of one step to the side."""
AHEAD = 0.15
"""m by which one foot comes in front of the other one."""
TURN = math.radians(90.0)
"""The whole turn, to the left."""
OPENING = math.radians(30.0)
"""By which a foot turns in one lift: half of it outwards from the other one, half of it back again."""


def sidestep() -> Script:
    """Two steps to the left and two back to the right, the other foot drawn up after each."""
    stance = _stance(NARROW)
    there = [(foot, ASIDE * count) for count in (1, 2) for foot in "lr"]
    back = [(foot, ASIDE * count) for count in (1, 0) for foot in "rl"]
    return _walking(stance, [(foot, _moved(stance, foot, 0.0, aside)) for foot, aside in there + back])


def turn() -> Script:
    """Ninety degrees to the left on the spot in seven lifts: the feet open with the left one, close with the right."""
    stance = _stance(WIDE)
    headings = [min(0.5 * OPENING * (count + 1), TURN) for count in range(7)]
    lifts = zip("lrlrlrl", headings, strict=True)
    faced = [0.5 * (before + after) for before, after in pairwise([0.0, *headings])]
    return _walking(stance, [(foot, _turned(stance, foot, heading)) for foot, heading in lifts], faced)


def stroll() -> Script:
    """Six steps ahead, the last of which brings the feet together."""
    lifts = zip("rlrlrl", (1, 2, 3, 4, 5, 5), strict=True)
    return _walking(STANCE, [(foot, _moved(STANCE, foot, AHEAD * count, 0.0)) for foot, count in lifts])


def _walking(stance: Stance, steps: Sequence[tuple[str, Landing]], faced: Sequence[float] = ()) -> Script:
    """A script of steps, each a foot and where it lands; faced: heading of the body after each, rad, if it turns."""
    swings = tuple(
        Swing(foot, FIRST + PERIOD * count, FIRST + PERIOD * count + LIFTED, landing, CLEARANCE, RISE)
        for count, (foot, landing) in enumerate(steps)
    )
    down, up = swings[0].lift - SETTLE, swings[-1].land + SETTLE
    turns = tuple((swing.lift, swing.land, heading) for swing, heading in zip(swings, faced, strict=False))
    return stepping(
        swings[-1].land + END,
        swings,
        stance=stance,
        height=Track(STAND, ((down - SHIFT, down, LOW), (up, up + SHIFT, STAND))),
        heading=Track(0.0, turns),
    )


def _stance(half: float) -> Stance:
    """Where the feet stand at the beginning, m each from the middle."""
    (x, _, left), (_, _, right) = STANCE
    return ((x, half, left), (x, -half, right))


def _moved(stance: Stance, foot: str, ahead: float, aside: float) -> Landing:
    """Where a foot stands after a walk from a stance, m ahead and m to the left."""
    x, y, yaw = stance[SIDES.index(foot)]
    return (x + ahead, y + aside, yaw)


def _turned(stance: Stance, foot: str, heading: float) -> Landing:
    """Where a foot stands after its stance has been turned about the middle between the feet, rad."""
    x, y, yaw = stance[SIDES.index(foot)]
    pivot, c, s = 0.5 * BODY.ball, math.cos(heading), math.sin(heading)
    return (pivot + c * (x - pivot) - s * y, s * (x - pivot) + c * y, yaw + heading)
