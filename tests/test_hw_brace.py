"""A robot that falls braces once, in a posture that its data give it, and is let go of as ever."""

from __future__ import annotations

import importlib
import math
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from guard_rig import DT, GATE, NAO, STAND, FakeRobot, command, guarded

from naoimitate import load_robot
from naoimitate.cli.conduct import Rig
from naoimitate.cli.live import live
from naoimitate.collision import distances, shape_arrays
from naoimitate.core.errors import DriverError
from naoimitate.core.frames import RobotCommand
from naoimitate.fsm.session import Event, State
from naoimitate.hw.brace import braced, side_of_fall
from naoimitate.hw.guarded import NOT_LIVE, Condition, GuardedDriver, GuardSettings
from naoimitate.hw.lean import UPRIGHT, quat_from_angles
from naoimitate.live.session import Session
from naoimitate.robot.kernel import forward
from naoimitate.robot.model import Array, RobotModel
from naoimitate.sim.driver import MujocoDriver

BRACE = GuardSettings(fall_response="brace")
LEANS = {"front": (0.0, 0.6), "back": (0.0, -0.6), "left": (-0.6, 0.0), "right": (0.6, 0.0)}
"""rad, roll and pitch."""
CLEARANCE = 0.002
"""[m] at least between shapes of the body."""


def written(robot: FakeRobot) -> list[RobotCommand]:
    return [done for done in robot.done if isinstance(done, RobotCommand)]


def lean_over(guard: GuardedDriver, robot: FakeRobot, angles: tuple[float, float]) -> None:
    guard.write(command(0.0))
    robot.angles = np.array(angles)
    for i in range(1, 120):
        guard.write(command(i * DT))


def gap(robot: RobotModel, q: Array) -> float:
    """Smallest distance between two shapes of the body, m."""
    pos, rot = np.empty((len(q) + 1, 3)), np.empty((len(q) + 1, 3, 3))
    forward(robot.tree, q, pos, rot)
    found = np.full(len(robot.pairs), np.nan)
    points = [np.empty((len(robot.pairs), 3)) for _ in range(3)]
    distances(shape_arrays(robot), robot.pairs, pos, rot, np.inf, found, *points)
    return float(found.min())


@pytest.mark.parametrize("version", ["v4", "v5", "v6"])
@pytest.mark.parametrize("side", LEANS)
def test_the_postures_are_possible(version: str, side: str) -> None:
    nao = load_robot("nao", version)
    q = nao.postures[f"brace_{side}"]
    assert (q >= nao.lower).all() and (q <= nao.upper).all()
    for table in nao.tables:
        low, high = table.bounds(q[table.x])
        assert low <= q[table.y] <= high
    way = [gap(nao, STAND + share * (q - STAND)) for share in np.linspace(0.0, 1.0, 21)]
    assert min(way) > CLEARANCE, "nor does the way there from a stand touch the body"


def test_left_and_right_are_mirror_images() -> None:
    left, right = NAO.postures["brace_left"], NAO.postures["brace_right"]
    for name, angle in zip(NAO.joint_names, left, strict=True):
        twin = {"L": "R", "R": "L"}.get(name[0], name[0]) + name[1:]
        flipped = -1.0 if name.endswith(("Roll", "ElbowYaw", "WristYaw", "HeadYaw")) else 1.0
        assert right[NAO.joint(twin)] == pytest.approx(flipped * angle), name


@pytest.mark.parametrize("side", LEANS)
def test_the_side_is_that_of_the_lean_from_the_plan(side: str) -> None:
    angles = np.array(LEANS[side])
    assert side_of_fall(UPRIGHT, angles) == side
    turned = np.array([math.cos(1.0), 0.0, 0.0, math.sin(1.0)])
    assert side_of_fall(turned, angles) == side, "whatever the heading"
    assert side_of_fall(quat_from_angles(2.0 * angles), angles) != side, "from a plan that leans further"
    assert side_of_fall(UPRIGHT, np.full(2, np.nan)) is None


@pytest.mark.parametrize("side", LEANS)
def test_a_robot_that_falls_braces_once_then_softens_and_is_let_go_of(side: str) -> None:
    guard, robot = guarded(BRACE)
    lean_over(guard, robot, LEANS[side])
    *_, before, brace = written(robot)
    np.testing.assert_array_equal(brace.q, NAO.postures[f"brace_{side}"])
    assert replace(brace, q=before.q) == before, "all else is the last command's"
    assert robot.done[-3:] == [brace, ("soften", BRACE.brace_stiffness), "stop"]
    assert guard.status.condition is Condition.FALLEN
    assert NOT_LIVE in guard.status.refused
    assert guard.command is before


def test_the_posture_is_a_copy_of_the_robots() -> None:
    brace = braced(command(0.0), NAO.postures, np.array(LEANS["front"]))
    assert brace is not None
    assert not np.shares_memory(brace.q, NAO.postures["brace_front"])


@pytest.mark.parametrize("why", ["limp", "no posture", "not measured", "no command", "fault"])
def test_a_robot_goes_limp_by_default_and_where_it_cannot_brace(why: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if why == "no posture":
        monkeypatch.setattr(GATE, "postures", {"stand": STAND})
    guard, robot = guarded(None if why == "limp" else BRACE)
    if why != "no command":
        guard.write(command(0.0))
    if why == "fault":
        robot.faults = ("RKneePitch is silent",)
        for i in range(1, 30):
            guard.write(command(i * DT))
        assert guard.status.condition is Condition.FAULT
    robot.angles, robot.fell = np.array(LEANS["front"]), why == "not measured"
    if why == "not measured":
        robot.angles = np.full(2, np.nan)
    passed = len(written(robot))
    for _ in range(120):
        guard.read()
    assert len(written(robot)) == passed
    assert robot.done[-2:] == [("soften", GuardSettings().fall_stiffness), "stop"]
    assert guard.status.condition is Condition.FALLEN


def test_a_robot_that_does_not_take_the_posture_is_softened_all_the_same() -> None:
    guard, robot = guarded(BRACE)
    guard.write(command(0.0))
    robot.angles, robot.breaks = np.array(LEANS["back"]), {"write"}
    for _ in range(5):
        guard.read()
    assert robot.done[-1] == ("soften", BRACE.fall_stiffness)
    assert guard.status.condition is Condition.FALLING
    assert "broken" in guard.status.problem


def test_an_emergency_stop_before_the_fall_is_believed_leaves_no_posture_to_write() -> None:
    guard, robot = guarded(BRACE)
    guard.write(command(0.0))
    guard.emergency_stop()
    robot.angles = np.array(LEANS["front"])
    for _ in range(120):
        guard.read()
    assert len(written(robot)) == 1


def test_a_response_that_nobody_knows_is_named() -> None:
    with pytest.raises(ValueError, match="limp or brace"):
        GuardSettings(fall_response="jump")


class Noted(MujocoDriver):
    """The simulated robot, which notes what it is written."""

    def __init__(self) -> None:
        self.commands: list[RobotCommand] = []
        super().__init__(NAO, real_time=False)

    def write(self, command: RobotCommand) -> None:
        self.commands.append(command)
        super().write(command)


PUSHES = {"front": (1.0, 0.0, 0.0), "back": (-1.0, 0.0, 0.0), "left": (0.0, 1.0, 0.0), "right": (0.0, -1.0, 0.0)}
FORCE, PUSHED = 75.0, 0.1
"""N on the torso, for s."""


def fall(guard: GuardedDriver, robot: Noted, push: tuple[float, float, float]) -> None:
    """A robot that stands is pushed over, while commands keep coming."""
    start = robot.read().time
    for i in range(120):
        robot._physics.push(FORCE * np.array(push) if 0.3 <= i * DT < 0.3 + PUSHED else np.zeros(3))
        guard.write(command(start + i * DT))
        robot.advance(DT)


@pytest.mark.parametrize("side", PUSHES)
def test_a_pushed_robot_braces_once_falls_and_lives_again_after_a_reset(side: str) -> None:
    robot = Noted()
    guard = GuardedDriver(robot, GATE, BRACE, clock=lambda: robot.read().time)
    guard.connect()
    fall(guard, robot, PUSHES[side])
    assert guard.status.condition.value == "fallen"
    np.testing.assert_array_equal(robot.commands[-1].q, NAO.postures[f"brace_{side}"])
    braces = [c for c in robot.commands if not np.array_equal(c.q, STAND)]
    assert len(braces) == 1, "once, and nothing afterwards"
    with pytest.raises(DriverError, match="fallen"):
        guard.connect()
    guard.reset()
    guard.connect()
    for i in range(50):
        guard.write(command(i * DT))
        robot.advance(DT)
    status = guard.status
    assert status.condition.value == "live"
    assert status.refusing == ()
    assert status.lean < np.radians(3.0)


@pytest.mark.parametrize("measured", [False, True])
def test_a_session_whose_robot_fell_is_idle_after_a_reset(measured: bool) -> None:
    session = Session(NAO)
    session.start()
    session._fsm.measured = measured
    session.step(0.0)
    session.tell(Event.FAULT, Condition.FALLING.value)
    session.step(DT)
    assert session.state is State.FAULT
    assert session.reason == "falling"
    session.tell(Event.RESET)
    ticks = [session.step((2 + i) * DT) for i in range(100)]
    assert session.state is State.CLUTCHED and session.reason == ""
    np.testing.assert_array_equal([tick.command.q for tick in ticks], np.tile(STAND, (100, 1)))
    np.testing.assert_allclose(np.diff([tick.command.time for tick in ticks]), DT, atol=1e-9)


@pytest.mark.parametrize("response", ["limp", "brace"])
def test_the_command_line_chooses(response: str, monkeypatch: pytest.MonkeyPatch) -> None:
    rigs: list[Rig] = []
    monkeypatch.setattr(importlib.import_module("naoimitate.cli.live"), "conduct", lambda rig, *_: rigs.append(rig))
    chosen = [] if response == "limp" else ["--fall", response]
    result = CliRunner().invoke(live, ["--source", "replay:builtin:wave", "--driver", "none", *chosen])
    assert result.exit_code == 0, result.output
    assert rigs[0].driver._settings.fall_response == response
