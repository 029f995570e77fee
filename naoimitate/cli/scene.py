"""``naoimitate scene``: a tele-operated task in simulation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from naoimitate.cli import types

if TYPE_CHECKING:
    from naoimitate.core.frames import Motion
    from naoimitate.robot.model import RobotModel
    from naoimitate.run.file import Run
    from naoimitate.sim.tasks import Attempt

FAILED = 1
"""Exit status when the robot did not do it."""


@click.command()
@click.argument("name")
@click.option("--out", type=types.RUN_FILE, help="Run file to write.")
@click.option("--video", type=types.VIDEO_FILE, help="Write a video: the scene, and what the robot's cameras see.")
@click.option("--robot-version", metavar="VERSION", help="Version of the robot [default: v4].")
@click.pass_context
def scene(context: click.Context, name: str, out: Path | None, video: Path | None, robot_version: str | None) -> None:
    """Pick up a ball by tele-operation and drop it into a bucket, in simulation.

    NAME is lean (on one foot, the other leg back) or step (two steps first). The operator is a built-in motion. The
    exit status is 0 when the ball lies in the bucket and the robot did not fall, else 1.
    """
    from naoimitate.cli.outputs import keep_apart
    from naoimitate.cli.progress import progress
    from naoimitate.motion.builtin import builtin_motion
    from naoimitate.robot import load_robot
    from naoimitate.run.file import save
    from naoimitate.sim.tasks import perform, task_of

    keep_apart([], [out, video])
    task = task_of(name)
    robot, operator = load_robot("nao", robot_version), builtin_motion(task.motion)
    click.echo(f"{task.name}: {task.about}")
    with progress("performing") as advance:
        attempt = perform(task, robot, operator, progress=advance)
    click.echo("\n".join(_story(attempt)))
    if out is not None:
        save(_run(attempt, robot, operator), out)
        click.echo(f"written: {out}")
    if video is not None:
        _film(attempt, robot, video)
    if not attempt.success:
        context.exit(FAILED)


def _story(attempt: Attempt) -> list[str]:
    """What happened, in the order of time."""
    lines = []
    if attempt.picked is None:
        lines.append("  the ball was not picked up")
    else:
        support = attempt.commands[attempt.picked].support
        feet = {"D": "both feet", "L": "the left foot", "R": "the right foot"}[support]
        lines.append(f"  {attempt.time[attempt.picked]:.1f} s: the ball is picked up, the robot on {feet}")
        lines.append(f"  at the end the ball {'lies' if attempt.dropped else 'does NOT lie'} in the bucket")
    lines.append(f"  largest load on a foot in the air: {100.0 * attempt.swing_load.max():.1f} % of the weight")
    lines.append(f"  {'FELL' if attempt.fell.any() else 'did not fall'}")
    return [*lines, "  success" if attempt.success else "  NO success"]


def _run(attempt: Attempt, robot: RobotModel, operator: Motion) -> Run:
    """The attempt as a run, with what the simulated robot made of it."""
    from naoimitate.run.columns import columns, constants
    from naoimitate.run.file import Run
    from naoimitate.run.provenance import provenance
    from naoimitate.sim.tasks import OPERATED

    text = provenance(OPERATED, source_sha256=operator.sha256, seed=0, speed=1.0, scene=attempt.task.name)
    return Run(
        **constants(robot, attempt.mapping, OPERATED.retarget, operator.source, text),
        **columns(attempt.commands),
        human_time=attempt.time - attempt.time[0],
        step_time=attempt.step_time,
        sim_q=attempt.moved.q,
        sim_fsr=attempt.moved.fsr,
        sim_base_pos=attempt.moved.base_pos,
        sim_base_quat=attempt.moved.base_quat,
        sim_fell=bool(attempt.fell.any()),
    )


def _film(attempt: Attempt, robot: RobotModel, video: Path) -> None:
    """Write the video; without off-screen OpenGL a message on standard error says why there is none."""
    from naoimitate.cli.outputs import whole
    from naoimitate.cli.progress import progress
    from naoimitate.core.errors import RenderingUnavailable
    from naoimitate.sim.tasks_film import film_task

    try:
        with progress("drawing the video") as advance, whole(video) as path:
            film_task(attempt, list(robot.data.get("cameras", {})), path, advance)
        click.echo(f"written: {video}")
    except RenderingUnavailable as error:
        click.echo(f"naoimitate: {error}", err=True)
