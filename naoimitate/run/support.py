"""Support modes: does the robot stand on the same feet as the person, and how late does it lift a foot."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from naoimitate.run.clips import is_auto, is_builtin, is_quasi_static, is_speed_one
from naoimitate.run.file import Run
from naoimitate.run.measure import Bar, Measure
from naoimitate.run.replay import Array

SHORT_PHASE = 0.5
"""A single support of the person counts for recall from this length, s of human time."""
LONG_PHASE = 1.5
"""The same for the bar at speed 1, s: shorter stands end before a robot's centre of mass can follow."""
TIME_TOLERANCE = 1e-6
"""Rounding of human time, s."""
RECALL_BAR = Bar(0.9, at_least=True)
AGREEMENT_BAR = Bar(0.95, at_least=True)


@dataclass(frozen=True)
class Phase:
    """A single support of the person. mode: L or R. first, last: frames. duration: s of human time.
    matched: s of human time in which the robot stands on the same foot."""

    mode: str
    first: int
    last: int
    duration: float
    matched: float


def human_seconds(run: Run) -> Array:
    """Human time that each frame stands for, (T,) s: to the next frame; 0 while waiting, at the end, and untracked."""
    return np.nan_to_num(np.diff(run.human_time, append=run.human_time[-1:]))


def phases(run: Run) -> list[Phase]:
    """The person's single-support phases in order."""
    seconds = human_seconds(run)
    changes = np.flatnonzero(run.human_support[1:] != run.human_support[:-1]) + 1
    edges = [0, *changes.tolist(), len(run)]
    result = []
    for first, end in pairwise(edges):
        mode = str(run.human_support[first])
        if mode in "LR":
            here = slice(first, end)
            same = run.support[here] == mode
            result.append(Phase(mode, first, end - 1, float(seconds[here].sum()), float(seconds[here][same].sum())))
    return result


def recall(run: Run, at_least: float) -> float | None:
    """Share of the person's single supports of some length (s) that the robot stands on the same foot for half of."""
    counted = [phase for phase in phases(run) if phase.duration >= at_least - TIME_TOLERANCE]
    if not counted:
        return None
    return sum(phase.matched >= 0.5 * phase.duration - TIME_TOLERANCE for phase in counted) / len(counted)


def agreement(run: Run) -> float | None:
    """Share of human time, flight apart, in which the robot stands on the person's feet."""
    seconds = human_seconds(run) * (run.human_support != "F")
    total = float(seconds.sum())
    return float(seconds[run.support == run.human_support].sum()) / total if total > 0.0 else None


def lift_off_delays(run: Run) -> Array:
    """From each lift-off of the person to the robot's, s on the robot's clock, without those that the robot skips."""
    delays = []
    for phase in phases(run):
        lifted = np.flatnonzero(run.support[phase.first : phase.last + 1] == phase.mode)
        if phase.first > 0 and len(lifted):
            delays.append(run.time[phase.first + int(lifted[0])] - run.time[phase.first])
    return np.array(delays)


def time_factor(run: Run) -> float | None:
    """Duration of the run over the duration of what it imitates."""
    known = run.human_time[~np.isnan(run.human_time)]
    span = float(known[-1] - known[0]) if len(known) else 0.0
    return run.duration / span if span > 0.0 else None


def support(run: Run) -> list[Measure]:
    """The measures of the support modes and of slowness."""
    auto, delays = is_auto(run), lift_off_delays(run)
    long_applies = is_speed_one(run) and is_builtin(run)
    agreement_applies = auto and is_quasi_static(run)
    return [
        Measure(
            "single_support_recall",
            "single supports of 0.5 s or more repeated",
            recall(run, SHORT_PHASE),
            "",
            RECALL_BAR,
            auto,
            "" if auto else "bar holds for --speed auto",
        ),
        Measure(
            "single_support_recall_long",
            "single supports of 1.5 s or more repeated",
            recall(run, LONG_PHASE),
            "",
            RECALL_BAR,
            long_applies,
            "" if long_applies else "bar holds for built-ins at --speed 1",
        ),
        Measure(
            "support_agreement",
            "time on the person's feet",
            agreement(run),
            "",
            AGREEMENT_BAR,
            agreement_applies,
            "" if agreement_applies else "bar holds for quasi-static clips at --speed auto",
        ),
        Measure("lift_off_delay_median_s", "lift-off delay, median", _median(delays), "s"),
        Measure("time_factor", "run duration over the person's", time_factor(run)),
    ]


def _median(values: npt.NDArray[np.float64]) -> float | None:
    return float(np.median(values)) if len(values) else None
