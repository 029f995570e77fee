"""``naoimitate imitate``: a recorded motion becomes a run file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from naoimitate.cli import types
from naoimitate.cli.method import head_option, robot_options, shift_option
from naoimitate.cli.source import motion_options, read_motion

if TYPE_CHECKING:
    from naoimitate.robot.model import RobotModel
    from naoimitate.run.file import Run


@click.command()
@click.argument("motion")
@click.option("--out", type=types.RUN_FILE, required=True, help="Run file to write.")
@robot_options
@click.option("--method", type=click.Choice(["static"]), default="static", show_default=True, help="How to imitate.")
@shift_option
@click.option(
    "--retarget",
    type=click.Choice(["planted", "paper", "direct"]),
    default="planted",
    show_default=True,
    help="Feet in double support: fixed on the floor, shifted as in the paper, or not stabilised at all (falls).",
)
@click.option(
    "--speed", type=types.FACTOR_OR_AUTO, default=1.0, show_default=True, help="auto: slower where the robot needs it."
)
@click.option("--rate", type=types.RUN_RATE, default=100.0, show_default=True, help="Commands a second.")
@click.option("--sample", type=types.SAMPLE_RATE, help="See the person only so often, as a camera would.")
@click.option("--start", type=types.SECONDS, help="Begin at this moment of the motion.")
@click.option("--end", type=types.SECONDS, help="End at this moment of the motion.")
@motion_options
@click.option("--subject", type=click.Path(path_type=Path), metavar="FILE", help="Person measured by 'calibrate'.")
@click.option(
    "--hand-orientation",
    type=click.Choice(["free", "upright", "follow"]),
    default="free",
    show_default=True,
    help="How the hands turn.",
)
@head_option
@click.option("--mirror", is_flag=True, help="The robot is the person's mirror image.")
@click.option("--seed", type=int, default=0, show_default=True, help="Of everything random.")
@click.option(
    "--sim/--no-sim", default=False, show_default=True, help="Play the run on the servos of the simulated robot."
)
@click.option(
    "--sim-stiffness",
    type=types.STIFFNESS,
    help="Of the simulated servos, N m/rad; the driver is not told.  [default: 300]",
)
@click.option(
    "--feedback/--no-feedback",
    default=False,
    show_default=True,
    help="Let the simulated robot's driver learn its servos and balance by its sensors.",
)
@click.option("--video", type=types.VIDEO_FILE, help="Write a video of person and robot.")
@click.option("--report", type=types.REPORT_FILE, help="Write a report: scores and plots in one HTML file.")
def imitate(motion: str, **options: Any) -> None:
    """Imitate a recorded motion.

    MOTION is a file or builtin:NAME. Every frame of the run file is statically stable, but with --retarget direct;
    'naoimitate score' measures it.
    """
    from naoimitate.cli.outputs import keep_apart, whole
    from naoimitate.cli.progress import progress
    from naoimitate.cli.simulated import simulated, write_pictures
    from naoimitate.human.mirror import mirrored
    from naoimitate.robot import load_robot
    from naoimitate.run.file import save
    from naoimitate.run.recorded import imitate as run_recorded
    from naoimitate.run.report import write_report

    if not options["sim"] and (options["sim_stiffness"] is not None or options["feedback"]):
        raise click.UsageError("--sim-stiffness and --feedback are of the simulated robot: add --sim")
    keep_apart((motion, options["subject"], options["skeleton"]), [options[key] for key in ("out", "video", "report")])
    robot = load_robot(options["robot"], options["robot_version"])
    person = read_motion(motion, **{key: options[key] for key in ("tpose_at", "fps", "unit", "up", "skeleton")})
    if options["mirror"]:
        person = mirrored(person)
    with progress(f"imitating {person.name}") as advance:
        run = run_recorded(person, robot, progress=advance, **_choices(options))
    if options["sim"]:
        run = simulated(run, robot, options["sim_stiffness"], options["feedback"])
    save(run, options["out"])
    if options["video"]:
        write_pictures(run, robot, person, video=options["video"], strip=None)
    if options["report"]:
        with whole(options["report"]) as path:
            write_report(run, robot, path)
    click.echo("\n".join(_summary(run, robot, options["out"], (*person.notes, person.tpose_note))))


def _choices(options: dict[str, Any]) -> dict[str, Any]:
    """The arguments of ``run.recorded.imitate`` that the options stand for."""
    import hashlib

    from naoimitate.balance.offset import OffsetLaw
    from naoimitate.calib.subject import calibrate, load_subject
    from naoimitate.human.mirror import mirrored_frame
    from naoimitate.settings import Settings

    settings = Settings(
        retarget=options["retarget"],
        hand_orientation=options["hand_orientation"],
        head=options["head"],
        offset=OffsetLaw(shift=options["shift"]),
    )
    choices = {key: options[key] for key in ("speed", "rate", "sample", "start", "end", "seed")}
    if options["subject"] is not None:
        subject = load_subject(options["subject"])
        choices["subject"] = calibrate(mirrored_frame(subject.tpose)) if options["mirror"] else subject
        choices["subject_sha256"] = hashlib.sha256(options["subject"].read_bytes()).hexdigest()
    return {"settings": settings, **choices}


def _summary(run: Run, robot: RobotModel, out: Path, notes: tuple[str, ...]) -> list[str]:
    """What a person wants to know at once; the rest is in the score sheet."""
    from naoimitate.core.frames import GivenUp

    lines = [f"  {note}" for note in notes if note]
    lines.append(f"{out}: {len(run)} frames, {run.duration:.2f} s on {robot.name} {robot.version}")
    for bit in GivenUp:
        share = float((run.given_up & bit.value != 0).mean())
        if share > 0.0:
            lines.append(f"  given up for {str(bit.name).lower()}: {100.0 * share:.1f} % of the frames")
    if run.sim_fell is not None:
        lines.append(f"  in simulation: {'FELL' if run.sim_fell else 'did not fall'}")
    return lines
