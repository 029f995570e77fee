"""What the motors allow: joint ranges, coupled joints, speed."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from naoimitate.robot.model import RobotModel
from naoimitate.run.file import Run
from naoimitate.run.measure import Bar, Measure
from naoimitate.run.replay import Array

COUPLED_TOLERANCE = 1e-6
"""Joints of one motor may differ by this much, rad."""
RANGE_TOLERANCE = 1e-9
"""Rounding of a joint at its limit, rad; less is no excess."""
SPEED_FRACTION = 0.9
"""Largest joint speed as a fraction of the motor's no-load speed."""

RATTLE_SPEED = 1.0
"""A joint that moves faster than this both before and after it turns round rattles, rad/s: people's joints do not."""


def limit_excess(run: Run, robot: RobotModel) -> float:
    """How far any joint leaves its range, a coupling table, or its coupled partner, rad; 0 where none does."""
    excess = max(float((robot.lower - run.q).max()), float((run.q - robot.upper).max()), 0.0)
    for table in robot.tables:
        x, y, rows = run.q[:, table.x], run.q[:, table.y], table.rows
        below = np.interp(x, rows[:, 0], rows[:, 1]) - y
        above = y - np.interp(x, rows[:, 0], rows[:, 2])
        excess = max(excess, float(below.max()), float(above.max()))
    for leader, follower in robot.coupled:
        apart = float(np.abs(run.q[:, leader] - run.q[:, follower]).max())
        excess = max(excess, apart if apart > COUPLED_TOLERANCE else 0.0)
    return excess if excess > RANGE_TOLERANCE else 0.0


def speed_ratios(run: Run, robot: RobotModel) -> Array:
    """Joint speed between frames over the motor's no-load speed, (T - 1, J)."""
    return np.asarray(np.abs(np.diff(run.q, axis=0)) / np.diff(run.time)[:, None] / robot.speed)


def rattling(run: Run) -> npt.NDArray[np.bool_]:
    """Frames in which a joint turns round from one fast step to the next, (T,)."""
    speed = np.diff(run.q, axis=0) / np.diff(run.time)[:, None]
    turns = (speed[1:] * speed[:-1] < 0.0) & (np.minimum(np.abs(speed[1:]), np.abs(speed[:-1])) > RATTLE_SPEED)
    result = np.zeros(len(run), dtype=np.bool_)
    result[1:-1] = turns.any(axis=1)
    return result


def limits(run: Run, robot: RobotModel) -> list[Measure]:
    """The measures of the joint limits."""
    fastest = float(speed_ratios(run, robot).max(initial=0.0))
    return [
        Measure("limit_excess_rad", "joints out of range", limit_excess(run, robot), "rad", Bar(0.0)),
        Measure("speed_over_limit", "joint speed over no-load speed, largest", fastest, "", Bar(SPEED_FRACTION)),
        Measure("rattle_frames", "frames in which a joint rattles", int(rattling(run).sum())),
    ]
