"""The report of a run: one HTML file that needs nothing else."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Sequence
from pathlib import Path

from naoimitate.core.errors import RunFileError
from naoimitate.robot.model import RobotModel
from naoimitate.run.figures import FIGURES, as_png, draw
from naoimitate.run.file import Run
from naoimitate.run.measure import Measure
from naoimitate.run.scores import score_run
from naoimitate.run.sheet import VERDICTS, bar_text, format_value

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.1rem; margin-top: 2rem; }
table { border-collapse: collapse; } td, th { padding: .15rem .8rem; text-align: left; border-bottom: 1px solid #ddd; }
td.value { text-align: right; white-space: nowrap; }
.MISSED { color: #c0392b; font-weight: 600; } .ok { color: #2e7d32; }
figure { margin: 1.2rem 0; } figcaption { font-weight: 600; } img { max-width: 100%; } pre { white-space: pre-wrap; }
"""


def write_report(
    run: Run,
    robot: RobotModel,
    path: str | Path,
    *,
    sheet: Sequence[Measure] | None = None,
    pictures: Sequence[Path] = (),
) -> None:
    """Write the report of a run.

    sheet: its measures, computed here when not given. pictures: PNG files that are embedded under the scores.
    Raises RunFileError when the file cannot be written.
    """
    text = report_html(run, robot, score_run(run, robot) if sheet is None else sheet, pictures)
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise RunFileError(f"cannot write {path}: {error.strerror}; choose another place with --report") from error


def report_html(run: Run, robot: RobotModel, sheet: Sequence[Measure], pictures: Sequence[Path] = ()) -> str:
    """The report as HTML text."""
    title = html.escape(f"{run.source} on {run.robot} {run.robot_version}")
    shown = [_image(picture.read_bytes(), picture.stem) for picture in pictures]
    drawn = [_image(as_png(draw(figure, run, robot)), figure.caption) for figure in FIGURES]
    provenance = html.escape(json.dumps(json.loads(run.provenance), indent=2))
    return "\n".join(
        [
            f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>',
            f"<style>{STYLE}</style></head><body><h1>{title}</h1>",
            f"<p>{html.escape(_summary(run))}</p><h2>Scores</h2>{_table(sheet)}",
            *(["<h2>Pictures</h2>", *shown] if shown else []),
            "<h2>Over time</h2>",
            *drawn,
            f"<h2>Provenance</h2><pre>{provenance}</pre></body></html>",
        ]
    )


def _summary(run: Run) -> str:
    rate = (len(run) - 1) / run.duration if len(run) > 1 else 0.0
    return (
        f"{len(run)} frames at {rate:.0f} Hz, {run.duration:.2f} s; method {run.method}, feet {run.retarget}, "
        f"person from {run.human_time[0]:.2f} to {run.human_time[-1]:.2f} s"
    )


def _table(sheet: Sequence[Measure]) -> str:
    rows = [
        f'<tr><td>{html.escape(m.label)}</td><td class="value">{html.escape(format_value(m))}</td>'
        f'<td>{html.escape(bar_text(m))}</td><td class="{VERDICTS[m.passed]}">{VERDICTS[m.passed]}</td>'
        f"<td>{html.escape(m.note)}</td></tr>"
        for m in sheet
    ]
    return f"<table><tr><th>measure</th><th>value</th><th>bar</th><th></th><th></th></tr>{''.join(rows)}</table>"


def _image(png: bytes, caption: str) -> str:
    data = base64.b64encode(png).decode()
    caption = html.escape(caption)
    return (
        f'<figure><figcaption>{caption}</figcaption><img alt="{caption}" src="data:image/png;base64,{data}"></figure>'
    )
