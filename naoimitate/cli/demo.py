"""``naoimitate demo``: the main job, end to end, on a built-in motion."""

from __future__ import annotations

from pathlib import Path

import click

MOTION = "builtin:paper"


@click.command()
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    default="naoimitate-demo",
    show_default=True,
    help="Results.",
)
def demo(out: Path) -> None:
    """Do the main job on a built-in motion.

    A simulated robot follows a person who balances on one foot with raised arms. Writes run file, scores, report,
    picture strip and video into a folder.
    """
    from naoimitate.cli.folder import make_folder
    from naoimitate.cli.progress import progress
    from naoimitate.cli.simulated import simulated, write_pictures
    from naoimitate.motion import load_motion
    from naoimitate.robot import load_robot
    from naoimitate.run.file import save
    from naoimitate.run.recorded import imitate
    from naoimitate.run.report import write_report
    from naoimitate.run.scores import score_run
    from naoimitate.run.sheet import as_lines

    make_folder(out)
    robot, person = load_robot("nao"), load_motion(MOTION)
    click.echo(f"{robot.name} {robot.version} imitates {MOTION}: {person.notes[0]}")
    click.echo("(the first time this takes a minute longer, because functions are compiled)")
    with progress("imitating") as advance:
        run = imitate(person, robot, progress=advance)
    run = simulated(run, robot)
    save(run, out / "run.npz")
    sheet = score_run(run, robot)
    (out / "scores.txt").write_text("\n".join(as_lines(sheet)) + "\n", encoding="utf-8")
    pictures = write_pictures(run, robot, person, video=out / "video.mp4", strip=out / "strip.png")
    write_report(run, robot, out / "report.html", sheet=sheet, pictures=[p for p in pictures if p.suffix == ".png"])
    click.echo("\n".join(as_lines(sheet)))
    click.echo(f"the simulated robot {'FELL' if run.sim_fell else 'stayed on its feet'}")
    for path in (out / "run.npz", out / "scores.txt", out / "report.html", *pictures):
        click.echo(f"written: {path}")
