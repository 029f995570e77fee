"""Feet and floor: slip, flatness, clearance of the swing foot, penetration."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from naoimitate.robot.model import RobotModel
from naoimitate.run.file import Run
from naoimitate.run.measure import Bar, Measure
from naoimitate.run.replay import LOADED, Array, Replay

CLEAR = 0.005
"""Height of a sole over the floor from which it is clear of it, m."""
SWING_ENDS = 0.15
"""At the start and the end of its swing a foot may be lower than ``CLEAR``, s."""
MM = 1000.0
DIRECTIONS = 36
"""Directions in which the extent of a slipping point's track is measured: its diameter to 0.1 %."""
TIME_TOLERANCE = 1e-9
"""Rounding of frame times, s."""

Bools = npt.NDArray[np.bool_]


def loaded(run: Run, side: int) -> Bools:
    """Where a foot (0 left, 1 right) carries the robot, (T,)."""
    return np.array([LOADED[mode][side] for mode in run.support])


def intervals(mask: Bools) -> list[tuple[int, int]]:
    """Maximal runs of True in a mask as (first, last) indices, both included."""
    steps = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(steps[::2], steps[1::2], strict=True)]


def stances(run: Run, frames: Replay, side: int) -> Iterator[npt.NDArray[np.int64]]:
    """Frames of each stance phase of a foot: the foot carries; a phase ends once it was clear of the floor."""
    carries, clear = loaded(run, side), frames.low(side) >= CLEAR
    phase: list[int] = []
    for i in range(len(run)):
        if carries[i]:
            phase.append(i)
        elif clear[i] and phase:
            yield np.array(phase)
            phase = []
    if phase:
        yield np.array(phase)


def slip(run: Run, frames: Replay) -> float:
    """Largest horizontal travel of any sole outline point during one stance phase, m."""
    angles = np.arange(DIRECTIONS) * np.pi / DIRECTIONS
    directions = np.array([np.cos(angles), np.sin(angles)])
    worst = 0.0
    for side in (0, 1):
        for phase in stances(run, frames, side):
            along = frames.soles[side][phase, :, :2] @ directions
            worst = max(worst, float(np.ptp(along, axis=0).max()))
    return worst


def sole_height(run: Run, frames: Replay) -> float:
    """Largest height of a stance sole's outline above or below the floor, m."""
    return max(_over_stances(run, [np.abs(sole[:, :, 2]).max(axis=1) for sole in frames.soles]))


def sole_tilt(run: Run, frames: Replay) -> float:
    """Largest angle between a stance sole's normal and the vertical, rad."""
    return max(_over_stances(run, [np.arctan2(np.hypot(u[:, 0], u[:, 1]), u[:, 2]) for u in frames.sole_up]))


def dragging(run: Run, frames: Replay) -> Bools:
    """Frames in which a swing foot is not clear of the floor, but for the first and last 0.15 s of its swing."""
    result = np.zeros(len(run), dtype=np.bool_)
    for side in (0, 1):
        low = frames.low(side) < CLEAR
        for first, last in intervals(~loaded(run, side)):
            time = run.time[first : last + 1]
            middle = (time - time[0] >= SWING_ENDS - TIME_TOLERANCE) & (time[-1] - time >= SWING_ENDS - TIME_TOLERANCE)
            result[first : last + 1] |= low[first : last + 1] & middle
    return result


def penetration(robot: RobotModel, frames: Replay) -> float:
    """Deepest point of any sole or body shape below the floor, m, 0 where none is."""
    lowest = min(float(frames.low(0).min()), float(frames.low(1).min()))
    for shape in robot.shapes:
        row = shape.joint + 1
        rot = frames.base_rot @ frames.links_rot[:, row]
        origin = frames.base_pos + np.einsum("nij,nj->ni", frames.base_rot, frames.links_pos[:, row])
        below = shape.radius + np.abs(rot[:, 2]) @ shape.half
        for p in (shape.p0, shape.p1):
            lowest = min(lowest, float((origin[:, 2] + rot[:, 2] @ p - below).min()))
    return max(0.0, -lowest)


def contact(run: Run, robot: RobotModel, frames: Replay) -> list[Measure]:
    """The measures of feet and floor."""
    planted = run.retarget == "planted"
    note = "" if planted else "bar holds for --retarget planted only"
    height, tilt = MM * sole_height(run, frames), float(np.degrees(sole_tilt(run, frames)))
    deepest = MM * penetration(robot, frames)
    return [
        Measure("slip_max_mm", "stance slip, largest", MM * slip(run, frames), "mm", Bar(0.5), planted, note),
        Measure("sole_height_max_mm", "stance sole off the floor, largest", height, "mm", Bar(0.5), planted, note),
        Measure("sole_tilt_max_deg", "stance sole tilt, largest", tilt, "deg", Bar(0.5), planted, note),
        Measure("drag_frames", "frames dragging a swing foot", int(dragging(run, frames).sum()), "", Bar(0)),
        Measure("floor_penetration_max_mm", "deepest point under the floor", deepest, "mm", Bar(0.5)),
    ]


def _over_stances(run: Run, values: list[Array]) -> list[float]:
    """The largest of each foot's values (T,) over the frames in which it carries; 0 where it never does."""
    return [float(value[loaded(run, side)].max(initial=0.0)) for side, value in enumerate(values)]
