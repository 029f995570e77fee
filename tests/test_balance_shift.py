"""Section V-C as functions: equations (6) and (7), the shift s, and what is done with soles near the floor."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from naoimitate.balance.shift import (
    LEVEL_BELOW,
    levelled,
    offset_in_space,
    parted,
    shift_factor,
    shifted,
    swung,
    up_vector,
)
from naoimitate.core.geometry import matrix_from_rotation_vector

LEFT, RIGHT = np.array([0.0, 0.05, -0.3]), np.array([0.0, -0.05, -0.3])
OUTLINE = np.array([[-0.07, -0.04], [0.07, -0.04], [0.07, 0.04], [-0.07, 0.04]])


@st.composite
def stands(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """Soles (2, 3) m and a CoM (3,) m as a small robot may have them in its torso frame."""
    soles = [
        [draw(st.floats(*r)) for r in ((-0.1, 0.1), side, (-0.34, -0.24))] for side in ((0.02, 0.12), (-0.12, -0.02))
    ]
    com = [draw(st.floats(*r)) for r in ((-0.04, 0.04), (-0.05, 0.05), (-0.10, 0.0))]
    return np.array(soles), np.array(com)


OFFSETS = st.floats(0.0, 1.0)


def test_equations_by_hand() -> None:
    com = np.array([0.0, 0.02, -0.05])
    assert offset_in_space(LEFT, RIGHT, com) == pytest.approx(0.3)
    np.testing.assert_allclose(up_vector(LEFT, RIGHT, com, 0.3), [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(up_vector(LEFT, RIGHT, com, 0.0), np.array([0.0, -0.03, 0.25]) / np.hypot(0.03, 0.25))


def test_shift_by_hand() -> None:
    """CoM in the middle, o' = 0: 0.065 s^2 - 0.07 s + 0.005 = 0 has the roots 1/13 and 1; the foot rises by 0.25/13."""
    com = np.array([0.0, 0.0, -0.05])
    assert shift_factor(LEFT, RIGHT, com, 0.0) == pytest.approx(1.0 / 13.0)
    np.testing.assert_allclose(shifted(np.array([LEFT, RIGHT]), com, 0.0)[0], LEFT + np.array([0.0, -0.05, 0.25]) / 13)


def test_shift_towards_the_other_foot_is_linear() -> None:
    """o' = 1 leaves (v.d - v.v) s + v.d - d.d = 0; CoM in the middle: -0.06 s - 0.005 = 0, away from the CoM."""
    assert shift_factor(LEFT, RIGHT, np.array([0.0, 0.0, -0.05]), 1.0) == pytest.approx(-1.0 / 12.0)


@given(stands(), OFFSETS)
def test_the_shifted_foot_meets_the_offset_by_the_smaller_root(
    stand: tuple[np.ndarray, np.ndarray], offset: float
) -> None:
    (left, right), com = stand
    s, v, d = shift_factor(left, right, com, offset), com - left, right - left
    roots = np.roots([(1.0 - offset) * v @ v, (2.0 * offset - 1.0) * v @ d - v @ v, v @ d - offset * d @ d])
    assume(len(roots) > 0 and np.isreal(roots).all() and np.abs(roots).min() < 1e3)
    assert offset_in_space(left + s * v, right, com) == pytest.approx(offset, abs=1e-6)
    assert abs(s) <= np.abs(roots).min() * (1.0 + 1e-6) + 1e-9


@given(stands(), OFFSETS)
def test_one_foot_is_shifted_and_the_normal_stands_on_the_line_between_them(
    stand: tuple[np.ndarray, np.ndarray], offset: float
) -> None:
    soles, com = stand
    places = shifted(soles, com, offset)
    still = 1 if offset < offset_in_space(*soles, com) else 0
    np.testing.assert_array_equal(places[still], soles[still])
    assume(abs(offset_in_space(*places, com) - offset) < 1e-6)  # else no real root: it comes as near as it can
    up = up_vector(*places, com, offset)
    assert np.linalg.norm(up) == pytest.approx(1.0)
    assert up @ (places[1] - places[0]) == pytest.approx(0.0, abs=1e-6)


@given(stands(), OFFSETS, st.sampled_from([0, 1]))
def test_the_other_sole_is_levelled_into_the_plane_of_the_stance_sole(
    stand: tuple[np.ndarray, np.ndarray], offset: float, stance: int
) -> None:
    soles, com = stand
    up, places = up_vector(*soles, com, offset), levelled(soles, com, offset, stance)
    np.testing.assert_array_equal(places[stance], soles[stance])
    assert up @ (places[1] - places[0]) == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(np.cross(places[1 - stance] - soles[1 - stance], up), 0.0, atol=1e-9)


@given(stands(), st.tuples(*[st.floats(-0.5, 0.5)] * 3), st.sampled_from([0, 1]))
def test_a_swing_sole_keeps_its_corners_off_the_floor_and_is_level_near_it(
    stand: tuple[np.ndarray, np.ndarray], turn: tuple[float, float, float], stance: int
) -> None:
    soles, com = stand
    frame = matrix_from_rotation_vector(np.array(turn))
    places, normals = swung(soles, np.array([frame, frame]), com, stance, OUTLINE, 0.008)
    up, swing = up_vector(*soles, com, float(stance)), 1 - stance
    np.testing.assert_array_equal(places[stance], soles[stance])
    np.testing.assert_allclose(normals[stance], up, atol=1e-12)
    height = (soles[swing] - soles[stance]) @ up
    reached = (places[swing] - places[stance]) @ up
    assert reached >= max(height, 0.008) - 1e-9
    if height <= 0.0:
        np.testing.assert_allclose(normals[swing], up, atol=1e-12)
    if height >= LEVEL_BELOW:
        np.testing.assert_allclose(normals[swing], frame[:, 2], atol=1e-12)
        assert reached + (OUTLINE @ frame[:, :2].T @ up).min() >= 0.008 - 1e-9


@given(stands(), st.floats(0.05, 0.2))
def test_soles_are_parted_sideways_around_their_middle(stand: tuple[np.ndarray, np.ndarray], apart: float) -> None:
    soles, _ = stand
    places = parted(soles, apart)
    assert places[0, 1] - places[1, 1] == pytest.approx(max(apart, soles[0, 1] - soles[1, 1]))
    np.testing.assert_allclose(places.mean(axis=0), soles.mean(axis=0))
    np.testing.assert_array_equal(places[:, [0, 2]], soles[:, [0, 2]])
