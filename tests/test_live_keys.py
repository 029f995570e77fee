"""What the operator's keys do: an emergency stop always, a reset only after a fault."""

from __future__ import annotations

import pytest

from naoimitate.command_gate import CommandGate
from naoimitate.core.errors import DriverError
from naoimitate.fsm.session import Event, State
from naoimitate.hw.condition import Condition
from naoimitate.hw.guarded import GuardedDriver
from naoimitate.hw.none import NoDriver
from naoimitate.live.keys import obey
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


@pytest.mark.parametrize("keys", [" ", "c ", "q r c "])
def test_an_emergency_stop_comes_before_every_other_key(session: Session, driver: GuardedDriver, keys: str) -> None:
    assert not obey(keys, session, driver)
    assert driver.status.condition is Condition.EMERGENCY


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
    assert session.state is State.WAITING and driver.status.condition is Condition.LIVE


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
