"""How far a point may move over the soles and keep its distance from their edges."""

from __future__ import annotations

import numpy as np
import pytest

from naoimitate.balance.polygon import room_around
from naoimitate.core.geometry import convex_hull, polygon_margin


@pytest.mark.parametrize("seed", range(40))
def test_a_point_keeps_its_margin_as_far_as_it_may_move(seed: int) -> None:
    """Edges at any angle to the way."""
    rng = np.random.default_rng(seed)
    polygon = convex_hull(rng.uniform(-0.1, 0.1, (12, 2)))
    x, y = polygon.mean(axis=0)
    margin, turn = 0.2 * polygon_margin(polygon, x, y), rng.uniform(-np.pi, np.pi)
    dx, dy = np.cos(turn), np.sin(turn)
    room = room_around(polygon, x, y, np.array([dx, dy]), margin, 0.0)
    for way, (ux, uy) in zip(room, ((dx, dy), (-dx, -dy), (-dy, dx), (dy, -dx)), strict=True):
        assert way > 0.0
        assert polygon_margin(polygon, x + way * ux, y + way * uy) == pytest.approx(margin, abs=1e-9)


def test_a_point_may_always_move_a_little() -> None:
    square = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]])
    assert room_around(square, 0.099, 0.05, np.array([1.0, 0.0]), 0.02, 0.003)[0] == 0.003
