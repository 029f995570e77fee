"""Similarity: how far hands and feet are from where equation (5) wants them."""

from __future__ import annotations

import numpy as np

from naoimitate.robot.model import RobotModel
from naoimitate.run.clips import PAPER, is_auto, is_quasi_static, is_speed_one
from naoimitate.run.file import Run
from naoimitate.run.measure import Bar, Measure
from naoimitate.run.reach import reachable_errors
from naoimitate.run.replay import Array, Replay, targets

HANDS, FEET = (0, 2), (1, 3)
"""Columns of the run file's postures: l_hand, l_foot, r_hand, r_foot."""
CM = 100.0
BOUND_PERIOD = 0.2
"""The reachable bound is solved once every so many seconds of a run, s: a posture changes little within."""


def errors(run: Run, frames: Replay) -> Array:
    """Distance of each effector to its target (5) before any limit, (T, 4) m; NaN where nobody is imitated."""
    return np.asarray(np.linalg.norm(frames.posture - targets(run), axis=2))


def hand_excess(run: Run, robot: RobotModel, frames: Replay) -> float | None:
    """Mean distance of the hands beyond what the arms alone could have reached, m; None where nobody is imitated."""
    step = max(1, round(BOUND_PERIOD * (len(run) - 1) / run.duration)) if len(run) > 1 else 1
    picked = np.arange(0, len(run), step)
    picked = picked[~np.isnan(run.human_time[picked])]
    if not len(picked):
        return None
    error = errors(run, frames)[picked][:, HANDS]
    bound = reachable_errors(robot, run.q[picked], targets(run)[picked][:, HANDS])
    return float((error - np.minimum(bound, error)).mean())


def similarity(run: Run, robot: RobotModel, frames: Replay) -> list[Measure]:
    """The measures of similarity."""
    error = errors(run, frames)
    hands, feet = _mean_cm(error, HANDS), _mean_cm(error, FEET)
    paper = run.source == PAPER and is_speed_one(run)
    note = "" if paper else f"bar holds for {PAPER} at --speed 1"
    quasi_static = is_auto(run) and is_quasi_static(run)
    excess = hand_excess(run, robot, frames)
    return [
        Measure("hand_error_cm_mean", "hands off target, mean", hands, "cm", Bar(1.0), paper, note),
        Measure("foot_error_cm_mean", "feet off target, mean", feet, "cm", Bar(1.2), paper, note),
        Measure(
            "hand_excess_cm_mean",
            "hands beyond the reachable bound, mean",
            None if excess is None else CM * excess,
            "cm",
            Bar(0.5),
            quasi_static,
            "" if quasi_static else "bar holds for quasi-static clips at --speed auto",
        ),
    ]


def _mean_cm(error: Array, columns: tuple[int, int]) -> float | None:
    known = error[:, columns]
    known = known[~np.isnan(known)]
    return CM * float(known.mean()) if len(known) else None
