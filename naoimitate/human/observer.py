"""From frames to what imitation needs of the person: posture, support, offset, head; bad landmarks are bridged."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from naoimitate.core.frames import SEGMENT, HumanFrame
from naoimitate.human.body import Body, BodyState, observe, rotation_of
from naoimitate.human.live_support import SupportEstimator
from naoimitate.human.segments import center_of_mass

Array = npt.NDArray[np.float64]

MAX_COORDINATE = 1e4
"""m from the origin beyond which a landmark is an error, not a person."""


@dataclass(frozen=True)
class Observation:
    """One moment of the person.

    body: posture and frames. support: ``D``, ``L``, ``R``, ``F``. com: (3,) m. head: yaw, pitch (rad) of the head in
    the torso, zero in the T-pose. hands: (2, 3, 3) torso from hand, or None. opening: (2,), NaN where unknown.
    complete: no landmark had to be replaced.
    """

    body: BodyState
    support: str
    com: Array
    head: tuple[float, float]
    hands: Array | None
    opening: Array
    complete: bool


class Observer:
    """Watches one person, whose measures are known; hands: whether the orientation of the hands is asked for."""

    def __init__(self, body: Body, tpose: HumanFrame, hands: bool = False) -> None:
        self._body, self._hands_wanted = body, hands
        self._last = tpose.landmarks.copy()
        self._estimator = SupportEstimator()
        self._head_zero = (0.0, 0.0)
        self._head_zero = self._head(tpose, observe(body, tpose).torso)

    def see(self, frame: HumanFrame, support: str | None = None) -> Observation:
        """Observe a frame; landmarks that are missing or absurd keep their last good place relative to the others.

        support: the mode where the caller knows it; else the frame's own, else it is estimated.
        """
        landmarks, complete = self._bridged(frame.landmarks)
        frame = replace(frame, landmarks=landmarks)
        state = observe(self._body, frame)
        com = frame.com if frame.com is not None and _possible(frame.com).all() else center_of_mass(landmarks)
        opening = np.full(2, np.nan) if frame.hand_opening is None else np.clip(frame.hand_opening, 0.0, 1.0)
        head = self._head(frame, state.torso)
        return Observation(
            state,
            support or frame.support or self._estimator.update(frame),
            com,
            (head[0] - self._head_zero[0], head[1] - self._head_zero[1]),
            self._hands(frame, state.torso) if self._hands_wanted else None,
            opening,
            complete,
        )

    def _bridged(self, landmarks: Array) -> tuple[Array, bool]:
        good = np.asarray(_possible(landmarks).all(axis=1))
        if good.all():
            self._last = np.array(landmarks, dtype=np.float64)
            return self._last, True
        moved = (landmarks[good] - self._last[good]).mean(axis=0) if good.any() else np.zeros(3)
        filled = np.where(good[:, None], landmarks, self._last + moved)
        self._last = filled
        return filled, False

    def _head(self, frame: HumanFrame, torso: Array) -> tuple[float, float]:
        R = rotation_of(frame, SEGMENT["head"])
        if R is None:
            return self._head_zero
        x = torso.T @ R[:, 0]
        return math.atan2(x[1], x[0]), math.atan2(-x[2], math.hypot(x[0], x[1]))

    @staticmethod
    def _hands(frame: HumanFrame, torso: Array) -> Array | None:
        found = [rotation_of(frame, SEGMENT[f"{s}_hand"]) for s in "lr"]
        if found[0] is None or found[1] is None:
            return None
        return np.array([torso.T @ found[0], torso.T @ found[1]])


def _possible(places: Array) -> npt.NDArray[np.bool_]:
    """Which coordinates (m) can be a person's."""
    return np.asarray(np.abs(np.where(np.isfinite(places), places, np.inf)) < MAX_COORDINATE)
