"""What the simulated robot and the clock say: did it fall, and what a step cost."""

from __future__ import annotations

import numpy as np

from naoimitate.core.falling import has_tipped, tilt
from naoimitate.run.file import Run
from naoimitate.run.measure import Bar, Measure

MS = 1000.0


def fell(run: Run) -> bool | None:
    """Whether the simulated robot fell; None without simulation.

    The simulation's own word (which knows the load on the feet) or the recorded torso: either is enough.
    """
    if run.sim_fell is None:
        return None
    return bool(run.sim_fell) or _toppled(run)


def _toppled(run: Run) -> bool:
    if run.sim_base_pos is None or run.sim_base_quat is None:
        return False
    height_ratio = run.sim_base_pos[:, 2] / run.base_pos[:, 2]
    return bool(has_tipped(tilt(run.base_quat, run.sim_base_quat), height_ratio).any())


def survival(run: Run) -> list[Measure]:
    """The measures of survival and of time."""
    step = MS * run.step_time
    note = "" if run.sim_fell is not None else "no simulation in this run; use imitate --sim"
    return [
        Measure("fell", "fell in simulation", fell(run), "", Bar(0), note=note),
        Measure("step_time_mean_ms", "step time, mean", float(step.mean()), "ms"),
        Measure("step_time_p99_ms", "step time, 99th percentile", float(np.percentile(step, 99)), "ms"),
        Measure("step_time_max_ms", "step time, largest", float(step.max()), "ms"),
    ]
