"""How a real robot and its world differ from the ones that the plan knows: one disturbance, complete and repeatable."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from naoimitate.core.frames import Array
from naoimitate.core.physics import GRAVITY
from naoimitate.sim.settings import SimSettings

PUSH_TIME = 0.05
"""How long a push lasts, s: a hand or a ball that bumps into the robot."""

LINKS, NOISE = 0, 1
"""Streams of random numbers that come from a disturbance's ``seed``."""


@dataclass(frozen=True)
class Disturbance:
    """What is otherwise than planned. The neutral one, ``Disturbance()``, changes nothing.

    Moments are shares of the motion, 0 its start and 1 its end, so that one disturbance fits every motion. Headings are
    in the world, rad from +x to +y.
    """

    stiffness: float = SimSettings.stiffness
    """Of every servo, N m/rad."""

    torque: float = 0.0
    """Torque limit of every servo, from 0, the robot's planning limit (``urdf_effort``), to 1, the motor's stall
    torque; below 0: what is missing from the planning limit, as a share of it."""

    friction: float = SimSettings.friction
    """Coefficient between soles and floor."""

    mass: float = 0.0
    """Largest error of a link's mass, as a share of it; each link has its own, of either sign."""

    com: float = 0.0
    """Largest error of a link's centre of mass, as a share of its distance from the link's frame; in any direction."""

    tilt: float = 0.0
    """Of the floor, rad; downhill towards ``tilt_heading``."""

    tilt_heading: float = 0.0

    delay: float = 0.0
    """Between a command and the servos that take it, s."""

    drop_time: float = 0.0
    """How long no command arrives, from ``drop_at`` on, s: the servos keep the last one, the plan goes on."""

    drop_at: float = 0.0

    noise: float = 0.0
    """Of encoders and inertial board, as a multiple of what ``disturbance_sensors`` states."""

    push: float = 0.0
    """Impulse on the torso, N s: horizontal, through its centre of mass, over ``PUSH_TIME`` from ``push_at`` on."""

    push_heading: float = 0.0
    push_at: float = 0.0

    seed: int = 0
    """Of the errors of the links and of the noise."""

    def random(self, stream: int) -> np.random.Generator:
        """Random numbers of a stream, ``LINKS`` or ``NOISE``."""
        return np.random.default_rng([self.seed, stream])

    @property
    def up(self) -> Array:
        """The true vertical (3,) in the frame of the floor, in which robot and plan move.

        A tilted floor is simulated as tilted gravity, which is the same thing seen by somebody on the floor.
        """
        downhill = math.sin(self.tilt)
        return np.array(
            [-downhill * math.cos(self.tilt_heading), -downhill * math.sin(self.tilt_heading), math.cos(self.tilt)]
        )

    def push_force(self, start: float, end: float, duration: float) -> Array:
        """Mean force (3,) N of the push from start to end, s since the motion began; duration: s of the motion."""
        first = self.push_at * duration
        shared = max(0.0, min(end, first + PUSH_TIME) - max(start, first))
        size = self.push / PUSH_TIME * shared / (end - start)
        return np.array([size * math.cos(self.push_heading), size * math.sin(self.push_heading), 0.0])


def disturbed_settings(settings: SimSettings, disturbance: Disturbance) -> SimSettings:
    """The simulation's settings with the servos and the friction of a disturbance."""
    return replace(
        settings,
        stiffness=disturbance.stiffness,
        friction=disturbance.friction,
        torque_limit=disturbance.torque if disturbance.torque != 0.0 else "effort",
    )


def disturb_model(model: mujoco.MjModel, data: mujoco.MjData, root: int, disturbance: Disturbance) -> None:
    """Change the masses of a compiled robot and the direction of gravity; ``data`` has to be placed anew.

    root: the body of the torso; the error reaches all bodies that hang on it.
    """
    if disturbance.tilt != 0.0:
        model.opt.gravity[:] = -GRAVITY * disturbance.up
    if disturbance.mass != 0.0 or disturbance.com != 0.0:
        _misjudge_links(model, root, disturbance)
        mujoco.mj_setConst(model, data)


def _misjudge_links(model: mujoco.MjModel, root: int, disturbance: Disturbance) -> None:
    links = np.flatnonzero((model.body_rootid == root) & (model.body_mass > 0.0))
    random = disturbance.random(LINKS)
    factors = 1.0 + disturbance.mass * random.uniform(-1.0, 1.0, len(links))
    directions = random.normal(size=(len(links), 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lengths = disturbance.com * random.uniform(0.0, 1.0, len(links)) * np.linalg.norm(model.body_ipos[links], axis=1)
    model.body_mass[links] *= factors
    model.body_inertia[links] *= factors[:, None]
    model.body_ipos[links] += lengths[:, None] * directions
