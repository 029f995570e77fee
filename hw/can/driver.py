"""A robot whose motors hang on a CAN bus, as a ``Driver``."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from naoimitate.calib.zeros import JointZeros
from naoimitate.core.errors import DriverError
from naoimitate.core.frames import Array, RobotCommand
from naoimitate.hw.approach import AWAY, Approach, check_arrival
from naoimitate.hw.can.bus import bitrate_of, open_bus
from naoimitate.hw.can.bus_load import check_load
from naoimitate.hw.can.codec import Codec
from naoimitate.hw.can.codecs import make_codec
from naoimitate.hw.can.health import Counts, Health
from naoimitate.hw.can.joints import HAND, read_joint_map
from naoimitate.hw.can.link import Link
from naoimitate.hw.can.sender import CanSettings, Sender
from naoimitate.hw.can.senses import sensed
from naoimitate.hw.can.startup import Startup
from naoimitate.hw.driver import INTERRUPTED, RobotState
from naoimitate.hw.lean import UPRIGHT
from naoimitate.hw.servo_command import servo_command
from naoimitate.hw.spell import Spell
from naoimitate.hw.target import Target, target_of
from naoimitate.robot.model import RobotModel

FAULTY = 0.3
"""s that a fault may last on the way to ``stand``."""
DEFAULT = CanSettings()


class CanDriver:
    """Motors on a CAN bus that follow the newest command within their speed limits, every ``period``.

    interface, channel: as python-can names them (``socketcan``, ``can0``). codec: ``dbc`` or an object that follows
    ``Codec``. compensation: add what the servos need under their load. period: s, None = the database's cycle time.
    bitrate: bit/s, None = robot.yaml's. database: DBC file instead of the robot's own. zeros: how far this
    specimen's encoders are off. notice: told, a sentence each, what the operator should know beforehand.
    Raises DriverError where robot.yaml, database and bus load do not allow driving.
    """

    def __init__(
        self,
        robot: RobotModel,
        *,
        interface: str = "socketcan",
        channel: str = "can0",
        codec: str | Codec = "dbc",
        compensation: bool = True,
        period: float | None = None,
        bitrate: int | None = None,
        database: Path | None = None,
        zeros: JointZeros | None = None,
        settings: CanSettings = DEFAULT,
        notice: Callable[[str], None] = lambda sentence: None,
    ) -> None:
        self._interface, self._channel, self._settings, self._notice = interface, channel, settings, notice
        self._map = read_joint_map(robot, zeros)
        self._codec = make_codec(codec, robot, self._map, database) if isinstance(codec, str) else codec
        self._period = self._codec.period if period is None else period
        self._bitrate = bitrate_of(robot) if bitrate is None else bitrate
        self.load = check_load(self._codec.traffic(self._period), self._bitrate, self._period)
        self._stand = Target(robot.postures["stand"], np.zeros(3), UPRIGHT, "D")
        stiffness = self._map.scatter(self._map.stiffness) if compensation else None
        self._servos = servo_command(robot, stiffness, self._period)
        self._health = Health(self._map)
        self._sender: Sender | None = None
        self._letting_go = threading.RLock()
        self._start = time.monotonic()

    @property
    def period(self) -> float:
        """Time between two frames to a motor, s."""
        return self._period

    @property
    def counts(self) -> Counts:
        """Frames received, damaged, lost and unsent since ``connect``."""
        return self._health.counts

    def connect(self) -> None:
        """Find every motor, switch on where it is, raise the stiffness, and lead the robot slowly to ``stand``.

        A robot that still holds itself, because its last host died, keeps its stiffness. After an emergency stop the
        motors are off for a moment: hold the robot. ``stop`` and ``emergency_stop`` from another thread or a signal
        handler end it at once. Raises DriverError when the bus or a motor cannot be used, and names the motors that do
        not arrive; the robot is let go of then.
        """
        self.stop()
        self._health, self._start = Health(self._map), time.monotonic()
        link = Link(open_bus(self._interface, self._channel, self._bitrate), self._codec, self._health)
        sender = Sender(link, self._codec, self._health, self._map, self._servos, self._period, self._settings)
        self._sender = sender  # from here on ``stop`` has something to stop
        try:
            self._switch_on(sender)
            sender.start()
            self._go_to_stand(sender)
        except BaseException:
            self._end(sender)
            raise

    def read(self) -> RobotState:
        """Return the newest answers of the motors; NaN for what they do not measure."""
        sender = self._sender
        if sender is None:
            unknown = np.full(len(self._map), np.nan)
            return sensed(self._map, time.monotonic() - self._start, unknown, unknown)
        now, state = time.monotonic(), sender.sense()
        alarms, faults = (judge(now, sender.driving) for judge in (self._health.alarms, self._health.faults))
        return replace(state, alarms=alarms, faults=faults)

    def write(self, command: RobotCommand) -> None:
        """Replace the command that the motors are led to; DriverError for one with NaN in its joints."""
        if not np.isfinite(command.q).all():
            raise DriverError("a command with NaN among its joints was kept from the motors: send joint angles in rad")
        if self._sender is not None:
            self._sender.target = target_of(command)._replace(q=command.q.copy())

    def soften(self, share: float) -> None:
        """Turn the stiffness down at once, or up again slowly, to a share (0 to 1) of its full value."""
        if self._sender is not None:
            self._sender.wanted = min(max(share, 0.0), 1.0)

    def emergency_stop(self) -> None:
        """Stop every motor where it is, stiff, at once and over everything else; ``stop`` lets go of them."""
        if self._sender is not None:
            self._sender.emergency_stop()

    def stop(self) -> None:
        """Hold while the stiffness goes down to 0 within ``ramp`` s, then switch the motors off: hold the robot.

        May be called twice; one that is interrupted goes on by itself.
        """
        sender = self._sender
        if sender is None:
            return
        sender.halt.set()
        if sender.started:  # otherwise ``connect`` sees it within a period, and lets go of what it has switched on
            self._end(sender)

    def _end(self, sender: Sender) -> None:
        """Wait until the motors are at rest, and close the bus."""
        sender.halt.set()
        with self._letting_go:
            sender.rested.wait()
            if self._sender is sender:
                sender.link.close()
                self._sender = None

    def _switch_on(self, sender: Sender) -> None:
        """The motors follow their own positions, with as much stiffness as they already had."""
        link, patience = sender.link, self._settings.patience
        startup = Startup(link, self._codec, self._health, self._map, sender.halt, self._period, patience)
        standing = startup.find(f"{self._interface} {self._channel}")
        startup.clear()
        sender.share = float(standing)
        try:
            startup.switch_on(sender.targets)
        except BaseException:
            if not standing:  # some may follow already, without stiffness
                link.send(self._codec.disable())
            raise

    def _go_to_stand(self, sender: Sender) -> None:
        """Lead the motors to the posture ``stand`` once they are stiff; hands stay where they are."""
        self._await(sender, sender.ramped.is_set, self._settings.ramp + self._settings.patience)
        goal = sender.goal(self._stand)
        way = Approach(sender.setpoint.angles, goal, np.minimum(self._settings.approach, sender.speed))
        if way.far:
            self._notice(way.notice)
        sender.go(way)

        def away() -> Array:
            error = np.abs(goal - self._map.from_motor(sender.link.position))
            return np.where(self._map.joint == HAND, 0.0, error)

        self._await(sender, lambda: sender.along >= way.duration, 2.0 * way.duration + self._settings.patience)
        self._await(sender, lambda: bool((away() <= AWAY).all()), self._settings.patience)
        check_arrival([self._map.title(motor) for motor in range(len(self._map))], away())
        sender.way = None

    def _await(self, sender: Sender, true: Callable[[], bool], patience: float) -> None:
        """Wait while the motors are sent for; DriverError when somebody stops the robot, or a fault lasts."""
        now = time.monotonic()
        end, faulty = now + patience, Spell(now)
        while not true() and now < end:
            sender.halt.wait(self._period)
            if sender.stopped:
                raise DriverError(INTERRUPTED)
            now = time.monotonic()
            faults = self._health.faults(now, driving=True)
            if faulty.look(bool(faults), now) > FAULTY:
                raise DriverError(f"{'; '.join(faults)}: the robot did not come to its stand posture")
