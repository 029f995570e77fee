"""The time law: auto waits only where the robot needs it, and never while the person stands on one foot."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from people import person

from naoimitate.balance.offset import OffsetLaw, Push, advance
from naoimitate.core.frames import Motion
from naoimitate.fsm import Mode, SupportFsm, SupportInput, offset_target
from naoimitate.run.pace import AutoPace, ConstantPace, PaceSettings, phases

LAW, DT = OffsetLaw(shift="parabola"), 0.02
STEPS = st.lists(st.tuples(st.sampled_from("DLRF"), st.floats(0.05, 1.5)), min_size=1, max_size=8)


def motion(steps: list[tuple[str, float]], rate: float = 50.0) -> Motion:
    """A person of whom only the support matters: modes with their durations, s."""
    frame = person()
    modes = [m for mode, seconds in steps for m in [mode] * max(1, round(seconds * rate))]
    time = np.arange(len(modes)) / rate
    return Motion("steps", time, np.tile(frame.landmarks, (len(time), 1, 1)), support=np.array(modes))


@dataclass
class Robot:
    """The support machine with the offset's law and a foot that comes down within a second."""

    fsm: SupportFsm = field(default_factory=SupportFsm)
    offset: float = 0.5
    speed: float = 0.0
    height: float = 0.0

    def step(self, human: str, ahead: str, dt: float = DT) -> None:
        given = SupportInput(human, self.offset, self.fsm.mode.landing and self.height == 0.0, ahead=ahead)
        mode = self.fsm.step(given)
        target = offset_target(mode, given, 0.5)
        push = Push(LAW.parabola(self.offset), 3.0, 3.0, 3.0)
        self.offset, self.speed = advance(self.offset, self.speed, target, dt, push)
        rising = mode in (Mode.LEFT, Mode.RIGHT)
        self.height = min(self.height + 2.0 * dt, 0.3) if rising else max(self.height - dt, 0.0)


@dataclass
class Play:
    """A clip played to a robot: what happened at every step."""

    times: np.ndarray
    human: list[str]
    given: list[str]
    ahead: list[str]
    modes: list[Mode]


def play(clip: Motion, lag: float = 0.0, dt: float = DT, pace: PaceSettings | None = None) -> Play:
    law, robot = AutoPace(clip, float(clip.time[0]), LAW, pace), Robot()
    result = Play(np.array([clip.time[0]]), [str(clip.support[0])], [], [], [robot.fsm.mode])
    times = [float(clip.time[0])]
    while law.time < clip.duration - 1e-9:
        moment = law.next(dt, robot.fsm.mode, robot.offset, lag)
        robot.step(moment.support, moment.ahead, dt)
        times.append(moment.time)
        result.human.append(clip.at(moment.time).support)
        result.given.append(moment.support)
        result.ahead.append(moment.ahead)
        result.modes.append(robot.fsm.mode)
        assert len(times) < 20000, "the clip never ends"
    return replace(result, times=np.array(times))


def test_phases_are_end_to_end() -> None:
    found = phases(motion([("D", 1.0), ("L", 0.5), ("D", 0.3), ("R", 0.4)]))
    assert [p.support for p in found] == list("DLDR")
    assert [p.start for p in found] == pytest.approx([0.0, 1.0, 1.5, 1.8])
    assert [p.end for p in found[:-1]] == [p.start for p in found[1:]] and found[-1].end == np.inf


@given(STEPS, st.sampled_from([0.005, 0.02, 0.05]))
@settings(max_examples=30, deadline=None)
def test_auto_covers_the_clip_and_never_goes_back_or_too_fast(steps: list[tuple[str, float]], dt: float) -> None:
    clip = motion(steps)
    times = play(clip, dt=dt).times
    assert times[0] == clip.time[0] and times[-1] >= clip.duration - 1e-9
    assert np.all(np.diff(times) >= 0.0)
    assert np.all(np.diff(times) <= dt + 1e-12)


@given(STEPS, st.sampled_from([0.0, 0.02, 1.0]))
@settings(max_examples=30, deadline=None)
def test_auto_never_pauses_while_the_person_stands_on_one_foot(steps: list[tuple[str, float]], lag: float) -> None:
    """But for the very start of a clip, from where the person is sped up, and its last frame."""
    clip = motion([("D", 0.2), *steps])
    result = play(clip, lag)
    pace = np.diff(result.times) / DT
    single = np.array([a in "LR" and a == b for a, b in zip(result.human, result.human[1:], strict=False)])
    ends = {p.end for p in phases(clip)}
    for k in np.flatnonzero(single):
        if all(abs(result.times[k] - end) > 0.03 for end in ends) and result.times[k] < clip.duration - 0.05:
            assert pace[k] > 0.3 * PaceSettings().slowest, f"paused at {result.times[k]:.3f} s"


@given(st.lists(st.tuples(st.sampled_from("LR"), st.floats(0.1, 1.5), st.floats(0.1, 2.0)), min_size=1, max_size=5))
@settings(max_examples=30, deadline=None)
def test_the_robot_lifts_with_the_person_however_short_the_double_support(
    stands: list[tuple[str, float, float]],
) -> None:
    """Waiting is done before: from the first to the last moment of a stand both are on the same foot."""
    clip = motion([("D", 0.5)] + [step for mode, on, between in stands for step in ((mode, on), ("D", between))])
    result = play(clip)
    for phase in phases(clip):
        if phase.support in "LR":
            inside = [
                mode.stance == phase.support
                for time, mode in zip(result.times, result.modes, strict=True)
                if phase.start + 1e-6 < time < phase.end - 1e-6
            ]
            assert inside and np.mean(inside) >= 0.9


def test_auto_waits_in_double_support_and_nowhere_else() -> None:
    clip = motion([("D", 1.0), ("L", 2.0), ("D", 0.1), ("R", 2.0), ("D", 1.0)])
    result = play(clip)
    slow = np.diff(result.times) < 0.5 * DT
    at = [result.human[k] for k in np.flatnonzero(slow)]
    assert at.count("D") > 0.8 * len(at)
    assert len(result.times) * DT > clip.duration + 1.0, "the shift from foot to foot needs 2 s"


def test_auto_is_as_fast_as_the_person_where_the_robot_can_follow() -> None:
    clip = motion([("D", 20.0)])
    assert len(play(clip).times) * DT < 20.0 + 0.5


def test_auto_looks_ahead_in_time_for_the_shift() -> None:
    """2 s of double support are enough to be over the foot when the person lifts: hardly any waiting."""
    clip = motion([("D", 3.0), ("L", 2.0), ("D", 3.0), ("R", 2.0), ("D", 1.0)])
    result = play(clip)
    assert len(result.times) * DT < clip.duration + 1.5
    first = result.ahead.index("L")
    assert 0.5 < result.times[first] < 2.5


def test_auto_slows_down_for_hands_that_cannot_follow() -> None:
    clip = motion([("D", 4.0)])
    free, late = len(play(clip).times), len(play(clip, lag=0.02).times)
    assert late > 1.5 * free


@given(STEPS)
@settings(max_examples=30, deadline=None)
def test_a_robot_that_never_moves_is_not_waited_for_for_ever(steps: list[tuple[str, float]]) -> None:
    clip = motion([("D", 0.3), *steps])
    pace = PaceSettings(patience=1.0)
    law, time = AutoPace(clip, 0.0, LAW, pace), 0.0
    while law.time < clip.duration - 1e-9:
        law.next(DT, Mode.DOUBLE, 0.5, 0.0)
        time += DT
        assert time < clip.duration + (len(steps) + 2) * 4.0, "stuck"


def test_a_clip_that_begins_on_one_foot_is_played_at_once() -> None:
    result = play(motion([("L", 1.0), ("D", 1.0)]))
    assert result.times[-1] >= 1.98 - 1e-9


def test_a_constant_pace_is_the_factor_times_the_clock() -> None:
    clip = motion([("D", 1.0), ("L", 1.0)])
    law = ConstantPace(clip, 0.0, 0.5)
    moments = [law.next(DT, Mode.DOUBLE, 0.5, 9.0) for _ in range(100)]
    assert [m.time for m in moments] == pytest.approx([0.5 * DT * (k + 1) for k in range(100)])
    assert {m.ahead for m in moments} == {""}
    assert moments[97].support == "D"
    assert law.next(DT, Mode.DOUBLE, 0.5, 0.0).support == "L"
