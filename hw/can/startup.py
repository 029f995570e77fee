"""From an open bus to motors that follow: find every motor, clear what is left of the last time, switch on in place."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import can
import numpy as np

from naoimitate.core.errors import DriverError
from naoimitate.core.frames import Array
from naoimitate.hw.can.codec import FAULTS, Codec, MotorStatus, Targets
from naoimitate.hw.can.health import Health
from naoimitate.hw.can.joints import JointMap
from naoimitate.hw.can.link import Link
from naoimitate.hw.driver import INTERRUPTED


class Startup:
    """One attempt to switch the motors on; period: s between frames, patience: s that a step may take.

    halt: ends it within a period, with a DriverError.
    """

    def __init__(
        self,
        link: Link,
        codec: Codec,
        health: Health,
        joint_map: JointMap,
        halt: threading.Event,
        period: float,
        patience: float,
    ) -> None:
        self._link, self._codec, self._health, self._map = link, codec, health, joint_map
        self._halt, self._period, self._patience = halt, period, patience

    def find(self, where: str) -> bool:
        """Wait until every motor has answered; returns whether they already carry the robot.

        where: the bus, for the message. DriverError names the motors that do not answer, or says what answers instead.
        """
        seen = self._health.seen
        if not self._repeat(self._codec.ask, lambda: bool(np.isfinite(seen).all())):
            raise DriverError(self._nobody(where) if np.isinf(seen).all() else self._missing(where))
        return all(status is MotorStatus.HOLDING for status in self._health.status)

    def clear(self) -> None:
        """Reset motors that an emergency stop or a fault holds; DriverError names those that stay faulty."""
        latched = (MotorStatus.STOPPED, *FAULTS)
        if not any(status in latched for status in self._health.status):
            return
        if not self._repeat(self._codec.disable, lambda: not any(s in latched for s in self._health.status)):
            names = self._names([s in latched for s in self._health.status])
            raise DriverError(f"{names}: the fault does not go away; let them cool down, look for what blocks them")

    def switch_on(self, targets: Callable[[Array], Targets]) -> None:
        """Switch all motors on; targets: what to send to motors at the positions (N,) that they read just then."""

        def frames() -> list[can.Message]:
            return self._codec.enable(targets(self._link.position.copy()))

        def following() -> list[bool]:
            return [status is MotorStatus.FOLLOWING for status in self._health.status]

        if not self._repeat(frames, lambda: all(following())):
            names = self._names([not follows for follows in following()])
            raise DriverError(f"{names}: cannot be switched on; check its supply and what it reports")

    def _repeat(self, frames: Callable[[], list[can.Message]], done: Callable[[], bool]) -> bool:
        """Send frames every period until it is done, or the patience is at its end."""
        end = time.monotonic() + self._patience
        while time.monotonic() < end:
            if self._halt.is_set():
                raise DriverError(INTERRUPTED)
            self._link.send([*self._codec.heartbeat(), *frames()])
            self._halt.wait(self._period)
            if done():
                return True
        return False

    def _nobody(self, where: str) -> str:
        if self._health.counts.damaged or self._link.strange:
            return (
                f"what answers on {where} does not fit the CAN database ({self._health.counts.damaged} damaged and "
                f"{self._link.strange} unknown frames): give the database of these motors"
            )
        return (
            f"no motor answers on {where}: check the power, the wiring, the channel, the bit rate and the ids "
            "(or start simulated motors: naoimitate can-stub)"
        )

    def _missing(self, where: str) -> str:
        names = self._names(list(np.isinf(self._health.seen)))
        return f"{names}: no answer on {where}; check power and wiring there, and the ids in robot.yaml"

    def _names(self, chosen: list[bool]) -> str:
        return ", ".join(self._map.title(motor) for motor, these in enumerate(chosen) if these)
