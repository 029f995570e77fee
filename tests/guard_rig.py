"""A robot that notes what is done to it, behind a guard."""

from __future__ import annotations

import time
from dataclasses import fields
from typing import Any

import numpy as np

from naoimitate import load_robot
from naoimitate.command_gate import CommandGate
from naoimitate.core.errors import DriverError
from naoimitate.core.frames import RobotCommand
from naoimitate.hw.driver import RobotState
from naoimitate.hw.guarded import GuardedDriver, GuardSettings
from naoimitate.sim.placement import stand_on_floor

NAO = load_robot("nao", "v4")

GATE = CommandGate(NAO)

STAND = NAO.postures["stand"]

DT, UP = 0.02, np.array([0.0, 0.0, 1.0])

NAN = np.full(24, np.nan)


class FakeRobot:
    """A driver that writes down what is done to it. Every reading takes a period; its time is the clock of a test."""

    period = DT

    def __init__(self) -> None:
        self.done: list[object] = []
        self.angles = np.zeros(2)
        self.fell, self.alarms, self.time = False, (), 0.0
        self.alarms: tuple[str, ...]
        self.faults: tuple[str, ...] = ()
        self.breaks: set[str] = set()
        self.slow = 0.0

    def connect(self) -> None:
        self._do("connect")

    def read(self) -> RobotState:
        if "read" in self.breaks:
            raise DriverError("the robot does not answer")
        self.time += DT
        gyro = np.zeros(3)
        state = (self.time, STAND, NAN, self.angles, gyro, np.zeros(3), np.zeros((2, 4)), self.fell)
        return RobotState(*state, alarms=self.alarms, faults=self.faults)

    def write(self, command: RobotCommand) -> None:
        self._do(command)

    def soften(self, share: float) -> None:
        self._do(("soften", share))

    def emergency_stop(self) -> None:
        self._do("emergency stop")

    def stop(self) -> None:
        time.sleep(self.slow)
        self._do("stop")

    def _do(self, what: object) -> None:
        self.done.append(what)
        if str(what if isinstance(what, str) else what[0] if isinstance(what, tuple) else "write") in self.breaks:
            raise RuntimeError("broken")


def command(moment: float, *, head: float = 0.0, lift: float = 0.0) -> RobotCommand:
    """A stand at a time, with the head turned by rad, lifted off the floor by m."""
    q = STAND.copy()
    q[NAO.joint("HeadYaw")] = head
    pos, quat = stand_on_floor(NAO, q)
    empty: dict[str, Any] = {field.name: None for field in fields(RobotCommand)}
    pose = {"time": moment, "q": q, "base_pos": pos + lift * UP, "base_quat": quat, "support": "D"}
    return RobotCommand(**{**empty, **pose})


def guarded(settings: GuardSettings | None = None) -> tuple[GuardedDriver, FakeRobot]:
    robot = FakeRobot()
    guard = GuardedDriver(robot, GATE, settings, clock=lambda: robot.time)
    guard.connect()
    return guard, robot
