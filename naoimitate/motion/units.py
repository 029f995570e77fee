"""Which way is up in a file and how long its unit is, told from the size and the posture of the person in it."""

from __future__ import annotations

import math

import numpy as np

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import LANDMARK, SIDES
from naoimitate.human.body import LEG_BY_STATURE
from naoimitate.motion.track import Track

CMU_UNIT = 0.0254 / 0.45
"""m; CMU's skeletons are in inches times 0.45 (header of its ASF files)."""
UNITS = {
    "metres": 1.0,
    "decimetres": 0.1,
    "centimetres": 0.01,
    "millimetres": 0.001,
    "inches": 0.0254,
    "feet": 0.3048,
    "CMU's units of 0.056444 m": CMU_UNIT,
}
"""Units that motion files are written in, m."""
STATURES = (0.9, 2.25)
"""m: from a child of three years to the tallest of people."""
USUAL_STATURE = 1.70
"""m: between units that all give a possible person, the one that gives the most usual person is taken."""
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Turns y up to z up."""
HELD = 0.3
"""A pelvis that stays nearer to the origin than this share of the legs' length is held there."""
SURE = 0.75
"""Share of the body's length along an axis above which that axis is called its up axis."""


def metres_per_unit(leg: float, declared: float | None, asked: float | None) -> tuple[float, str]:
    """Metres per file unit and a sentence why.

    leg: thigh and shank, file units. declared: by the file's header. asked: by the user, who is believed.
    Raises MotionFormatError when there is no leg to measure or the asked unit is no length.
    """
    if asked is not None and not (math.isfinite(asked) and asked > 0.0):
        raise MotionFormatError(f"the unit {asked} is no length: give metres per unit of the file, e.g. --unit 0.01")
    if not (math.isfinite(leg) and leg > 0.0):
        raise MotionFormatError("the legs of the skeleton have no length: export it with its bone lengths")
    stature = leg / LEG_BY_STATURE
    if asked is not None:
        return asked, f"The unit is {asked:g} m as asked; the person is {asked * stature:.2f} m tall."
    if declared is not None and (declared == 1.0 or _possible(declared * stature)):
        return (
            declared,
            f"The file says that its unit is {declared:.6g} m; the person is {declared * stature:.2f} m tall.",
        )
    fitting = [(name, unit) for name, unit in UNITS.items() if _possible(unit * stature)]
    if not fitting:
        unit = USUAL_STATURE / stature
        return unit, (
            f"No usual unit makes a person of these legs ({leg:.4g} units): scaled to a stature of {USUAL_STATURE} m;"
            " say the unit with --unit."
        )
    name, unit = min(fitting, key=lambda f: abs(math.log(f[1] * stature / USUAL_STATURE)))
    return unit, f"The unit is taken as {name}: the person is {unit * stature:.2f} m tall by the legs."


def _possible(stature: float) -> bool:
    return STATURES[0] <= stature <= STATURES[1]


def up_axis(track: Track, rest: Track, declared: str | None, asked: str | None) -> tuple[str, str]:
    """``y`` or ``z``, and a sentence why.

    The axis along which the person stands most of the time and in the rest pose. Where the two differ (a person who
    lies all the time, or a skeleton built for another world) the one in which the lowest point stays at one level.
    Raises MotionFormatError when the asked axis is neither.
    """
    if asked is not None:
        if asked.lower() not in ("y", "z"):
            raise MotionFormatError(f"the up axis {asked!r} is unknown: choose --up y or --up z")
        return asked.lower(), f"Up is the file's {asked.lower()} axis as asked."
    if declared is not None:
        return declared, f"Up is the file's {declared} axis by its format."
    moving, standing = _upright(track), _upright(rest)
    if moving is None and standing is None:
        return "y", "Up is taken as the file's y axis: neither posture nor rest pose tells."
    if moving is None or standing is None or moving == standing:
        axis = moving or standing or "y"
        return axis, f"Up is the file's {axis} axis: the person stands along it."
    axis = min((moving, standing), key=lambda a: _floor_unrest(track, "xyz".index(a)))
    return (
        axis,
        f"Up is the file's {axis} axis: the floor is level along it, though the rest pose stands along {standing}.",
    )


def _upright(track: Track) -> str | None:
    """The axis along which shoulders are above ankles (or below, upside down) for most of the time, if one is clear."""
    body = sum(
        track.landmarks[:, LANDMARK[f"{s}_shoulder"]] - track.landmarks[:, LANDMARK[f"{s}_ankle"]] for s in SIDES
    )
    length = np.linalg.norm(body, axis=-1, keepdims=True)
    body = np.abs(body / np.where(length > 0.0, length, np.nan))
    if not np.isfinite(body).any():
        return None
    share = np.nanmedian(body[np.isfinite(body).all(axis=-1)], axis=0)
    axis = "y" if share[1] >= share[2] else "z"
    return axis if max(share[1], share[2]) > SURE else None


def _floor_unrest(track: Track, axis: int) -> float:
    """How far the lowest landmark is from the level zero and how much it moves, in file units.

    The level tells nothing where the pelvis is held at the origin, as some suits record it.
    """
    heights = track.landmarks[..., axis]
    finite = np.where(np.isfinite(heights), heights, np.inf).min(axis=1)
    lowest = finite[np.isfinite(finite)]
    if not len(lowest):
        return math.inf
    level = 0.0 if _is_held(track) else abs(float(np.median(lowest)))
    return float(np.percentile(lowest, 90) - np.percentile(lowest, 10)) + level


def _is_held(track: Track) -> bool:
    """Whether the pelvis stays so near the origin that no floor is at the level zero."""
    pelvis, ankles = track.landmarks[:, LANDMARK["pelvis"]], [LANDMARK[f"{s}_ankle"] for s in SIDES]
    legs = np.linalg.norm(track.landmarks[:, ankles].mean(axis=1) - pelvis, axis=-1)
    away = np.linalg.norm(pelvis, axis=-1)
    return bool(np.nanmedian(away) < HELD * np.nanmedian(legs)) if np.isfinite(away + legs).any() else False
