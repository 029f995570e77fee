"""A scripted motion: what every part of the procedural person does when, and the parameters that follow."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from naoimitate.core.frames import SIDES, Array
from naoimitate.human.anthropometry import Anthropometry
from naoimitate.human.procedural import Parameters
from naoimitate.human.steps import Landing, Stride, Swing, planted
from naoimitate.human.tracks import Curve, Track


@dataclass(frozen=True)
class Script:
    """What a person does.

    duration s. stance: where the left and right foot stand at the beginning. offset: centre of mass on the line from
    the left (0) to the right (1) foot's centre. height: m of mid-hip above the floor. trunk, left_arm, right_arm,
    head: as in ``Parameters``. swings: in order of time. path: centre of mass over the floor, (T, 2) m, instead of the
    offset. hands: opening of left and right hand, (T, 2), 0 closed to 1 open, None where nothing is known of it.
    heading: where the body faces, rad to the left of +x, whatever its trunk does. rate: frames a second.
    """

    duration: float
    stance: tuple[Landing, Landing]
    offset: Curve
    height: Curve
    trunk: Curve
    left_arm: Curve
    right_arm: Curve
    head: Curve = field(default=Track((0.0, 0.0)))
    swings: tuple[Swing | Stride, ...] = ()
    path: Curve | None = None
    hands: Curve | None = None
    heading: Curve = field(default=Track(0.0))
    rate: float = 100.0

    @property
    def time(self) -> Array:
        """(T,) s, the frames' times, from 0."""
        return np.arange(round(self.duration * self.rate)) / self.rate


def parameters(script: Script, body: Anthropometry) -> Parameters:
    """The person's parameters at every frame of a script."""
    time = script.time
    feet = np.stack([foot_poses(script, side) for side in SIDES], axis=1)
    left, right = foot_centers(feet, body)
    on_line = left + script.offset(time)[:, None] * (right - left)
    return Parameters(
        feet=feet,
        com=on_line if script.path is None else script.path(time),
        height=script.height(time),
        trunk=script.trunk(time),
        arms=np.stack([script.left_arm(time), script.right_arm(time)], axis=1),
        head=script.head(time),
        heading=script.heading(time),
    )


def foot_poses(script: Script, side: str) -> Array:
    """(T, 6) pose of one foot at every frame: x, y, z m of the sole point below the ankle, yaw, pitch, roll rad."""
    time = script.time
    pose = planted(script.stance[SIDES.index(side)])
    poses = np.tile(pose, (len(time), 1))
    for swing in script.swings:
        if swing.foot == side:
            poses += swing.change(time, pose)
            pose = planted(swing.land_at)
    return poses


def support(script: Script) -> npt.NDArray[np.str_]:
    """(T,) ``D``, ``L``, ``R`` or ``F``: feet that stand; a foot is up strictly between lift and landing."""
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
