"""Options that the commands share which imitate: the robot, and choices of the method."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

_ROBOT = click.option("--robot", default="nao", show_default=True, help="A built-in robot, or a folder with one.")
_VERSION = click.option("--robot-version", metavar="VERSION", help="Version of the robot [default: v4 for nao].")

shift_option = click.option(
    "--shift",
    type=click.Choice(["pendulum", "parabola"]),
    default="pendulum",
    show_default=True,
    help="How the weight goes from foot to foot: as fast as balance allows, or by the paper's speed law.",
)
head_option = click.option(
    "--head",
    type=click.Choice(["follow", "left-hand", "right-hand"]),
    default="follow",
    show_default=True,
    help="The head follows the person's, or looks at a hand of the robot.",
)


def robot_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that name a robot to a command."""
    return _ROBOT(_VERSION(command))
