"""Where the simulated robot pressed on the floor, as its force sensors tell: the zero-moment point as a robot feels it.

The centre of pressure of all sensors is measured against the soles that should stand, where they really were. Sensors
lie inside the soles: a sole that presses beyond their hull seems to press on its edge, and the margin is mostly told
too large. Frames with such a sole are counted for that reason.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from naoimitate.core.geometry import convex_hull, polygon_margin
from naoimitate.core.physics import GRAVITY
from naoimitate.hw.force_sensors import center_of_pressure, sensor_places
from naoimitate.robot.model import RobotModel
from naoimitate.run.file import Run
from naoimitate.run.measure import Measure
from naoimitate.run.replay import Array, Replay
from naoimitate.run.zmp import AIRBORNE, MM, PERCENTILE

EDGE = 5e-4
"""[m] from the edge of the sensors' hull within which they cannot tell how far out the pressure is."""


def sensed_pressure(robot: RobotModel, fsr: Array, poses: Replay) -> Array:
    """Centre of pressure (T, 2) m in the world of force sensors (T, 2, 4) N; NaN where they carry too little."""
    at = np.stack([poses.on_sole(robot, side, places) for side, places in enumerate(sensor_places(robot))], axis=1)
    count = len(fsr)
    point = center_of_pressure(fsr.reshape(count, -1), at[..., :2].reshape(count, -1, 2))
    point[~_carries(robot, fsr.sum(axis=(1, 2)))] = np.nan
    return point


def at_the_edge(robot: RobotModel, fsr: Array) -> npt.NDArray[np.bool_]:
    """Frames (T,) in which a sole that carries presses on the edge of its sensors' hull, or beyond."""
    result = np.zeros(len(fsr), dtype=np.bool_)
    for side, places in enumerate(sensor_places(robot)):
        forces, hull = fsr[:, side], convex_hull(places)
        carrying = np.flatnonzero(_carries(robot, forces.sum(axis=1)))
        points = center_of_pressure(forces[carrying], places)
        result[carrying] |= np.array([polygon_margin(hull, *point) < EDGE for point in points], dtype=np.bool_)
    return result


def _carries(robot: RobotModel, force: Array) -> npt.NDArray[np.bool_]:
    """Whether forces (T,) N are enough to tell where they act."""
    return np.asarray(force > AIRBORNE * robot.mass * GRAVITY)


def pressure(run: Run, robot: RobotModel, moved: Replay | None) -> list[Measure]:
    """The measures of the simulated force sensors; moved: the poses of the simulated robot."""
    known, edge = np.zeros(0), None
    if moved is not None and run.sim_fsr is not None:
        margin = moved.margins(run.support, sensed_pressure(robot, run.sim_fsr, moved))
        known = MM * margin[np.isfinite(margin)]
        edge = int(at_the_edge(robot, run.sim_fsr).sum())
    there = len(known) > 0
    return [
        Measure(
            "sim_cop_margin_min_mm",
            "pressure on the force sensors, least margin",
            float(known.min()) if there else None,
            "mm",
        ),
        Measure(
            "sim_cop_margin_p01_mm",
            "pressure on the force sensors, 1st percentile",
            float(np.percentile(known, PERCENTILE)) if there else None,
            "mm",
        ),
        Measure("sim_cop_edge_frames", "frames with it at the edge of a foot's sensors", edge if there else None),
    ]
