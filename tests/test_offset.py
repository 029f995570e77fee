"""The rate-limited offset: equation (6), the speed law, and the bound on its acceleration."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate.balance.offset import GRAVITY, OffsetLaw, Push, Span, advance, normalised_offset

LAW = OffsetLaw(shift="parabola")
FEET, COM_HEIGHT = 0.10, 0.26
"""m: a stance of 10 cm under a CoM at 26 cm, as of a robot of 0.57 m."""
STANCE = Span(FEET, COM_HEIGHT, -0.04, FEET + 0.04)
LIMIT = LAW.push(0.5, 1.0, STANCE).forth
ROUNDING = 3e-9
"""The offset snaps to a target that is nearer than 1e-9."""


def parabola(offset: float, limit: float) -> Push:
    """The paper's speed law with accelerations (1/s^2) up to a limit."""
    return Push(LAW.parabola(offset), limit, limit, limit)


def travel(start: float, target: float, dt: float = 0.01, limit: float = LIMIT) -> np.ndarray:
    """Offsets from rest until the target is reached, at most 10 s."""
    path, velocity = [start], 0.0
    while path[-1] != target and len(path) * dt < 10.0:
        offset, velocity = advance(path[-1], velocity, target, dt, parabola(path[-1], limit))
        path.append(offset)
    return np.array(path)


def test_equation_6_by_hand() -> None:
    left, right = np.array([0.0, 0.05]), np.array([0.0, -0.05])
    assert normalised_offset(np.array([0.3, 0.05]), left, right, 0.7) == pytest.approx(0.0)
    assert normalised_offset(np.array([0.3, -0.05]), left, right, 0.7) == pytest.approx(1.0)
    assert normalised_offset(np.array([0.3, 0.0]), left, right, 0.7) == pytest.approx(0.5)
    assert normalised_offset(np.array([0.0, -0.10]), left, right, 0.7) == pytest.approx(1.5), "not clamped"


def test_equation_6_is_the_projection_on_the_line_between_oblique_feet() -> None:
    left, right = np.array([0.1, 0.2]), np.array([0.4, -0.2])
    across = np.array([0.4, 0.3])
    for o in (-0.2, 0.0, 0.35, 1.0):
        assert normalised_offset(left + o * (right - left) + 0.7 * across, left, right, 0.0) == pytest.approx(o)


def test_last_value_is_kept_while_the_feet_are_closer_than_3_cm() -> None:
    left = np.zeros(2)
    assert normalised_offset(np.array([0.1, 0.0]), left, np.array([0.029, 0.0]), 0.42) == 0.42
    assert normalised_offset(np.array([0.1, 0.0]), left, np.array([0.031, 0.0]), 0.42) != 0.42
    assert normalised_offset(np.array([0.1, 0.0]), left, np.array([np.nan, 0.0]), 0.42) == 0.42


def test_speed_law_is_a_parabola_that_leaves_the_borders() -> None:
    assert LAW.parabola(0.5) == pytest.approx(LAW.max_speed)
    assert LAW.parabola(0.0) == LAW.parabola(1.0) == pytest.approx(LAW.min_speed)
    assert LAW.parabola(0.25) == pytest.approx(0.05 + 0.95 * 0.75)
    assert LAW.parabola(-0.3) == LAW.parabola(1.4) == pytest.approx(LAW.min_speed)


def test_acceleration_moves_the_zmp_by_at_most_10_mm() -> None:
    """Linear inverted pendulum: the ZMP is off the CoM by z a / g, with a = d o''."""
    for feet, height in ((0.05, 0.2), (0.10, 0.26), (0.3, 1.0)):
        zmp_shift = height * feet * LAW.push(0.5, 1.0, Span(feet, height, -0.04, feet + 0.04)).brake / GRAVITY
        assert zmp_shift == pytest.approx(0.010)


def test_centre_to_foot_takes_about_1_1_s_and_foot_to_foot_2_0_s() -> None:
    assert 1.0 <= 0.01 * len(travel(0.5, 0.0)) <= 1.3
    assert 1.0 <= 0.01 * len(travel(0.5, 1.0)) <= 1.3
    assert 1.9 <= 0.01 * len(travel(0.0, 1.0)) <= 2.3


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.0005, 0.05), st.floats(0.3, 20.0))
@settings(max_examples=60, deadline=None)
def test_a_fixed_target_is_reached_without_passing_it(start: float, target: float, dt: float, limit: float) -> None:
    path = travel(start, target, dt, limit)
    assert path[-1] == target
    assert np.all(np.diff(path) * np.sign(target - start) >= 0.0)
    assert path.min() >= min(start, target) and path.max() <= max(start, target)


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.0005, 0.05))
@settings(max_examples=60, deadline=None)
def test_a_fixed_target_is_reached_within_speed_law_and_acceleration(start: float, target: float, dt: float) -> None:
    path = travel(start, target, dt)
    speed = np.abs(np.diff(path)) / dt
    assert np.all(speed <= np.array([LAW.parabola(o) for o in path[:-1]]) + LIMIT * dt)
    change = np.abs(np.diff(np.concatenate([[0.0], np.diff(path), [0.0]]) / dt))
    assert np.all(change <= LIMIT * dt + ROUNDING / dt)


@given(
    st.floats(0.0, 1.0),
    st.lists(st.tuples(st.floats(0.0, 1.0), st.integers(1, 60)), min_size=1, max_size=12),
    st.floats(0.001, 0.05),
    st.floats(2.0, 10.0),
)
@settings(max_examples=200, deadline=None)
def test_jumping_targets_never_throw_the_offset(
    start: float, targets: list[tuple[float, int]], dt: float, limit: float
) -> None:
    offset, velocity, last = start, 0.0, 0.0
    for target, steps in targets:
        for _ in range(steps):
            moved, velocity = advance(offset, velocity, target, dt, parabola(offset, limit))
            speed = (moved - offset) / dt
            assert -0.05 <= moved <= 1.05, "braked in time"
            assert abs(speed) <= LAW.max_speed + 1e-9
            assert abs(speed - last) <= limit * dt + ROUNDING / dt, "the ZMP is thrown"
            offset, last = moved, speed


PENDULUM = OffsetLaw(shift="pendulum")


def pendulum(start: float, target: float, span: Span, dt: float = 0.01) -> tuple[np.ndarray, np.ndarray]:
    """Offsets and speeds (1/s) on the pendulum, from rest until the target is reached."""
    path, speeds = [start], [0.0]
    while path[-1] != target and len(path) * dt < 10.0:
        push = PENDULUM.push(path[-1], target, span)
        offset, velocity = advance(path[-1], speeds[-1], target, dt, push)
        path.append(offset)
        speeds.append(velocity)
    return np.array(path), np.array(speeds)


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.06, 0.2), st.floats(0.15, 0.4), st.floats(0.03, 0.06))
@settings(max_examples=60, deadline=None)
def test_the_pendulum_keeps_the_zmp_inside_the_soles(
    start: float, target: float, feet: float, height: float, sole: float
) -> None:
    path, speeds = pendulum(start, target, Span(feet, height, -sole, feet + sole))
    assert path[-1] == target
    assert path.min() >= min(start, target) - ROUNDING and path.max() <= max(start, target) + ROUNDING
    zmp = feet * (path[:-1] - height / GRAVITY * np.diff(speeds) / 0.01)
    margin = min(PENDULUM.zmp_margin, sole - PENDULUM.least_reach)
    assert (
        zmp[:-1].min(initial=0.0) >= -sole + margin - 1e-3 and zmp[:-1].max(initial=0.0) <= feet + sole - margin + 1e-3
    )
    assert np.abs(zmp - feet * path[:-1]).max(initial=0.0) <= PENDULUM.reach + 1e-3


def test_the_pendulum_takes_half_the_time_of_the_parabola() -> None:
    assert len(pendulum(0.5, 0.0, STANCE)[0]) <= 0.5 * len(travel(0.5, 0.0))
    assert len(pendulum(0.0, 1.0, STANCE)[0]) <= 0.5 * len(travel(0.0, 1.0))
