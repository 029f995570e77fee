"""Persons for tests: one procedural body in postures with known truth."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from naoimitate.core.frames import LANDMARK, LANDMARKS, HumanFrame
from naoimitate.core.geometry import quat_from_matrix, yaw_matrix
from naoimitate.human.anthropometry import Anthropometry
from naoimitate.human.procedural import Parameters, pose
from naoimitate.motion.builtin import HANGING, STANCE_HALF, STAND, T_ARM

BODY = Anthropometry()


def person(time: float = 0.0, **changes: Any) -> HumanFrame:
    """Somebody who stands upright with soft knees and hanging arms, but for changed ``Parameters`` of one moment."""
    values: dict[str, Any] = {
        "feet": [[0.0, STANCE_HALF, 0.0, 0.0, 0.0, 0.0], [0.0, -STANCE_HALF, 0.0, 0.0, 0.0, 0.0]],
        "com": [0.04, 0.0],
        "height": STAND - 0.05,
        "trunk": [0.0, 0.0, 0.0],
        "arms": [HANGING, HANGING],
        "head": [0.0, 0.0],
    } | changes
    landmarks, orientations = pose(BODY, Parameters(**{k: np.array([v], dtype=float) for k, v in values.items()}))
    return HumanFrame(time, landmarks[0], orientations[0])


def tpose() -> HumanFrame:
    """A T-pose that faces +x."""
    return person(arms=[T_ARM, T_ARM])


def moved(frame: HumanFrame, R: np.ndarray, t: np.ndarray) -> HumanFrame:
    """The same posture elsewhere: turned by R (3, 3), then shifted by t (3,) m."""
    from naoimitate.core.geometry import matrix_from_quat

    orientations = frame.orientations
    if orientations is not None:
        orientations = np.array([quat_from_matrix(R @ matrix_from_quat(q)) for q in orientations])
    com = None if frame.com is None else R @ frame.com + t
    return replace(frame, landmarks=frame.landmarks @ R.T + t, orientations=orientations, com=com)


def turned(frame: HumanFrame, yaw: float, x: float = 0.0, y: float = 0.0) -> HumanFrame:
    """The same posture, facing another way at another place on the floor."""
    return moved(frame, yaw_matrix(yaw), np.array([x, y, 0.0]))


def without(frame: HumanFrame, *names: str, value: float = np.nan) -> HumanFrame:
    """The frame with some landmarks missing (or absurd)."""
    landmarks = frame.landmarks.copy()
    landmarks[[LANDMARK[name] for name in names]] = value
    return replace(frame, landmarks=landmarks)


def bare(frame: HumanFrame) -> HumanFrame:
    """The frame with landmarks only, as from a camera."""
    return HumanFrame(frame.time, frame.landmarks)


NEEDED = [n for n in LANDMARKS if n.split("_")[-1] in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "toe")]
