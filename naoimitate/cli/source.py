"""Where the person comes from: the options that say how a motion file is to be read, shared by commands."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from naoimitate.cli.types import FILE_RATE, METRES, MOMENT

if TYPE_CHECKING:
    from naoimitate.core.frames import Motion

Command = TypeVar("Command", bound=Callable[..., Any])

OPTIONS = (
    click.option(
        "--tpose-at",
        type=MOMENT,
        default="auto",
        show_default=True,
        help="Moment of the T-pose; none: the skeleton's rest pose.",
    ),
    click.option("--fps", type=FILE_RATE, help="Frame rate, where the file's own is wrong."),
    click.option("--unit", type=METRES, help="Metres per unit of the file."),
    click.option("--up", type=click.Choice(["y", "z"]), help="The file's axis that points up."),
    click.option(
        "--skeleton",
        type=click.Path(path_type=Path),
        metavar="FILE.asf",
        help="Skeleton of an .amc file; else the one .asf beside it.",
    ),
)


def motion_options(command: Command) -> Command:
    """Add the options of reading a motion to a command; ``read_motion`` takes their values."""
    for option in reversed(OPTIONS):
        command = option(command)
    return command


def read_motion(
    motion: str,
    *,
    tpose_at: float | str,
    fps: float | None,
    unit: float | None,
    up: str | None,
    skeleton: Path | None,
) -> Motion:
    """The motion that a command was given. Raises MotionFormatError, also for a name that lacks ``builtin:``."""
    from naoimitate.core.errors import MotionFormatError
    from naoimitate.motion import load_motion
    from naoimitate.motion.builtin import builtin_names

    if motion in builtin_names() and not Path(motion).exists():
        raise MotionFormatError(f"there is no file '{motion}' here: for the built-in motion write builtin:{motion}")
    return load_motion(motion, tpose_at=tpose_at, fps=fps, unit=unit, up=up, skeleton=skeleton)
