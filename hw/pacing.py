"""A plan that waits for the robot: after commands were lost, servos take it up where they are, not where it would be.

Commands that do not arrive leave the servos where they are while the plan goes on, and the first one that arrives again
is a jump: in the middle of a shift of weight it throws the body over. So when the legs stand still that were sent
somewhere else, the plan goes back to where they still followed it, and waits there until they move; then it goes on,
from rest as they do, and a little faster until it has caught up.

What is sent is always a posture of the plan, at most ``most`` s old.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from naoimitate.core.frames import SIDES, Array
from naoimitate.hw.driver import RobotState
from naoimitate.hw.target import ServoCommand, Target
from naoimitate.robot.model import RobotModel


@dataclass(frozen=True)
class PacingSettings:
    """When the plan waits, and how it goes on."""

    lag: float = 0.06
    """[s] by which servos follow what they are sent at most, by their own lag and that of the line."""
    watched: float = 0.08
    """[s] of motion that is compared..."""
    sent: float = 0.02
    """...and the least of it, [rad] as a norm over the legs and whatever the lag, that tells anything..."""
    follows: float = 0.4
    """...and the share of it that legs do at least."""
    moves: float = 0.015
    """[rad] likewise, by which legs that stood still must move before the plan goes on."""
    lead: float = 0.04
    """[s] before it showed that the legs stand still: the place of the plan from where they take it up."""
    most: float = 0.3
    """[s] Longest that the plan is behind, and that it waits."""
    back: float = 1.0
    """Speed at which the plan goes back, as a share of its own."""
    ahead: float = 0.05
    """By how much faster than itself it goes while it catches up, likewise."""
    ramp: float = 0.1
    """[s] in which it gets from rest to its own speed."""


DEFAULT = PacingSettings()


class Pacing:
    """A ``ServoCommand`` around another one, which gets the plan when the robot is ready for it.

    period: s between two calls. From a state that is not known the plan just catches up.
    """

    def __init__(
        self, robot: RobotModel, inner: ServoCommand, period: float, settings: PacingSettings = DEFAULT
    ) -> None:
        self.inner, self._period, self._s = inner, period, settings
        self._legs = np.array([j for side in SIDES for j in robot.chains[f"{side}_leg"]])
        self._lag, self._watched = max(1, round(settings.lag / period)), max(1, round(settings.watched / period))
        self._plan: deque[Target] = deque(maxlen=2 + round(settings.most / period))
        self._sent: deque[Array] = deque(maxlen=self._lag + self._watched)
        self._seen: deque[Array] = deque(maxlen=self._watched + 1)
        self._time, self._waited, self._speed = -np.inf, 0.0, 1.0
        self._stood: Array | None = None
        self.behind = 0.0
        """[s] by which what is sent is behind the plan."""

    def __call__(self, target: Target, state: RobotState) -> Array:
        """Servo angles (J,) rad for the target, or for one of a little ago."""
        s, period = self._s, self._period
        self._plan.appendleft(target)
        if self._waits(state):
            self._waited += period
            before, most = self.behind, max(s.most - 0.5 * s.ramp, self.behind)
            wanted = max(s.lead + self._waited, before + period)
            self.behind = min(before + (1.0 + s.back) * period, wanted, most)
            self._speed = max(1.0 - (self.behind - before) / period, 0.0)
        else:
            self._waited = 0.0
            self._speed = min(self._speed + period / s.ramp, 1.0 + s.ahead if self.behind > 0.0 else 1.0)
            self.behind = min(max(self.behind + (1.0 - self._speed) * period, 0.0), s.most)
        sent = self._at(self.behind)._replace(time=math.nan if self._waited else target.time)
        self._sent.appendleft(sent.q[self._legs])
        return self.inner(sent, state)

    def _waits(self, state: RobotState) -> bool:
        """Whether the legs stand still although they were sent somewhere else."""
        s, q = self._s, state.q[self._legs]
        known = state.time > self._time and bool(np.isfinite(q).all())
        self._time = max(self._time, state.time) if np.isfinite(state.time) else self._time
        if not known:
            self._seen.clear()
            self._stood = None
            return False
        self._seen.appendleft(q)
        if self._stood is not None:
            if np.linalg.norm(q - self._stood) > s.moves or self._waited >= s.most:
                self._stood = None
                self._seen.clear()
        elif len(self._sent) == self._sent.maxlen and len(self._seen) == self._seen.maxlen:
            path = np.stack(self._sent)
            sent = float(np.linalg.norm(path[: self._lag] - path[-self._lag :], axis=1).min())
            moved = float(np.linalg.norm(np.stack(self._seen) - q, axis=1).max())
            if sent > s.sent and moved < s.follows * sent:
                self._stood = q
        return self._stood is not None

    def _at(self, ago: float) -> Target:
        """The target of so many s ago."""
        frame, part = divmod(ago / self._period, 1.0)
        newer, older = (self._plan[min(int(frame) + k, len(self._plan) - 1)] for k in (0, 1))
        if not part:
            return newer
        turned = np.copysign(1.0, newer.base_quat @ older.base_quat) * older.base_quat
        quat = newer.base_quat + part * (turned - newer.base_quat)
        return newer._replace(
            q=newer.q + part * (older.q - newer.q),
            base_pos=newer.base_pos + part * (older.base_pos - newer.base_pos),
            base_quat=quat / np.linalg.norm(quat),
        )
