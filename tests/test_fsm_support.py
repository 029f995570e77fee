"""The support machine: every edge, and walks with random people on a small simulated robot."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate.balance.offset import OffsetLaw, Push, advance
from naoimitate.fsm import Mode, SupportFsm, SupportInput, next_mode, offset_target, wanted_stance
from naoimitate.fsm.support import OFFSET_REACHED

PARABOLA = OffsetLaw(shift="parabola")
D, L, R = Mode.DOUBLE, Mode.LEFT, Mode.RIGHT
ON_LEFT, ON_RIGHT = Mode.LANDING_ON_LEFT, Mode.LANDING_ON_RIGHT
LEFT_BAD, RIGHT_BAD = (False, True), (True, False)

EDGES = {
    "stays double with the person": (D, SupportInput("D", 0.5), D),
    "waits for the offset to reach the left foot": (D, SupportInput("L", 0.011), D),
    "lifts the right foot when the offset is over the left": (D, SupportInput("L", 0.01), L),
    "waits for the offset to reach the right foot": (D, SupportInput("R", 0.989), D),
    "lifts the left foot when the offset is over the right": (D, SupportInput("R", 0.99), R),
    "does not lift the foot under the weight": (D, SupportInput("L", 1.0), D),
    "does not lift when lifting is forbidden": (D, SupportInput("L", 0.0, may_lift=False), D),
    "does not lift on what lies ahead": (D, SupportInput("D", 0.0, ahead="L"), D),
    "a flight lifts nothing": (D, SupportInput("F", 0.0), D),
    "leaves a bad left stance by the left foot (re-lift)": (D, SupportInput("L", 1.0, stance_ok=LEFT_BAD), R),
    "leaves a bad right stance by the right foot (re-lift)": (D, SupportInput("R", 0.0, stance_ok=RIGHT_BAD), L),
    "does not stand on a bad left foot": (D, SupportInput("L", 0.0, stance_ok=LEFT_BAD), D),
    "does not stand on a bad right foot": (D, SupportInput("R", 1.0, stance_ok=RIGHT_BAD), D),
    "a bad stance is no matter while the person has both feet down": (D, SupportInput("D", 0.0, stance_ok=LEFT_BAD), D),
    "leaves a bad stance before the foot is needed (re-lift)": (
        D,
        SupportInput("D", 1.0, stance_ok=LEFT_BAD, ahead="L"),
        R,
    ),
    "leaves a bad right stance before it is needed": (D, SupportInput("D", 0.0, stance_ok=RIGHT_BAD, ahead="R"), L),
    "stays on the left foot with the person": (L, SupportInput("L", 0.0), L),
    "stays on the right foot with the person": (R, SupportInput("R", 1.0), R),
    "stays on one foot when lifting is forbidden": (L, SupportInput("L", 0.0, may_lift=False), L),
    "lands the right foot": (L, SupportInput("D", 0.0), ON_LEFT),
    "lands the left foot": (R, SupportInput("D", 1.0), ON_RIGHT),
    "lands the right foot when the person has changed feet": (L, SupportInput("R", 0.0), ON_LEFT),
    "lands the left foot when the person has changed feet": (R, SupportInput("L", 1.0), ON_RIGHT),
    "keeps the left foot down in a flight": (L, SupportInput("F", 0.0), L),
    "keeps the right foot down in a flight": (R, SupportInput("F", 1.0), R),
    "goes on landing on the left": (ON_LEFT, SupportInput("D", 0.0), ON_LEFT),
    "goes on landing on the right": (ON_RIGHT, SupportInput("D", 1.0), ON_RIGHT),
    "goes on landing for the other foot": (ON_LEFT, SupportInput("R", 0.0), ON_LEFT),
    "goes on landing in a flight": (ON_RIGHT, SupportInput("F", 1.0), ON_RIGHT),
    "has landed on the left": (ON_LEFT, SupportInput("D", 0.0, landed=True), D),
    "has landed on the right": (ON_RIGHT, SupportInput("D", 1.0, landed=True), D),
    "passes double support on the way to the other foot": (ON_LEFT, SupportInput("R", 0.0, landed=True), D),
    "has landed although the person lifts again": (ON_LEFT, SupportInput("L", 0.0, landed=True), D),
    "does not turn back on the last way down to the left": (ON_LEFT, SupportInput("L", 0.0, descending=True), ON_LEFT),
    "does not turn back on the last way down to the right": (
        ON_RIGHT,
        SupportInput("R", 1.0, descending=True),
        ON_RIGHT,
    ),
    "breaks a landing on the left off": (ON_LEFT, SupportInput("L", 0.0), L),
    "breaks a landing on the right off": (ON_RIGHT, SupportInput("R", 1.0), R),
}


@pytest.mark.parametrize("name", EDGES)
def test_edge(name: str) -> None:
    mode, seen, expected = EDGES[name]
    assert next_mode(mode, seen) is expected
    assert SupportFsm(mode).step(seen) is expected


def test_every_edge_of_the_paper_and_of_ours_is_among_the_edges() -> None:
    changes = {(mode, expected) for mode, _, expected in EDGES.values() if mode is not expected}
    assert changes == {
        (D, L),
        (D, R),
        (L, ON_LEFT),
        (R, ON_RIGHT),
        (ON_LEFT, D),
        (ON_RIGHT, D),
        (ON_LEFT, L),
        (ON_RIGHT, R),
    }


INPUTS = st.builds(
    SupportInput,
    human=st.sampled_from("DLRF"),
    offset=st.one_of(st.sampled_from([0.0, 0.01, 0.5, 0.99, 1.0]), st.floats(0.0, 1.0)),
    landed=st.booleans(),
    descending=st.booleans(),
    stance_ok=st.tuples(st.booleans(), st.booleans()),
    ahead=st.sampled_from(["", "L", "R"]),
    may_lift=st.booleans(),
)


@given(st.sampled_from(list(Mode)), INPUTS)
@settings(max_examples=500, deadline=None)
def test_every_transition_is_safe_whatever_comes_in(mode: Mode, seen: SupportInput) -> None:
    after = next_mode(mode, seen)
    if mode is D:
        assert not after.landing
        if after is not D:
            assert seen.may_lift and (seen.human in "LR" or seen.ahead)
            assert abs(seen.offset - (0.0 if after is L else 1.0)) <= OFFSET_REACHED + 1e-12
            needed = seen.human if seen.human in "LR" else seen.ahead
            assert seen.stance_ok["LR".index(needed)] == (after.stance == needed)
    else:
        assert after.stance == mode.stance or (after is D and mode.landing and seen.landed)
    if seen.human == "F" and not seen.ahead and not mode.landing:
        assert after is mode


@given(st.sampled_from(list(Mode)), INPUTS, st.floats(-3.0, 4.0))
@settings(max_examples=300, deadline=None)
def test_offset_stays_over_the_stance_foot_until_the_swing_foot_has_landed(
    mode: Mode, seen: SupportInput, human: float
) -> None:
    target = offset_target(mode, seen, human)
    assert 0.0 <= target <= 1.0
    if mode is not D:
        assert target == (0.0 if mode.stance == "L" else 1.0)


def test_offset_follows_the_person_clamped_while_both_feet_are_down() -> None:
    assert offset_target(D, SupportInput("D", 0.5), 0.3) == 0.3
    assert offset_target(D, SupportInput("D", 0.5), -0.4) == 0.0
    assert offset_target(D, SupportInput("D", 0.5), 1.7) == 1.0


def test_offset_is_forced_to_the_foot_on_which_the_person_stands() -> None:
    assert offset_target(D, SupportInput("L", 0.5), 0.4) == 0.0
    assert offset_target(D, SupportInput("R", 0.5), 0.4) == 1.0


def test_offset_rests_while_the_person_flies() -> None:
    assert offset_target(D, SupportInput("F", 0.37), 0.9) == 0.37


def test_offset_goes_ahead_to_the_foot_on_which_the_person_will_stand() -> None:
    assert offset_target(D, SupportInput("D", 0.5, ahead="L"), 0.6) == 0.0
    assert offset_target(D, SupportInput("D", 0.5, ahead="R"), 0.4) == 1.0
    assert offset_target(D, SupportInput("D", 0.5, ahead="R", stance_ok=RIGHT_BAD), 0.4) == 0.0


def test_what_the_person_does_now_goes_before_what_lies_ahead() -> None:
    assert offset_target(D, SupportInput("L", 0.5, ahead="R"), 0.5) == 0.0
    assert wanted_stance(D, SupportInput("L", 0.5, ahead="R")) == "L"


def test_stance_of_every_mode() -> None:
    assert [(m.stance, m.landing) for m in Mode] == [("D", False), ("L", False), ("R", False), ("L", True), ("R", True)]


DT = 0.02
SHIFT_TIME = 2.6
"""s in which the offset gets from foot to foot with the acceleration below."""
RISE_TIME, SINK_TIME = 0.4, 1.0


@dataclass
class Walker:
    """A robot reduced to what the machine sees: an offset with the real law, and a swing foot that takes its time."""

    bad_landings: list[bool]
    fsm: SupportFsm = field(default_factory=SupportFsm)
    offset: float = 0.5
    speed: float = 0.0
    height: float = 0.0
    good: bool = True

    def step(self, human: str, human_offset: float, ahead: str = "") -> Mode:
        before = self.fsm.mode
        ok = (True, True) if self.good or before is not D else (self.offset < 0.5, self.offset >= 0.5)
        low = before.landing and self.height < 0.3
        seen = SupportInput(human, self.offset, before.landing and self.height == 0.0, low, ok, ahead)
        mode = self.fsm.step(seen)
        target = offset_target(mode, seen, human_offset)
        push = Push(PARABOLA.parabola(self.offset), 3.0, 3.0, 3.0)
        self.offset, self.speed = advance(self.offset, self.speed, target, DT, push)
        if before.landing and mode is D:
            self.good = not (self.bad_landings and self.bad_landings.pop())
        if mode in (L, R):
            self.height = min(self.height + DT / RISE_TIME, 1.0)
        elif mode.landing:
            self.height = max(self.height - DT / SINK_TIME, 0.0)
        return mode


PEOPLE = st.lists(
    st.tuples(st.sampled_from("DLRF"), st.integers(1, 150), st.floats(-0.3, 1.3), st.sampled_from(["", "", "L", "R"])),
    min_size=1,
    max_size=8,
)


@given(PEOPLE, st.lists(st.booleans(), max_size=4))
@settings(max_examples=120, deadline=None)
def test_random_people_never_unbalance_the_walker(people: list[tuple[str, int, float, str]], bad: list[bool]) -> None:
    walker, before = Walker(bad), D
    for human, steps, offset, ahead in people:
        for _ in range(steps):
            mode = walker.step(human, offset, ahead if human == "D" else "")
            if mode is D:
                assert walker.height == 0.0, "double support with a foot in the air"
            else:
                foot = 0.0 if mode.stance == "L" else 1.0
                assert abs(walker.offset - foot) <= OFFSET_REACHED + 1e-9, "one foot without the CoM over it"
                assert before is D or before.stance == mode.stance, (
                    "the other foot was lifted before the first was down"
                )
            before = mode


@given(PEOPLE, st.lists(st.booleans(), max_size=3), st.sampled_from("DLR"), st.floats(0.0, 1.0))
@settings(max_examples=120, deadline=None)
def test_no_state_is_stuck(
    people: list[tuple[str, int, float, str]], bad: list[bool], human: str, offset: float
) -> None:
    walker = Walker(bad)
    for mode, steps, human_offset, ahead in people:
        for _ in range(steps):
            walker.step(mode, human_offset, ahead if mode == "D" else "")
    bound = (SINK_TIME + SHIFT_TIME) + len(bad) * (RISE_TIME + SINK_TIME + 3 * DT) + 0.2
    waited = 0.0
    while walker.fsm.mode is not {"D": D, "L": L, "R": R}[human]:
        walker.step(human, offset)
        waited += DT
        assert waited <= bound, f"stuck in {walker.fsm.mode} with the person in {human}"


def test_walker_skips_what_the_person_has_done_meanwhile() -> None:
    """D, R, D, L in quick succession, while the foot comes down: the robot goes for the latest mode only."""
    walker = Walker([])
    while walker.height < 1.0:
        walker.step("L", 0.5)
    modes = [walker.step(human, 0.5) for human in "DRDL" for _ in range(8)]
    assert set(modes) == {ON_LEFT, L}


def test_walker_is_ready_when_it_knows_what_lies_ahead() -> None:
    walker = Walker([])
    for _ in range(round(SHIFT_TIME / DT)):
        walker.step("D", 0.8, ahead="L")
    assert walker.fsm.mode is D
    assert walker.step("L", 0.8) is L


def test_a_flight_in_double_support_keeps_the_offset() -> None:
    walker = Walker([])
    for _ in range(40):
        walker.step("D", 0.2)
    before = replace(walker)
    for _ in range(100):
        walker.step("F", 0.9)
    assert walker.fsm.mode is D
    assert abs(walker.offset - before.offset) < 0.05
