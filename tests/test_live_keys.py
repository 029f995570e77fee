"""What the operator's keys do: an emergency stop always, a reset only after a fault."""

from __future__ import annotations

import os
import pty
import sys
import time
from collections.abc import Iterator

import pytest

from naoimitate.command_gate import CommandGate
from naoimitate.core.errors import DriverError
from naoimitate.fsm.session import Event, State
from naoimitate.hw.condition import Condition
from naoimitate.hw.guarded import GuardedDriver
from naoimitate.hw.none import NoDriver
from naoimitate.live.keys import Keys, obey
from naoimitate.live.session import Session
from naoimitate.robot.model import RobotModel


@pytest.fixture
def session(nao: RobotModel) -> Session:
    session = Session(nao)
    session.start()
    return session


@pytest.fixture
def driver(nao: RobotModel) -> GuardedDriver:
    driver = GuardedDriver(NoDriver(nao), CommandGate(nao))
    driver.connect()
    return driver


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The operator's side of a terminal that is our standard input."""
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        yield ours
    os.close(ours)


def test_the_emergency_stop_waits_for_nobody_and_other_keys_are_kept(driver: GuardedDriver, terminal: int) -> None:
    with Keys(driver) as keys:
        assert keys.open
        os.write(terminal, b"c")
        os.write(terminal, b"u q")
        end, pressed = time.monotonic() + 10.0, ""
        while len(pressed) < 3 and time.monotonic() < end:
            pressed += keys.pressed()
            time.sleep(0.01)
        assert pressed == "cuq"
        assert driver.status.condition is Condition.EMERGENCY


def test_without_a_terminal_there_are_no_keys(driver: GuardedDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    with open(os.devnull) as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        with Keys(driver) as keys:
            assert not keys.open and keys.pressed() == ""


def test_a_robot_that_follows_is_not_connected_anew(
    session: Session, driver: GuardedDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(driver, "connect", lambda: pytest.fail("connected while it was live"))
    assert not obey("r", session, driver)
    assert session.state is State.WAITING


def test_a_fault_is_reset(session: Session, driver: GuardedDriver) -> None:
    driver.emergency_stop()
    session.tell(Event.FAULT, "emergency stop")
    assert not obey("r", session, driver)
    assert session.state is State.CLUTCHED and driver.status.condition is Condition.LIVE


def test_a_robot_that_cannot_be_connected_stays_in_fault_and_says_why(
    session: Session, driver: GuardedDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unreachable() -> None:
        raise DriverError("nobody there")

    session.tell(Event.FAULT, "it fell")
    monkeypatch.setattr(driver, "connect", unreachable)
    assert not obey("r", session, driver)
    assert session.state is State.FAULT and session.reason == "nobody there"


def test_q_ends_the_session_and_unknown_keys_do_nothing(session: Session, driver: GuardedDriver) -> None:
    assert not obey("xyz\x1b[A", session, driver)
    assert obey("q", session, driver)
