"""The evaluation of Koenemann et al. 2014 as files: figures, and one page that puts our figures beside the paper's."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from naoimitate.robot.model import RobotModel
from naoimitate.run.figures import FIGURES, as_png, draw
from naoimitate.run.reproduce import CAMERA_RATE, NOISE, PAPER_ERRORS_CM, Baseline, Case
from naoimitate.run.table import PAPER_TABLE, Table, markdown

NUMBERS = {"hands": "fig7", "feet": "fig8", "offset": "fig9"}
"""Our figures that stand for the paper's."""


@dataclass(frozen=True)
class Evaluation:
    """Everything that was measured. tables: motion and parameter set to Table I."""

    cases: tuple[Case, ...]
    tables: dict[tuple[str, str], Table]
    baselines: tuple[Baseline, ...]


def write_evaluation(evaluation: Evaluation, robot: RobotModel, folder: Path) -> list[Path]:
    """Write summary.md and the figures of every case's first repetition into an existing folder."""
    written = [folder / "summary.md"]
    written[0].write_text(summary(evaluation, robot), encoding="utf-8")
    for case in evaluation.cases:
        for figure in FIGURES:
            if figure.name in NUMBERS:
                name = f"{_plain(case.motion)}-{case.parameters}-{NUMBERS[figure.name]}-{figure.name}.png"
                written.append(folder / name)
                written[-1].write_bytes(as_png(draw(figure, case.runs[0], robot)))
    return written


def summary(evaluation: Evaluation, robot: RobotModel) -> str:
    """The page: errors, Table I and the direct baseline, the paper's figures beside ours."""
    count = len(evaluation.cases[0].runs)
    return "\n".join(
        [
            "# Koenemann, Burget, Bennewitz 2014, evaluated again",
            "",
            f"{robot.name} {robot.version}; persons seen at {CAMERA_RATE:g} Hz, {1000 * NOISE:g} mm of white noise;",
            f"{count} repetitions each. The paper used a real NAO v4 and a person in an Xsens suit.",
            "",
            "## Similarity (Figures 7 and 8) and stability",
            "",
            _errors_table(evaluation.cases),
            "",
            "Beyond reach: of the hands' error, what the arms alone could have avoided. Fell: the torso tips over or",
            "sinks, or a foot planned in swing carries 10 % of the weight, if only for a frame.",
            "",
            "## Table I",
            "",
            _table_one(evaluation.tables),
            "",
            "The paper's times are of one core of an i5-2400 at 3 GHz, ours of this computer. Iterations: of the",
            "stabilisation; those of the mapping are fixed.",
            "",
            "## Without stabilisation",
            "",
            *(f"- {_plain(b.motion)}: {_baseline(b)}" for b in evaluation.baselines),
            "",
        ]
    )


def _errors_table(cases: tuple[Case, ...]) -> str:
    paper = ("(published)", "theirs", f"{PAPER_ERRORS_CM['hands']}", "", f"{PAPER_ERRORS_CM['feet']}", "", "never fell")
    rows = [
        (
            _plain(case.motion),
            case.parameters,
            f"{case.hand_errors.mean():.2f} ± {case.hand_errors.std():.2f}",
            f"{case.hand_excess.mean():.2f}",
            f"{case.foot_errors.mean():.2f} ± {case.foot_errors.std():.2f}",
            f"{case.least_margin:.1f}",
            f"{sum(case.fell)} of {len(case.fell)} fell" if case.fell else "",
        )
        for case in cases
    ]
    header = ("motion", "parameters", "hands, cm", "beyond reach, cm", "feet, cm", "least margin, mm", "in physics")
    return markdown(header, [paper, *rows])


def _table_one(tables: dict[tuple[str, str], Table]) -> str:
    header = ["", "the paper", *(f"{_plain(motion)}, {parameters}" for motion, parameters in tables)]
    columns = [table.rows() for table in tables.values()]
    rows = [
        [name, f"{mean}, max {largest}", *(f"{column[i][1]}, max {column[i][2]}" for column in columns)]
        for i, (name, mean, largest) in enumerate(PAPER_TABLE)
    ]
    return markdown(header, rows)


def _baseline(baseline: Baseline) -> str:
    end = {None: "not simulated", True: "FELL in physics", False: "did not fall in physics"}[baseline.fell]
    outside = f"centre of mass not over what touches the floor in {100.0 * baseline.outside:.1f} % of the frames"
    return f"{outside}, soles that should stand tilted by up to {baseline.tilt:.1f} deg, {end}"


def _plain(motion: str) -> str:
    return motion.removeprefix("builtin:")
