"""The mirror image of a person: symmetric motions stay, sides swap, twice is nothing."""

from __future__ import annotations

import numpy as np
import pytest

from naoimitate.core.frames import LANDMARK, SEGMENT
from naoimitate.core.geometry import matrix_from_quat
from naoimitate.human.body import measure, observe
from naoimitate.human.mirror import mirrored, mirrored_frame
from naoimitate.motion.builtin import builtin_motion

MIRROR = np.diag([1.0, -1.0, 1.0])


@pytest.mark.parametrize("name", ["paper", "side-kick", "walk"])
def test_twice_mirrored_is_the_same_motion(name: str) -> None:
    motion = builtin_motion(name)
    twice = mirrored(mirrored(motion))
    np.testing.assert_array_equal(twice.landmarks, motion.landmarks)
    np.testing.assert_array_equal(twice.orientations, motion.orientations)
    np.testing.assert_array_equal(twice.contacts, motion.contacts)
    np.testing.assert_array_equal(twice.support, motion.support)


def test_left_becomes_right_on_the_other_side_of_the_path() -> None:
    motion = builtin_motion("paper")
    image = mirrored(motion)
    right = motion.landmarks[:, LANDMARK["r_wrist"]]
    np.testing.assert_array_equal(image.landmarks[:, LANDMARK["l_wrist"]], right * [1.0, -1.0, 1.0])
    assert set(image.support) == {"D", "R"}
    assert image.notes[-1].startswith("The person is mirrored")


def test_orientations_are_those_of_the_mirrored_segments() -> None:
    frame = builtin_motion("side-kick").at(7.0)
    image = mirrored_frame(frame)
    for here, there in (("l_foot", "r_foot"), ("chest", "chest"), ("r_hand", "l_hand")):
        original = matrix_from_quat(frame.orientations[SEGMENT[here]])
        np.testing.assert_allclose(
            matrix_from_quat(image.orientations[SEGMENT[there]]), MIRROR @ original @ MIRROR, atol=1e-12
        )


def test_the_posture_of_the_image_is_the_mirrored_posture() -> None:
    motion = builtin_motion("paper")
    body, other = measure(motion.tpose), measure(mirrored(motion).tpose)
    for time in (0.0, 6.0, 11.0, 18.0):
        posture = observe(body, motion.at(time)).posture
        image = observe(other, mirrored(motion).at(time)).posture
        np.testing.assert_allclose(image, posture[[2, 3, 0, 1]] * [1.0, -1.0, 1.0], atol=1e-9)
