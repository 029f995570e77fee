"""A part of a motion, between two moments."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import Motion

FRAMEWISE = ("landmarks", "orientations", "com", "contacts", "support", "hand_opening")
"""What a motion has one value of for each frame, beside the time."""
ROUNDING = 1e-9
"""s, of frame times."""


def stretch(motion: Motion, start: float | None, end: float | None) -> Motion:
    """The frames from ``start`` to ``end`` (s, None for as far as it goes), at their own times.

    Raises MotionFormatError when no frame is among them.
    """
    first, last = (-math.inf if start is None else start), (math.inf if end is None else end)
    inside = (motion.time >= first - ROUNDING) & (motion.time <= last + ROUNDING)
    if not inside.any():
        whole = f"{motion.time[0]:.2f} to {motion.time[-1]:.2f} s"
        raise MotionFormatError(f"no frame lies between --start and --end: {motion.name} goes from {whole}")
    if inside.all():
        return motion
    arrays = {name: getattr(motion, name) for name in ("time", *FRAMEWISE)}
    kept: dict[str, Any] = {name: None if values is None else values[inside] for name, values in arrays.items()}
    return replace(motion, **kept)
