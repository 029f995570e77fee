"""The person's mirror image: left becomes right, for a robot that faces its person as a mirror does."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from naoimitate.core.frames import LANDMARKS, SEGMENTS, Array, HumanFrame, Motion

Scalar = TypeVar("Scalar", bound=np.generic)

OTHER = {"L": "R", "R": "L"}
"""Support modes that change; D and F stay."""
_FLIP = np.array([1.0, -1.0, 1.0])
_FLIP_QUATERNION = np.array([1.0, -1.0, 1.0, -1.0])
"""Reflection in the x-z plane of a rotation (w, x, y, z)."""


def _other_side(names: tuple[str, ...]) -> npt.NDArray[np.int64]:
    swap = {"l_": "r_", "r_": "l_"}
    return np.array([names.index(swap.get(name[:2], name[:2]) + name[2:]) for name in names])


_LANDMARKS, _SEGMENTS = _other_side(LANDMARKS), _other_side(SEGMENTS)


def mirrored_frame(frame: HumanFrame) -> HumanFrame:
    """One moment of the person, seen in a mirror that stands along their path (the world's x-z plane)."""
    return replace(
        frame,
        landmarks=_points(frame.landmarks),
        orientations=_orientations(frame.orientations),
        com=None if frame.com is None else frame.com * _FLIP,
        contacts=_swapped(frame.contacts),
        support=None if frame.support is None else OTHER.get(frame.support, frame.support),
        hand_opening=_swapped(frame.hand_opening),
    )


def mirrored(motion: Motion) -> Motion:
    """A whole motion in the mirror, its T-pose with it; a note says so."""
    support = None
    if motion.support is not None:
        support = np.array([OTHER.get(str(mode), str(mode)) for mode in motion.support])
    return replace(
        motion,
        landmarks=_points(motion.landmarks),
        orientations=_orientations(motion.orientations),
        com=None if motion.com is None else motion.com * _FLIP,
        contacts=_swapped(motion.contacts),
        support=support,
        hand_opening=_swapped(motion.hand_opening),
        tpose=None if motion.tpose is None else mirrored_frame(motion.tpose),
        notes=(*motion.notes, "The person is mirrored, left is right."),
    )


def _points(landmarks: Array) -> Array:
    return np.asarray(landmarks[..., _LANDMARKS, :] * _FLIP)


def _orientations(orientations: Array | None) -> Array | None:
    return None if orientations is None else np.asarray(orientations[..., _SEGMENTS, :] * _FLIP_QUATERNION)


def _swapped(pair: npt.NDArray[Scalar] | None) -> npt.NDArray[Scalar] | None:
    return None if pair is None else pair[..., ::-1]
