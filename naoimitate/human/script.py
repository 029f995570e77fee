"""Scripts for the procedural person: tracks of values over time, steps of the feet, and the motion they make."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from naoimitate.core.frames import SIDES, Array
from naoimitate.human.anthropometry import Anthropometry
from naoimitate.human.procedural import Parameters

Move = tuple[float, float, npt.ArrayLike]
"""From s, to s, the value to arrive at."""


@dataclass(frozen=True)
class Track:
    """A value that rests, moves, and rests again: minimum-jerk blends, so twice continuously differentiable.

    start: the value at the beginning, a number or a vector. moves: when it changes, in order of time, not overlapping.
    """

    start: npt.ArrayLike
    moves: tuple[Move, ...] = ()

    def __call__(self, time: Array) -> Array:
        """The value at times (T,) s, (T,) or (T, n)."""
        value = np.asarray(self.start, dtype=float)
        result = np.broadcast_to(value, (len(time), *value.shape)).copy()
        for begin, end, goal in self.moves:
            change = np.asarray(goal, dtype=float) - value
            result += np.multiply.outer(minimum_jerk((time - begin) / (end - begin)), change)
            value = value + change
        return result


def minimum_jerk(s: Array) -> Array:
    """Blend from 0 to 1 over s = 0..1 with velocity and acceleration zero at both ends (Flash and Hogan 1985)."""
    s = np.clip(s, 0.0, 1.0)
    return np.asarray(s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


Foot = tuple[float, float, float, float, float, float]
"""A pose of a foot: x, y, z m of the sole below the ankle, yaw, pitch, roll rad."""


@dataclass(frozen=True)
class Swing:
    """One foot in the air, from lift to landing, both s: straight up, through the poses of ``via``, straight down flat.

    foot: ``l`` or ``r``. land_at: x, y m and yaw rad of the landing. height: m over the floor on the way up and down.
    rise: s that the way up takes, and the way down. via: (from s, to s, pose) while in the air; without any, the foot
    goes straight over to its landing.
    """

    foot: str
    lift: float
    land: float
    land_at: tuple[float, float, float]
    height: float
    rise: float
    via: tuple[tuple[float, float, Foot], ...] = ()


@dataclass(frozen=True)
class Script:
    """A motion in words: what every part does when.

    duration s, rate Hz. stance: x, y m and yaw rad of the left and right foot at the beginning. swings: in time order.
    offset: centre of mass on the line from the left (0) to the right (1) foot's centre. height: m of mid-hip above the
    floor. trunk, left_arm, right_arm, head: as in ``Parameters``.
    """

    duration: float
    stance: tuple[tuple[float, float, float], tuple[float, float, float]]
    offset: Track
    height: Track
    trunk: Track
    left_arm: Track
    right_arm: Track
    swings: tuple[Swing, ...] = ()
    head: Track = field(default=Track((0.0, 0.0)))
    rate: float = 100.0

    @property
    def time(self) -> Array:
        """(T,) s, the frames' times, from 0."""
        return np.arange(round(self.duration * self.rate)) / self.rate


def parameters(script: Script, body: Anthropometry) -> Parameters:
    """The person's parameters at every frame of a script."""
    time = script.time
    feet = np.stack([foot_track(script, side)(time) for side in SIDES], axis=1)
    left, right = foot_centers(feet, body)
    return Parameters(
        feet=feet,
        com=left + script.offset(time)[:, None] * (right - left),
        height=script.height(time),
        trunk=script.trunk(time),
        arms=np.stack([script.left_arm(time), script.right_arm(time)], axis=1),
        head=script.head(time),
    )


def foot_track(script: Script, side: str) -> Track:
    """Everything that one foot does, as a track of its six pose values."""
    x, y, yaw = script.stance[SIDES.index(side)]
    pose: Foot = (x, y, 0.0, yaw, 0.0, 0.0)
    moves: list[Move] = []
    for swing in script.swings:
        if swing.foot == side:
            moves += _swing_moves(swing, pose)
            pose = (*swing.land_at[:2], 0.0, swing.land_at[2], 0.0, 0.0)
    return Track((x, y, 0.0, yaw, 0.0, 0.0), tuple(moves))


def _swing_moves(swing: Swing, start: Foot) -> list[Move]:
    up = swing.lift + swing.rise
    down = swing.land - swing.rise
    x, y, yaw = swing.land_at
    over = (x, y, swing.height, yaw, 0.0, 0.0)
    arrive = swing.via[-1][1] if swing.via else up
    return [
        (swing.lift, up, (*start[:2], swing.height, *start[3:])),
        *swing.via,
        (arrive, down, over),
        (down, swing.land, (x, y, 0.0, yaw, 0.0, 0.0)),
    ]


def support(script: Script) -> npt.NDArray[np.str_]:
    """(T,) ``D``, ``L`` or ``R``: the feet that stand at every frame; a foot is up strictly between lift and landing."""
    time = script.time
    up = {side: np.zeros(len(time), dtype=bool) for side in SIDES}
    for swing in script.swings:
        up[swing.foot] |= (time > swing.lift) & (time < swing.land)
    return np.where(up["r"] & up["l"], "F", np.where(up["r"], "L", np.where(up["l"], "R", "D")))


def foot_centers(feet: Array, body: Anthropometry) -> tuple[Array, Array]:
    """Ankle-toe midpoints over the floor, (T, 2) m each, from foot poses (T, 2, 6)."""
    yaw, pitch, roll = np.moveaxis(feet[..., 3:], -1, 0)
    ahead, up = 0.5 * body.ball, 0.5 * (body.ankle_height + body.ball_height)
    forward = ahead * np.cos(pitch) + up * np.sin(pitch) * np.cos(roll)
    aside = -up * np.sin(roll)
    x = feet[..., 0] + forward * np.cos(yaw) - aside * np.sin(yaw)
    y = feet[..., 1] + forward * np.sin(yaw) + aside * np.cos(yaw)
    centers = np.stack([x, y], axis=-1)
    return centers[:, 0], centers[:, 1]
