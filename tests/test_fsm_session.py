"""The session machine: every edge, and nothing but the edges."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from naoimitate.fsm.session import EDGES, Action, Edge, Event, SessionFsm, State, edge_table

DOCS = Path(__file__).parent.parent / "docs" / "live.md"


def machine(state: State, measured: bool) -> SessionFsm:
    fsm = SessionFsm(measured)
    fsm.state = state
    return fsm


@pytest.mark.parametrize("edge", EDGES, ids=lambda e: f"{e.state.value}, {e.event.value}")
def test_an_edge_leads_where_the_table_says(edge: Edge) -> None:
    for measured in (False, True) if edge.measured is None else (edge.measured,):
        fsm = machine(edge.state, measured)
        assert fsm.take(edge.event) is edge.action
        assert fsm.state is edge.next
        assert fsm.measured == (measured or edge.action is Action.CALIBRATE)


@pytest.mark.parametrize("measured", [False, True])
def test_an_event_without_an_edge_changes_nothing(measured: bool) -> None:
    known = {(e.state, e.event) for e in EDGES if e.measured in (None, measured)}
    for state in State:
        for event in Event:
            if (state, event) not in known:
                fsm = machine(state, measured)
                assert fsm.take(event) is None
                assert fsm.state is state


def test_no_two_edges_start_alike() -> None:
    starts = [
        (e.state, e.event, m) for e in EDGES for m in ((False, True) if e.measured is None else (e.measured,))
    ]  # fmt: skip
    assert len(starts) == len(set(starts))


@given(st.lists(st.sampled_from(list(Event)), max_size=40))
def test_nobody_is_followed_who_was_not_measured_and_every_state_can_be_stopped(events: list[Event]) -> None:
    fsm, faulty = SessionFsm(), False
    for event in events:
        before = fsm.state
        fsm.take(event)
        if fsm.state in (State.BLENDING, State.TRACKING):
            assert fsm.measured
        if before is State.STOPPED:
            assert fsm.state is State.STOPPED
        faulty = fsm.state is State.FAULT
    if faulty:
        for event in set(Event) - {Event.RESET, Event.STOP}:
            fsm.take(event)
            assert fsm.state is State.FAULT
    for _ in range(2):
        fsm.take(Event.STOP)
    assert fsm.state is State.STOPPED


def test_the_documentation_shows_the_table() -> None:
    assert edge_table() in DOCS.read_text()
