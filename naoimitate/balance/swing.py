"""The swing foot's way: straight up off the floor, free, over its landing place, straight down."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from naoimitate.core.geometry import heading, matrix_from_rotation_vector, rotation_vector, yaw_matrix
from naoimitate.limits import braking_speed

Array = npt.NDArray[np.float64]

OVERHEAD = 0.001
"""[m] by which a foot may be lower than its way to the landing place asks, so that bound and way never fight."""


SINKING = 0.4
"""Share of the way down that it was asked for with which a foot still comes down: half a step does."""


class Phase(enum.Enum):
    """Parts of a swing."""

    LIFT = "lift"
    FREE = "free"
    APPROACH = "approach"
    DESCEND = "descend"


@dataclass(frozen=True)
class SwingSettings:
    """Shape and pace of a step."""

    clearance: float = 0.015
    """[m] of the sole's lowest point above the floor while it swings, at least."""
    lift_height: float = 0.010
    """[m] of straight lift before the foot may move sideways or tilt."""
    lift_speed: float = 0.12
    """[m/s] straight up."""
    approach_speed: float = 0.2
    """[m/s] over the floor to the landing place."""
    descend_speed: float = 0.06
    """[m/s] straight down, at most."""
    touch_speed: float = 0.01
    """[m/s] at the floor."""
    touch_height: float = 0.0004
    """[m] above the floor at which the foot counts as carrying: servos that sag bring it down a moment early."""
    lift_acceleration: float = 2.0
    """[m/s^2] straight up."""
    approach_acceleration: float = 1.0
    """[m/s^2] over the floor."""
    descend_acceleration: float = 1.0
    """[m/s^2] down: a soft end, after which the robot does not sway."""
    turn_speed: float = 2.0
    """[rad/s]."""
    turn_acceleration: float = 12.0
    """[rad/s^2]."""
    level_speed: float = 0.1
    """[rad/s] at which the last tilt goes while the foot comes down."""
    level_height: float = 0.006
    """[m] below which the foot does not come before it is level."""
    patience: float = 1.5
    """[s] of approach after which a foot that does not arrive may come down near its place."""
    yielding: float = 0.015
    """[m] by which the distance that is near enough grows while it gives way."""
    hover: float = 0.2
    """[s] over the landing place before the foot goes down: what sways comes to rest."""
    hover_height: float = 0.007
    """[m] over the floor: a leg that is stretched there has brought the body down with it, and not while it lands."""
    close: float = 0.02
    """[m] from the landing place, over the floor, within which the foot comes down to hover."""
    blocked: float = 0.2
    """[s] of steps refused, or of next to no way, after which a foot that comes down goes up again."""
    settled: float = 0.02
    """[m/s] below which a foot over its landing place goes down."""
    arrived: float = 0.001
    """[m] and [rad * 0.1 m]: the foot is over its landing place, close enough to go straight down."""


class Swing:
    """One swing, from lift-off to touchdown: gives the sole pose to ask for in each frame.

    position (3,) m and rotation (3, 3): the planted sole at lift-off.
    """

    def __init__(self, position: Array, rotation: Array, settings: SwingSettings) -> None:
        self.phase = Phase.LIFT
        self.settings = settings
        self.min_height = 0.0
        self._velocity, self._turning = np.zeros(3), 0.0
        self._waited, self._hovered = 0.0, 0.0
        self._blocked, self._asked, self._refused = 0.0, 0.0, False
        self._before = position.copy()
        self._start = position.copy()
        self._rotation = rotation.copy()

    def step(
        self, position: Array, rotation: Array, goal: Array, goal_yaw: float, landing: bool, dt: float
    ) -> tuple[Array, Array, bool]:
        """The sole pose to ask for next.

        position, rotation: the sole as it is. goal (2,) m, goal_yaw rad: where it is to land, used once ``landing``.
        Returns position (3,), rotation (3, 3), and whether it has touched down.
        """
        moved, self._before = position - self._before, position.copy()
        self._blocked, self._refused = self._blocked + dt if self._refused else 0.0, False
        if self.phase is Phase.LIFT:
            return self._lift(position, dt)
        if not landing:
            self.phase = Phase.FREE
            self.min_height = min(self.settings.clearance, self.min_height + self.settings.lift_speed * dt)
            self._velocity, self._turning, self._waited = moved / dt, 0.0, 0.0
            return position, yaw_matrix(goal_yaw), False
        if self.phase is Phase.DESCEND:
            self._sink(-moved[2], dt)
            self._waited += dt if self._blocked > 0.0 else 0.0
            if self._blocked < self.settings.blocked:
                return self._descend(position, rotation, dt)
            self._blocked, self._hovered, self.min_height = 0.0, 0.0, min(self.min_height, float(position[2]))
        return self._approach(position, rotation, moved, goal, goal_yaw, dt)

    def _sink(self, way: float, dt: float) -> None:
        """The foot came down by ``way`` m in the last dt s; where its leg is in the way, by less than was asked."""
        if way < SINKING * self._asked - 1e-6:
            self._velocity[2], self._refused = -max(way, 0.0) / dt, True

    def stop(self) -> None:
        """The last step was not taken: start again from rest."""
        self._velocity[:] = 0.0
        self._turning, self._asked, self._refused = 0.0, 0.0, True

    def go_up(self) -> None:
        """The leg of a foot that comes down pulls the body along: up again, and to a nearer place in the end."""
        self.stop()
        self._blocked = self.settings.blocked

    @property
    def lateness(self) -> float:
        """0 to 1: how much a foot that cannot get down where it should has to give up its place."""
        late = self._waited / self.settings.patience - 1.0
        return min(max(late, 0.0), 1.0)

    @property
    def hovering(self) -> bool:
        """Whether the foot has arrived over its landing place and waits to go down."""
        return self._hovered > 0.0

    def _lift(self, position: Array, dt: float) -> tuple[Array, Array, bool]:
        speed = min(self._velocity[2] + self.settings.lift_acceleration * dt, self.settings.lift_speed)
        self._velocity[:] = (0.0, 0.0, speed)
        height = position[2] + speed * dt
        if height >= self.settings.lift_height:
            self.phase, self.min_height = Phase.FREE, self.settings.lift_height * 0.9
        return np.array([self._start[0], self._start[1], height]), self._rotation, False

    def _approach(
        self, position: Array, rotation: Array, moved: Array, goal: Array, goal_yaw: float, dt: float
    ) -> tuple[Array, Array, bool]:
        self.phase = Phase.APPROACH
        close = math.hypot(goal[0] - position[0], goal[1] - position[1]) < self.settings.close
        height = self.settings.hover_height if close else self.settings.clearance
        self.min_height = min(height - OVERHEAD, self.min_height + self.settings.lift_speed * dt)
        target = np.array([goal[0], goal[1], height])
        level = yaw_matrix(goal_yaw)
        turn = rotation_vector(level @ rotation.T)
        way, angle = target - position, float(np.linalg.norm(turn))
        self._waited += dt
        near = self.settings.arrived + self.settings.yielding * self.lateness
        settled = np.linalg.norm(moved) < self.settings.settled * dt or self._waited > self.settings.patience
        arrived = np.linalg.norm(way) < near and 0.1 * angle < near and settled
        self._hovered = self._hovered + dt if arrived else 0.0
        if self._hovered > self.settings.hover:
            self.phase = Phase.DESCEND
            self._start = position.copy()
            self._velocity[:] = 0.0
            return self._descend(position, rotation, dt)
        step = self._braked(way, dt)
        part = self._turn(angle, dt) / angle if angle > 0.0 else 1.0
        return position + step, matrix_from_rotation_vector(part * turn) @ rotation, False

    def _turn(self, angle: float, dt: float) -> float:
        """How far (rad) to turn next on a way of ``angle``."""
        s = self.settings
        braking = math.sqrt(2.0 * s.turn_acceleration * angle)
        self._turning = min(self._turning + s.turn_acceleration * dt, s.turn_speed, braking)
        return min(self._turning * dt, angle)

    def _braked(self, way: Array, dt: float) -> Array:
        distance = float(np.linalg.norm(way))
        if distance == 0.0:
            return way
        speed = min(braking_speed(distance, self.settings.approach_acceleration, dt), self.settings.approach_speed)
        change = speed * way / distance - self._velocity
        length = float(np.linalg.norm(change))
        if length > self.settings.approach_acceleration * dt:
            change *= self.settings.approach_acceleration * dt / length
        self._velocity += change
        step = self._velocity * dt
        return way if np.linalg.norm(step - way) < 1e-5 else step

    def _descend(self, position: Array, rotation: Array, dt: float) -> tuple[Array, Array, bool]:
        """Straight down from where the foot has arrived; what is left of its tilt goes on the way."""
        s = self.settings
        braking = math.sqrt(s.touch_speed**2 + 2.0 * s.descend_acceleration * max(position[2], 0.0))
        speed = min(-self._velocity[2] + s.descend_acceleration * dt, s.descend_speed, braking)
        self._velocity[:] = (0.0, 0.0, -speed)
        flat = yaw_matrix(heading(rotation))
        tilt = rotation_vector(flat @ rotation.T)
        angle = float(np.linalg.norm(tilt))
        level = angle <= s.level_speed * dt
        lowest = s.touch_height if level else s.level_height
        height = max(position[2] - speed * dt, min(lowest, position[2]) if not level else 0.0)
        if not level:
            flat = matrix_from_rotation_vector(tilt * (s.level_speed * dt / angle)) @ rotation
        self._asked = float(position[2]) - height
        return np.array([self._start[0], self._start[1], height]), flat, level and height <= s.touch_height
