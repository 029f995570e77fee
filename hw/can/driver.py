"""A robot whose motors hang on a CAN bus, as a ``Driver``."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from naoimitate.calib.zeros import JointZeros
from naoimitate.core.errors import DriverError
from naoimitate.core.frames import Array, RobotCommand
from naoimitate.hw.approach import AWAY, Approach, check_arrival
from naoimitate.hw.can.bus import open_bus
from naoimitate.hw.can.bus_load import check_load
from naoimitate.hw.can.codec import Codec, Targets
from naoimitate.hw.can.codecs import make_codec
from naoimitate.hw.can.health import Counts, Health
from naoimitate.hw.can.joints import HAND, read_joint_map
from naoimitate.hw.can.link import Link
from naoimitate.hw.can.setpoint import Setpoint
from naoimitate.hw.can.startup import Startup
from naoimitate.hw.can.target import Servos, Target
from naoimitate.hw.compensation import GravityCompensation
from naoimitate.hw.driver import INTERRUPTED, RobotState
from naoimitate.hw.lean import UPRIGHT
from naoimitate.hw.spell import Spell
from naoimitate.robot.model import RobotModel

USUAL_BITRATE = 1_000_000
"""bit/s of a CAN bus in a robot, where robot.yaml says nothing: the fastest that classic CAN has."""
FAULTY = 0.3
"""s that a fault may last on the way to ``stand``."""
LATEST = 2
"""Periods that a late cycle may make up for at most."""


@dataclass(frozen=True)
class CanSettings:
    """How the driver treats the motors."""

    speed: float = 1.0
    """Share of the joint map's speeds that is used, 0 to 1."""
    ramp: float = 1.0
    """s in which the stiffness goes from 0 to full after switching on, and back before switching off."""
    patience: float = 1.0
    """s to wait for the motors' answers at the start, and for the last motor to arrive at the posture ``stand``."""
    approach: float = 0.3
    """rad/s, highest speed of the farthest joint on the way to the posture ``stand``."""


DEFAULT = CanSettings()


class CanDriver:
    """Motors on a CAN bus that follow the newest command within their speed limits, every ``period``.

    interface, channel: as python-can names them (``socketcan``, ``can0``). codec: ``dbc`` or an object that follows
    ``Codec``. compensation: add what the servos need against gravity. period: s, None = the database's cycle time.
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
        self._bitrate = int(robot.data["can"].get("bitrate", USUAL_BITRATE)) if bitrate is None else bitrate
        self.load = check_load(self._codec.traffic(self._period), self._bitrate, self._period)
        self._stand = Target(robot.postures["stand"], UPRIGHT, "D", np.full(2, np.nan))
        self._servos = Servos(self._map, GravityCompensation(robot) if compensation else None)
        self._servos.angles(self._stand, self._map.lower)  # compiles, before a robot waits for it
        self._speed = np.abs(self._map.factor) * self._map.speed * settings.speed
        self._health = Health(self._map)
        self._link: Link | None = None
        self._thread: threading.Thread | None = None
        self._halt, self._ramped = threading.Event(), threading.Event()
        self._starting, self._letting_go = False, threading.RLock()
        self._approach: Approach | None = None
        self._along = 0.0
        self._target: Target | None = None
        self._led: Target | None = None
        self._share, self._wanted, self._emergency = 0.0, 1.0, False
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
        self._halt, self._starting, self._emergency = threading.Event(), True, False
        self._health = Health(self._map)
        self._start = time.monotonic()
        try:
            link = self._link = Link(open_bus(self._interface, self._channel, self._bitrate), self._codec, self._health)
            self._switch_on(link)
            self._thread = threading.Thread(target=self._run, args=(link,), name="can", daemon=True)
            self._thread.start()
            self._starting = False
            self._go_to_stand(link)
        except BaseException:
            self._starting = False
            self.stop()
            raise

    def read(self) -> RobotState:
        """Return the newest answers of the motors; NaN for what they do not measure."""
        now = time.monotonic()
        joints = self._map
        unknown = np.full(len(joints), np.nan)
        link = self._link
        position, current = (unknown, unknown) if link is None else (link.position, link.current)
        torque = joints.scatter(current * joints.torque_constant * np.sign(joints.factor))
        torque[[follower for _, follower in joints.followers]] = 0.0
        return RobotState(
            time=now - self._start,
            q=joints.scatter(joints.from_motor(position)),
            torque=torque,
            angles=np.full(2, np.nan),
            gyro=np.full(3, np.nan),
            accelerometer=np.full(3, np.nan),
            fsr=np.full((2, 4), np.nan),
            fell=False,
            alarms=() if link is None else self._health.alarms(now, self._driving()),
            faults=() if link is None else self._health.faults(now, self._driving()),
        )

    def write(self, command: RobotCommand) -> None:
        """Replace the command that the motors are led to; DriverError for one with NaN in its joints."""
        if not np.isfinite(command.q).all():
            raise DriverError("a command with NaN among its joints was kept from the motors: send joint angles in rad")
        self._target = Target(command.q.copy(), command.base_quat, command.support, command.hand_opening)

    def soften(self, share: float) -> None:
        """Turn the stiffness down at once, or up again slowly, to a share (0 to 1) of its full value."""
        self._wanted = min(max(share, 0.0), 1.0)

    def emergency_stop(self) -> None:
        """Stop every motor where it is, at once and over everything else; only ``stop`` and ``connect`` end it."""
        self._emergency = True
        link = self._link
        if link is not None:
            link.send(self._codec.emergency_stop())
        if self._starting:
            self._halt.set()

    def stop(self) -> None:
        """Hold, let the stiffness go down to 0, and switch the motors off; may be called twice."""
        self._halt.set()
        if self._starting:  # ``connect`` sees it within a period, and lets go of what it has switched on
            return
        with self._letting_go:
            if self._thread is not None:
                self._thread.join()
                self._thread = None
            link, self._link = self._link, None
            if link is not None:
                link.close()

    def _switch_on(self, link: Link) -> None:
        """The motors follow their own positions, with as much stiffness as they already had."""
        startup = Startup(link, self._codec, self._health, self._map, self._halt, self._period, self._settings.patience)
        standing = startup.find(f"{self._interface} {self._channel}")
        startup.clear()
        self._share, self._wanted = float(standing), 1.0
        self._target = self._led = self._approach = None
        self._ramped.clear()
        try:
            startup.switch_on(self._targets)
        except BaseException:
            if not standing:  # some may follow already, without stiffness
                link.send(self._codec.disable())
            raise
        start = self._map.from_motor(link.position)
        speed = self._map.speed * self._settings.speed
        self._setpoint = Setpoint(start, self._map.lower, self._map.upper, speed)
        self._goal = start

    def _go_to_stand(self, link: Link) -> None:
        """Lead the motors to the posture ``stand`` once they are stiff; hands stay where they are."""
        self._await(self._ramped.is_set, self._settings.ramp + self._settings.patience)
        goal = self._servos.angles(self._stand, self._setpoint.angles)
        speed = np.minimum(self._settings.approach, self._map.speed * self._settings.speed)
        way = Approach(self._setpoint.angles, np.clip(goal, self._map.lower, self._map.upper), speed)
        if way.far:
            self._notice(way.notice)
        self._along, self._approach = 0.0, way

        def away() -> Array:
            error = np.abs(goal - self._map.from_motor(link.position))
            return np.where(self._map.joint == HAND, 0.0, error)

        self._await(lambda: self._along >= way.duration, 2.0 * way.duration + self._settings.patience)
        self._await(lambda: bool((away() <= AWAY).all()), self._settings.patience)
        check_arrival([self._map.title(motor) for motor in range(len(self._map))], away())
        self._approach = None

    def _await(self, true: Callable[[], bool], patience: float) -> None:
        """Wait while the sending thread works; DriverError when somebody stops the robot, or a fault lasts."""
        now = time.monotonic()
        end, faulty = now + patience, Spell(now)
        while not true() and now < end:
            if self._halt.wait(self._period) or self._emergency:
                raise DriverError(INTERRUPTED)
            now = time.monotonic()
            faults = self._health.faults(now, driving=True)
            if faulty.look(bool(faults), now) > FAULTY:
                raise DriverError(f"{'; '.join(faults)}: the robot did not come to its stand posture")

    def _run(self, link: Link) -> None:
        """The sending thread: a cycle every period, then the way to rest."""
        try:
            last = due = time.monotonic()
            while not self._halt.is_set():
                now = time.monotonic()
                self._cycle(link, now, min(now - last, LATEST * self._period))
                last, due = now, due + self._period
                if due < time.monotonic():  # too late: what was missed is not made up in a hurry
                    due = now + self._period
                self._halt.wait(max(0.0, due - time.monotonic()))
            self._rest(link)
        except Exception as error:
            self._health.fatal(f"the driver's thread has ended ({error!r})")
            raise

    def _cycle(self, link: Link, now: float, dt: float) -> None:
        """Send the next setpoint on the way to the newest command."""
        if self._emergency:
            link.send(self._codec.emergency_stop())  # again, for a motor that missed it
        else:
            self._lead(dt)
        self._share = min(self._wanted, self._share + dt / self._settings.ramp)
        angles = self._setpoint.angles
        link.send([*self._codec.heartbeat(), *self._codec.command(self._targets(self._map.to_motor(angles)))])
        if self._share >= self._wanted:
            self._ramped.set()
        soft = self._share < 1.0 or self._emergency
        self._health.follow(None if soft else angles - self._map.from_motor(link.position), now)

    def _lead(self, dt: float) -> None:
        """Move the setpoint on its way to ``stand``, later towards the newest command; without one it stays."""
        way, target = self._approach, self._target
        if way is not None:
            self._along += dt
            self._setpoint.angles = way.at(self._along)
            return
        if target is None:
            return
        if target is not self._led:
            self._goal, self._led = self._servos.angles(target, self._setpoint.angles), target
        self._setpoint.step(self._goal, dt)

    def _targets(self, position: Array) -> Targets:
        """Targets at motor positions (N,) rad with the speed limits and the stiffness of the moment."""
        return Targets(position, self._speed, np.full(len(position), self._share))

    def _rest(self, link: Link) -> None:
        """Hold where the motors were sent last while the stiffness goes down, then switch them off."""
        position = self._map.to_motor(self._setpoint.angles)
        self._share = min(self._share, self._wanted)
        last = time.monotonic()
        while self._share > 0.0:
            link.send([*self._codec.heartbeat(), *self._codec.command(self._targets(position))])
            time.sleep(self._period)
            now = time.monotonic()
            self._share -= (now - last) / self._settings.ramp
            last = now
        for _ in range(3):  # a lost frame must not leave a motor on
            link.send([*self._codec.heartbeat(), *self._codec.disable()])
            time.sleep(self._period)

    def _driving(self) -> bool:
        return self._thread is not None and not self._halt.is_set()
