"""A run on the servos of the simulated robot, and its pictures: what joins the rooms ``run`` and ``sim``."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from naoimitate.core.frames import Motion
    from naoimitate.robot.model import RobotModel
    from naoimitate.run.file import Run


def simulated(run: Run, robot: RobotModel, stiffness: float | None = None, closed: bool = False) -> Run:
    """The run with what the simulated robot made of it.

    stiffness: N m/rad of its servos, which nobody tells the driver. closed: whether the driver's loops are closed.
    """
    from naoimitate.cli.progress import progress
    from naoimitate.hw.feedback import feedback
    from naoimitate.sim.settings import SimSettings
    from naoimitate.sim.simulate import period_of, simulate

    nominal = SimSettings.stiffness
    control = feedback(robot, nominal, period_of(run.time), learning=closed, balance=closed)
    with progress("simulating") as advance:
        result = simulate(
            robot,
            run.time,
            run.q,
            run.base_pos,
            run.base_quat,
            run.support,
            hand_opening=run.hand_opening,
            stiffness=nominal if stiffness is None else stiffness,
            control=control,
            progress=advance,
        )
    return dataclasses.replace(
        run,
        sim_base_pos=result.base_pos,
        sim_base_quat=result.base_quat,
        sim_q=result.q,
        sim_fsr=result.fsr,
        sim_fell=not result.survived,
    )


def write_pictures(
    run: Run, robot: RobotModel, motion: Motion, *, video: Path | None, strip: Path | None
) -> list[Path]:
    """Write video and picture strip, person and robot at equal times: as it moved where the run was simulated.

    Returns what was written. Without off-screen OpenGL nothing is, and a message on standard error says why.
    """
    from naoimitate.cli.outputs import whole
    from naoimitate.cli.progress import progress
    from naoimitate.core.errors import RenderingUnavailable
    from naoimitate.sim.render import render_strip, render_video

    q, base_pos, base_quat = run.q, run.base_pos, run.base_quat
    if run.sim_q is not None and run.sim_base_pos is not None and run.sim_base_quat is not None:
        q, base_pos, base_quat = run.sim_q, run.sim_base_pos, run.sim_base_quat
    seen: dict[str, Any] = {"human": motion, "human_time": run.human_time, "hand_opening": run.hand_opening}
    written: list[Path] = []
    try:
        if strip is not None:
            with whole(strip) as path:
                render_strip(robot, run.time, q, base_pos, base_quat, path, **seen)
            written.append(strip)
        if video is not None:
            with progress("drawing the video") as advance, whole(video) as path:
                render_video(robot, run.time, q, base_pos, base_quat, path, **seen, progress=advance)
            written.append(video)
    except RenderingUnavailable as error:
        click.echo(f"naoimitate: {error}", err=True)
    return written
