"""Static stability: how far inside the support polygon the centre of mass stays."""

from __future__ import annotations

import numpy as np

from naoimitate.run.file import Run
from naoimitate.run.measure import Bar, Measure
from naoimitate.run.replay import Array, Replay

MIN_MARGIN = 5.0
"""Smallest allowed distance of the centre of mass to the edge of the support polygon, mm."""
PLANNED_MARGIN = 25.0
"""Distance planned for in single support, mm."""
MM = 1000.0


def margins_at_frames(run: Run, frames: Replay) -> Array:
    """Signed distance to the edge of the support polygon at the frames, (T,) m."""
    return frames.margins(run.support)


def margins_between(run: Run, middles: Replay) -> Array:
    """The same half-way between the frames, (T - 1,) m: where the support changes, the worse of both modes."""
    return np.minimum(middles.margins(run.support[:-1]), middles.margins(run.support[1:]))


def stability(run: Run, frames: Replay, middles: Replay) -> list[Measure]:
    """The measures of the static margin."""
    at, between = margins_at_frames(run, frames), margins_between(run, middles)
    every = np.concatenate([at, between])
    single = at[run.support != "D"]
    return [
        Measure("margin_min_mm", "static margin, least", MM * float(every.min()), "mm", Bar(MIN_MARGIN, at_least=True)),
        Measure("outside_frames", "frames and midpoints outside", int(np.sum(every < 0.0)), "", Bar(0)),
        Measure(
            "margin_single_min_mm",
            "static margin on one foot, least",
            MM * float(single.min()) if len(single) else None,
            "mm",
            note=f"planned at {PLANNED_MARGIN:g} mm",
        ),
    ]
