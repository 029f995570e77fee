"""One simulated motor: a position servo with a watchdog. It knows no frames, and its clock is handed in."""

from __future__ import annotations

from naoimitate.hw.can.stub_faults import StubFault

TIMEOUT = 0.1
"""s without a valid command or without the host's heartbeat after which a motor holds where it is."""
AMBIENT = 30.0
"""deg C of a motor at rest."""
WARMING = 20.0
"""deg C per s of a motor with the fault hot."""
TOO_HOT = 90.0
"""deg C at which a motor switches itself off."""
ABSENCE = 1.0
"""s that a motor stays away after bus-off. A real one may come back after 128 times 11 recessive bits (ISO 11898-1)."""


class StubMotor:
    """A motor at ``position`` rad that can turn at ``fastest`` rad/s; times are s since the start of the simulation."""

    def __init__(self, position: float, fastest: float) -> None:
        self.position = position
        self.speed = 0.0
        self.status = "off"
        self.stiffness = 0.0
        self.temperature = AMBIENT
        self.faults: list[StubFault] = []
        self._fastest = fastest
        self._target = position
        self._limit = 0.0
        self._time = self._fed = self._heard = 0.0

    def has(self, kind: str, now: float) -> bool:
        """Whether a fault is there; one of bus-off is over after its absence."""
        return any(
            fault.kind == kind and fault.start <= now and (kind != "bus-off" or now < fault.start + ABSENCE)
            for fault in self.faults
        )

    def advance(self, now: float) -> None:
        """Live until ``now``: move, warm up, and hold from the moment at which the watchdog bites."""
        bite = min(self._fed, self._heard) + TIMEOUT
        if self.has("bus-off", now):
            self.status, self.stiffness = "off", 0.0
        self._move(min(now, bite))
        if self.status == "following" and now > bite:
            self.status = "holding"
        if self.status != "following":
            self.speed = 0.0
        if self.has("hot", now):
            self.temperature += WARMING * (now - self._time)
        if self.temperature >= TOO_HOT:
            self.status, self.stiffness = "hot", 0.0
        self._time = now

    def heartbeat(self, now: float) -> None:
        """The host lives."""
        self.advance(now)
        self._heard = now

    def command(self, mode: str, position: float, limit: float, stiffness: float, now: float) -> None:
        """Obey a valid command: mode ``ask``, ``off`` or ``follow``; rad, rad/s, share of the full stiffness."""
        self.advance(now)
        if mode == "off":
            self.status, self.stiffness = ("hot" if self.temperature >= TOO_HOT else "off"), 0.0
        elif mode == "follow" and (self.status in ("following", "holding") or (self.status == "off" and not stiffness)):
            self.status = "following"
            self._target, self._limit, self.stiffness, self._fed = position, limit, stiffness, now
        elif mode == "follow" and self.status == "stopped":
            self.stiffness = min(self.stiffness, stiffness)  # it may be let down, but not moved

    def emergency_stop(self, now: float) -> None:
        """Hold where it is until mode off."""
        self.advance(now)
        if self.status in ("following", "holding"):
            self.status = "stopped"
            self.speed = 0.0

    def _move(self, until: float) -> None:
        """Turn towards the target, never faster than commanded or possible; a limp or stuck motor stays."""
        dt = until - self._time
        if dt <= 0.0:
            return
        free = self.status == "following" and self.stiffness > 0.0 and not self.has("stuck", until)
        reach = min(self._limit, self._fastest) * dt if free else 0.0
        step = min(max(self._target - self.position, -reach), reach)
        self.position += step
        self.speed = step / dt
