"""Every edge of the session machine, driven by UDP packets, keys and a robot that fails; nothing unsafe comes out."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest

from naoimitate.calib.subject import Subject, calibrate
from naoimitate.command_gate import CommandGate
from naoimitate.core.frames import HumanFrame
from naoimitate.fsm.session import EDGES, Action, Event, SessionFsm, State
from naoimitate.hw.guarded import GuardedDriver
from naoimitate.hw.none import NoDriver
from naoimitate.live.keys import obey
from naoimitate.live.loop import Beat, Loop, listen
from naoimitate.live.protocols.registry import PROTOCOLS
from naoimitate.live.receiver import Receiver
from naoimitate.live.session import Session, SessionSettings
from naoimitate.live.stream import Stream
from naoimitate.motion.builtin import relaxed, tpose
from naoimitate.robot.model import RobotModel

QUICK = SessionSettings(predict=0.05, hold=0.4, back=1.0, blend_in=0.8, blend_back=0.3)
PATIENCE = 20.0
"""s until an edge must have been taken."""

E = Event
Step = tuple[str, Event]
"""What is done (send a posture, be silent, press keys, or nothing), and the event that follows from it."""

BEGIN: list[Step] = [("", E.START)]
MEASURED: list[Step] = [*BEGIN, ("stand", E.FRAME), ("T-pose", E.TPOSE)]
TOURS: dict[str, list[Step]] = {
    "nobody comes": BEGIN,
    "an emergency before anybody comes": [*BEGIN, ("key u", E.BODY), ("emergency", E.FAULT)],
    "somebody who is not measured goes": [
        *BEGIN, ("stand", E.FRAME), ("key u", E.BODY), ("silence", E.LATE), ("stand", E.FRAME),
    ],
    "an emergency while waiting for the T-pose": [
        *BEGIN, ("stand", E.FRAME), ("emergency", E.FAULT), ("key r", E.RESET), ("key c", E.CLUTCH),
        ("stand", E.FRAME),
    ],
    "pauses": [
        *MEASURED, ("", E.BLENDED), ("key c", E.CLUTCH), ("key u", E.BODY), ("key c", E.CLUTCH), ("", E.FRAME),
        ("key c", E.CLUTCH), ("T-pose", E.TPOSE), ("key u", E.BODY), ("", E.BLENDED), ("key u", E.BODY),
    ],
    "losses": [
        *MEASURED, ("silence", E.LATE), ("stand", E.FRAME), ("", E.BLENDED), ("silence", E.LATE), ("key u", E.BODY),
        ("", E.LOST), ("key u", E.BODY), ("", E.STANDING), ("key c", E.CLUTCH), ("key c", E.CLUTCH), ("stand", E.FRAME),
        ("silence", E.LATE), ("", E.LOST), ("stand", E.FRAME), ("", E.BLENDED),
    ],
    "a pause on the way back": [*MEASURED, ("silence", E.LATE), ("", E.LOST), ("key c", E.CLUTCH)],
    "a stop on the way back": [*MEASURED, ("silence", E.LATE), ("", E.LOST)],
    "a pause that never ends": [*MEASURED, ("key c", E.CLUTCH), ("silence", E.LOST)],
    "a pause of somebody who has gone": [*MEASURED, ("silence", E.LATE), ("key c", E.CLUTCH)],
    "gone": [*MEASURED, ("silence", E.LATE)],
    "an emergency while blending in": [*MEASURED, ("emergency", E.FAULT)],
    "an emergency while it follows": [*MEASURED, ("", E.BLENDED), ("emergency", E.FAULT), ("key r", E.RESET)],
    "an emergency in a pause": [*MEASURED, ("key c", E.CLUTCH), ("emergency", E.FAULT)],
    "an emergency while it holds": [*MEASURED, ("silence", E.LATE), ("emergency", E.FAULT)],
    "an emergency on the way back": [*MEASURED, ("silence", E.LATE), ("", E.LOST), ("emergency", E.FAULT)],
    "a fall": [*MEASURED, ("", E.BLENDED), ("fall", E.FAULT)],
}  # fmt: skip
"""Each ends with a stop, from wherever it has come to."""


class Fragile(NoDriver):
    """Moves nothing, and falls when it is told to."""

    fell = False

    def read(self):  # type: ignore[no-untyped-def]
        return replace(super().read(), fell=self.fell)


@dataclass
class Sender:
    """Streams a posture at 100 Hz, in a thread of its own; None: is silent."""

    port: int
    posture: HumanFrame | None = None
    halt: threading.Event = field(default_factory=threading.Event)

    def run(self) -> None:
        encoder, out = PROTOCOLS["json"].encoder(), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        begin, count = time.monotonic(), 0
        while not self.halt.wait(0.01):
            if (posture := self.posture) is not None:
                now = time.monotonic() - begin
                for datagram in encoder.encode(replace(posture, time=now), count, now):
                    out.sendto(datagram, ("127.0.0.1", self.port))
            count += 1
        out.close()


POSTURES: dict[str, Callable[[], HumanFrame]] = {"T-pose": tpose, "stand": relaxed}


@dataclass
class Guide:
    """Leads a session through a tour, a step at a time, as its operator."""

    tour: list[Step]
    session: Session
    driver: GuardedDriver
    robot: Fragile
    sender: Sender
    taken: list[Event]
    since: float = 0.0
    done: int = 0

    def __call__(self) -> bool:
        """Whether the tour is over; called in every turn."""
        now = time.monotonic()
        while self.done < len(self.tour) and len(self.taken) > self.done:
            assert self.taken[self.done] is self.tour[self.done][1], f"{self.tour[self.done]}: {self.taken}"
            self.done, self.since = self.done + 1, now
            if self.done < len(self.tour):
                self.act(self.tour[self.done][0])
        assert now - self.since < PATIENCE, f"{self.tour[self.done]} never came: {self.taken}"
        return self.done == len(self.tour)

    def act(self, what: str) -> None:
        if what in POSTURES:
            self.sender.posture = POSTURES[what]()
        elif what == "silence":
            self.sender.posture = None
        elif what == "fall":
            self.robot.fell = True
        elif what == "emergency":
            self.driver.emergency_stop()
        elif what.startswith("key "):
            obey(what[4:], self.session, self.driver)
            if what == "key r":
                self.sender.posture = None


def follow(
    nao: RobotModel,
    tour: list[Step],
    monkeypatch: pytest.MonkeyPatch,
    subject: Subject | None = None,
    meanwhile: Callable[[GuardedDriver], bool] = lambda driver: False,
) -> list[Event]:
    """Run a session through a tour; returns the events whose edges were taken, those of its end among them.

    meanwhile: what happens while the robot comes to its stand at the end; whether it is to hurry.
    """
    taken: list[Event] = []
    take = SessionFsm.take

    def logged(fsm: SessionFsm, event: Event) -> Action | None:
        action = take(fsm, event)
        if action is not None and not (event is Event.LOST and taken[-1] is event):  # told again in every step
            taken.append(event)
        return action

    monkeypatch.setattr(SessionFsm, "take", logged)
    session, robot, receiver = Session(nao, live=QUICK, subject=subject), Fragile(nao), Receiver("127.0.0.1", 0)
    session.warm_up()
    driver = GuardedDriver(robot, CommandGate(nao))
    driver.connect()
    sender, beats = Sender(receiver.port), list[Beat]()
    thread = threading.Thread(target=sender.run)
    thread.start()
    guide = Guide(tour, session, driver, robot, sender, taken, since=time.monotonic())
    try:
        stream = Stream(PROTOCOLS["json"], ())
        turns = listen(session, stream, receiver, driver.period)
        Loop(session, driver, [beats.append]).run(turns, ended=guide, hurried=lambda: meanwhile(driver))
    finally:
        sender.halt.set()
        thread.join()
        receiver.close()
    assert set(driver.status.refused) <= {"not live"}, "an unsafe command came to the gate"
    assert session.state is State.STOPPED
    return taken


def ending(tour: list[Step]) -> list[Event]:
    """The events of a tour and of its end: a robot that obeys comes to a stand first."""
    fsm, events = SessionFsm(), [*(event for _, event in tour), Event.STOP]
    for event in events:
        fsm.take(event)
    return events if fsm.state is State.STOPPED else [*events, Event.STANDING]


@pytest.mark.parametrize("tour", TOURS.values(), ids=TOURS.keys())
def test_packets_keys_and_failures_lead_along_the_edges(
    nao: RobotModel, tour: list[Step], monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = ending(tour)
    assert follow(nao, tour, monkeypatch) == expected


def test_an_operator_who_was_measured_before_is_followed_at_once(
    nao: RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    tour = [*BEGIN, ("stand", E.FRAME), ("", E.BLENDED)]
    assert follow(nao, tour, monkeypatch, calibrate(tpose()))[-2:] == [E.STOP, E.STANDING]


def test_a_hurried_operator_does_not_wait_for_the_stand(nao: RobotModel, monkeypatch: pytest.MonkeyPatch) -> None:
    assert follow(nao, MEASURED, monkeypatch, meanwhile=lambda driver: True)[-2:] == [E.STOP, E.STOP]


def test_an_emergency_on_the_way_to_the_last_stand_ends_it(nao: RobotModel, monkeypatch: pytest.MonkeyPatch) -> None:
    def meanwhile(driver: GuardedDriver) -> bool:
        driver.emergency_stop()
        return False

    assert follow(nao, MEASURED, monkeypatch, meanwhile=meanwhile)[-3:] == [E.STOP, E.FAULT, E.STOP]


def edges(tour: list[Step]) -> set[tuple[State, Event]]:
    """The edges that a tour takes, its stop among them."""
    fsm, found = SessionFsm(), set()
    for event in ending(tour):
        found.add((fsm.state, event))
        assert fsm.take(event) is not None
    return found


def test_the_tours_take_every_edge_of_a_session_that_has_begun() -> None:
    before, after = {State.IDLE}, {(State.STOPPING, E.STOP), (State.STOPPING, E.FAULT)}  # the tests above take these
    every = {(edge.state, edge.event) for edge in EDGES if edge.state not in before} | {(State.IDLE, E.START)}
    assert set().union(*map(edges, TOURS.values())) == every - after
