from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate.core.frames import LANDMARK, LANDMARKS
from naoimitate.human.segments import SEGMENT_TABLE, center_of_mass
from naoimitate.motion.builtin import tpose

T_POSE = tpose().landmarks


def by_hand(landmarks: np.ndarray) -> np.ndarray:
    """The sum over segments, written out."""
    total, moment = 0.0, np.zeros(3)
    for segment in SEGMENT_TABLE:
        first = np.mean([landmarks[LANDMARK[name]] for name in segment.first], axis=0)
        second = np.mean([landmarks[LANDMARK[name]] for name in segment.second], axis=0)
        center = first + segment.center * (second - first)
        if np.isfinite(center).all():
            total, moment = total + segment.mass, moment + segment.mass * center
    return moment / total if total > 0.0 else np.full(3, np.nan)


def test_masses_of_the_table_sum_to_the_whole_body() -> None:
    assert sum(segment.mass for segment in SEGMENT_TABLE) == pytest.approx(1.0, abs=2e-4)


def test_a_symmetric_person_has_a_symmetric_center_of_mass() -> None:
    assert center_of_mass(T_POSE)[1] == pytest.approx(0.0, abs=1e-9)


def test_center_of_a_person_in_a_tpose_is_a_little_above_the_hips() -> None:
    """Anthropometry: 55 to 57 % of the stature with the arms down, a few per cent more with the arms raised."""
    assert 0.55 < center_of_mass(T_POSE)[2] / 1.75 < 0.62


@settings(max_examples=60, deadline=None)
@given(st.sets(st.sampled_from(LANDMARKS)), st.integers(0, 2**32 - 1))
def test_segments_with_missing_landmarks_are_left_out(missing: set[str], seed: int) -> None:
    landmarks = T_POSE + np.random.default_rng(seed).normal(0.0, 0.1, T_POSE.shape)
    landmarks[[LANDMARK[name] for name in missing]] = np.nan
    np.testing.assert_allclose(center_of_mass(landmarks), by_hand(landmarks), atol=1e-12)


def test_frames_of_a_stack_do_not_influence_each_other() -> None:
    stack = np.stack([T_POSE, T_POSE + 1.0, T_POSE])[:, None]
    stack[1, 0, LANDMARK["l_knee"]] = np.nan
    centers = center_of_mass(stack)
    assert centers.shape == (3, 1, 3)
    np.testing.assert_allclose(centers[1, 0], by_hand(stack[1, 0]))
    np.testing.assert_allclose(centers[2, 0], center_of_mass(T_POSE))


def test_nobody_has_no_center() -> None:
    assert np.isnan(center_of_mass(np.full_like(T_POSE, np.nan))).all()
