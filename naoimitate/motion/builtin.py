"""The built-in motions: a procedural person does them, so every truth about them is known.

Single supports are quasi-static in all but the walk: the centre of mass moves along the line between the feet until it
is over the stance foot, and only then the other foot lifts. To add a motion, write a function that returns its script
and register it in ``BUILTINS``.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import HumanFrame, Motion
from naoimitate.human.procedural import arm_towards, pose
from naoimitate.human.script import Script, parameters, support
from naoimitate.human.steps import FootPose, Stride, Swing
from naoimitate.human.tracks import Spline, Track
from naoimitate.motion.operator import lean_and_pick, step_and_pick
from naoimitate.motion.stand import (
    BODY,
    HANGING,
    LEANING,
    STANCE,
    STANCE_HALF,
    STAND,
    T_ARM,
    TOE_OUT,
    UPRIGHT,
    standing,
    stepping,
)
from naoimitate.motion.stepping import sidestep, stroll, turn


@dataclass(frozen=True)
class Builtin:
    """A built-in motion: its name, one sentence about it, and the function that writes its script."""

    name: str
    about: str
    script: Callable[[], Script]


def builtin_names() -> tuple[str, ...]:
    """Names of the built-in motions, as in ``builtin:NAME``."""
    return tuple(BUILTINS)


def builtin_motion(name: str) -> Motion:
    """A built-in motion with its support, contacts and T-pose.

    Raises MotionFormatError when there is none of this name.
    """
    if name not in BUILTINS:
        raise MotionFormatError(f"no built-in motion is called {name!r}: choose one of {', '.join(BUILTINS)}")
    builtin = BUILTINS[name]
    return scripted_motion(name, builtin.script(), builtin.about)


def scripted_motion(name: str, script: Script, about: str) -> Motion:
    """What the person of the built-in motions does by a script, with its support, contacts and T-pose."""
    landmarks, orientations = pose(BODY, parameters(script, BODY))
    modes = support(script)
    return Motion(
        name=f"builtin:{name}",
        time=script.time,
        landmarks=landmarks,
        orientations=orientations,
        contacts=np.stack([(modes == "D") | (modes == side) for side in "LR"], axis=1),
        hand_opening=None if script.hands is None else script.hands(script.time),
        support=modes,
        tpose=tpose(),
        tpose_note="the same procedural person in an exact T-pose",
        source=f"builtin:{name}",
        sha256=hashlib.sha256(landmarks.round(9).tobytes()).hexdigest(),
        notes=(about,),
    )


def builtin_phases(name: str) -> tuple[tuple[str, float, float], ...]:
    """Every single support of a built-in motion: side of the stance foot (L or R), from s, to s."""
    return single_support_phases(builtin_motion(name))


def single_support_phases(motion: Motion) -> tuple[tuple[str, float, float], ...]:
    """Every single support of a motion whose support is known: side (L or R), first frame's and next mode's time, s.

    Raises MotionFormatError when the support is not known.
    """
    if motion.support is None:
        raise MotionFormatError(f"the support of {motion.name} is not known: annotate the motion first")
    starts = np.flatnonzero(np.r_[True, motion.support[1:] != motion.support[:-1]])
    ends = np.r_[starts[1:], len(motion) - 1]
    return tuple(
        (str(motion.support[a]), float(motion.time[a]), float(motion.time[b]))
        for a, b in zip(starts, ends, strict=True)
        if motion.support[a] in ("L", "R")
    )


def tpose() -> HumanFrame:
    """The person of the built-in motions in a T-pose that faces +x."""
    return _still(standing(0.01, left_arm=Track(T_ARM), right_arm=Track(T_ARM)))


def relaxed() -> HumanFrame:
    """The person of the built-in motions, standing with hanging arms and facing +x."""
    return _still(standing(0.01))


def _still(script: Script) -> HumanFrame:
    landmarks, orientations = pose(BODY, parameters(script, BODY))
    return HumanFrame(time=0.0, landmarks=landmarks[0], orientations=orientations[0], support="D")


def _paper() -> Script:
    """The sequence of Koenemann 2014, figures 6 to 9; sole to sole 0.45 leg lengths apart in the hold."""
    raised = (2.4, 0.25, 0.35, 0.0)
    stretched = _stretched_back(0.45 * BODY.leg, 0.32)
    arms = Track(T_ARM, ((2.0, 4.0, HANGING), (7.8, 10.4, raised), (15.8, 18.4, HANGING)))
    lean = Track(UPRIGHT, ((7.4, 10.4, (0.0, 0.40, 0.0)), (15.8, 18.8, UPRIGHT)))
    script = stepping(
        25.0,
        (Swing("r", 6.4, 19.8, STANCE[1], 0.06, 1.0, ((7.4, 10.2, stretched), (10.2, 15.8, stretched))),),
        trunk=lean,
        left_arm=arms,
        right_arm=arms,
        head=Track((0.0, 0.0), ((7.4, 10.4, (0.0, -0.25)), (15.8, 18.8, (0.0, 0.0)))),
    )
    return script


def _stretched_back(distance: float, rise: float) -> FootPose:
    """Pose of the right foot ``distance`` m from the left sole, backwards and up (``rise``: share that is height)."""
    aside, up = 2.0 * STANCE_HALF - 0.03, rise * distance
    back = float(np.sqrt(distance**2 - up**2 - aside**2))
    return (-back, STANCE_HALF - aside, up, -TOE_OUT, 0.35, 0.0)


def _step_and_reach() -> Script:
    """The second experiment of Koenemann 2014: two steps to an object, pick it up, drop it to the right."""
    ahead, grasp = 0.22, arm_towards(BODY, "r", np.array([0.50, 0.02, 0.03]))
    drop = (0.9, 0.75, 0.5, 0.0)
    swings = (
        Swing("r", 4.4, 6.8, (ahead, -STANCE_HALF, -TOE_OUT), 0.07, 0.7),
        Swing("l", 9.8, 12.2, (ahead, STANCE_HALF, TOE_OUT), 0.07, 0.7),
    )
    low, down, up, rest = STAND - 0.085, (15.6, 19.0), (20.6, 23.6), (27.0, 30.0)
    steps = ((2.0, 4.0, LEANING), (4.4, 6.8, low), (9.8, 12.2, LEANING), (12.6, 14.6, STAND))
    lean, reach, turn = (0.0, 0.15, 0.0), (0.25, 0.75, 0.0), (-0.35, 0.1, 0.0)
    return stepping(
        100.0 / 3.0,
        swings,
        rate=30.0,
        height=Track(STAND, (*steps, (*down, STAND - 0.16), (*up, STAND))),
        trunk=Track(UPRIGHT, ((4.4, 6.8, lean), (9.8, 12.2, UPRIGHT), (*down, reach), (*up, turn), (*rest, UPRIGHT))),
        right_arm=Track(HANGING, ((*down, grasp), (21.0, 24.0, drop), (26.4, 29.4, HANGING))),
        left_arm=Track(HANGING, ((*down, (-0.35, 0.25, 0.35, 0.0)), (*up, HANGING))),
        head=Track((0.0, 0.0), ((14.8, 17.6, (0.0, 0.25)), (21.0, 24.0, (-0.3, 0.2)), (*rest, (0.0, 0.0)))),
    )


def _squat() -> Script:
    """Two squats with the arms stretched forward, the second one deep."""
    down, up, deeper, again = (2.0, 4.5), (6.0, 8.5), (10.0, 13.0), (15.0, 18.0)
    half, deep = (0.0, 0.40, 0.0), (0.0, 0.65, 0.0)
    forward, higher = (1.85, 0.1, 0.15, 0.0), (2.1, 0.1, 0.15, 0.0)
    arms = Track(HANGING, ((*down, forward), (*up, HANGING), (*deeper, higher), (*again, HANGING)))
    return standing(
        20.0,
        height=Track(STAND, ((*down, STAND - 0.20), (*up, STAND), (*deeper, STAND - 0.36), (*again, STAND))),
        trunk=Track(UPRIGHT, ((*down, half), (*up, UPRIGHT), (*deeper, deep), (*again, UPRIGHT))),
        left_arm=arms,
        right_arm=arms,
        head=Track((0.0, 0.0), ((*deeper, (0.0, -0.3)), (*again, (0.0, 0.0)))),
    )


def _bow_and_reach() -> Script:
    """A deep bow with both hands towards the floor, then a reach to the left and one to the right."""
    low, out = (1.45, 0.05, 0.15, 0.0), (1.5, 0.35, 0.2, 0.0)
    down, up = (2.0, 5.0), (6.5, 9.5)
    left, right, back = (10.5, 13.5), (14.5, 18.5), (19.5, 22.0)
    height = Track(STAND, ((*down, STAND - 0.06), (*up, LEANING), (*back, STAND)))
    trunk = ((*down, (0.0, 1.20, 0.0)), (*up, UPRIGHT))
    sides = ((*left, (0.5, 0.3, -0.1)), (*right, (-0.5, 0.3, 0.1)), (*back, UPRIGHT))
    arms = ((*down, low), (*up, HANGING))
    return standing(
        24.0,
        height=height,
        trunk=Track(UPRIGHT, (*trunk, *sides)),
        right_arm=Track(HANGING, (*arms, (*left, out), (14.5, 17.5, HANGING))),
        left_arm=Track(HANGING, (*arms, (15.5, 18.5, out), (*back, HANGING))),
        head=Track((0.0, 0.0), ((*left, (0.3, 0.0)), (*right, (-0.3, 0.0)), (*back, (0.0, 0.0)))),
    )


def _wave() -> Script:
    """The right arm goes up and waves, with the weight a little on the left foot."""
    elbow = BODY.upper_arm * np.array([0.25, -0.85, 0.1]) / np.linalg.norm([0.25, -0.85, 0.1])
    half, count = 0.55, 10

    def waving(angle: float) -> Any:
        return arm_towards(BODY, "r", elbow + BODY.forearm * np.array([0.3, -np.sin(angle), np.cos(angle)]) / 1.044)

    waves = tuple((4.5 + half * i, 4.5 + half * (i + 1), waving(0.45 if i % 2 == 0 else -0.35)) for i in range(count))
    arm = Track(HANGING, ((2.0, 4.3, waving(-0.35)), *waves, (10.5, 13.0, HANGING)))
    return standing(
        14.0,
        right_arm=arm,
        offset=Track(0.5, ((1.5, 4.0, 0.35), (10.5, 13.0, 0.5))),
        height=Track(STAND, ((1.5, 4.0, STAND - 0.01), (10.5, 13.0, STAND))),
        trunk=Track(UPRIGHT, ((1.5, 4.0, (0.0, 0.0, -0.05)), (10.5, 13.0, UPRIGHT))),
    )


def _side_kick() -> Script:
    """A slow kick to the side with the right and with the left leg, the arms spread a little."""
    spread, side = (0.0, 0.9, 0.2, 0.0), STANCE_HALF + 0.42
    right: FootPose = (0.0, -side, 0.22, -TOE_OUT, 0.0, -0.45)
    left: FootPose = (0.0, side, 0.22, TOE_OUT, 0.0, 0.45)
    swings = (
        Swing("r", 4.4, 11.0, STANCE[1], 0.06, 0.8, ((5.2, 7.2, right), (7.2, 8.2, right))),
        Swing("l", 14.2, 20.8, STANCE[0], 0.06, 0.8, ((15.0, 17.0, left), (17.0, 18.0, left))),
    )
    arms = Track(HANGING, ((4.0, 7.0, spread), (18.2, 21.2, HANGING)))
    lean = ((5.2, 7.2, (0.0, 0.0, -0.2)), (8.2, 10.2, UPRIGHT), (15.0, 17.0, (0.0, 0.0, 0.2)), (18.0, 20.0, UPRIGHT))
    return stepping(24.5, swings, trunk=Track(UPRIGHT, lean), left_arm=arms, right_arm=arms)


def _march() -> Script:
    """Four stands of 2 s, left and right by turns, the other foot raised straight up and the opposite arm forward."""
    lifts = tuple(("rl"[i % 2], 4.4 + 4.8 * i) for i in range(4))
    swings = tuple(Swing(foot, lift, lift + 2.0, STANCE["lr".index(foot)], 0.18, 0.8) for foot, lift in lifts)
    forward = (0.6, 0.14, 0.9, 0.0)

    def arm(opposite: str) -> Track:
        raised = [((t, t + 0.9, forward), (t + 1.1, t + 2.0, HANGING)) for foot, t in lifts if foot == opposite]
        return Track(HANGING, tuple(move for pair in raised for move in pair))

    return stepping(24.0, swings, left_arm=arm("r"), right_arm=arm("l"))


def _walk() -> Script:
    """Eight steps straight ahead at a human pace, from a stand to a stand: dynamic, not quasi-static."""
    step, period, swing, half, first, count = 0.44, 0.60, 0.48, 0.06, 1.6, 8
    sway, low, high, swing_arm = 0.035, STAND - 0.108, STAND - 0.035, 0.50
    at, strides, flow = {"l": 0.0, "r": 0.0}, [], [(0.0, 0.0, STAND - 0.01, 0.0)] * 2
    for i in range(count):
        foot, stance, lift = "rl"[i % 2], "lr"[i % 2], first + period * i
        sign = 1.0 if foot == "l" else -1.0
        at[foot] = at[stance] + (0.5 * step if i == 0 else 0.0 if i == count - 1 else step)
        strides.append(Stride(foot, lift, lift + swing, (at[foot], sign * half, 0.05 * sign), BODY))
        flow += [(at[stance], -sign * sway, high, 0.0), (0.5 * (at["l"] + at["r"]), 0.0, low, -sign * swing_arm)]
    flow = [*flow[:-1], (at["l"], 0.0, STAND - 0.01, 0.0)]
    x, y, height, arm = np.array(flow).T
    begin, spacing = first + 0.5 * swing - period, 0.5 * period

    def arms(forward: Any) -> Spline:
        return Spline(begin, spacing, np.multiply.outer(forward, (1.0, 0.0, 0.0, 0.0)) + HANGING)

    return Script(
        duration=strides[-1].land + 2.0,
        stance=((0.0, half, 0.05), (0.0, -half, -0.05)),
        offset=Track(0.5),
        height=Spline(begin, spacing, height),
        trunk=Spline(begin, spacing, np.multiply.outer(arm, (0.15, 0.0, 0.0))),
        left_arm=arms(arm),
        right_arm=arms(-arm),
        swings=tuple(strides),
        path=Spline(begin, spacing, np.stack([x + 0.5 * BODY.ball, y], axis=1)),
    )


BUILTINS = {
    builtin.name: builtin
    for builtin in (
        Builtin("paper", "T-pose, weight to the left, right leg back, both arms up, 5 s on one foot, back", _paper),
        Builtin("step-and-reach", "two steps, pick something up with the right hand, drop it", _step_and_reach),
        Builtin("squat", "a half and a deep squat, arms forward", _squat),
        Builtin("bow-and-reach", "a deep bow, then reaches to both sides", _bow_and_reach),
        Builtin("wave", "the right arm goes up and waves", _wave),
        Builtin("side-kick", "a slow kick to the side with each leg", _side_kick),
        Builtin("march", "four stands of 2 s on alternate feet", _march),
        Builtin("lean-and-pick", "on the left foot, right leg back, grasp far in front; drop aside", lean_and_pick),
        Builtin("step-and-pick", "two steps, grasp with the right hand, drop aside", step_and_pick),
        Builtin("sidestep", "two slow steps to the left and two back, the other foot drawn up", sidestep),
        Builtin("turn", "90 degrees to the left on the spot, in seven slow lifts", turn),
        Builtin("stroll", "six slow steps ahead, each with the weight over one foot first", stroll),
        Builtin("walk", "eight steps straight ahead at a human pace", _walk),
    )
}
