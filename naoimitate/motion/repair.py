"""Damage in recorded landmarks: gaps are bridged where they are short, jumps are kept and said."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import LANDMARK, LANDMARKS, SIDES, Array
from naoimitate.motion.track import Track

LONGEST_GAP = 0.25
"""s: longer gaps stay open (NaN), a guess would be no motion of the person's."""
FARTHEST = 1e4
"""m from the origin beyond which a landmark is damage."""
TELEPORT_SPEED = 15.0
"""m/s: no pelvis is faster (sprinters: 12)."""
TELEPORT = 0.3
"""m: shorter jumps between frames are noise, whatever their speed."""
NEEDED = tuple(f"{s}_{p}" for p in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist") for s in SIDES)
"""Landmarks without which there is nothing to imitate."""
_WORDS = {"l": "left", "r": "right"}


def bridged(track: Track, rate: float) -> tuple[Track, list[str]]:
    """The track with short gaps interpolated, and sentences about what was damaged.

    Raises MotionFormatError when a needed landmark is in no frame.
    """
    points = np.concatenate([track.landmarks, track.tips], axis=1)
    with np.errstate(invalid="ignore"):
        bad = np.asarray(~(np.abs(points) < FARTHEST).all(axis=-1))
    points[bad] = np.nan
    for name in NEEDED:
        if bad[:, LANDMARK[name]].all():
            raise MotionFormatError(f"the {_WORDS[name[0]]} {name[2:]} is in no frame: export the clip again")
    gaps = bad & ~bad.all(axis=0)
    if not gaps.any() and np.isfinite(track.turns[:, ~np.isnan(track.turns).all(axis=(0, 2, 3))]).all():
        return _track(points, track.turns), []
    longest = max(1, round(LONGEST_GAP * rate))
    for row in np.flatnonzero(gaps.any(axis=0)):
        _fill(points[:, row], longest)
    turns = _held(track.turns, longest)
    left = (~np.isfinite(points).all(axis=-1) & gaps).any(axis=1).sum()
    notes = [f"{int(gaps.any(axis=1).sum())} frames had gaps; those up to {LONGEST_GAP:g} s were interpolated."]
    if left:
        notes.append(f"{int(left)} frames keep missing landmarks: their gaps are longer.")
    return _track(points, turns), notes


def _track(points: Array, turns: Array) -> Track:
    """The track of landmarks and tips one after the other, (T, 21, 3) m."""
    return Track(points[:, : len(LANDMARKS)], turns, points[:, len(LANDMARKS) :])


def _fill(points: Array, longest: int) -> None:
    """Interpolate gaps of at most ``longest`` frames in (T, 3), in place; at the ends the nearest point is kept."""
    known = np.flatnonzero(np.isfinite(points).all(axis=1))
    for first, last in _gaps(points[:, 0]):
        if last - first + 1 <= longest:
            frames = np.arange(first, last + 1)
            for axis in range(3):
                points[frames, axis] = np.interp(frames, known, points[known, axis])


def _gaps(values: Array) -> list[tuple[int, int]]:
    edges = np.diff(np.concatenate([[0], np.isnan(values).astype(int), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist(), strict=True))


def _held(turns: Array, longest: int) -> Array:
    """Rotations (T, 7, 3, 3) whose gaps of at most ``longest`` frames take the nearest known rotation."""
    turns = turns.copy()
    for segment in range(turns.shape[1]):
        bad = ~np.isfinite(turns[:, segment]).all(axis=(1, 2))
        known = np.flatnonzero(~bad)
        if not len(known):
            continue
        for first, last in _gaps(np.where(bad, np.nan, 0.0)):
            if last - first + 1 <= longest:
                frames = np.arange(first, last + 1)
                nearest = known[np.abs(frames[:, None] - known[None]).argmin(axis=1)]
                turns[frames, segment] = turns[nearest, segment]
    return turns


def teleports(landmarks: Array, time: Array) -> str:
    """A sentence about jumps of the whole person between two frames, or an empty text."""
    pelvis = landmarks[:, LANDMARK["pelvis"]]
    step = np.linalg.norm(np.diff(pelvis, axis=0), axis=-1)
    jumps: npt.NDArray[np.intp] = np.flatnonzero((step > TELEPORT) & (step > TELEPORT_SPEED * np.diff(time)))
    if not len(jumps):
        return ""
    moments = ", ".join(f"{time[i + 1]:.2f} s" for i in jumps[:3]) + (", ..." if len(jumps) > 3 else "")
    farthest = float(step[jumps].max())
    return f"The person jumps up to {farthest:.2f} m between two frames at {moments}; kept as recorded."
