"""A robot that is pushed over in the middle of a session: limp, not fought with, and idle after a reset."""

from __future__ import annotations

import os
import pty
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from naoimitate import load_robot
from naoimitate.cli import run as command
from naoimitate.core.frames import RobotCommand
from naoimitate.fsm.session import State
from naoimitate.hw.condition import Condition, GuardSettings
from naoimitate.hw.driver import RobotState
from naoimitate.live.panel import Panel
from naoimitate.robot.model import Array
from naoimitate.run.file import load_run
from naoimitate.sim.driver import MujocoDriver

PUSH = 4.0
"""[m/s^2] of a wind to the left, until the robot is made soft: it tips over its left foot."""
PATIENCE = 30.0
"""[s] until something must have happened."""


class Windy(MujocoDriver):
    """A simulated robot in a wind, which notes what it is told."""

    def __init__(self, *arguments: object, **options: object) -> None:
        super().__init__(*arguments, **options)  # type: ignore[arg-type]
        self.written, self.softened = list[Array](), list[float]()

    def blow(self, strength: float) -> None:
        self.model.opt.gravity[1] = strength

    def write(self, command: RobotCommand) -> None:
        self.written.append(command.q)
        super().write(command)

    def soften(self, share: float) -> None:
        self.softened.append(share)
        self.blow(0.0)
        super().soften(share)


@dataclass
class Operator:
    """Sits at the terminal of a session with a panel and a simulated robot."""

    terminal: int
    panels: list[Panel] = field(default_factory=list)
    robots: list[Windy] = field(default_factory=list)

    @property
    def robot(self) -> Windy:
        return self.robots[0]

    @property
    def state(self) -> State | None:
        """Of the session that the panel shows."""
        return self.panels[0]._session.state if self.panels else None

    @property
    def condition(self) -> Condition:
        return self.panels[0]._driver.status.condition

    def sees(self, what: str) -> str:
        """A row of the panel."""
        return dict(self.panels[0]._rows())[what]

    def press(self, key: str) -> None:
        os.write(self.terminal, key.encode())

    def wait_for(self, true: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE
        while not true():
            assert time.monotonic() < end, f"did not happen in time: {self.state}"
            time.sleep(0.01)


@pytest.fixture
def operator(monkeypatch: pytest.MonkeyPatch) -> Iterator[Operator]:
    ours, theirs = pty.openpty()
    operator = Operator(ours)

    class SeenPanel(Panel):
        def __init__(self, *arguments: object) -> None:
            super().__init__(*arguments)  # type: ignore[arg-type]
            operator.panels.append(self)

    def windy(*arguments: object, **options: object) -> Windy:
        operator.robots.append(Windy(*arguments, **options))
        return operator.robots[-1]

    monkeypatch.setattr("naoimitate.live.panel.Panel", SeenPanel)
    monkeypatch.setattr("naoimitate.sim.driver.MujocoDriver", windy)
    with os.fdopen(theirs, "r") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        yield operator
    os.close(ours)


@dataclass
class Story:
    """What the operator saw, and what the robot was told meanwhile: joint angles (J,) rad a command."""

    fault: str = ""
    fallen: tuple[str, str] = ("", "")
    lay: bool = False
    on_the_floor: list[Array] = field(default_factory=list)
    idle: str = ""
    while_idle: list[Array] = field(default_factory=list)
    stood: RobotState | None = None
    error: BaseException | None = None


def push_over_and_reset(operator: Operator, story: Story) -> None:
    """Everything that happens, up to the operator's end of the session."""
    operator.wait_for(lambda: operator.state is State.TRACKING)
    robot = operator.robot
    robot.blow(PUSH)
    operator.wait_for(lambda: operator.state is State.FAULT)
    story.fault, told = operator.sees("state"), len(robot.written)
    operator.wait_for(lambda: operator.condition is Condition.FALLEN)
    operator.press("c")
    time.sleep(0.5)
    story.fallen, story.lay = (operator.sees("state"), operator.sees("robot")), robot.read().fell
    story.on_the_floor = robot.written[told:]
    operator.press("r")
    operator.wait_for(lambda: operator.state is State.CLUTCHED)
    told = len(robot.written)
    time.sleep(2.0)
    story.idle, story.while_idle, story.stood = operator.sees("state"), robot.written[told:], robot.read()
    operator.press("c")
    operator.wait_for(lambda: operator.state is State.TRACKING)
    operator.press("q")


def test_a_robot_that_falls_goes_limp_and_is_idle_after_the_reset(operator: Operator, tmp_path: Path) -> None:
    story = Story()

    def tell() -> None:
        try:
            push_over_and_reset(operator, story)
        except BaseException as error:
            story.error = error
            operator.press("q")

    thread = threading.Thread(target=tell)
    thread.start()
    arguments = ["live", "--source", "replay:builtin:march", "--driver", "mujoco", "--duration", "60"]
    assert command([*arguments, "--out", str(tmp_path / "run.npz")]) == 0
    thread.join()
    if story.error is not None:
        raise story.error
    assert story.fault == "fault: falling" and operator.robot.softened == [GuardSettings().fall_stiffness]
    assert story.lay and story.fallen[0].startswith("fault") and story.fallen[1].startswith("fallen")
    assert story.on_the_floor == [], "nobody fights on the floor, nor does the operator's c"
    assert story.idle == "clutched: nothing moves until you press c or hold a T-pose"
    assert len(story.while_idle) > 100
    stand = load_robot("nao").postures["stand"]
    np.testing.assert_array_equal(np.array(story.while_idle), np.tile(stand, (len(story.while_idle), 1)))
    assert story.stood is not None and not story.stood.fell
    np.testing.assert_allclose(story.stood.q, stand, atol=0.01)
    before, after = load_run(tmp_path / "run.npz"), load_run(tmp_path / "run-2.npz")
    assert before.sim_fell and before.session is not None and before.session[-1] == "fault"
    assert not after.sim_fell and after.session is not None and after.session[0] == "clutched"
