"""Whole sessions over bad networks, in time that is told: loss, jitter, gaps, other senders, restarts, and rubbish."""

from __future__ import annotations

import random
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
import pytest

from naoimitate.command_gate import CommandGate, GateState
from naoimitate.core.frames import RobotCommand
from naoimitate.live.loop import SHORTEST
from naoimitate.live.performance import Performance
from naoimitate.live.protocols.registry import PROTOCOLS
from naoimitate.live.sender import Conditions, Tally, frames, through
from naoimitate.live.session import Session
from naoimitate.live.stream import Address, Stream
from naoimitate.motion.builtin import builtin_motion
from naoimitate.robot.model import RobotModel

PERIOD = 0.01
OPERATOR: Address = ("10.0.0.1", 5000)
STRANGER: Address = ("10.0.0.2", 5000)
Packet = tuple[float, Address, bytes]
BEGIN = ["calibrating", "blending", "tracking"]


def sent(
    protocol: str, network: Conditions | None = None, motion: str = "march", rate: float = 60.0, until: float = 14.0
) -> list[Packet]:
    """What comes of a motion after a T-pose: when, from whom, what."""
    made = frames(Performance(builtin_motion(motion), 3.0), PROTOCOLS[protocol].encoder(), rate)
    schedule = through(network or Conditions(), made, 1.0 / rate, Tally())
    return [(1.0 + due, OPERATOR, datagram) for due, datagram in schedule if due < until]


@dataclass
class Life:
    """A session with its stream and gate, step by step."""

    robot: RobotModel
    protocol: str
    states: list[str] = field(default_factory=list)
    ages: list[float] = field(default_factory=list)
    commands: list[RobotCommand] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.stream = Stream(PROTOCOLS[self.protocol], tuple(PROTOCOLS.values()))
        self.session, self.gate = Session(self.robot), CommandGate(self.robot)
        self.session.start()
        self.passed: GateState = self.gate.begin(self.robot.postures["stand"])
        self.last = 0.0

    def live(self, packets: Iterable[Packet]) -> Life:
        """Take packets as the loop does: a step for each fresh frame, and after a period without one."""
        for due, address, datagram in packets:
            while due > self.last + PERIOD:
                self.step(self.last + PERIOD)
            before = self.stream.counts.frames
            self.stream.take(due, address, datagram)
            if self.stream.counts.frames != before:
                self.step(max(due, self.last + SHORTEST))
        return self

    def step(self, now: float) -> None:
        newest = self.stream.newest()
        if newest is not None:
            self.session.see(newest[1].frame, newest[0])
        tick = self.session.step(now)
        verdict = self.gate.check(self.passed, tick.command, now - self.last)
        assert verdict.accepted is not None, verdict.refusals
        self.passed, self.last = verdict.state, now
        self.commands.append(tick.command)
        if not self.states or self.states[-1] != tick.state.value:
            self.states.append(tick.state.value)
        if newest is not None:
            self.ages.append(now - newest[0])


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_loss_jitter_doubles_and_overtaking_do_not_disturb_the_robot(nao: RobotModel, protocol: str) -> None:
    network = Conditions(loss=0.3, jitter=0.2, duplicate=0.2, reorder=0.2, seed=1)
    life = Life(nao, protocol).live(sent(protocol, network))
    assert life.states[-1] in ("tracking", "blending", "holding")
    assert {"L", "R"} & {command.support for command in life.commands}
    assert max(life.ages) <= 2.0 * SHORTEST, "nothing waits"
    assert life.stream.counts.late > 0


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_rubbish_beside_a_stream_does_not_disturb_it(nao: RobotModel, protocol: str) -> None:
    chance, good = random.Random(3), sent(protocol, until=8.0)
    others = [sent(name, until=8.0)[0][2] for name in PROTOCOLS if name != protocol]
    mixed: list[Packet] = []
    for due, address, datagram in good:
        cut = datagram[: chance.randrange(len(datagram))]
        worse = bytes(b ^ (chance.random() < 0.02) * chance.randrange(256) for b in datagram)
        mixed += [(due, address, datagram), (due, STRANGER, worse)]
        mixed.extend((due, address, rubbish) for rubbish in (cut, chance.randbytes(40), chance.choice(others)))
    life, plain = Life(nao, protocol).live(mixed), Life(nao, protocol).live(good)
    assert life.states == plain.states
    assert life.stream.counts.damaged > 0 and life.stream.counts.foreign > 0
    assert np.abs(life.commands[-1].q - plain.commands[-1].q).max() < 0.02


@pytest.mark.parametrize("protocol", ["xsens", "json"])
@pytest.mark.parametrize(
    "gap, after",
    [
        (5.0, ["holding", "blending", "tracking"]),
        (13.0, ["holding", "returning", "waiting", "blending", "tracking"]),
    ],
)
def test_a_gap_is_held_and_a_long_one_ends_in_a_stand(
    nao: RobotModel, protocol: str, gap: float, after: list[str]
) -> None:
    packets = sent(protocol)
    late = [(due + gap * (due > 9.0), address, datagram) for due, address, datagram in packets]
    life = Life(nao, protocol).live(late)
    assert life.states == ["waiting", *BEGIN, *after]


@pytest.mark.parametrize("protocol", ["xsens", "json", "vmc"])
def test_a_sender_that_begins_again_is_followed(nao: RobotModel, protocol: str) -> None:
    first, again = sent(protocol, until=9.0), sent(protocol, until=6.0)
    life = Life(nao, protocol).live([*first, *((due + 9.05, *rest) for due, *rest in again)])  # type: ignore[misc]
    assert life.states == ["waiting", *BEGIN]
    assert life.stream.counts.frames >= 0.95 * 15.0 * 60.0
    assert life.session.state.value == "tracking"


@pytest.mark.parametrize("protocol", ["xsens", "json"])
def test_a_second_sender_is_not_mixed_in_and_may_take_over_from_one_that_is_gone(
    nao: RobotModel, protocol: str
) -> None:
    mine = sent(protocol, until=9.0)
    theirs = [(due, STRANGER, datagram) for due, _, datagram in sent(protocol, motion="squat", until=14.0)]
    both = Life(nao, protocol).live(sorted([*mine, *(p for p in theirs if p[0] < 10.0)], key=lambda p: p[0]))
    alone = Life(nao, protocol).live(mine)
    assert both.states == alone.states == ["waiting", *BEGIN]
    assert np.array_equal(both.commands[-1].q, alone.commands[-1].q)
    both.live(p for p in theirs if p[0] >= 10.0)
    assert both.states == ["waiting", *BEGIN, "holding", "blending", "tracking"]
    assert both.stream.sender == STRANGER
