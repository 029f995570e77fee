"""When a robot counts as fallen: the same rule for the simulation, its driver and the score."""

from __future__ import annotations

import numpy as np
import pytest

from naoimitate.core.falling import HEIGHT_LIMIT, TILT_LIMIT, has_fallen, swing_load, tilt


def test_fallen_means_tipped_sunk_or_carried_by_the_wrong_foot_and_lasts() -> None:
    fine, low, heavy = np.zeros(4), np.array([1.0, HEIGHT_LIMIT - 0.01, 1.0, 1.0]), np.array([0.0, 0.0, 0.1, 0.0])
    steep = np.array([0.0, 0.0, TILT_LIMIT + 0.01, 0.0])
    ones = np.ones(4)
    assert not has_fallen(fine, ones, fine).any()
    assert has_fallen(fine, low, fine).tolist() == [False, True, True, True]
    assert has_fallen(steep, ones, fine).tolist() == [False, False, True, True]
    assert has_fallen(fine, ones, heavy).tolist() == [False, False, True, True]


def test_swing_load_counts_the_foot_in_the_air_only() -> None:
    load = np.array([[30.0, 20.0]] * 3)
    np.testing.assert_allclose(swing_load(np.array(["D", "L", "R"]), load, 50.0), (0.0, 0.4, 0.6))


def test_tilt_is_the_angle_from_the_plan_and_ignores_the_heading() -> None:
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    turned = np.array([np.cos(0.5), 0.0, 0.0, np.sin(0.5)])
    leaning = np.array([np.cos(0.3), np.sin(0.3), 0.0, 0.0])
    assert tilt(upright, turned) == pytest.approx(0.0, abs=1e-6)
    assert tilt(upright, np.array([turned, leaning])) == pytest.approx([0.0, 0.6], abs=1e-6)
