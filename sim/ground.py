"""A floor that is not where the plan has it: each foot has its own, whose height may change at any moment.

So a foot that is in the air comes down on a board or in a dip, all of its sole at once, whichever way it goes. The body
has the floor at z = 0.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco

from naoimitate.core.frames import SIDES, Array
from naoimitate.sim.contacts import plate_name

Ground = Callable[[float], Array]
"""Heights (2,) m of the floor under the left and the right foot at a moment, s from the beginning of the plan. What
changes under a foot that stands kicks it."""

GROUNDS = {side: 4 << index for index, side in enumerate(SIDES)}
"""Bits of MuJoCo's contype and conaffinity by which a sole meets its own floor only."""


def split_floor(spec: mujoco.MjSpec) -> None:
    """Give each foot a floor of its own, the bodies ``l_ground`` and ``r_ground`` that only the program moves."""
    floor = spec.geom("floor")
    for side, bit in GROUNDS.items():
        body = spec.worldbody.add_body(name=f"{side}_ground", mocap=True)
        ground = body.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05], friction=floor.friction)
        ground.contype, ground.conaffinity, ground.rgba[3] = bit, 0, 0.0
        for ball in spec.body(plate_name(side)).geoms:
            ball.conaffinity = bit


def set_heights(model: mujoco.MjModel, data: mujoco.MjData, heights: Array) -> None:
    """Move the floors of the left and the right foot to heights (2,) m."""
    for side, height in zip(SIDES, heights, strict=True):
        data.mocap_pos[model.body(f"{side}_ground").mocapid[0], 2] = height
