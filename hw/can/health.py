"""What is wrong on the bus: frames are counted, and what lasts becomes a sentence that a person can read.

An alarm warns of what the robot gets over by itself, or of what may come; a fault says that it cannot be commanded.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from naoimitate.core.frames import Array
from naoimitate.hw.can.codec import FAULTS, Feedback, MotorStatus
from naoimitate.hw.can.joints import JointMap

MEMORY = 1.0
"""s that a damaged frame or a bus error stays an alarm."""
BEHIND = 0.2
"""rad at the joint that a motor may be away from where it was sent: a fast servo lags by up to half of it."""
BEHIND_TIME = 0.3
"""s that it may be further away than that without a warning."""
BLOCKED_TIME = 1.0
"""s after which it counts as blocked: a person who holds an arm for a moment ends nothing."""
BUS_OFF_BIT = 0x40
"""Of an error frame's identifier: the host's controller has left the bus (Linux, linux/can/error.h)."""


@dataclass(frozen=True)
class Counts:
    """Frames since the connection: received from motors, damaged, lost (gaps of the counters), error frames of the
    bus, unsent (refused by the bus)."""

    received: int = 0
    damaged: int = 0
    lost: int = 0
    errors: int = 0
    unsent: int = 0


class Health:
    """Judges the motors of a joint map. Times are s on one clock that the caller brings."""

    def __init__(self, joint_map: JointMap) -> None:
        self._map = joint_map
        motors = len(joint_map)
        self._received = self._damages = self._lost = self._errors = 0  # the receiving thread's
        self._unsent = 0  # the sending thread's
        self.seen = np.full(motors, -np.inf)
        self.status = [MotorStatus.OFF] * motors
        self._temperature = np.full(motors, np.nan)
        self._counter: list[int | None] = [None] * motors
        self._damaged = np.full(motors, -np.inf)
        self._near = np.full(motors, np.inf)
        self._troubles: dict[str, float] = {}
        self._ends: tuple[str, ...] = ()

    @property
    def counts(self) -> Counts:
        """Frames until now."""
        return Counts(self._received, self._damages, self._lost, self._errors, self._unsent)

    def feedback(self, feedback: Feedback, now: float) -> None:
        """Take notice of a motor's answer."""
        motor, counter, last = feedback.motor, feedback.counter, self._counter[feedback.motor]
        lost = 0 if counter is None or last is None else (counter - last - 1) % feedback.counters
        self._received += 1
        self._lost += lost
        self._counter[motor] = counter
        self.seen[motor] = now
        self.status[motor] = feedback.status
        self._temperature[motor] = feedback.temperature

    def damaged(self, motor: int, now: float) -> None:
        """Take notice of a damaged frame of a motor."""
        self._damages += 1
        self._damaged[motor] = now

    def error_frame(self, identifier: int, now: float) -> None:
        """Take notice of an error frame; identifier: its bits as Linux has them."""
        self._errors += 1
        off = bool(identifier & BUS_OFF_BIT)
        self.trouble("the CAN controller is off the bus (bus-off)" if off else "error frames on the CAN bus", now)

    def unsent(self, reason: str, now: float) -> None:
        """Take notice of frames that the bus did not take."""
        self._unsent += 1
        self.trouble(f"the CAN bus takes no commands ({reason})", now)

    def trouble(self, sentence: str, now: float) -> None:
        """Any other trouble of the bus, an alarm for a while."""
        recent = {what: when for what, when in self._troubles.items() if now - when < MEMORY}
        self._troubles = {**recent, sentence: now}  # a new one, since other threads read it

    def follow(self, error: Array | None, now: float) -> None:
        """How far (N,) rad the joints are from where they were sent; None where they need not follow."""
        if error is None:
            self._near[:] = now
        else:
            self._near[np.abs(error) <= BEHIND] = now

    def fatal(self, sentence: str) -> None:
        """What no waiting mends."""
        self._ends = (*self._ends, sentence)

    def alarms(self, now: float, driving: bool) -> tuple[str, ...]:
        """A sentence for everything that is wrong while the robot still obeys; driving: the motors shall follow."""
        return (*self._recent(now), *self._of_motors(lambda motor: self._warning(motor, now, driving)))

    def faults(self, now: float, driving: bool) -> tuple[str, ...]:
        """A sentence for everything because of which the robot does not obey any more."""
        return (*self._ends, *self._of_motors(lambda motor: self._failure(motor, now, driving), self._recent(now)))

    def _recent(self, now: float) -> tuple[str, ...]:
        return tuple(sentence for sentence, when in self._troubles.items() if now - when < MEMORY)

    def _of_motors(self, judge: Callable[[int], str | None], bus: tuple[str, ...] = ()) -> tuple[str, ...]:
        """What is wrong with each motor; in one sentence, with the trouble of the bus, where all have the same."""
        found = [judge(motor) for motor in range(len(self._map))]
        if found[0] is not None and len(set(found)) == 1:
            return (f"every motor {found[0]}" + (f" ({'; '.join(bus)})" if bus else ""),)
        return tuple(f"{self._map.title(motor)} {what}" for motor, what in enumerate(found) if what is not None)

    def _failure(self, motor: int, now: float, driving: bool) -> str | None:
        """Why a motor cannot be commanded."""
        status = self.status[motor]
        if now - self.seen[motor] > self._map.watchdog[motor]:
            return "sends damaged frames only" if now - self._damaged[motor] < MEMORY else "is silent"
        if status in FAULTS:
            return f"has switched itself off: {status.value}"
        if driving and status is not MotorStatus.FOLLOWING:
            return f"has stopped following: {status.value}"
        if driving and now - self._near[motor] > BLOCKED_TIME:
            return "does not get where it is sent"
        return None

    def _warning(self, motor: int, now: float, driving: bool) -> str | None:
        """What is worst about a motor that can still be commanded."""
        if self._failure(motor, now, driving) is not None:
            return None
        if now - self._damaged[motor] < MEMORY:
            return "sends damaged frames"
        if self._temperature[motor] >= self._map.hot[motor]:
            return f"is hot (over {self._map.hot[motor]:g} degrees)"
        if driving and now - self._near[motor] > BEHIND_TIME:
            return "is behind where it is sent"
        return None
