"""How soon a leg comes to the end of its range: counted by hand for joints and coupling tables."""

from __future__ import annotations

import numpy as np
import pytest

from naoimitate.balance.legs import LegLimits, build_legs
from naoimitate.balance.range_end import SLOW, time_to_end
from naoimitate.robot.model import RobotModel

DT = 0.01


def test_a_leg_at_rest_or_slow_has_all_the_time(robot: RobotModel) -> None:
    legs, q = build_legs(robot, LegLimits()), robot.postures["stand"]
    assert time_to_end(legs, q, q, DT) == np.inf
    assert time_to_end(legs, q + 0.9 * SLOW * DT, q, DT) == np.inf


@pytest.mark.parametrize("side", ["l", "r"])
def test_a_knee_on_its_way_to_an_end(robot: RobotModel, side: str) -> None:
    legs, knee = build_legs(robot, LegLimits()), robot.points[f"{side}_knee"].joint
    for sign, end in ((1.0, legs.upper[knee]), (-1.0, legs.lower[knee])):
        q = robot.postures["stand"].copy()
        q[knee] = end - sign * 0.1
        before = q.copy()
        before[knee] -= sign * 2.0 * DT
        assert time_to_end(legs, before, q, DT) == pytest.approx(0.1 / 2.0)
        assert time_to_end(legs, q, before, DT) > 0.2, "away from it"


def test_an_ankle_on_its_way_to_its_coupling_table(nao: RobotModel) -> None:
    """Bent forward all the way: the table ends sooner than the joint."""
    legs = build_legs(nao, LegLimits())
    table = next(t for t in nao.tables if legs.variable[t.y] >= 0)
    q = nao.postures["stand"].copy()
    q[table.x] = legs.lower[table.x] + 0.1
    q[table.y] = table.bounds(q[table.x])[1] - 0.05
    before = q.copy()
    before[table.y] -= 1.0 * DT
    assert legs.upper[table.y] - q[table.y] > 0.05
    assert time_to_end(legs, before, q, DT) == pytest.approx(0.05)


def test_a_leg_past_its_end_has_no_time_left(robot: RobotModel) -> None:
    legs, knee = build_legs(robot, LegLimits()), robot.points["l_knee"].joint
    q = robot.postures["stand"].copy()
    q[knee] = legs.upper[knee] + 0.01
    before = q.copy()
    before[knee] -= 1.0 * DT
    assert time_to_end(legs, before, q, DT) == 0.0
