"""Heights of the soles from the loads that they are told to have, without a robot."""

from __future__ import annotations

import numpy as np
import pytest

from naoimitate.hw.sole_heights import HEIGHTS, SoleHeights

PERIOD = 0.01
ALONE, BOTH = np.array([1.0, 0.0]), np.array([0.5, 0.5])


@pytest.mark.parametrize(
    ("softness", "height"), [(0.5, 0.0), (1.0, 0.0), (3.0, 2.0 * HEIGHTS.spare), (1e9, HEIGHTS.most)]
)
def test_a_foot_in_the_air_keeps_the_farther_off_the_softer_the_servos_are(softness: float, height: float) -> None:
    heights, before = SoleHeights(PERIOD), 0.0
    for _ in range(200):
        heights.update("L", ALONE, ALONE, True, softness)
        assert heights.raised[1] - before <= HEIGHTS.easing * PERIOD + 1e-12, "gently"
        before = heights.raised[1]
    assert heights.raised == pytest.approx([0.0, height])
    for _ in range(200):
        heights.update("D", BOTH, BOTH, True, softness)
    assert heights.raised == pytest.approx([0.0, 0.0]), "and comes down once it stands"


def test_nothing_known_brings_it_back() -> None:
    heights = SoleHeights(PERIOD)
    for _ in range(200):
        heights.update("L", ALONE, ALONE, True, 5.0)
    for _ in range(200):
        heights.update("L", ALONE, None, True, 5.0)
    assert heights.raised == pytest.approx([0.0, 0.0])
