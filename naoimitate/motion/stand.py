"""What the scripts of built-in motions are made of: the person, their stand, and steps with the weight over the stance
foot before the other foot lifts.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from naoimitate.human.anthropometry import Anthropometry
from naoimitate.human.script import Script
from naoimitate.human.steps import Landing, Swing
from naoimitate.human.tracks import Move, Track

BODY = Anthropometry()
"""The person of all built-in motions."""
TOE_OUT = 0.09
"""rad, about 5 deg of each foot in a relaxed stand."""
STANCE_HALF = 0.10
"""m, half the distance of the feet: a little wider than the hips."""
STANCE: tuple[Landing, Landing] = ((0.0, STANCE_HALF, TOE_OUT), (0.0, -STANCE_HALF, -TOE_OUT))
STAND = BODY.leg_reach(0.25) + BODY.ankle_height
"""m of mid-hip: a stand with soft knees."""
LEANING = STAND - 0.025
"""m of mid-hip with the weight on one foot, so that the other leg still reaches the floor."""
SHIFT = 2.0
"""s to bring the weight from the middle, or from the other foot, over a foot."""
SETTLE = 0.4
"""s between the end of a shift and the lift, and between a landing and the next shift."""
T_ARM = (0.0, 0.5 * np.pi, 0.0, 0.0)
HANGING = (0.05, 0.14, 0.25, 0.0)
UPRIGHT = (0.0, 0.0, 0.0)


def standing(duration: float, **parts: Any) -> Script:
    """A script of somebody who stands relaxed, but for the parts given."""
    hanging, middle = Track(HANGING), Track(0.5)
    relaxed = Script(duration, STANCE, middle, Track(STAND), Track(UPRIGHT), hanging, hanging)
    return replace(relaxed, **parts)


def stepping(duration: float, swings: tuple[Swing, ...], **parts: Any) -> Script:
    """A script of somebody who shifts the weight over the stance foot before each swing, and to the middle at last."""
    offset: list[Move] = []
    for swing in swings:
        begin, end = swing.lift - SETTLE - SHIFT, swing.lift - SETTLE
        offset.append((begin, end, 0.0 if swing.foot == "r" else 1.0))
    last = swings[-1].land + SETTLE
    offset.append((last, last + SHIFT, 0.5))
    height = Track(STAND, ((*offset[0][:2], LEANING), (*offset[-1][:2], STAND)))
    return standing(duration, **{"offset": Track(0.5, tuple(offset)), "height": height, "swings": swings, **parts})
