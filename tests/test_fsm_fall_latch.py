"""The fall latch: quick where a robot falls, patient with single readings, and never released by what it senses."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from naoimitate.fsm.fall_latch import EDGES, Action, Fall, FallLatch, FallLimits, Senses, take

LIMITS = FallLimits()
DT = 0.02
FAR = LIMITS.lean + 0.01
TRIPPED = (Fall.FALLING, Fall.FALLEN)

readings = st.tuples(
    st.sampled_from([0.0, 0.1, LIMITS.quick_lean + 0.01, FAR, math.nan]),
    st.sampled_from([0.0, LIMITS.quick_rate + 0.1, math.nan]),
    st.booleans(),
    st.floats(1e-3, 0.3),
)


def sense(latch: FallLatch, lean: float = 0.0, rate: float = 0.0, fell: bool = False, times: int = 1) -> list[Action]:
    return [latch.sense(lean, rate, fell, DT) for _ in range(times)]


def test_a_robot_that_stands_or_bows_slowly_is_upright() -> None:
    latch = FallLatch()
    assert set(sense(latch, 0.0, 0.0, times=50) + sense(latch, LIMITS.lean, 1.0, times=50)) == {Action.NONE}
    assert latch.state is Fall.UPRIGHT


def test_a_single_wrong_reading_is_no_fall() -> None:
    latch = FallLatch()
    for _ in range(100):
        assert set(sense(latch, FAR, 9.0, times=2) + sense(latch)) == {Action.NONE}
    assert latch.state not in TRIPPED


def test_a_lean_that_lasts_softens_at_once_and_stops_after_the_fall() -> None:
    latch = FallLatch()
    actions = sense(latch, FAR, times=80)
    first = actions.index(Action.SOFTEN)
    assert first * DT == pytest.approx(LIMITS.patience, abs=DT)
    assert actions.index(Action.STOP) * DT == pytest.approx(first * DT + LIMITS.fall_time, abs=2 * DT)
    assert [a for a in actions if a is not Action.NONE] == [Action.SOFTEN, Action.STOP]


def test_a_robot_that_turns_fast_falls_at_a_smaller_lean() -> None:
    slow, fast = FallLatch(), FallLatch()
    sense(slow, LIMITS.quick_lean + 0.01, LIMITS.quick_rate - 0.1, times=50)
    sense(fast, LIMITS.quick_lean + 0.01, LIMITS.quick_rate + 0.1, times=10)
    assert slow.state not in TRIPPED
    assert fast.state in TRIPPED


def test_a_robot_that_says_that_it_fell_is_believed_at_once() -> None:
    latch = FallLatch()
    assert sense(latch, fell=True, times=2) == [Action.SOFTEN, Action.STOP]
    assert latch.state is Fall.FALLEN


def test_what_nobody_measures_is_no_fall() -> None:
    latch = FallLatch()
    assert set(sense(latch, math.nan, math.nan, times=100)) == {Action.NONE}


@given(st.lists(readings, max_size=60), st.lists(readings, max_size=60))
def test_a_tripped_latch_stays_whatever_it_senses(
    before: list[tuple[float, float, bool, float]], after: list[tuple[float, float, bool, float]]
) -> None:
    latch = FallLatch()
    for reading in before:
        latch.sense(*reading)
    if latch.state not in TRIPPED:
        return
    for reading in after:
        latch.sense(*reading)
        assert latch.state in TRIPPED
    for _ in range(2):
        latch.sense(0.0, 0.0, False, LIMITS.fall_time)
    assert latch.state is Fall.FALLEN, "a fall ends"


@given(st.lists(readings, max_size=100))
def test_every_fall_softens_once_and_before_it_stops(seen: list[tuple[float, float, bool, float]]) -> None:
    latch = FallLatch()
    actions = [a for a in (latch.sense(*reading) for reading in seen) if a is not Action.NONE]
    assert actions in ([], [Action.SOFTEN], [Action.SOFTEN, Action.STOP])


EXAMPLES = {
    (Fall.UPRIGHT, "fell"): Senses(fell=True),
    (Fall.UPRIGHT, "leans"): Senses(lean=FAR),
    (Fall.LEANING, "fell"): Senses(fell=True),
    (Fall.LEANING, "leans_long"): Senses(lean=FAR, lasted=LIMITS.patience),
    (Fall.LEANING, "upright"): Senses(),
    (Fall.FALLING, "fell"): Senses(fell=True),
    (Fall.FALLING, "time_is_up"): Senses(lasted=LIMITS.fall_time),
}


@pytest.mark.parametrize("edge", EDGES, ids=lambda e: f"{e.state.value}-{e.guard.__name__}")
def test_every_edge_of_the_table_can_be_taken(edge: object) -> None:
    senses = EXAMPLES[edge.state, edge.guard.__name__]  # type: ignore[attr-defined]
    assert take(edge.state, senses, LIMITS) == (edge.next, edge.action)  # type: ignore[attr-defined]


def test_no_edge_leads_back_from_a_fall() -> None:
    assert all(edge.next in TRIPPED for edge in EDGES if edge.state in TRIPPED)
