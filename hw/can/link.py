"""The bus with the motors on it: frames go out, and a thread of python-can keeps what the motors answer."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable

import can
import numpy as np

from naoimitate.hw.can.codec import Codec, CorruptFrame
from naoimitate.hw.can.health import Health

PATIENCE = 0.05
"""s between two looks at a bus that cannot be read, so that a broken one does not take a core."""
RECEIVE_TIMEOUT = 0.1
"""s after which the receiving thread looks whether it shall end."""


class Link(can.Listener):
    """Newest answers of the N motors, in motor units: position, speed, current, (N,) each, NaN before the first."""

    def __init__(self, bus: can.BusABC, codec: Codec, health: Health) -> None:
        self.position, self.speed, self.current = np.full((3, len(health.seen)), np.nan)
        self.strange = 0
        """Frames that were neither a motor's nor our own kind."""
        self._bus, self._codec, self._health = bus, codec, health
        self._sending = threading.RLock()  # an emergency stop may come from a signal handler
        self._ours: set[int] = set()
        self._notifier = can.Notifier(bus, [self], timeout=RECEIVE_TIMEOUT)

    def send(self, frames: Iterable[can.Message]) -> None:
        """Hand frames to the bus; what it does not take is counted, and the rest goes on."""
        with self._sending:
            for frame in frames:
                self._ours.add(frame.arbitration_id)
                try:
                    self._bus.send(frame)
                except (can.CanError, OSError) as error:
                    self._health.unsent(" ".join(str(error).split()), time.monotonic())

    def on_message_received(self, msg: can.Message) -> None:
        """Keep what a motor answers (called by python-can's thread)."""
        now = time.monotonic()
        if msg.is_error_frame:
            self._health.error_frame(msg.arbitration_id, now)
            return
        try:
            feedback = self._codec.decode(msg)
        except CorruptFrame as error:
            self._health.damaged(error.motor, now)
            return
        if feedback is None:
            self.strange += msg.arbitration_id not in self._ours  # some interfaces return our own frames
            return
        self.position[feedback.motor] = feedback.position
        self.speed[feedback.motor] = feedback.speed
        self.current[feedback.motor] = feedback.current
        self._health.feedback(feedback, now)

    def on_error(self, exc: Exception) -> None:
        """The bus cannot be read at the moment (called by python-can's thread)."""
        self._health.trouble(f"the CAN bus cannot be read ({' '.join(str(exc).split())})", time.monotonic())
        time.sleep(PATIENCE)

    def close(self) -> None:
        """Stop listening and close the bus."""
        self._notifier.stop()
        self._bus.shutdown()
