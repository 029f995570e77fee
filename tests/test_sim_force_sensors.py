"""The force sensors under the soles read what a rigid sole that rests on them presses on each."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sim_poses import one_foot_pose

from naoimitate.core.geometry import convex_hull, polygon_margin
from naoimitate.hw.force_sensors import center_of_pressure, sensor_places
from naoimitate.robot import RobotModel, load_robot
from naoimitate.robot.model import Array
from naoimitate.sim.force_sensors import shares_of
from naoimitate.sim.physics import Physics
from naoimitate.sim.placement import stand_on_floor
from naoimitate.sim.settings import SimSettings

NAO = load_robot("nao")
PLACES = sensor_places(NAO)
COORDINATE = st.floats(-0.15, 0.15)
SQUARE = np.array([[0.05, 0.03], [0.05, -0.03], [-0.05, 0.03], [-0.05, -0.03]])


def settled(robot: RobotModel, q: Array, foot: str | None = None) -> Physics:
    physics = Physics(robot, SimSettings())
    physics.place(q, *stand_on_floor(robot, q, foot))
    physics.advance(q, 2.0)
    return physics


def felt(robot: RobotModel, physics: Physics) -> Array:
    """Centre of pressure (2,) m in the world as the sensors tell it."""
    origins, axes = physics.sole_frames()
    places = np.pad(sensor_places(robot), ((0, 0), (0, 0), (0, 1)))
    at = origins[:, None] + np.einsum("sij,skj->ski", axes, places)
    return center_of_pressure(physics.fsr.ravel(), at[..., :2].reshape(-1, 2))


@given(st.sampled_from([0, 1]), COORDINATE, COORDINATE)
def test_no_sensor_pulls_no_force_is_lost_and_the_centre_of_pressure_is_kept(side: int, x: float, y: float) -> None:
    places, point = PLACES[side], np.array([x, y])
    shares, hull = shares_of(places, point), convex_hull(places)
    assert shares.min() >= 0.0 and shares.sum() == pytest.approx(1.0)
    told = shares @ places
    if polygon_margin(hull, x, y) >= 0.0:
        np.testing.assert_allclose(told, point, atol=1e-6)
    else:
        assert abs(polygon_margin(hull, *told)) < 1e-6
        nearest = min(np.linalg.norm(a + t * (b - a) - point) for a, b in _edges(hull) for t in np.linspace(0, 1, 500))
        assert np.linalg.norm(told - point) == pytest.approx(nearest, abs=1e-4)


@given(st.floats(-math.pi, math.pi), st.floats(0.0, 300.0))
def test_a_blow_from_anywhere_however_far_out_gives_numbers(angle: float, decibels: float) -> None:
    point = 10.0 ** (decibels / 20.0 - 3.0) * np.array([math.cos(angle), math.sin(angle)])
    shares = shares_of(PLACES[0], point)
    assert shares.min() >= 0.0 and shares.sum() == pytest.approx(1.0)


def _edges(hull: Array) -> list[tuple[Array, Array]]:
    return list(zip(hull, np.roll(hull, -1, axis=0), strict=True))


def test_a_force_in_the_middle_is_shared_evenly_and_one_off_it_as_by_four_equal_springs() -> None:
    np.testing.assert_allclose(shares_of(SQUARE, np.zeros(2)), 0.25, atol=1e-6)
    np.testing.assert_allclose(shares_of(SQUARE, np.array([0.01, 0.0])), [0.3, 0.3, 0.2, 0.2], atol=1e-5)


def test_a_robot_whose_data_place_no_sensors_has_them_at_the_corners_of_its_soles(second_robot: RobotModel) -> None:
    for places, side in zip(sensor_places(second_robot), "lr", strict=True):
        np.testing.assert_allclose(convex_hull(places), convex_hull(second_robot.soles[side]), atol=1e-9)


@pytest.mark.parametrize("foot", [None, "l", "r"])
def test_the_centre_of_pressure_of_a_robot_at_rest_is_under_its_centre_of_mass(
    robot: RobotModel, foot: str | None
) -> None:
    q = robot.postures["stand"] if foot is None else one_foot_pose(robot, foot)
    physics = settled(robot, q, foot)
    com = physics.data.subtree_com[physics.torso][:2]
    np.testing.assert_allclose(felt(robot, physics), com, atol=5e-4)
    np.testing.assert_allclose(physics.fsr.sum(axis=1), physics.foot_load, atol=0.2)


@pytest.mark.parametrize("lean", [-0.1, -0.05, 0.05, 0.1])
def test_it_follows_a_body_that_leans_over_its_soles(nao: RobotModel, lean: float) -> None:
    q = nao.postures["stand"].copy()
    physics = settled(nao, q)
    upright = felt(nao, physics)
    for side in "LR":
        q[nao.joint(f"{side}AnklePitch")] += lean
    physics.advance(q, 2.0)
    com = physics.data.subtree_com[physics.torso][:2]
    np.testing.assert_allclose(felt(nao, physics), com, atol=5e-4)
    assert (felt(nao, physics) - upright)[0] == pytest.approx(-0.24 * lean, abs=0.006)
