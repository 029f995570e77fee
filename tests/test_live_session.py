"""A live session without sockets: what the robot does about an operator who comes, stops, and comes back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from naoimitate.command_gate import CommandGate
from naoimitate.core.frames import LANDMARK, HumanFrame, RobotCommand
from naoimitate.fsm.session import Event, State
from naoimitate.live.performance import moved
from naoimitate.live.session import Session, SessionSettings, Tick
from naoimitate.motion.builtin import builtin_motion, relaxed, tpose
from naoimitate.robot.model import RobotModel

DT = 0.01
MARCH = builtin_motion("march")


@dataclass
class Story:
    """The ticks of a session, and their times."""

    times: list[float]
    ticks: list[Tick]

    def states(self) -> list[str]:
        """The states in the order in which they came."""
        names = [tick.state.value for tick in self.ticks]
        return [name for k, name in enumerate(names) if k == 0 or names[k - 1] != name]

    def at(self, time: float) -> Tick:
        return self.ticks[int(np.searchsorted(self.times, time))]

    def commands(self) -> list[RobotCommand]:
        return [tick.command for tick in self.ticks]


def operator(time: float) -> HumanFrame | None:
    """T-pose for three seconds, a second on the way out of it, then a march."""
    share = float(np.clip(time - 3.0, 0.0, 1.0))
    share = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    march, start = MARCH.at(max(time - 4.0, 0.0) % MARCH.duration), tpose()
    landmarks = (1.0 - share) * start.landmarks + share * march.landmarks
    return HumanFrame(time, landmarks, start.orientations if share < 0.5 else march.orientations)


def play(
    robot: RobotModel,
    duration: float,
    person: Callable[[float], HumanFrame | None] = operator,
    live: SessionSettings | None = None,
    act: Callable[[Session, float], None] = lambda session, time: None,
) -> Story:
    session, story = Session(robot, live=live), Story([], [])
    session.start()
    for k in range(round(duration / DT)):
        time = k * DT
        frame = person(time)
        if frame is not None:
            session.see(frame, time)
        act(session, time)
        story.times.append(time)
        story.ticks.append(session.step(time))
    return story


def assert_smooth(robot: RobotModel, story: Story) -> None:
    q = np.array([c.q for c in story.commands()])
    step = np.diff(np.concatenate([robot.postures["stand"][None], q]), axis=0)
    assert (np.abs(step) <= 0.9 * robot.speed * DT + 1e-9).all()
    assert np.abs(np.diff(step, axis=0)).max() < 0.05, "rad in a frame that were not in the one before"


def test_a_t_pose_starts_the_imitation(robot: RobotModel) -> None:
    story = play(robot, 12.0)
    assert story.states() == ["calibrating", "blending", "tracking"]
    assert sum(tick.began for tick in story.ticks) == 1
    assert {c.support for c in story.commands()} >= {"D", "L"}
    assert_smooth(robot, story)


def test_nobody_is_followed_without_a_t_pose(nao: RobotModel) -> None:
    story = play(nao, 4.0, lambda t: replace(MARCH.at(2.0 + t), time=t, support=None))
    assert story.states() == ["calibrating"]


def test_a_silent_stream_holds_then_returns_and_a_stream_that_comes_back_blends_in(nao: RobotModel) -> None:
    live = SessionSettings(back=2.0)
    story = play(nao, 19.0, lambda t: None if 7.0 < t < 7.1 or 9.0 < t < 9.8 or 11.8 < t < 16.3 else operator(t), live)
    assert story.states() == [
        "calibrating", "blending", "tracking", "holding", "blending", "tracking", "holding", "returning", "waiting",
        "blending", "tracking",
    ]  # fmt: skip
    assert story.at(7.09).state is State.TRACKING, "a short gap is bridged"
    assert story.at(9.24).state is State.TRACKING and story.at(9.27).state is State.HOLDING
    assert story.at(13.7).state is State.HOLDING and story.at(13.85).state is State.RETURNING
    assert_smooth(nao, story)


def test_a_paused_operator_may_do_anything_and_is_blended_in_again(nao: RobotModel) -> None:
    def act(session: Session, time: float) -> None:
        if time in (6.0, 9.0):
            session.tell(Event.CLUTCH)

    story = play(nao, 12.0, act=act)
    assert story.states() == ["calibrating", "blending", "tracking", "clutched", "blending", "tracking"]
    paused = [t.command for t, at in zip(story.ticks, story.times, strict=True) if 8.0 < at < 8.9]
    assert np.ptp([c.q for c in paused], axis=0).max() < 0.01
    assert_smooth(nao, story)


def test_a_pause_lasts_until_the_operator_ends_it(nao: RobotModel) -> None:
    def person(time: float) -> HumanFrame | None:
        return None if 7.0 < time < 19.0 else operator(time)

    def act(session: Session, time: float) -> None:
        if time in (6.0, 21.0):
            session.tell(Event.CLUTCH)

    story = play(nao, 24.0, person, act=act)
    assert story.states() == ["calibrating", "blending", "tracking", "clutched", "blending", "tracking"]
    assert story.at(20.9).command.support == "D"
    assert np.abs(story.at(20.9).command.q - story.at(6.5).command.q).max() > 0.1, "nobody there: it stands"
    assert_smooth(nao, story)


def test_the_end_is_a_stand_on_both_feet_from_wherever_the_robot_is(nao: RobotModel) -> None:
    lifted = [k for k, t in enumerate(play(nao, 12.0).ticks) if t.command.support != "D"]
    story = play(nao, 18.0, act=lambda s, t: s.tell(Event.STOP) if t == round(lifted[20] * DT, 2) else None)
    assert story.states() == ["calibrating", "blending", "tracking", "stopping", "stopped"]
    assert story.commands()[-1].support == "D"
    assert_smooth(nao, story)


def test_a_lost_operator_leaves_no_jerk(nao: RobotModel) -> None:
    story = play(nao, 8.0, lambda t: None if t > 6.3 else operator(t))
    assert story.states()[-1] == "holding"
    at = round(6.55 / DT)
    q = np.array([c.q for c in story.commands()])[at - 20 : at + 20]
    assert np.abs(np.diff(q, 2, axis=0)).max() < 0.015


def test_a_paused_operator_may_walk_off_and_turn_and_the_robot_goes_on_from_where_it_is(nao: RobotModel) -> None:
    def person(time: float) -> HumanFrame | None:
        frame = operator(time)
        assert frame is not None
        share = float(np.clip((time - 6.5) / 2.0, 0.0, 1.0))
        return moved(frame, 2.0 * share, np.array([share, -2.0 * share, 0.0]))

    def act(session: Session, time: float) -> None:
        if time in (6.0, 9.0):
            session.tell(Event.CLUTCH)

    plain, turned = play(nao, 14.0, act=act), play(nao, 14.0, person, act=act)
    assert turned.states() == plain.states()
    last = [story.commands()[-1] for story in (plain, turned)]
    assert np.abs(last[0].q - last[1].q).max() < 0.02
    assert_smooth(nao, turned)


def test_the_legs_may_be_left_out_and_taken_in_again(nao: RobotModel) -> None:
    def act(session: Session, time: float) -> None:
        if time in (6.0, 13.0):
            session.tell(Event.BODY)

    story = play(nao, 20.0, act=act)
    assert story.states() == ["calibrating", "blending", "tracking", "blending", "tracking", "blending", "tracking"]
    supports = [{t.command.support for t, at in zip(story.ticks, story.times, strict=True) if a < at < b}
                for a, b in ((9.5, 13.0), (14.5, 20.0))]  # fmt: skip
    assert supports[0] == {"D"} and len(supports[1]) > 1
    assert_smooth(nao, story)


def test_a_t_pose_of_a_paused_operator_begins_another_run(nao: RobotModel) -> None:
    def person(time: float) -> HumanFrame | None:
        return replace(tpose(), time=time, support=None) if time > 7.0 else operator(time)

    story = play(nao, 12.0, person, act=lambda s, t: s.tell(Event.CLUTCH) if t == 6.5 else None)
    assert sum(tick.began for tick in story.ticks) == 2
    assert story.states()[-3:] == ["clutched", "blending", "tracking"]


def test_a_fault_ends_the_session_until_the_robot_stands_again(nao: RobotModel) -> None:
    def act(session: Session, time: float) -> None:
        if time == 6.0:
            session.tell(Event.FAULT, "it fell")
        if time == 8.0:
            session.tell(Event.RESET)
        if time == 9.0:
            session.tell(Event.CLUTCH)

    story = play(nao, 10.0, act=act)
    assert story.states() == ["calibrating", "blending", "tracking", "fault", "clutched", "blending"]
    assert story.at(7.0).state is State.FAULT
    frozen = [t.command for t, at in zip(story.ticks, story.times, strict=True) if 6.0 <= at < 7.9]
    assert np.ptp([c.q for c in frozen], axis=0).max() == 0.0


def test_after_a_reset_nothing_moves_until_the_operator_asks_measured_or_not(nao: RobotModel) -> None:
    def act(session: Session, time: float) -> None:
        if time == 1.0:
            session.tell(Event.FAULT, "it fell")
        if time == 2.0:
            session.tell(Event.RESET)
        if time == 4.0:
            session.tell(Event.CLUTCH)

    story = play(nao, 6.0, lambda time: replace(relaxed(), time=time, support=None), act=act)
    assert story.states() == ["calibrating", "fault", "clutched", "calibrating"]
    idle = [t.command.q for t, at in zip(story.ticks, story.times, strict=True) if 2.0 < at < 4.0]
    np.testing.assert_array_equal(idle, np.tile(nao.postures["stand"], (len(idle), 1)))
    on = np.array([t.command.q for t, at in zip(story.ticks, story.times, strict=True) if at > 3.9])
    assert (np.abs(np.diff(on, axis=0)) <= 0.9 * nao.speed * DT + 1e-9).all(), "and then it goes on without a jump"


def test_frames_of_nothing_and_of_nonsense_are_survived(nao: RobotModel) -> None:
    rng = np.random.default_rng(0)

    def person(time: float) -> HumanFrame | None:
        frame = operator(time)
        assert frame is not None
        landmarks = frame.landmarks.copy()
        if 6.0 < time < 6.4:
            landmarks[:] = np.nan
        if 7.0 < time < 7.4:
            landmarks += rng.normal(0.0, 5.0, landmarks.shape)
        if 8.0 < time < 8.4:
            landmarks[rng.integers(0, len(landmarks))] = [1e300, -1e300, np.inf]
        return replace(frame, landmarks=landmarks)

    story = play(nao, 10.0, person)
    q = np.array([c.q for c in story.commands()])
    assert np.isfinite(q).all()
    speed = np.diff(q, axis=0) / (0.9 * nao.speed * DT)
    assert np.abs(speed).max() <= 1.0 and np.abs(np.diff(speed, axis=0)).max() <= 1.0, "what the gate allows"


@pytest.mark.parametrize("rate", [20.0, 240.0])
def test_the_stream_may_be_slow_or_fast(nao: RobotModel, rate: float) -> None:
    last = [-1.0]

    def person(time: float) -> HumanFrame | None:
        if time - last[0] < 1.0 / rate - 1e-9:
            return None
        last[0] = time
        return operator(time)

    story = play(nao, 9.0, person)
    assert story.states() == ["calibrating", "blending", "tracking"]
    assert_smooth(nao, story)


def test_the_mirrored_operator_lifts_the_other_foot(nao: RobotModel) -> None:
    plain, mirrored = play(nao, 9.0), play(nao, 9.0, live=SessionSettings(mirror=True))
    feet = [next(c.support for c in story.commands() if c.support != "D") for story in (plain, mirrored)]
    assert set(feet) == {"L", "R"}


def test_the_fourteen_landmarks_that_imitation_needs_are_enough(nao: RobotModel) -> None:
    def person(time: float) -> HumanFrame | None:
        frame = operator(time)
        assert frame is not None
        landmarks = frame.landmarks.copy()
        for name in ("pelvis", "chest", "head", "l_hand", "r_hand"):
            landmarks[LANDMARK[name]] = np.nan
        return replace(frame, landmarks=landmarks, orientations=None)

    story = play(nao, 9.0, person)
    assert story.states() == ["calibrating", "blending", "tracking"]
    assert {c.support for c in story.commands()} >= {"D", "L"}
    assert_smooth(nao, story)


@pytest.mark.parametrize("seed", [3, 8])
def test_nothing_that_an_operator_and_a_busy_computer_do_is_refused_by_the_gate(nao: RobotModel, seed: int) -> None:
    rng, gate = np.random.default_rng(seed), CommandGate(nao)
    session = Session(nao, live=SessionSettings(hold=0.4, back=1.0, blend_in=0.8, blend_back=0.3))
    session.start()
    state, now, until, posture = gate.begin(nao.postures["stand"]), 10.0, 0.0, "silence"
    for _ in range(3000):
        stall = rng.random() > 0.97
        dt = rng.uniform(0.02, 0.3) if stall else rng.uniform(0.002, 0.012)
        now += dt
        if now > until:
            until = now + rng.choice([0.1, 0.3, 0.6, 2.0, 3.0])
            posture = rng.choice(["T-pose", "T-pose", "stand", "march", "silence"])
        if rng.random() < 0.004:
            session.tell(rng.choice([Event.CLUTCH, Event.BODY]))
        if posture != "silence":
            frame = {"T-pose": tpose(), "stand": relaxed(), "march": MARCH.at(now % MARCH.duration)}[posture]
            session.see(replace(frame, time=now, support=None), now)
        verdict = gate.check(state, session.step(now).command, dt)
        assert verdict.accepted is not None, verdict.refusals
        state = verdict.state
