"""``naoimitate score``: the score sheet of a run file."""

from __future__ import annotations

import json
from pathlib import Path

import click

MISSED = 1
"""Exit status of ``--check`` when a bar is missed."""


@click.command()
@click.argument("run_file", metavar="RUN.npz", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="One JSON object: every measure by its key, bars under 'bars'.")
@click.option("--check", is_flag=True, help="Exit with 1 when a bar is missed.")
@click.option("--robot", metavar="FOLDER", help="Folder of the run's robot, when it is not a built-in one.")
@click.pass_context
def score(context: click.Context, run_file: Path, as_json: bool, check: bool, robot: str | None) -> None:
    """Measure a run.

    One line per measure of RUN.npz, with its bar and whether it is met.
    """
    from naoimitate.core.errors import RobotModelError
    from naoimitate.robot import load_robot, robot_names
    from naoimitate.run.file import load_run
    from naoimitate.run.scores import score_run
    from naoimitate.run.sheet import as_dict, as_lines

    run = load_run(run_file)
    if robot is None and run.robot not in robot_names():
        raise RobotModelError(f"{run_file} is of the robot '{run.robot}', which is not built in: name it with --robot")
    sheet = score_run(run, load_robot(robot or run.robot, run.robot_version))
    click.echo(json.dumps(as_dict(sheet)) if as_json else "\n".join(as_lines(sheet)))
    if check and any(measure.passed is False for measure in sheet):
        context.exit(MISSED)
