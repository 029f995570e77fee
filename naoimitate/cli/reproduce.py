"""``naoimitate reproduce``: the evaluation of a paper, our figures beside the authors'."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("paper", metavar="PAPER", type=click.Choice(["koenemann2014"]))
@click.option("--out", type=click.Path(path_type=Path), metavar="FOLDER", help="Results [default: PAPER here].")
@click.option("--repetitions", type=click.IntRange(1, 100), default=10, show_default=True, help="Runs of each case.")
@click.option("--sim/--no-sim", default=True, show_default=True, help="Play the runs in MuJoCo.")
def reproduce(paper: str, out: Path | None, repetitions: int, sim: bool) -> None:
    """Repeat the evaluation of a paper.

    koenemann2014: Figures 7, 8, 9, Table I, and the robot without stabilisation, our figures beside the paper's.
    """
    from naoimitate.cli.folder import make_folder
    from naoimitate.cli.progress import progress
    from naoimitate.cli.simulated import simulated
    from naoimitate.motion import load_motion
    from naoimitate.robot import load_robot
    from naoimitate.run.evaluation import Evaluation, summary, write_evaluation
    from naoimitate.run.reproduce import CAMERA_RATE, MOTIONS, PARAMETER_SETS, direct_baseline, repeat
    from naoimitate.run.table import measure_steps

    folder = make_folder(out or Path(paper))
    robot = load_robot("nao", "v4")
    simulate = (lambda run: simulated(run, robot)) if sim else None
    motions = [load_motion(f"builtin:{name}") for name in MOTIONS]
    cases, tables, baselines = [], {}, []
    for motion in motions:
        for parameters, settings in PARAMETER_SETS.items():
            with progress(f"{motion.name}, parameters {parameters}") as advance:
                cases.append(repeat(motion, robot, parameters, repetitions, simulate, advance))
            tables[motion.name, parameters] = measure_steps(motion, robot, settings, CAMERA_RATE)
        baselines.append(direct_baseline(motion, robot, simulate))
    evaluation = Evaluation(tuple(cases), tables, tuple(baselines))
    written = write_evaluation(evaluation, robot, folder)
    click.echo(summary(evaluation, robot))
    click.echo(f"written: {folder} ({len(written)} files)")
