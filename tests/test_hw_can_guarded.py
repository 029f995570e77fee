"""Behind the guard: what an operator gets from each fault of a motor, and what the robot does meanwhile."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from can_rig import Rig, all_follow, rig, wait_for

from naoimitate import Imitator
from naoimitate.calib.subject import calibrate
from naoimitate.command_gate import CommandGate
from naoimitate.core.frames import RobotCommand
from naoimitate.hw.can.joints import read_joint_map
from naoimitate.hw.guarded import Condition, GuardedDriver, GuardStatus
from naoimitate.motion.builtin import relaxed, tpose
from naoimitate.robot import RobotModel

PERIOD = 0.01


class Life:
    """A guarded robot on the rig that is sent commands in real time, as by a session."""

    def __init__(self, it: Rig, robot: RobotModel, gate: CommandGate) -> None:
        self.it, self.robot = it, robot
        self.guard = GuardedDriver(it.driver, gate)
        imitator = Imitator(robot)
        imitator.use(calibrate(tpose()))
        imitator.stand()
        self._calm = imitator.step(relaxed(), PERIOD)
        self.guard.connect()
        self._begin = time.monotonic()
        self._q = robot.postures["stand"].copy()

    def command(self) -> RobotCommand:
        """A calm stand in which the head looks left and right."""
        moment = time.monotonic() - self._begin
        q = self._q.copy()
        q[0] = 0.6 * np.sin(moment)  # slow enough that a stuck motor is away for long, wherever it sticks
        return replace(self._calm, time=moment, q=q)

    def until(self, true: Callable[[GuardStatus], bool], patience: float = 20.0) -> bool:
        def turn() -> bool:
            self.guard.write(self.command())
            return true(self.guard.status)

        return wait_for(turn, patience)


@pytest.fixture(scope="module")
def gate(nao: RobotModel) -> CommandGate:
    return CommandGate(nao)


@contextmanager
def living(nao: RobotModel, gate: CommandGate, *faults: str) -> Iterator[Life]:
    with rig(nao, *faults, compensation=False) as it:
        life = Life(it, nao, gate)
        try:
            yield life
        finally:
            life.guard.stop()


@pytest.mark.parametrize(
    ("what", "problem"),
    [
        ("HeadYaw:stuck@0.8", "motor 1 (HeadYaw) does not get where it is sent"),
        ("LKneePitch:silent@0.8", "motor 11 (LKneePitch) is silent"),
        ("LKneePitch:crc@0.8", "motor 11 (LKneePitch) sends damaged frames only"),
        ("LKneePitch:bus-off@0.8", "motor 11 (LKneePitch) is silent"),
        ("LKneePitch:hot@0.8", "motor 11 (LKneePitch) has switched itself off: hot"),
    ],
)
def test_a_motor_that_fails_ends_the_motion_by_name_and_all_others_stay_stiff(
    nao: RobotModel, gate: CommandGate, what: str, problem: str
) -> None:
    with living(nao, gate, what) as life:
        ill = read_joint_map(nao).nodes[read_joint_map(nao).names.index(what.split(":")[0])]
        life.it.stub.motors[ill].temperature = 72.0
        assert life.until(lambda status: status.condition is Condition.FAULT)
        status = life.guard.status
        assert status.problem == problem
        assert problem in status.alarms
        assert status.accepted > 0
        held = life.guard.command
        time.sleep(0.5)
        life.guard.write(life.command())
        assert life.guard.command is held, "no command passes any more"
        assert held is not None
        assert {motor.stiffness for node, motor in life.it.stub.motors.items() if node != ill} == {1.0}
        assert all_follow(life.it, but=ill)
        others = np.arange(len(nao.joint_names)) != nao.joint_names.index(what.split(":")[0])
        np.testing.assert_allclose(life.it.driver.read().q[others], held.q[others], atol=0.01)


def test_a_hot_motor_is_told_before_it_ends_anything(nao: RobotModel, gate: CommandGate) -> None:
    with living(nao, gate, "LKneePitch:hot@0.8") as life:
        life.it.stub.motors[11].temperature = 72.0
        hot = "motor 11 (LKneePitch) is hot (over 75 degrees)"
        assert life.until(lambda status: status.alarms == (hot,))
        assert life.guard.status.condition is Condition.LIVE
        assert life.guard.status.problem == ""


def test_the_operator_stops_a_robot_in_fault_and_connects_it_again(nao: RobotModel, gate: CommandGate) -> None:
    with living(nao, gate, "RShoulderRoll:bus-off@0.8") as life:
        assert life.until(lambda status: status.condition is Condition.FAULT)
        life.guard.stop()
        assert life.guard.status.condition is Condition.STOPPED
        assert life.guard.status.problem == "motor 20 (RShoulderRoll) is silent"
        assert wait_for(lambda: {m.status for m in life.it.stub.motors.values()} == {"off"})
        time.sleep(2.0)  # the motor is on the bus again
        life.guard.reset()
        life.guard.connect()
        assert life.until(lambda status: status.accepted > 50)
        assert life.guard.status.condition is Condition.LIVE


def test_a_pause_of_the_computer_ends_nothing(nao: RobotModel, gate: CommandGate) -> None:
    """The motors hold by themselves meanwhile, and follow again."""
    with living(nao, gate) as life:
        assert life.it.driver._sender is not None
        send = life.it.driver._sender.link.send
        life.it.driver._sender.link.send = lambda frames: None  # type: ignore[method-assign]
        time.sleep(0.3)
        life.it.driver._sender.link.send = send  # type: ignore[method-assign]
        before = life.guard.status.accepted
        assert life.until(lambda status: status.accepted > before + 50)
        assert life.guard.status.condition is Condition.LIVE
        assert all_follow(life.it)
