"""``naoimitate stress``: motions on a simulated robot that is not quite the one that was planned for."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from naoimitate.cli import types
from naoimitate.cli.method import robot_options

if TYPE_CHECKING:
    from rich.table import Table

    from naoimitate.robot.model import RobotModel
    from naoimitate.sim.stress import Kind
    from naoimitate.sim.stress_play import Plan
    from naoimitate.sim.stress_pool import Pool
    from naoimitate.sim.stress_sweep import Boundary
    from naoimitate.sim.stress_table import Case, Row

FELL = 1
"""Exit status of ``--check`` when the robot fell."""
TOLD = 12
"""Falls that are told one by one; the rest are in ``--json``."""
WIDTH = 120
"""Of the tables where nobody watches, characters."""


@click.command()
@click.argument("motions", nargs=-1, metavar="[MOTION|RUN.npz]...")
@click.option("--draws", type=click.IntRange(1), help="Random draws [default: 200; --sweep: a few at each level].")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of all draws.")
@click.option("--jobs", type=click.IntRange(1), help="Simulations side by side [default: one a processor].")
@click.option("--only", metavar="NAME", help="Draw this disturbance alone.")
@click.option("--draw", "number", type=click.IntRange(0), metavar="K", help="Repeat this one draw on every motion.")
@click.option("--sweep", "swept", metavar="NAME", help="Find where this disturbance, alone, makes the robot fall.")
@click.option(
    "--known-stiffness", is_flag=True, help="The driver knows how stiff its servos are; else it takes them for nominal."
)
@click.option("--feedback", is_flag=True, help="The driver learns its servos and balances by its sensors.")
@click.option("--speed", type=types.FACTOR_OR_AUTO, default=1.0, show_default=True, help="As in imitate.")
@robot_options
@click.option("--json", "as_json", is_flag=True, help="One JSON object with every draw.")
@click.option("--check", is_flag=True, help="Exit with 1 when the robot fell.")
def stress(motions: tuple[str, ...], as_json: bool, check: bool, **options: Any) -> None:
    """Disturb the simulated robot and count its falls.

    Servos, masses, floor, commands and sensors differ from what was planned, and somebody pushes. Draws take the
    motions in turn, all built-in ones by default: each disturbance alone, then all at once. Load compensation goes
    on believing in the nominal robot.
    """
    from naoimitate.robot import load_robot
    from naoimitate.sim.stress import kinds_for

    robot = load_robot(options["robot"], options["robot_version"])
    kinds = kinds_for(robot)
    for option in ("only", "swept"):
        _check_name(option.replace("swept", "sweep"), options[option], kinds)
    if options["swept"] and (options["only"] or options["number"] is not None):
        raise click.UsageError("--sweep finds a boundary; it goes with neither --only nor --draw")
    plans = [_plan(motion, robot, options["speed"]) for motion in motions or _builtins()]
    if options["swept"]:
        with _pool(robot, plans, options, f"stressing with {options['swept']}") as (pool, told):
            fell = _sweep(pool, told, kinds[options["swept"]], plans, options, as_json)
    else:
        fell = _draws(robot, kinds, plans, motions or _builtins(), options, as_json)
    if check and fell:
        click.get_current_context().exit(FELL)


def _builtins() -> tuple[str, ...]:
    from naoimitate.motion.builtin import builtin_names

    return tuple(f"builtin:{name}" for name in builtin_names())


def _check_name(option: str, name: str | None, kinds: dict[str, Kind]) -> None:
    if name is not None and name not in kinds:
        raise click.UsageError(f"--{option}: there is no disturbance {name!r}: choose one of {', '.join(kinds)}")


@contextmanager
def _pool(robot: RobotModel, plans: Sequence[Plan], options: dict[str, Any], title: str) -> Iterator[tuple[Pool, Any]]:
    from naoimitate.cli.progress import progress
    from naoimitate.sim.stress_pool import Pool

    jobs = options["jobs"] or len(os.sched_getaffinity(0))
    how = {"known_stiffness": options["known_stiffness"], "closed": options["feedback"]}
    with Pool(robot, plans, jobs=jobs, **how) as pool, progress(title) as told:
        yield pool, told


def _plan(motion: str, robot: RobotModel, speed: float | str) -> Plan:
    """What the robot is to do: from a run file, or by imitating a motion."""
    from naoimitate.cli.progress import progress
    from naoimitate.cli.source import read_motion
    from naoimitate.core.errors import RobotModelError
    from naoimitate.run.file import load_run
    from naoimitate.run.recorded import imitate
    from naoimitate.sim.stress_play import Plan

    if motion.endswith(".npz"):
        run = load_run(motion)
        if (run.robot, run.robot_version) != (robot.name, robot.version):
            raise RobotModelError(f"{motion} is of {run.robot} {run.robot_version}: name it with --robot")
    else:
        person = read_motion(motion, tpose_at="auto", fps=None, unit=None, up=None, skeleton=None)
        with progress(f"imitating {person.name}") as advance:
            run = imitate(person, robot, speed=speed, progress=advance)
    return Plan(motion, run.time, run.q, run.base_pos, run.base_quat, run.support, run.hand_opening)


def _draws(
    robot: RobotModel,
    kinds: dict[str, Kind],
    plans: Sequence[Plan],
    motions: Sequence[str],
    options: dict[str, Any],
    as_json: bool,
) -> bool:
    """Play the draws and tell of them; whether the robot fell."""
    from naoimitate.sim.stress import ALL, draw
    from naoimitate.sim.stress_pool import Trial
    from naoimitate.sim.stress_table import Case, case_entry, entry, summed

    wanted = [
        (part, number, plan, draw(kinds, part, number, options["seed"]))
        for part, number, plan in _wanted(kinds, len(plans), options)
    ]
    cases: list[Case] = []
    with _pool(robot, plans, options, "stressing") as (pool, told):
        outcomes = pool.play([Trial(plan, disturbance) for _, _, plan, disturbance in wanted])
        for (part, number, plan, disturbance), outcome in zip(wanted, outcomes, strict=True):
            cases.append(Case(part, number, motions[plan], disturbance, outcome))
            told(len(cases) / len(wanted))
    ranges = {name: kind.range for name, kind in kinds.items()} | {ALL: "all at once"}
    rows = [
        summed(part, ranges[part], [case for case in cases if case.part == part])
        for part in dict.fromkeys(case.part for case in cases)
    ]
    if as_json:
        click.echo(
            json.dumps(
                {"seed": options["seed"], "parts": [entry(row) for row in rows], "cases": [*map(case_entry, cases)]}
            )
        )
    else:
        _show(_draw_table(rows))
        click.echo("\n".join(_summary(cases, options)))
    return any(not case.outcome.survived for case in cases)


def _wanted(kinds: dict[str, Kind], plans: int, options: dict[str, Any]) -> Iterator[tuple[str, int, int]]:
    """Part, number of the draw and plan of every trial: plans take turns, but for one draw that is to be repeated."""
    from naoimitate.sim.stress import ALL

    if options["number"] is not None:
        yield from ((options["only"] or ALL, options["number"], plan) for plan in range(plans))
        return
    draws = options["draws"] or 200
    singles = dict.fromkeys(kinds, max(1, draws // len(kinds)))
    parts = {options["only"]: draws} if options["only"] else singles | {ALL: draws}
    for turn, (part, count) in enumerate(parts.items(), 1):
        first = len(parts) - turn  # so that few draws of each part still see all motions
        yield from ((part, number, (first + number) % plans) for number in range(count))


def _draw_table(rows: Sequence[Row]) -> Table:
    table = _table("disturbance", "range", "draws", "survived", "failed first", "on the floor", "tilt", "swing", "CoP")
    for row in rows:
        failures = ", ".join(f"{what} {count}" for what, count in row.failures.items())
        share = f"{row.survived} ({100.0 * row.survived / row.draws:.0f} %)"
        worst = _number(math.degrees(row.tilt), "deg"), _number(100.0 * row.swing_load, "%")
        cop = _number(1000.0 * row.cop_margin, "mm")
        table.add_row(row.part, row.range, str(row.draws), share, failures or "-", str(row.tipped), *worst, cop)
    return table


def _summary(cases: Sequence[Case], options: dict[str, Any]) -> list[str]:
    """The total, and each fall with the command that repeats it."""
    from naoimitate.sim.stress_table import words

    fallen = [case for case in cases if not case.outcome.survived]
    lines = ["tilt, swing, CoP: the worst among those survived; largest lean off the plan, load on a foot in the air,"]
    lines.append("smallest distance of the centre of pressure to the edge of the stance soles")
    lines.append(f"{len(cases) - len(fallen)} of {len(cases)} draws survived")
    for case in fallen[:TOLD]:
        lines.append(f"  {case.motion} {case.outcome.failure} at {case.outcome.at:.2f} s: {_repeat(case, options)}")
        lines.append(f"      {words(case.disturbance)}")
    if len(fallen) > TOLD:
        lines.append(f"  and {len(fallen) - TOLD} more: --json has all")
    return lines


def _repeat(case: Case, options: dict[str, Any]) -> str:
    """The command line that repeats a case."""
    from naoimitate.sim.stress import ALL

    words = ["naoimitate stress", case.motion, f"--seed {options['seed']} --draw {case.draw}"]
    if case.part != ALL:
        words.append(f"--only {case.part}")
    if options["known_stiffness"]:
        words.append("--known-stiffness")
    if options["feedback"]:
        words.append("--feedback")
    if not case.motion.endswith(".npz") and options["speed"] != 1.0:
        words.append(f"--speed {options['speed']}")
    if options["robot"] != "nao":
        words.append(f"--robot {options['robot']}")
    if options["robot_version"]:
        words.append(f"--robot-version {options['robot_version']}")
    return " ".join(words)


def _sweep(pool: Pool, told: Any, kind: Kind, plans: Sequence[Plan], options: dict[str, Any], as_json: bool) -> bool:
    """Find the boundaries and tell of them; whether there is one within the suite's range."""
    from naoimitate.sim.stress_sweep import sweep
    from naoimitate.sim.stress_table import boundary_entry

    found = sweep(pool, kind, len(plans), seed=options["seed"], cases=options["draws"], told=told)
    if as_json:
        entries = [boundary_entry(boundary, plans[boundary.plan].name) for boundary in found]
        click.echo(json.dumps({"seed": options["seed"], "disturbance": kind.name, "boundaries": entries}))
    else:
        _show(_boundary_table(kind, found, plans))
    return any(boundary.fell is not None and kind.covers(boundary.fell) for boundary in found)


def _boundary_table(kind: Kind, found: Sequence[Boundary], plans: Sequence[Plan]) -> Table:
    from naoimitate.sim.stress_table import words

    table = _table("motion", f"{kind.name} survived to", "fell at", "cases", "first of them")
    for boundary in found:
        row = [plans[boundary.plan].name, "-" if boundary.survived is None else kind.show(boundary.survived)]
        if boundary.fell is None:
            table.add_row(*row, "-", f"0 of {boundary.cases}", "no fall at any level")
            continue
        disturbance, outcome = boundary.fallen[0]
        how = f"{outcome.failure} at {outcome.at:.2f} s{', then fell over' if outcome.tipped else ''}"
        count = f"{len(boundary.fallen)} of {boundary.cases}"
        table.add_row(*row, kind.show(boundary.fell), count, f"{how}; {words(disturbance)}")
    return table


def _number(value: float, unit: str) -> str:
    return "-" if math.isnan(value) else f"{value:.1f} {unit}"


def _table(*columns: str) -> Table:
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(box=SIMPLE, pad_edge=False)
    for column in columns:
        table.add_column(column, overflow="fold")
    return table


def _show(table: Table) -> None:
    from rich.console import Console

    console = Console()
    Console(width=None if console.is_terminal else WIDTH, highlight=False).print(table)
