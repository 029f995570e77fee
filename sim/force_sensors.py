"""Four force sensors under each sole of the simulated robot: what a rigid sole that rests on them presses on each.

MuJoCo measures force and moment between a sole and its foot. Of all forces on the four that make up the same sum and
the same moment, the least ones, none of them pulling, are those of four equal springs. A moment that would take a pull
acts beyond the sensors' hull; the nearest point of the hull stands for it then, and no force is lost.
"""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.optimize import nnls

from naoimitate.core.frames import SIDES, Array
from naoimitate.hw.force_sensors import sensor_places
from naoimitate.robot.model import RobotModel
from naoimitate.sim.contacts import plate_name

SENSOR_GROUP = 4
"""MuJoCo's site group of sensors: not drawn."""
ARM = 0.05
"""[m] A moment counts as much as a force at this arm: half a small foot."""
FARTHEST = 0.3
"""[m] from the sensors' middle, beyond any sole: of a force farther away only the direction counts."""
EVEN = 1e-3
"""Weight of the wish for small forces, beside those for the sum and the moment; moves the centre of pressure by less
than 1e-6 of a foot."""


def add_force_sensors(spec: mujoco.MjSpec) -> None:
    """Add ``l_sole_force``, ``l_sole_torque`` and the right ones: what a foot does to its sole, in the sole frame."""
    for side in SIDES:
        site = f"{side}_sole"
        spec.body(plate_name(side)).add_site(name=site, group=SENSOR_GROUP)
        for what, kind in (("force", mujoco.mjtSensor.mjSENS_FORCE), ("torque", mujoco.mjtSensor.mjSENS_TORQUE)):
            spec.add_sensor(name=f"{site}_{what}", type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site)


class ForceSensors:
    """Reads the soles of a simulated robot."""

    def __init__(self, model: mujoco.MjModel, robot: RobotModel) -> None:
        rows = [[model.sensor(f"{side}_sole_{what}").adr[0] for what in ("force", "torque")] for side in SIDES]
        self._rows = np.array(rows)[:, :, None] + np.arange(3)
        self._places = sensor_places(robot)

    def loads(self, data: mujoco.MjData) -> Array:
        """Force (2,) N that presses on the left and the right sole."""
        return np.maximum(-data.sensordata[self._rows[:, 0, 2]], 0.0)

    def read(self, data: mujoco.MjData) -> Array:
        """Forces (2, 4) N, as ``RobotState.fsr``."""
        loads, torques = self.loads(data), -data.sensordata[self._rows[:, 1]]
        shares = np.zeros((2, 4))
        for side in np.flatnonzero(loads):
            point = np.array([-torques[side, 1], torques[side, 0]]) / loads[side]
            shares[side] = shares_of(self._places[side], point)
        return loads[:, None] * shares


def shares_of(places: Array, point: Array) -> Array:
    """Shares (N,) of a force at a point (2,) m that sensors at (N, 2) m get; their sum is 1."""
    count, middle = len(places), places.mean(axis=0)
    point = middle + np.clip(point - middle, -FARTHEST, FARTHEST)
    rows = np.vstack([np.ones(count), (places - point).T / ARM, EVEN * np.eye(count)])
    found, _ = nnls(rows, np.concatenate([[1.0], np.zeros(2 + count)]))
    return np.asarray(found / found.sum())
