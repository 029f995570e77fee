"""Which bars hold for which clips: what a run says about its source, and how its clock ran."""

from __future__ import annotations

from pathlib import PurePath

import numpy as np

from naoimitate.run.file import Run
from naoimitate.run.provenance import settings_of

BUILTIN = "builtin:"
PAPER = "builtin:paper"
NOT_QUASI_STATIC_BUILTINS = ("walk",)
QUASI_STATIC_CLIPS = ("13_29", "141_16", "mass_balance", "88_03")
"""Beginnings of file names of the recorded clips that a robot can follow without dynamics."""
CLOCK_TOLERANCE = 1e-6
"""Rounding of the clocks when a run's speed is read off them, s."""


def is_builtin(run: Run) -> bool:
    """Whether the person is a built-in motion."""
    return run.source.startswith(BUILTIN)


def is_quasi_static(run: Run) -> bool:
    """Whether the clip is one of those that count as quasi-static."""
    if is_builtin(run):
        return run.source.removeprefix(BUILTIN) not in NOT_QUASI_STATIC_BUILTINS
    return PurePath(run.source).name.startswith(QUASI_STATIC_CLIPS)


def is_auto(run: Run) -> bool:
    """Whether the run was made with ``--speed auto``; a run that does not say so was if its clock ever slowed down."""
    speed = settings_of(run.provenance).get("speed")
    return speed == "auto" if speed is not None else not _follows(run, 1.0)


def is_speed_one(run: Run) -> bool:
    """Whether the robot imitated at the person's own speed throughout."""
    return not is_auto(run) and _follows(run, 1.0)


def _follows(run: Run, speed: float) -> bool:
    steps = np.diff(run.human_time) - speed * np.diff(run.time)
    return bool(np.all(np.abs(steps[~np.isnan(steps)]) <= CLOCK_TOLERANCE))
