"""A plan waits for a robot that commands no longer reach, and for nothing else."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate import load_robot
from naoimitate.hw.driver import RobotState
from naoimitate.hw.lean import UPRIGHT
from naoimitate.hw.pacing import DEFAULT, Pacing
from naoimitate.hw.target import Target
from naoimitate.robot.model import Array

NAO = load_robot("nao")
PERIOD = 0.01
SPEED = 0.3
ROLLS = [NAO.joint(name) for name in ("LHipRoll", "LAnkleRoll", "RHipRoll", "RAnkleRoll")]


def leaning(seconds: float) -> Array:
    """The posture of a plan that shifts its weight at SPEED rad/s."""
    q = NAO.postures["stand"].copy()
    q[ROLLS] += SPEED * seconds * np.array([1.0, -1.0, 1.0, -1.0])
    return q


def state(time: float, q: Array) -> RobotState:
    nan = np.full(3, np.nan)
    return RobotState(time, q, np.full(len(q), np.nan), np.zeros(2), nan, nan, np.zeros((2, 4)), fell=False)


def play(frames: int, seen: Callable[[int, list[Array]], Array], pacing: Pacing | None = None) -> tuple[Pacing, Array]:
    """Play a shift; seen: from a frame and all postures sent so far to the joints measured. What was sent (T, J)."""
    sent: list[Array] = []

    def inner(target: Target, state: RobotState) -> Array:
        sent.append(target.q)
        return target.q

    pacing = pacing or Pacing(NAO, inner, PERIOD)
    pacing.inner = inner
    for frame in range(frames):
        target = Target(leaning(frame * PERIOD), np.zeros(3), UPRIGHT, "D")
        pacing(target, state(frame * PERIOD, seen(frame, sent)))
    return pacing, np.array(sent)


def following(lag: int) -> Callable[[int, list[Array]], Array]:
    return lambda frame, sent: sent[max(0, len(sent) - lag)] if sent else leaning(0.0)


def lost(first: int, last: int, lag: int = 4) -> Callable[[int, list[Array]], Array]:
    """Commands sent in the frames from first on, up to last, do not arrive."""

    def seen(frame: int, sent: list[Array]) -> Array:
        newest = len(sent) - lag
        newest = first - 1 if first <= newest < last else newest
        return sent[max(0, newest)] if sent else leaning(0.0)

    return seen


@pytest.mark.parametrize("lag", [1, 3, 6])
def test_a_robot_that_follows_gets_the_plan_as_it_is(lag: int) -> None:
    pacing, sent = play(100, following(lag))
    assert pacing.behind == 0.0
    np.testing.assert_array_equal(sent, [leaning(frame * PERIOD) for frame in range(100)])


def test_servos_that_sag_are_no_reason_to_wait() -> None:
    follow = following(3)
    pacing, _ = play(100, lambda frame, sent: follow(frame, sent) - 0.05)
    assert pacing.behind == 0.0


def test_after_lost_commands_the_servos_take_up_the_plan_where_they_stand() -> None:
    first, last = 40, 62
    _, sent = play(70, lost(first, last))
    jump = (sent[last] - sent[first - 1])[ROLLS[0]]
    assert abs(jump) < 0.4 * SPEED * (last - first) * PERIOD


def test_it_catches_up() -> None:
    pacing, sent = play(900, lost(40, 62))
    assert pacing.behind == 0.0
    np.testing.assert_array_equal(sent[-1], leaning(899 * PERIOD))
    speed = np.diff(sent[:, ROLLS[0]]) / PERIOD
    assert speed[64:].max() == pytest.approx((1.0 + DEFAULT.ahead) * SPEED, rel=1e-6)


@pytest.mark.parametrize("last", [56, 62])
def test_it_goes_on_gently(last: int) -> None:
    """From rest, as the robot's legs are then, to its own speed: after a long wait, too."""
    _, sent = play(200, lost(40, last))
    speed = np.diff(sent[:, ROLLS[0]]) / PERIOD
    begin = np.flatnonzero(speed <= 0.0)[-1]
    assert begin > 50
    assert np.diff(speed[begin:]).max() <= SPEED * PERIOD / DEFAULT.ramp + 1e-9
    assert speed[begin + round(1.2 * DEFAULT.ramp / PERIOD)] >= SPEED


def test_a_blocked_robot_is_not_waited_for_for_ever() -> None:
    pacing, sent = play(300, lambda frame, sent: leaning(0.0))
    assert pacing.behind <= DEFAULT.most
    assert sent[-1][ROLLS[0]] >= leaning(299 * PERIOD - DEFAULT.most)[ROLLS[0]] - 1e-9


@pytest.mark.parametrize("wrong", ["nan", "stale"])
def test_a_state_that_is_not_known_holds_nothing_up(wrong: str) -> None:
    def inner(target: Target, state: RobotState) -> Array:
        return target.q

    pacing = Pacing(NAO, inner, PERIOD)
    for frame in range(100):
        target = Target(leaning(frame * PERIOD), np.zeros(3), UPRIGHT, "D")
        q = np.full(len(target.q), np.nan) if wrong == "nan" else leaning(0.0)
        pacing(target, state(1.0 if wrong == "stale" else frame * PERIOD, q))
    assert pacing.behind == 0.0


@given(st.lists(st.tuples(st.floats(-0.5, 0.5), st.integers(1, 30)), min_size=1, max_size=12))
@settings(max_examples=50, deadline=None)
def test_whatever_it_sees_it_sends_postures_of_the_plan(seen: list[tuple[float, int]]) -> None:
    joints = np.concatenate([np.full(count, lean) for lean, count in seen])
    _, sent = play(len(joints), lambda frame, _: leaning(float(joints[frame])))
    planned = SPEED * PERIOD * np.arange(len(joints))
    at = (sent - leaning(0.0))[:, ROLLS[0]]
    assert (at <= planned + 1e-9).all()
    assert (at >= np.maximum(planned - SPEED * DEFAULT.most, 0.0) - 1e-9).all()
    assert np.abs(np.diff(at)).max(initial=0.0) <= (1.0 + DEFAULT.ahead) * SPEED * PERIOD + 1e-9
