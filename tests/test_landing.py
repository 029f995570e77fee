"""The landing set: clipping, its mirror image, and the proof that both feet can carry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from naoimitate.balance.landing import LandingSet, landing_set
from naoimitate.balance.landing_tool import LandingGrid, Prover, compute_landing_set
from naoimitate.core.errors import RobotModelError
from naoimitate.robot.model import RobotModel

WISHES = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-2.0, 2.0))
ROUNDING = 1e-9


def violation(places: LandingSet, swing: int, position: np.ndarray, yaw: float) -> float:
    """How far (m) a landing pose is outside, by the half planes themselves."""
    sign = 1.0 if swing == 0 else -1.0
    reach = [np.interp(sign * yaw, places.yaws, places.reach[:, k]) for k in range(len(places.directions))]
    return float((places.directions @ (position * [1.0, sign]) - reach).max())


@given(wish=WISHES, swing=st.sampled_from([0, 1]))
@settings(max_examples=150, deadline=None)
def test_a_clipped_wish_is_inside_and_clipping_again_changes_nothing(
    robot: RobotModel, wish: tuple[float, float, float], swing: int
) -> None:
    places = landing_set(robot)
    position, yaw, moved = places.clip(swing, np.array(wish[:2]), wish[2])
    assert violation(places, swing, position, yaw) < ROUNDING
    assert places.yaws[0] <= (yaw if swing == 0 else -yaw) <= places.yaws[-1]
    again, yaw_again, moved_again = places.clip(swing, position, yaw)
    assert again == pytest.approx(position, abs=1e-9) and yaw_again == pytest.approx(yaw, abs=1e-9)
    assert not moved_again
    assert moved == bool(np.linalg.norm(position - wish[:2]) > 1e-6 or abs(yaw - wish[2]) > 1e-6)


@given(wish=WISHES)
@settings(max_examples=80, deadline=None)
def test_the_other_foot_has_the_mirror_image(robot: RobotModel, wish: tuple[float, float, float]) -> None:
    places, (x, y, yaw) = landing_set(robot), wish
    left, left_yaw, left_moved = places.clip(0, np.array([x, y]), yaw)
    right, right_yaw, right_moved = places.clip(1, np.array([x, -y]), -yaw)
    assert right == pytest.approx(left * [1.0, -1.0], abs=1e-9)
    assert right_yaw == pytest.approx(-left_yaw)
    assert right_moved == left_moved


def test_clipping_takes_the_nearest_place(robot: RobotModel) -> None:
    """Compared with SLSQP at the same yaw."""
    places, rng = landing_set(robot), np.random.default_rng(0)
    for _ in range(60):
        wish, yaw = rng.uniform(-0.4, 0.4, 2), rng.uniform(*places.yaws[[0, -1]])
        position, _, _ = places.clip(0, wish, yaw)
        reach = np.array([np.interp(yaw, places.yaws, places.reach[:, k]) for k in range(len(places.directions))])
        nearest = minimize(
            lambda p, w=wish: np.sum((p - w) ** 2),
            places.clip(0, np.array([0.0, 0.1]), yaw)[0],
            constraints={"type": "ineq", "fun": lambda p, r=reach: r - places.directions @ p},
            method="SLSQP",
        )
        assert np.linalg.norm(position - wish) <= np.linalg.norm(nearest.x - wish) + 1e-5


def test_membership_has_a_small_tolerance(robot: RobotModel) -> None:
    places = landing_set(robot)
    inside, yaw, _ = places.clip(0, np.array([0.0, 0.4]), 0.0)
    assert places.contains(0, inside, yaw)
    assert places.contains(0, inside + np.array([0.0, 0.001]), yaw)
    assert not places.contains(0, inside + np.array([0.0, 0.01]), yaw)
    assert not places.contains(0, inside, places.yaws[-1] + 0.1)
    assert places.contains(1, inside * [1.0, -1.0], -yaw)
    assert not places.contains(1, inside, yaw), "the right foot does not land on the left of the left one"


def test_the_standing_posture_is_a_landing_place(robot: RobotModel) -> None:
    places, prover = landing_set(robot), Prover(robot)
    middle = places.clip(0, np.array([0.0, 0.1]), 0.0)[0]
    assert places.contains(0, middle, 0.0)
    assert prover.both_feet(middle, 0.0)


@pytest.mark.parametrize("swing", [0, 1])
def test_the_middle_is_well_inside(robot: RobotModel, swing: int) -> None:
    places = landing_set(robot)
    middle = places.middle(swing)
    assert violation(places, swing, middle, 0.0) < -0.01
    assert Prover(robot).both_feet(middle * [1.0, 1.0 if swing == 0 else -1.0], 0.0)


def test_the_set_is_wide_enough_to_walk(robot: RobotModel) -> None:
    """At least 4 cm forwards and backwards, some of it with the feet turned by 0.2 rad."""
    places = landing_set(robot)
    for yaw in (-0.2, 0.0, 0.2):
        ahead, behind = (places.clip(0, np.array([x, 0.11]), yaw)[0] for x in (0.3, -0.3))
        assert ahead[0] - behind[0] >= 0.08


def test_members_can_carry_on_either_foot(robot: RobotModel) -> None:
    """Random members, a centimetre inside: the tool moves the foot there and the CoM over either foot."""
    places, prover, rng = landing_set(robot), Prover(robot), np.random.default_rng(1)
    inner = replace(places, reach=places.reach - 0.01)
    failed = []
    for _ in range(25):
        wish, yaw = rng.uniform([-0.15, 0.05], [0.15, 0.2]), rng.uniform(*places.yaws[[0, -1]])
        position, yaw, _ = inner.clip(0, wish, yaw)
        if not prover.both_feet(position, yaw):
            failed.append((position, yaw))
    assert not failed


def test_places_far_outside_cannot_carry(robot: RobotModel) -> None:
    prover = Prover(robot)
    for place in ([0.0, 0.02], [0.0, 0.35], [0.3, 0.1], [-0.3, 0.1]):
        assert not prover.both_feet(np.array(place), 0.0)


def test_the_tool_finds_places_that_it_proves(nao: RobotModel) -> None:
    """A grid of 12 places at one yaw: the polygon holds exactly the good ones."""
    grid = LandingGrid(step=0.04, behind=0.04, narrow=0.06, wide=0.19, turn=0.0, turns=1, directions=8, reserve=0.0)
    shares: list[float] = []
    data = compute_landing_set(nao, grid, shares.append)
    prover, angles = Prover(nao), np.radians(data["directions_deg"])
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    assert shares == [1.0] and data["yaws"] == [0.0]
    for x in (-0.04, 0.0, 0.04):
        for y in (0.06, 0.10, 0.14, 0.18):
            inside = bool((normals @ [x, y] <= np.array(data["reach"][0]) + 1e-3).all())
            assert inside <= prover.both_feet(np.array([x, y]), 0.0)


def test_a_robot_without_a_landing_set_says_what_to_do(nao: RobotModel) -> None:
    with pytest.raises(RobotModelError, match="landing"):
        landing_set(replace(nao, data={k: v for k, v in nao.data.items() if k != "landing"}))
