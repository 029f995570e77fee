"""What a test sender performs: a T-pose, then the clip, again and again where wished, as one motion without jumps."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import LANDMARK, Array, HumanFrame, Motion
from naoimitate.human.segments import center_of_mass
from naoimitate.live.fade import Fade
from naoimitate.motion.tpose import heading

BLEND = 1.0
"""s from the T-pose into the clip, and from the clip's end to its next beginning."""
_PELVIS = LANDMARK["pelvis"]


class Performance:
    """A person to be streamed: the frame of any moment.

    motion: the clip. tpose: s of the T-pose before it, at the place and heading of the clip's first frame; 0 for none.
    repeat: how often the clip comes; each time it begins where the last one ended. Raises MotionFormatError where a
    T-pose is wished and the motion has none.
    """

    def __init__(self, motion: Motion, tpose: float = 0.0, repeat: int = 1) -> None:
        first = motion[0]
        parts: list[tuple[float, Callable[[float], HumanFrame]]] = []
        if tpose > 0.0:
            stand = _standing(motion)
            parts += [(tpose, lambda time: stand), (BLEND, Fade(stand, first, BLEND).at)]
        yaw, shift = 0.0, np.zeros(3)
        for turn in range(repeat):
            if turn:
                last = moved(motion[-1], yaw, shift)
                yaw, shift = _onward(first, last)
                parts.append((BLEND, Fade(last, moved(first, yaw, shift), BLEND).at))
            parts.append((motion.duration, _moving(motion, yaw, shift)))
        self._parts = [part for _, part in parts]
        self._starts = np.concatenate([[0.0], np.cumsum([length for length, _ in parts])]).tolist()

    @property
    def duration(self) -> float:
        """Time of the last frame, s."""
        return float(self._starts[-1])

    def at(self, time: float) -> HumanFrame:
        """The person at a time (s) from the beginning; afterwards they stand still."""
        part = min(bisect_right(self._starts, time) - 1, len(self._parts) - 1)
        return replace(self._parts[part](time - self._starts[part]), time=time)


def moved(frame: HumanFrame, yaw: float, shift: Array) -> HumanFrame:
    """The person turned by yaw (rad) about the world's z axis, then shifted by (3,) m."""
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    orientations = frame.orientations
    if orientations is not None:
        w, z = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
        q = orientations.T
        orientations = np.stack(
            [w * q[0] - z * q[3], w * q[1] - z * q[2], w * q[2] + z * q[1], w * q[3] + z * q[0]], -1
        )
    return replace(
        frame,
        landmarks=frame.landmarks @ turn.T + shift,
        orientations=orientations,
        com=None if frame.com is None else turn @ frame.com + shift,
    )


def _moving(motion: Motion, yaw: float, shift: Array) -> Callable[[float], HumanFrame]:
    return lambda time: moved(motion.at(time), yaw, shift)


def _onward(first: HumanFrame, last: HumanFrame) -> tuple[float, Array]:
    """Yaw (rad) and shift (3,) m on the floor that bring the person of ``first`` to where ``last`` is and looks."""
    yaw = heading(last.landmarks) - heading(first.landmarks)
    there = last.landmarks[_PELVIS] - moved(first, yaw, np.zeros(3)).landmarks[_PELVIS]
    return yaw, np.append(np.nan_to_num(there[:2]), 0.0)


def _standing(motion: Motion) -> HumanFrame:
    """The motion's T-pose where its first frame is, saying what the clip's frames say."""
    if motion.tpose is None:
        raise MotionFormatError(
            f"{motion.name} has no T-pose: give its moment with --tpose-at, or leave it out, --tpose 0"
        )
    first = motion[0]
    frame = moved(motion.tpose, *_onward(motion.tpose, first))
    return replace(
        frame,
        orientations=None if first.orientations is None else frame.orientations,
        com=None if first.com is None else center_of_mass(frame.landmarks),
        contacts=None if first.contacts is None else np.array([True, True]),
        support="D",
        hand_opening=first.hand_opening,
    )
