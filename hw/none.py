"""No robot: commands are recorded or shown only, and the robot is at once where it was commanded."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from naoimitate.core.frames import Array, RobotCommand
from naoimitate.hw.driver import RobotState
from naoimitate.robot.model import RobotModel


class NoDriver:
    """A robot that stands in its posture ``stand`` and then is where the newest command says.

    take: called with every command, such as the ``append`` of a list. What only a body could feel is NaN in its state,
    and nothing is known of its torso in the world.
    """

    def __init__(
        self,
        robot: RobotModel,
        take: Callable[[RobotCommand], object] | None = None,
        *,
        period: float = 0.02,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._stand, self._take, self._period, self._clock = robot.postures["stand"], take, period, clock
        self._command: RobotCommand | None = None
        self._start, self._open = clock(), False

    @property
    def period(self) -> float:
        """Time between two uses of the newest command, s: that of a typical robot."""
        return self._period

    def connect(self) -> None:
        """Start the clock."""
        self._start, self._command, self._open = self._clock(), None, True

    def read(self) -> RobotState:
        """The newest command as if it were measured."""
        command = self._command
        return RobotState(
            time=self._clock() - self._start,
            q=(self._stand if command is None else command.q).copy(),
            torque=_unknown(len(self._stand)),
            angles=_unknown(2),
            gyro=_unknown(3),
            accelerometer=_unknown(3),
            fsr=_unknown(2, 4),
            fell=False,
        )

    def write(self, command: RobotCommand) -> None:
        """Be where the command says; after ``stop`` it is ignored."""
        if not self._open:
            return
        self._command = command
        if self._take is not None:
            self._take(command)

    def soften(self, share: float) -> None:
        """There are no servos."""

    def emergency_stop(self) -> None:
        """Nothing moves; ignore all further commands."""
        self._open = False

    def stop(self) -> None:
        """Ignore all further commands."""
        self._open = False


def _unknown(*shape: int) -> Array:
    return np.full(shape, np.nan)
