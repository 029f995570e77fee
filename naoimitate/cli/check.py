"""``naoimitate check``: what was recognised in a motion or a robot, and a picture of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from naoimitate.cli import types
from naoimitate.cli.source import motion_options, read_motion

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@click.command()
@click.argument("source", metavar="MOTION|ROBOT")
@motion_options
@click.option("--robot-version", metavar="VERSION", help="Version of a ROBOT.")
@click.option("--out", type=types.PICTURE_FILE, help="The picture [default: NAME-check.png here].")
def check(source: str, robot_version: str | None, out: Path | None, **reading: Any) -> None:
    """Say what a motion or a robot holds, and draw it.

    MOTION is a file or builtin:NAME; ROBOT is the name of a built-in one, or a folder. Says what was recognised and
    what is missing, and writes a picture.
    """
    from naoimitate.cli.outputs import keep_apart, whole
    from naoimitate.core.errors import NaoimitateError
    from naoimitate.run.figures import as_png

    keep_apart((source, reading["skeleton"]), [out])
    lines, figure = _robot(source, robot_version) if _is_robot(source) else _motion(source, reading)
    click.echo("\n".join(lines))
    path = out or Path(f"{Path(source.replace(':', '-')).stem}-check.png")
    try:
        with whole(path) as beside:
            beside.write_bytes(as_png(figure))
    except OSError as error:
        raise NaoimitateError(f"cannot write {path}: {error.strerror}; choose another place with --out") from error
    click.echo(f"  picture: {path}")


def _is_robot(source: str) -> bool:
    from naoimitate.robot import robot_names

    return source in robot_names() or Path(source).is_dir()


def _robot(source: str, version: str | None) -> tuple[list[str], Figure]:
    from naoimitate.robot import load_robot
    from naoimitate.run.check_robot import describe_robot, picture_robot

    robot = load_robot(source, version)
    return describe_robot(robot), picture_robot(robot)


def _motion(source: str, reading: dict[str, Any]) -> tuple[list[str], Figure]:
    from naoimitate.run.check_motion import describe_motion, picture_motion

    motion = read_motion(source, **reading)
    return describe_motion(motion), picture_motion(motion)
