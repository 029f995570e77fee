"""A real NAO through NAOqi: the newest command every 20 ms, its senses likewise, and a safe start and end.

The fastest call that is safe beside NAOqi's reflexes is ``ALMotion.setAngles``: it does not block, and ALMotion runs at
20 ms. The fraction of the maximum speed that it takes is chosen so that the largest step just takes a period: less lags
behind, more jerks from step to step.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from typing import Any

import numpy as np

from naoimitate.calib.zeros import JointZeros, no_zeros
from naoimitate.core.errors import DriverError
from naoimitate.core.frames import RobotCommand
from naoimitate.hw.driver import INTERRUPTED, RobotState
from naoimitate.hw.lean import UPRIGHT
from naoimitate.hw.naoqi_link import NaoqiLink
from naoimitate.hw.naoqi_sender import NaoqiSender
from naoimitate.hw.naoqi_senses import accelerometer_sign, as_known, blank, keys, state
from naoimitate.hw.naoqi_settings import NaoqiSettings, loops_of
from naoimitate.hw.naoqi_start import (
    ON_ITS_FEET,
    check_body,
    check_posture,
    check_version,
    go_to,
    keep_reflexes,
    posture_family,
    quieten,
    stand_up,
    wake,
)
from naoimitate.hw.target import Target, target_of
from naoimitate.robot.model import RobotModel

SILENCE = 0.5
"""[s] without an answer after which the robot is said not to answer; ten times its slowest call on a busy network."""

GONE = 2.0
"""[s] without an answer after which it does not obey either; it then holds the last command that it got."""

NEW = 3.0
"""Periods for which closed loops believe a state: answers take one or two. From an older one they let go."""


class NaoqiDriver:
    """One NAO. ``notice`` is told, a sentence each, what was changed on the robot."""

    def __init__(
        self,
        robot: RobotModel,
        settings: NaoqiSettings | None = None,
        *,
        zeros: JointZeros | None = None,
        notice: Callable[[str], None] = lambda sentence: None,
    ) -> None:
        self._robot, self._settings = robot, settings or NaoqiSettings()
        self._zeros, self._notice = zeros or no_zeros(robot), notice
        self._names, self._keys = list(robot.joint_names), keys(robot.joint_names)
        self._link: NaoqiLink | None = None
        self._thread: threading.Thread | None = None
        self._leaving: NaoqiLink | None = None
        self._halt, self._stopping = threading.Event(), threading.RLock()
        self._nonsense = ""
        self._state = blank(len(self._names), robot.postures["stand"])
        self._target: Target | None = None
        self._began = time.monotonic()

    @property
    def period(self) -> float:
        """Time between two uses of the newest command, s."""
        return self._settings.period

    def connect(self) -> None:
        """Find the robot, check it, wake it up and bring it to the model's posture ``stand``.

        Takes some seconds; ``stop`` and ``emergency_stop`` end it. DriverError says what to do.
        """
        self.stop()
        s, halt = self._settings, threading.Event()
        self._halt, self._command = halt, loops_of(self._robot, s)
        link = NaoqiLink(s.url, s.user, s.password, s.patience)
        try:
            check_version(link)
            check_body(link, self._names)
            check_posture(link)
            quieten(link, self._notice)
            keep_reflexes(link, self._notice)
            self._go_on()
        except BaseException:
            link.close()
            raise
        self._link = link  # from here on ``stop`` has something to stop
        try:
            self._wake(link)
            self._start_from(link)
        except BaseException:
            self.stop()
            raise
        self._thread = threading.Thread(target=self._run, args=(link, halt), name="naoqi", daemon=True)
        self._thread.start()

    def read(self) -> RobotState:
        """The newest state that the robot has sent, with an alarm where it has not for a while, and later a fault.

        Raises DriverError when the connection has broken.
        """
        newest, link = self._state, self._link
        if link is None:
            return newest
        if not link.open:
            raise DriverError("the connection to the robot broke; it holds its last posture: go and look after it")
        silent = self._now() - newest.time
        if silent < SILENCE:
            return newest
        nonsense = self._nonsense
        what = f"no sense in what the robot answers ({nonsense})" if nonsense else "the robot has not answered"
        if silent >= GONE:
            return replace(newest, faults=(*newest.faults, f"{what} for {GONE:g} s"))
        return replace(newest, alarms=(*newest.alarms, f"{what} for {silent:.1f} s"))

    def write(self, command: RobotCommand) -> None:
        """Replace the command that is sent from the next period on; after ``stop`` it leads to nothing."""
        self._target = target_of(command)

    def soften(self, share: float) -> None:
        """Turn the stiffness down to a share, 0 to 1, of its setting, without waiting for the robot."""
        if self._link is not None:
            self._link.ask("ALMotion", "setStiffnesses", "Body", float(share * self._settings.stiffness))

    def emergency_stop(self) -> None:
        """Send nothing more, and end every motion that ALMotion has under way; the robot holds where it is, stiff.

        Letting go of it, once ``stop`` has begun with that, is not ended any more.
        """
        self._halt.set()
        link = self._link
        if link is not None:
            with contextlib.suppress(DriverError):  # a robot that is gone shows in ``read``
                link.ask("ALMotion", "killAll")

    def stop(self) -> None:
        """Send nothing more; on its feet the robot crouches and rests, otherwise its servos go off as it lies.

        One that is interrupted may be repeated; where nobody does, the robot rests when the program ends.
        """
        with self._stopping:
            self._halt.set()
            if self._link is not None:
                self._leaving, self._link = self._link, None
            link = self._leaving
            if self._thread is not None:
                self._thread.join(2.0)
                self._thread = None
            if link is None:
                return
            gone: DriverError | None = None
            try:
                self._let_go(link)
            except DriverError as error:
                gone = error if link.open else None  # else it is gone and cannot be told: ``read`` has said so
            link.close()
            self._leaving = None
            if gone is not None:
                raise gone

    def _let_go(self, link: NaoqiLink) -> None:
        """Crouch and rest, which takes some seconds, or go limp where the robot lies already."""
        with contextlib.suppress(DriverError):  # what follows ends all motion as well
            link.call("ALMotion", "killAll", patience=2.0)
        if posture_family(link) in ON_ITS_FEET and not self._state.fell:
            link.call("ALMotion", "rest", patience=20.0)
        else:
            link.call("ALMotion", "setStiffnesses", "Body", 0.0)

    def _wake(self, link: NaoqiLink) -> None:
        """Servos on, up, and to the posture ``stand``, unless somebody stops the robot on the way."""
        s, robot = self._settings, self._robot
        stand = np.clip(self._zeros.to_servos(robot.postures["stand"]), robot.lower, robot.upper)
        self._go_on()
        wake(link, s.stiffness, s.ramp)
        self._go_on()
        stand_up(link, s.stand_speed)
        self._go_on()
        go_to(link, self._names, stand, s.approach, self._notice)
        self._go_on()

    def _go_on(self) -> None:
        """DriverError once somebody has stopped the robot while it is being connected."""
        if self._halt.is_set():
            raise DriverError(INTERRUPTED)

    def _start_from(self, link: NaoqiLink) -> None:
        """The robot's first state, its sender, and no target."""
        self._began, self._target, self._nonsense = time.monotonic(), None, ""
        values = link.call("ALMemory", "getListData", self._keys)
        self._upright = accelerometer_sign(values)
        servos = link.call("ALMotion", "getAngles", self._names, True)
        self._state = self._sensed(servos, values)
        self._sender = NaoqiSender(link, self._robot, self._zeros, self._command, self.period)

    def _run(self, link: NaoqiLink, halt: threading.Event) -> None:
        """The robot's period: send, ask, and take the answers to what was asked before.

        Nothing ends it but the end of the connection: what cannot be understood is told in ``read``.
        """
        asked: tuple[Future[Any], Future[Any]] | None = None
        due = time.monotonic()
        while not halt.is_set() and link.open:
            try:
                if self._target is not None:
                    self._sender.send(self._target, as_known(self._state, self._now(), NEW * self.period))
                if asked is not None and all(future.done() for future in asked):
                    answers, asked = asked, None
                    self._take(*answers)
                if asked is None:
                    sensed = link.ask("ALMotion", "getAngles", self._names, True)
                    asked = sensed, link.ask("ALMemory", "getListData", self._keys)
            except DriverError:
                pass  # a robot that is gone shows in ``read``
            except Exception as error:  # an answer may be anything
                self._nonsense = f"{type(error).__name__}: {' '.join(str(error).split())}"
            due = max(due + self.period, time.monotonic())
            halt.wait(max(0.0, due - time.monotonic()))

    def _take(self, angles: Future[Any], values: Future[Any]) -> None:
        """A new state from two answers; where one failed, the old state stays and grows old."""
        if angles.exception() is None and values.exception() is None:
            self._state, self._nonsense = self._sensed(angles.result(), values.result()), ""

    def _sensed(self, servos: Any, values: Any) -> RobotState:
        planned = UPRIGHT if self._target is None else self._target.base_quat
        return state(self._now(), servos, values, self._names, self._zeros, self._upright, planned)

    def _now(self) -> float:
        return time.monotonic() - self._began
