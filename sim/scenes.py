"""Scenes of tele-operation: a ball on a slender stand, and a bucket to drop it into.

The ball is free, stand and bucket are fixed to the floor; all three meet the robot's body and fingers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import mujoco

from naoimitate.core.frames import Array

BALL, BUCKET = "ball", "bucket"
"""Names of the ball's body and free joint, and of the bucket's body."""

RED, BLUE, WOOD = (0.85, 0.12, 0.10, 1.0), (0.15, 0.35, 0.85, 1.0), (0.55, 0.42, 0.30, 1.0)

ROLLING_DIMENSIONS, BALL_FRICTION = 6, (0.8, 0.005, 0.002)
"""MuJoCo's ``condim`` and ``friction``: sliding, and m against turning and rolling; soft foam soon lies still."""

POST_RADIUS, FOOT_RADIUS, FOOT_HEIGHT = 0.010, 0.050, 0.008
"""m, of the stand: so slender that a thumb comes past it."""

CUP_RADIUS, CUP_POINTS, CUP_POINT = 0.007, 4, 0.003
"""On top of the post the ball lies on small beads: radius of their circle m, how many, radius of one m."""

WALLS, WALL = 16, 0.003
"""Flat pieces that a bucket's wall is made of, and half their thickness, m."""


@dataclass(frozen=True)
class BallAndBucket:
    """What stands where; m, in the world: the robot begins with its feet around the origin and faces +x.

    ball: (x, y, z) of its centre on the stand. bucket: (x, y) of its middle; bucket_radius is the inner one.
    ball_mass: kg; the default is a ball of soft foam.
    """

    ball: tuple[float, float, float]
    bucket: tuple[float, float]
    ball_radius: float = 0.025
    ball_mass: float = 0.03
    bucket_radius: float = 0.07
    bucket_height: float = 0.13

    def add(self, spec: mujoco.MjSpec) -> None:
        """Add it to a robot's world: a ``sim.model.Scene``."""
        self._add_stand(spec.worldbody.add_body(name="stand", pos=[*self.ball[:2], 0.0]))
        self._add_bucket(spec.worldbody.add_body(name=BUCKET, pos=[*self.bucket, 0.0]))
        ball = spec.worldbody.add_body(name=BALL, pos=self.ball)
        ball.add_freejoint(name=BALL)
        geom = _add(ball, mujoco.mjtGeom.mjGEOM_SPHERE, [self.ball_radius, 0.0, 0.0], RED)
        geom.mass, geom.condim, geom.friction = self.ball_mass, ROLLING_DIMENSIONS, BALL_FRICTION

    def holds(self, ball: Array) -> bool:
        """Whether a ball at (3,) m is in the bucket, all of it under the rim."""
        inside = math.dist(ball[:2], self.bucket) + self.ball_radius < self.bucket_radius + WALL
        return inside and bool(ball[2] + self.ball_radius < self.bucket_height)

    def _add_stand(self, body: Any) -> None:
        """A foot, a post, and a cup of beads whose middle is under the ball."""
        apart = self.ball_radius + CUP_POINT
        beads = self.ball[2] - math.sqrt(apart**2 - CUP_RADIUS**2)
        cylinder = mujoco.mjtGeom.mjGEOM_CYLINDER
        _add(body, cylinder, [FOOT_RADIUS, 0.5 * FOOT_HEIGHT, 0.0], WOOD, [0.0, 0.0, 0.5 * FOOT_HEIGHT])
        _add(body, cylinder, [POST_RADIUS, 0.5 * beads, 0.0], WOOD, [0.0, 0.0, 0.5 * beads])
        for angle in _around(CUP_POINTS):
            place = [CUP_RADIUS * math.cos(angle), CUP_RADIUS * math.sin(angle), beads]
            _add(body, mujoco.mjtGeom.mjGEOM_SPHERE, [CUP_POINT, 0.0, 0.0], WOOD, place)

    def _add_bucket(self, body: Any) -> None:
        """A bottom and flat pieces around it."""
        out = self.bucket_radius + WALL
        width = out * math.tan(math.pi / WALLS) + WALL
        half = 0.5 * self.bucket_height
        _add(body, mujoco.mjtGeom.mjGEOM_CYLINDER, [out, WALL, 0.0], BLUE, [0.0, 0.0, WALL])
        for angle in _around(WALLS):
            place = [out * math.cos(angle), out * math.sin(angle), half]
            piece = _add(body, mujoco.mjtGeom.mjGEOM_BOX, [WALL, width, half], BLUE, place)
            piece.quat = [math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)]


def _around(count: int) -> list[float]:
    """Angles (rad) of ``count`` even parts of a circle."""
    return [2.0 * math.pi * number / count for number in range(count)]


def _add(body: Any, kind: mujoco.mjtGeom, size: list[float], colour: tuple[float, ...], pos: Any = (0, 0, 0)) -> Any:
    return body.add_geom(type=kind, size=size, rgba=colour, pos=pos)
