"""Task limits: points follow their targets at a bounded speed and acceleration, without lag where they can."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate.limits import Follower, TaskLimits

SPEED, ACCELERATION = TaskLimits().hand_speed, TaskLimits().hand_acceleration
DTS = st.floats(TaskLimits().min_dt, TaskLimits().max_dt)
PLACES = st.tuples(*[st.floats(-0.4, 0.4)] * 3)


def follower(start: object = (0.0, 0.0, 0.0)) -> Follower:
    return Follower(np.array([start], dtype=float), SPEED, ACCELERATION)


@given(st.lists(st.tuples(PLACES, st.integers(1, 25), DTS), min_size=1, max_size=8))
@settings(max_examples=60, deadline=None)
def test_speed_and_acceleration_are_bounded_whatever_the_target_and_the_frame_rate(
    orders: list[tuple[tuple[float, float, float], int, float]],
) -> None:
    hand, velocity = follower(), np.zeros((1, 3))
    for target, steps, dt in orders:
        for _ in range(steps):
            before = hand.position.copy()
            moved = (hand.step(np.array([target]), dt) - before) / dt
            assert np.linalg.norm(moved) <= SPEED * (1.0 + 1e-9)
            assert np.linalg.norm(moved - velocity) <= ACCELERATION * dt * (1.0 + 1e-6) + 1e-9
            velocity = moved


@given(PLACES, PLACES, DTS)
@settings(max_examples=60, deadline=None)
def test_a_resting_target_is_reached_and_kept(
    start: tuple[float, float, float], target: tuple[float, float, float], dt: float
) -> None:
    hand = follower(start)
    way = np.linalg.norm(np.subtract(target, start))
    enough = way / SPEED + 2.0 * SPEED / ACCELERATION + 20.0 * dt
    farthest = 0.0
    for _ in range(int(enough / dt) + 1):
        hand.step(np.array([target]), dt)
        beyond = np.dot(hand.position[0] - target, np.subtract(target, start))
        farthest = max(farthest, beyond / max(float(way), 1e-12))
    assert hand.behind[0] < 1e-9
    assert farthest <= 0.5 * ACCELERATION * dt * dt + 1e-9, "the hand overshoots a resting target"
    before = hand.position.copy()
    hand.step(np.array([target]), dt)
    assert np.array_equal(hand.position, before)


@pytest.mark.parametrize("rate", [20.0, 60.0, 120.0, 240.0])
def test_a_slow_target_is_followed_without_lag(rate: float) -> None:
    """A sine of 0.2 m and 0.35 Hz: 0.44 m/s and 0.97 m/s^2 at most."""
    hand, time = follower(), np.arange(0.0, 4.0, 1.0 / rate)
    path = np.stack([0.2 * np.sin(2.0 * np.pi * 0.35 * time)] + [0.0 * time] * 2, axis=1)
    hand.restart(path[:1])
    late = []
    for target in path[1:]:
        hand.step(target[None], 1.0 / rate)
        late.append(hand.behind[0])
    assert max(late[int(0.5 * rate) :]) == 0.0


def test_a_target_faster_than_the_limit_is_chased_at_the_limit_and_caught_when_it_stops() -> None:
    hand, dt = follower(), 0.01
    for k in range(100):
        before = hand.position.copy()
        hand.step(np.array([[0.009 * (k + 1), 0.0, 0.0]]), dt)
    assert np.linalg.norm(hand.position - before) == pytest.approx(SPEED * dt, rel=1e-6)
    assert hand.behind[0] > 0.2
    for _ in range(100):
        hand.step(np.array([[0.9, 0.0, 0.0]]), dt)
    assert hand.behind[0] == 0.0


def test_points_do_not_influence_each_other() -> None:
    both = Follower(np.zeros((2, 3)), SPEED, ACCELERATION)
    alone = follower()
    for k in range(50):
        target = np.array([[0.01 * k, 0.1, 0.0], [0.3, -0.2, 0.02 * k]])
        both.step(target, 0.02)
        alone.step(target[1:], 0.02)
    assert np.array_equal(both.position[1:], alone.position)


def test_restart_stands_still_at_the_place() -> None:
    hand = follower()
    for _ in range(20):
        hand.step(np.array([[1.0, 0.0, 0.0]]), 0.02)
    hand.restart(np.array([[0.5, 0.5, 0.5]]))
    assert hand.behind[0] == 0.0 and not hand.velocity.any()
    assert np.linalg.norm(hand.step(np.array([[0.0, 0.0, 0.0]]), 0.02) - 0.5) <= ACCELERATION * 0.02**2 + 1e-12
