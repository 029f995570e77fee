"""The figures of a run, each a function that draws on one axes; all share the robot's clock as their x axis.

To add a figure, write its function and register it in ``FIGURES``.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from naoimitate.core.frames import GivenUp
from naoimitate.robot.model import RobotModel
from naoimitate.run.contact import intervals
from naoimitate.run.file import Run
from naoimitate.run.limits import SPEED_FRACTION, speed_ratios
from naoimitate.run.replay import Replay, frames
from naoimitate.run.similarity import errors
from naoimitate.run.stability import MIN_MARGIN, PLANNED_MARGIN, margins_at_frames

COLOURS = {"D": "#9aa5b1", "L": "#2f6fb0", "R": "#d9822b", "F": "#c0392b"}
MODE_NAMES = {"D": "double", "L": "left", "R": "right", "F": "flight"}
HUMAN, ROBOT, BAR = "#b9c0c7", "#2f6fb0", "#c0392b"
LEFT, RIGHT = COLOURS["L"], COLOURS["R"]
WIDTH, LEFT_EDGE, RIGHT_EDGE, BOTTOM, TOP = 9.0, 0.85, 0.15, 0.5, 0.3
"""Width of every figure and its margins, inch: the same for all, so that their time axes lie above each other."""


@dataclass(frozen=True)
class Subject:
    """What a figure is drawn from."""

    run: Run
    robot: RobotModel
    frames: Replay


@dataclass(frozen=True)
class RunFigure:
    """A figure: its name, what it shows in one sentence, its height (inch), and the function that draws it."""

    name: str
    caption: str
    height: float
    draw: Callable[[Axes, Subject], None]


def draw_support(axes: Axes, subject: Subject) -> None:
    """Support modes of the person (above) and of the robot (below) as coloured bands."""
    run = subject.run
    for row, modes in enumerate((run.support, run.human_support)):
        for mode, colour in COLOURS.items():
            spans = [(run.time[a], run.time[min(b + 1, len(run) - 1)]) for a, b in intervals(modes == mode)]
            axes.broken_barh([(a, b - a) for a, b in spans], (row - 0.4, 0.8), facecolors=colour)
    axes.set_yticks([0, 1], ["robot", "person"])
    handles = [axes.plot([], [], lw=8, color=colour, label=MODE_NAMES[mode])[0] for mode, colour in COLOURS.items()]
    legend(axes, handles=handles)


def draw_offset(axes: Axes, subject: Subject) -> None:
    """The normalised offset of the centre of mass between the feet (the paper's Fig. 9)."""
    run = subject.run
    axes.plot(run.time, run.human_offset, color=HUMAN, lw=3.5, label="person")
    axes.plot(run.time, run.offset, color=ROBOT, label="robot")
    axes.set(ylabel="offset", ylim=(-0.05, 1.05))
    axes.set_yticks([0, 0.5, 1], ["left 0", "0.5", "right 1"])
    legend(axes)


def draw_hands(axes: Axes, subject: Subject) -> None:
    """Distance of the hands to their targets (the paper's Fig. 7)."""
    _draw_errors(axes, subject, (0, 2))


def draw_feet(axes: Axes, subject: Subject) -> None:
    """Distance of the feet to their targets (the paper's Fig. 8)."""
    _draw_errors(axes, subject, (1, 3))


def draw_margin(axes: Axes, subject: Subject) -> None:
    """Distance of the centre of mass to the edge of the support polygon."""
    axes.plot(subject.run.time, 1000.0 * margins_at_frames(subject.run, subject.frames), color=ROBOT)
    axes.axhline(MIN_MARGIN, color=BAR, lw=1, label="least allowed")
    axes.axhline(PLANNED_MARGIN, color=BAR, lw=1, ls=":", label="planned on one foot")
    axes.set(ylabel="margin, mm")
    legend(axes)


def draw_speed(axes: Axes, subject: Subject) -> None:
    """The fastest joint of each limb, as a share of its motor's no-load speed."""
    run, robot = subject.run, subject.robot
    if len(run) > 1:
        ratios = speed_ratios(run, robot)
        for name, joints in robot.chains.items():
            axes.plot(run.time[1:], ratios[:, list(joints)].max(axis=1), lw=1, label=name)
    axes.axhline(SPEED_FRACTION, color=BAR, lw=1)
    axes.set(ylabel="speed / no-load", ylim=(0.0, None))
    legend(axes)


def draw_time_law(axes: Axes, subject: Subject) -> None:
    """The moment of the recording that each frame imitates; flat where the robot waits."""
    axes.plot(subject.run.time, subject.run.human_time, color=ROBOT)
    axes.set(ylabel="time of the person, s")


def draw_given_up(axes: Axes, subject: Subject) -> None:
    """What similarity was sacrificed for."""
    run, bits = subject.run, list(GivenUp)
    for row, bit in enumerate(bits):
        spans = [(run.time[a], run.time[min(b + 1, len(run) - 1)]) for a, b in intervals(run.given_up & bit.value != 0)]
        axes.broken_barh([(a, b - a) for a, b in spans], (row - 0.4, 0.8), facecolors=ROBOT)
    axes.set_yticks(range(len(bits)), [str(bit.name).lower() for bit in bits])
    axes.set(ylim=(len(bits) - 0.5, -0.5))


FIGURES = (
    RunFigure("support", "Support modes of the person and of the robot.", 1.5, draw_support),
    RunFigure("offset", "Normalised offset of the centre of mass between the feet.", 2.2, draw_offset),
    RunFigure("hands", "Distance of the hands to their targets, equation (5).", 2.2, draw_hands),
    RunFigure("feet", "Distance of the feet to their targets, equation (5).", 2.2, draw_feet),
    RunFigure("margin", "Centre of mass to the edge of the support polygon.", 2.2, draw_margin),
    RunFigure("speed", "Fastest joint of each limb over its motor's no-load speed.", 2.2, draw_speed),
    RunFigure("time-law", "Which moment of the recording the robot imitates.", 2.2, draw_time_law),
    RunFigure("given-up", "What similarity was sacrificed for.", 2.4, draw_given_up),
)


def draw(figure: RunFigure, run: Run, robot: RobotModel) -> Figure:
    """One figure of a run as a matplotlib figure."""
    canvas = Figure(figsize=(WIDTH, figure.height))
    across, up = WIDTH - LEFT_EDGE - RIGHT_EDGE, figure.height - BOTTOM - TOP
    axes = canvas.add_axes((LEFT_EDGE / WIDTH, BOTTOM / figure.height, across / WIDTH, up / figure.height))
    figure.draw(axes, Subject(run, robot, frames(run, robot)))
    axes.set(xlabel="time of the robot, s", xlim=(run.time[0], max(run.time[-1], run.time[0] + 1e-3)))
    axes.spines[["top", "right"]].set_visible(False)
    return canvas


def as_png(figure: Figure, dpi: int = 110) -> bytes:
    """A matplotlib figure as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    return buffer.getvalue()


def legend(axes: Axes, **options: Any) -> None:
    """A legend in one line above the axes, where it hides nothing; none where nothing has a label."""
    if not options and not axes.get_legend_handles_labels()[0]:
        return
    axes.legend(ncol=9, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1, frameon=False, **options)


def _draw_errors(axes: Axes, subject: Subject, columns: tuple[int, int]) -> None:
    error = 100.0 * errors(subject.run, subject.frames)
    for column, label, colour in zip(columns, ("left", "right"), (LEFT, RIGHT), strict=True):
        mean = np.nanmean(error[:, column]) if not np.all(np.isnan(error[:, column])) else np.nan
        axes.plot(subject.run.time, error[:, column], color=colour, label=f"{label}, mean {mean:.2f} cm")
    axes.set(ylabel="error, cm", ylim=(0.0, None))
    legend(axes)
