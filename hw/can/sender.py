"""What motors on a CAN bus are sent: a setpoint every period for as long as they are held, then the way to rest."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass

import numpy as np

from naoimitate.core.frames import Array
from naoimitate.hw.approach import Approach
from naoimitate.hw.can.codec import Codec, Targets
from naoimitate.hw.can.health import Health
from naoimitate.hw.can.joints import JointMap
from naoimitate.hw.can.link import Link
from naoimitate.hw.can.senses import sensed
from naoimitate.hw.can.setpoint import Setpoint
from naoimitate.hw.driver import RobotState
from naoimitate.hw.target import ServoCommand, Target

LATEST = 2
"""Periods that a late cycle may make up for at most."""
UNKNOWN = np.full(2, np.nan)
"""Openings of hands without a command."""


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


class Sender:
    """One connection's N motors, led to ``target``, or along ``way`` while there is one, by a thread of its own.

    servos: from a target to the servos' angles. period: s between two frames to a motor. ``halt`` ends it; ``rested``
    is set while no thread runs, ``ramped`` once the stiffness is as ``wanted`` (a share of the full one, 0 to 1).
    """

    def __init__(
        self,
        link: Link,
        codec: Codec,
        health: Health,
        joint_map: JointMap,
        servos: ServoCommand,
        period: float,
        settings: CanSettings,
    ) -> None:
        self.link, self._codec, self._health, self._map = link, codec, health, joint_map
        self._servos, self._period, self._ramp = servos, period, settings.ramp
        self.speed = joint_map.speed * settings.speed
        self.halt, self.ramped, self.rested = threading.Event(), threading.Event(), threading.Event()
        self.rested.set()
        self.started = False
        self.target: Target | None = None
        self.way: Approach | None = None
        self.along = 0.0
        self.share, self.wanted = 0.0, 1.0
        self._emergency = False
        self._began = time.monotonic()

    @property
    def driving(self) -> bool:
        """Whether the motors shall follow."""
        return self.started and not self.halt.is_set()

    @property
    def stopped(self) -> bool:
        """Whether somebody has ended the connection."""
        return self.halt.is_set() or self._emergency

    def sense(self) -> RobotState:
        """What the motors have answered last."""
        return sensed(self._map, time.monotonic() - self._began, self.link.position, self.link.current)

    def targets(self, position: Array) -> Targets:
        """Targets at motor positions (N,) rad with the speed limits and the stiffness of the moment."""
        return Targets(position, np.abs(self._map.factor) * self.speed, np.full(len(position), self.share))

    def goal(self, target: Target) -> Array:
        """Joint angles (N,) rad that the motors must be sent to end up at a target; a hand without a command stays."""
        opening = UNKNOWN if target.hand_opening is None else target.hand_opening
        angles = self._map.gather(self._servos(target, self.sense()), opening)
        angles = np.where(np.isnan(angles), self.setpoint.angles, angles)
        return np.asarray(np.clip(angles, self._map.lower, self._map.upper))

    def start(self) -> None:
        """Begin to send, from where the motors are; they follow already."""
        here = self._map.from_motor(self.link.position)
        self.setpoint = Setpoint(here, self._map.lower, self._map.upper, self.speed)
        self.rested.clear()
        self.started = True
        threading.Thread(target=self._run, name="can", daemon=True).start()

    def go(self, way: Approach) -> None:
        """Lead the motors along a way; it is over when ``along``, s, has reached its duration."""
        self.along, self.way = 0.0, way

    def emergency_stop(self) -> None:
        """Stop every motor where it is, and go on telling them so."""
        self._emergency = True
        self.link.send(self._codec.emergency_stop())
        if not self.started:
            self.halt.set()

    def _run(self) -> None:
        """A cycle every period, then the way to rest."""
        try:
            last = due = time.monotonic()
            while not self.halt.is_set():
                now = time.monotonic()
                self._cycle(now, min(now - last, LATEST * self._period))
                last, due = now, due + self._period
                if due < time.monotonic():  # too late: what was missed is not made up in a hurry
                    due = now + self._period
                self.halt.wait(max(0.0, due - time.monotonic()))
            self._rest()
        except Exception as error:
            self._health.fatal(f"the driver's thread has ended ({error!r})")
            raise
        finally:
            self.rested.set()

    def _cycle(self, now: float, dt: float) -> None:
        """Send the next setpoint."""
        if self._emergency:
            self.link.send(self._codec.emergency_stop())  # again, for a motor that missed it
        else:
            self._lead(dt)
        self.share = min(self.wanted, self.share + dt / self._ramp)
        angles = self.setpoint.angles
        self.link.send([*self._codec.heartbeat(), *self._codec.command(self.targets(self._map.to_motor(angles)))])
        if self.share >= self.wanted:
            self.ramped.set()
        soft = self.share < 1.0 or self._emergency
        self._health.follow(None if soft else angles - self._map.from_motor(self.link.position), now)

    def _lead(self, dt: float) -> None:
        """Move the setpoint along its way, or towards the newest target; without one it stays."""
        way, target = self.way, self.target
        if way is not None:
            self.along += dt
            self.setpoint.angles = way.at(self.along)
        elif target is not None:
            self.setpoint.step(self.goal(target), dt)

    def _rest(self) -> None:
        """Hold where the motors were sent last while the stiffness goes down, then switch them off."""
        position = self._map.to_motor(self.setpoint.angles)
        self.share = min(self.share, self.wanted)
        last = time.monotonic()
        while self.share > 0.0:
            self.link.send([*self._codec.heartbeat(), *self._codec.command(self.targets(position))])
            time.sleep(self._period)
            now = time.monotonic()
            self.share -= (now - last) / self._ramp
            last = now
        for _ in range(3):  # a lost frame must not leave a motor on
            self.link.send([*self._codec.heartbeat(), *self._codec.disable()])
            time.sleep(self._period)
