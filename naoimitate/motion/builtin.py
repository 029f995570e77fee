"""The built-in motions: a procedural person does them, so every truth about them is known.

Single supports are quasi-static in all but the walk: the centre of mass moves along the line between the feet until it
is over the stance foot, then the other foot lifts. To add one, write a function that returns its script and register it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import HumanFrame, Motion
from naoimitate.human.anthropometry import Anthropometry
from naoimitate.human.procedural import Parameters, pose
from naoimitate.human.script import Foot, Script, Swing, Track, parameters, support

BODY = Anthropometry()
"""The person of all built-in motions."""
TOE_OUT = 0.09
"""rad, about 5 deg of each foot in a relaxed stand."""
STANCE_HALF = 0.10
"""m, half the distance of the feet: a little wider than the hips."""
STANCE = ((0.0, STANCE_HALF, TOE_OUT), (0.0, -STANCE_HALF, -TOE_OUT))
STAND = BODY.leg_reach(0.25) + BODY.ankle_height
"""m of mid-hip: a stand with soft knees."""
T_ARM = (0.5 * np.pi, 0.5 * np.pi, 0.0, 0.0)
HANGING = (0.15, 1.2, 0.25, 0.0)
UPRIGHT = (0.0, 0.0, 0.0)


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
    builtin = _builtin(name)
    script = builtin.script()
    landmarks, orientations = pose(BODY, parameters(script, BODY))
    modes = support(script)
    return Motion(
        name=f"builtin:{name}",
        time=script.time,
        landmarks=landmarks,
        orientations=orientations,
        contacts=np.stack([(modes == "D") | (modes == side) for side in "LR"], axis=1),
        support=modes,
        tpose=tpose(),
        tpose_note="the same procedural person in an exact T-pose",
        source=f"builtin:{name}",
        sha256=hashlib.sha256(landmarks.round(9).tobytes()).hexdigest(),
        notes=(builtin.about,),
    )


def builtin_phases(name: str) -> tuple[tuple[str, float, float], ...]:
    """Every single support of a built-in motion: side of the stance foot (L or R), from s, to s."""
    return single_support_phases(builtin_motion(name))


def single_support_phases(motion: Motion) -> tuple[tuple[str, float, float], ...]:
    """Every single support of a motion whose support is known: side (L or R), first frame's and next mode's time, s."""
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
    script = _standing(1.0, left_arm=Track(T_ARM), right_arm=Track(T_ARM))
    still: Parameters = parameters(replace(script, duration=0.01), BODY)
    landmarks, orientations = pose(BODY, still)
    return HumanFrame(time=0.0, landmarks=landmarks[0], orientations=orientations[0], support="D")


def _builtin(name: str) -> Builtin:
    if name not in BUILTINS:
        raise MotionFormatError(f"no built-in motion is called {name!r}: choose one of {', '.join(BUILTINS)}")
    return BUILTINS[name]


def _standing(duration: float, **parts: object) -> Script:
    """A script of somebody who stands relaxed, but for the parts given."""
    relaxed = Script(
        duration=duration,
        stance=STANCE,
        offset=Track(0.5),
        height=Track(STAND),
        trunk=Track(UPRIGHT),
        left_arm=Track(HANGING),
        right_arm=Track(HANGING),
    )
    return replace(relaxed, **parts)  # type: ignore[arg-type]


def _paper() -> Script:
    """The sequence of Koenemann 2014, figures 6 to 9; sole to sole 0.45 leg lengths apart in the hold."""
    raised = (2.5, 0.35, 0.35, 0.0)
    stretched = _stretched_back(0.45 * BODY.leg, rise=0.25)
    arms = Track(T_ARM, ((2.0, 4.0, HANGING), (7.8, 10.4, raised), (15.8, 18.4, HANGING)))
    return _standing(
        25.0,
        swings=(Swing("r", 6.4, 19.8, STANCE[1], 0.06, 1.0, ((7.4, 10.2, stretched), (10.2, 15.8, stretched))),),
        offset=Track(0.5, ((3.8, 5.9, 0.0), (20.3, 22.4, 0.5))),
        height=Track(
            STAND,
            ((3.8, 5.9, STAND - 0.025), (7.4, 10.2, STAND - 0.005), (16.0, 18.8, STAND - 0.025), (20.3, 22.4, STAND)),
        ),
        trunk=Track(UPRIGHT, ((7.4, 10.4, (0.0, 0.40, 0.0)), (15.8, 18.8, UPRIGHT))),
        left_arm=arms,
        right_arm=arms,
        head=Track((0.0, 0.0), ((7.4, 10.4, (0.0, -0.25)), (15.8, 18.8, (0.0, 0.0)))),
    )


def _stretched_back(distance: float, rise: float) -> Foot:
    """Pose of the right foot ``distance`` m from the left sole, backwards and up (``rise``: share that is height)."""
    aside = 2.0 * STANCE_HALF - 0.03
    up = rise * distance
    back = float(np.sqrt(distance**2 - up**2 - aside**2))
    return (-back, STANCE_HALF - aside, up, -TOE_OUT, 0.6, 0.0)


BUILTINS = {
    builtin.name: builtin
    for builtin in (
        Builtin("paper", "T-pose, weight to the left, right leg back, both arms up, 5 s on one foot, back", _paper),
    )
}
