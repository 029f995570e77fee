"""What an operator does to pick up a ball with a tele-operated robot: section VI-D of Koenemann 2014, in two ways.

The person knows the scene (``sim.scenes``) and moves without feedback; they stretch far, grasp with the right hand, go
back to both feet, and let go over a bucket at their right.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from naoimitate.core.frames import Array
from naoimitate.human.procedural import arm_towards
from naoimitate.human.script import Script
from naoimitate.human.steps import FootPose, Swing
from naoimitate.human.tracks import Move, Track
from naoimitate.motion.stand import BODY, HANGING, LEANING, STANCE, STANCE_HALF, STAND, TOE_OUT, UPRIGHT, stepping

Trunk = tuple[float, float, float]
"""Yaw, pitch, roll of the chest, rad."""
CLOSED, OPEN = (0.0, 0.0), (0.0, 1.0)
"""Opening of the left and right hand."""
GRASP_TIME = 0.6
"""s in which a hand opens or closes."""
BEFORE, AFTER = np.array([-0.13, -0.03, 0.13]), np.array([-0.12, -0.03, 0.16])
"""m from where the wrist grasps: it comes from behind and above, and takes the ball up and back."""
OVER_BUCKET = (0.38, -0.28, -0.20)
"""m from the right shoulder: where the wrist is when the hand lets go."""


def lean_and_pick() -> Script:
    """Balance on the left foot with the right leg far back, grasp, and drop the ball from a stand on both feet."""
    lean: Trunk = (0.49, 0.84, -0.11)
    stretched: FootPose = (-0.82, -0.32, 0.88, 0.50, 0.50, 0.0)
    reach = np.array([0.530, 0.200, -0.111])
    near, lifted = reach + BEFORE, reach + AFTER
    swing = Swing("r", 4.4, 21.4, STANCE[1], 0.06, 1.0, ((5.4, 9.4, stretched), (9.4, 16.4, stretched)))
    out, back = (5.4, 9.4), (16.4, 20.4)
    arm = (
        (5.0, 9.4, _hand_at(lean, near)),
        (10.4, 12.4, _hand_at(lean, reach)),
        (13.6, 15.6, _hand_at(lean, lifted)),
        *_drop(16.4, 20.4, 24.2),
    )
    return stepping(
        31.0,
        (swing,),
        height=Track(STAND, ((2.0, 4.0, LEANING), (*out, LEANING - 0.07), (*back, LEANING), (21.8, 23.8, STAND))),
        trunk=Track(UPRIGHT, ((*out, lean), (*back, UPRIGHT))),
        right_arm=Track(HANGING, arm),
        left_arm=Track(HANGING, ((*out, (-0.50, 0.12, 0.10, 0.0)), (*back, HANGING))),
        head=Track((0.0, 0.0), ((*out, (-0.6, -0.15)), (*back, (-0.8, 0.35)), (29.0, 31.0, (0.0, 0.0)))),
        hands=_hands(8.0, 12.6, 26.6),
    )


def step_and_pick() -> Script:
    """Two steps towards the ball, grasp in front, and drop it: the second experiment."""
    ahead, lean, low = 0.22, (0.56, 0.95, -0.12), STAND - 0.085
    swings = (
        Swing("r", 4.4, 6.8, (ahead, -STANCE_HALF, -TOE_OUT), 0.07, 0.7),
        Swing("l", 9.8, 12.2, (ahead, STANCE_HALF, TOE_OUT), 0.07, 0.7),
    )
    reach = np.array([0.552, 0.160, -0.065])
    near, lifted = reach + BEFORE, reach + AFTER
    down, back = (15.0, 18.4), (23.4, 26.4)
    steps = ((2.0, 4.0, LEANING), (4.4, 6.8, low), (9.8, 12.2, LEANING), (12.6, 14.6, STAND))
    arm = (
        (15.0, 18.4, _hand_at(lean, near)),
        (19.0, 20.6, _hand_at(lean, reach)),
        (21.6, 23.2, _hand_at(lean, lifted)),
        *_drop(23.4, 26.4, 26.8),
    )
    return stepping(
        34.0,
        swings,
        height=Track(STAND, (*steps, (*down, STAND - 0.05), (*back, STAND))),
        trunk=Track(UPRIGHT, ((*down, lean), (*back, UPRIGHT))),
        right_arm=Track(HANGING, arm),
        head=Track((0.0, 0.0), ((*down, (-1.0, -0.35)), (*back, (-0.8, 0.35)), (32.0, 34.0, (0.0, 0.0)))),
        left_arm=Track(HANGING, ((*down, (-0.5, 0.25, 0.1, 0.0)), (*back, HANGING))),
        hands=_hands(15.0, 20.8, 29.2),
    )


def _drop(begin: float, raised: float, over: float) -> tuple[Move, ...]:
    """The right arm from a grasp to a carry in front, over the bucket at ``over`` + 2 s, and down again."""
    carry, drop = _hand_at(UPRIGHT, np.array([0.43, -0.10, -0.15])), _hand_at(UPRIGHT, np.array(OVER_BUCKET))
    return (begin, raised, carry), (over, over + 2.0, drop), (over + 4.0, over + 6.0, HANGING)


def _hands(opens: float, closes: float, drops: float) -> Track:
    """Opening of both hands: the right one opens, closes, opens to drop, and closes again (s when each begins)."""
    changes = ((opens, OPEN), (closes, CLOSED), (drops, OPEN), (drops + 2.0, CLOSED))
    return Track(CLOSED, tuple((begin, begin + GRASP_TIME, goal) for begin, goal in changes))


def _hand_at(trunk: Trunk, place: npt.ArrayLike) -> Array:
    """Arm angles (4,) that bring the right wrist to a place (3,) m from its shoulder, axes of the world, whatever the
    trunk does."""
    return arm_towards(BODY, "r", Rotation.from_euler("ZYX", trunk).inv().apply(np.asarray(place, dtype=float)))
