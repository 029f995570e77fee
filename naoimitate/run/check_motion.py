"""What was recognised in a motion, in words and as a picture: stick figures, support modes, foot heights."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from naoimitate.core.frames import LANDMARK, Array, Motion
from naoimitate.motion.describe import describe
from naoimitate.run.contact import intervals
from naoimitate.run.figures import COLOURS, LEFT, MODE_NAMES, RIGHT, legend

FIGURES_DRAWN = 8
"""Stick figures in a picture, at equal steps of time."""
VIEW = np.radians(35.0)
"""Direction from which a stick figure is seen, from its front towards its left, rad."""
GAP = 1.45
"""Between stick figures, m."""
BONES = (
    ("pelvis", "chest", "head"),
    ("l_shoulder", "chest", "r_shoulder"),
    ("l_hip", "pelvis", "r_hip"),
    *((f"{s}_shoulder", f"{s}_elbow", f"{s}_wrist", f"{s}_hand") for s in "lr"),
    *((f"{s}_hip", f"{s}_knee", f"{s}_ankle", f"{s}_toe") for s in "lr"),
)
"""Chains of landmarks that a stick figure joins with lines."""


def describe_motion(motion: Motion) -> list[str]:
    """What is known about a motion, a line each."""
    facts = describe(motion)
    missing = [f"{name} ({100.0 * share:.0f} %)" for name, share in facts["missing"].items()]
    support = [f"{MODE_NAMES[mode]} {100.0 * share:.1f} %" for mode, share in facts["support"].items()]
    span = f"from {facts['start']:.2f} to {facts['end']:.2f} s"
    return [
        f"{facts['name']}: {facts['frames']} frames {span}, {facts['rate']:.1f} Hz",
        *(f"  {note}" for note in facts["notes"]),
        f"  T-pose: {facts['tpose'] or 'none'}",
        f"  person: {_person(facts)}",
        f"  missing landmarks: {', '.join(missing) or 'none'}",
        f"  feet: lowest {facts['lowest_foot']:+.3f} m over the floor",
        f"  support: {', '.join(support) or 'unknown'}",
    ]


def _person(facts: dict[str, Any]) -> str:
    measures = facts["person"]
    if not measures:
        return f"not measured: {facts['not_measured']}"
    arms, legs = (" and ".join(f"{length:.2f}" for length in measures[limb]) for limb in ("arms", "legs"))
    height, ankles = measures["stature"], measures["ankle_height"]
    return f"height {height:.2f} m, arms {arms} m, legs {legs} m, ankles {ankles:.3f} m"


def picture_motion(motion: Motion) -> Figure:
    """Stick figures, support modes and foot heights over time."""
    figure = Figure(figsize=(11.0, 4.8), layout="constrained")
    people, modes, feet = figure.subplots(3, 1, height_ratios=[4, 0.5, 2])
    _draw_people(people, motion)
    _draw_modes(modes, motion)
    for side, colour in (("l", LEFT), ("r", RIGHT)):
        feet.plot(motion.time, motion.landmarks[:, LANDMARK[f"{side}_ankle"], 2], color=colour, label=f"{side} ankle")
        feet.plot(
            motion.time, motion.landmarks[:, LANDMARK[f"{side}_toe"], 2], color=colour, ls=":", label=f"{side} toe"
        )
    feet.set(xlabel="time, s", ylabel="height, m", xlim=_span(motion))
    legend(feet)
    figure.suptitle(motion.name)
    return figure


def _draw_people(axes: Axes, motion: Motion) -> None:
    """Stick figures at equal steps of time, each seen from its own front and a little from its left."""
    frames = np.unique(np.linspace(0, len(motion) - 1, FIGURES_DRAWN).round().astype(int))
    for place, frame in enumerate(frames):
        points = motion.landmarks[frame]
        x = GAP * place + _across(points)
        for bone in BONES:
            rows = [LANDMARK[name] for name in bone]
            colour = {"l_": LEFT, "r_": RIGHT}.get(bone[0][:2], "#444444") if bone[1] != "chest" else "#444444"
            axes.plot(x[rows], points[rows, 2], color=colour, lw=2, marker=".", ms=4, solid_capstyle="round")
        axes.text(GAP * place, -0.18, f"{motion.time[frame]:.2f} s", ha="center")
    axes.axhline(0.0, color="#888888", lw=1)
    axes.set(aspect="equal", ylabel="height, m")
    axes.set_xticks([])
    axes.spines[["top", "right", "bottom"]].set_visible(False)


def _across(points: Array) -> Array:
    """Coordinate of the landmarks across the picture, relative to the pelvis, m."""
    hips = points[LANDMARK["l_hip"]] - points[LANDMARK["r_hip"]]
    heading = np.arctan2(-hips[0], hips[1])
    right = np.array([-np.sin(heading + VIEW), np.cos(heading + VIEW)])
    return np.asarray((points[:, :2] - points[LANDMARK["pelvis"], :2]) @ right)


def _draw_modes(axes: Axes, motion: Motion) -> None:
    if motion.support is not None:
        for mode, colour in COLOURS.items():
            spans = [
                (motion.time[a], motion.time[min(b + 1, len(motion) - 1)]) for a, b in intervals(motion.support == mode)
            ]
            axes.broken_barh([(a, b - a) for a, b in spans], (0, 1), facecolors=colour, label=MODE_NAMES[mode])
    axes.set(yticks=[], xticks=[], xlim=_span(motion), ylabel="support")
    legend(axes)


def _span(motion: Motion) -> tuple[float, float]:
    return float(motion.time[0]), float(max(motion.time[-1], motion.time[0] + 1e-3))
