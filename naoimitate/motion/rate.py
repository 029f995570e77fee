"""How many frames a second a recording really has."""

from __future__ import annotations

import math
import re

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import Array
from naoimitate.motion.clip import Clip
from naoimitate.motion.families import CMU
from naoimitate.motion.flight import rate_by_flight

CMU_RATE = 120.0
"""Hz, of CMU's recordings; their AMC files do not say it."""
CMU_SUBJECTS_AT_60 = ("88", "141", "142", "143")
"""Subjects whose files say 120 Hz and were recorded at 60: free flights of 88 fall with 4 g, 141 waves at twice a
human's pace (mocap/INDEX.yaml)."""
RATES = (1.0, 2000.0)
"""Hz: frame times outside of these are mistakes of the file."""


def true_rate(clip: Clip, landmarks: Array, file_name: str, family: str, asked: float | None) -> tuple[float, str]:
    """Frames per second and a sentence about it.

    landmarks: (T, 19, 3) m, z up, of the motion alone. asked: by the user, who is believed. Else the file's rate,
    corrected for known files and where free flight shows another.
    Raises MotionFormatError when the file has none, or one that cannot be.
    """
    if asked is not None:
        if not (math.isfinite(asked) and asked > 0.0):
            raise MotionFormatError(f"{asked} is no frame rate: give frames per second, e.g. --fps 120")
        return asked, f"The frame rate is {asked:g} Hz as asked."
    labelled = clip.rate if clip.rate is not None else CMU_RATE if clip.format == "AMC" else None
    if labelled is None or not RATES[0] <= labelled <= RATES[1]:
        raise MotionFormatError("the file has no usable frame rate: say it with --fps, e.g. --fps 120")
    if round(labelled) == CMU_RATE and family.startswith(CMU) and (subject := _slow_subject(file_name)):
        return 60.0, f"The frame rate is 60 Hz: CMU's subject {subject} was recorded at 60, though files say 120."
    rate, note = rate_by_flight(landmarks, labelled)
    if note:
        return rate, note
    said = "CMU's, the file has none" if clip.rate is None else "the file's"
    return labelled, f"The frame rate is {labelled:g} Hz, {said}."


def _slow_subject(file_name: str) -> str:
    """The subject's number when a file's name has that of a subject recorded at 60 Hz, as 88_03 or 141_16."""
    found = re.search(rf"(?<!\d)0*({'|'.join(CMU_SUBJECTS_AT_60)})_\d\d(?!\d)", file_name)
    return found.group(1) if found else ""
