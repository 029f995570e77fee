"""``naoimitate calibrate``: measure a person once, for later runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from naoimitate.cli import types
from naoimitate.cli.source import motion_options, read_motion


@click.command()
@click.argument("motion")
@click.option("--out", type=types.SUBJECT_FILE, required=True, help="Subject file to write.")
@motion_options
def calibrate(motion: str, out: Path, **reading: Any) -> None:
    """Measure a person in the T-pose.

    Writes a subject file of the person in MOTION, for 'imitate --subject'.
    """
    from naoimitate.calib.subject import calibrate as measure
    from naoimitate.calib.subject import save_subject
    from naoimitate.cli.outputs import keep_apart, whole
    from naoimitate.core.errors import CalibrationError

    keep_apart((motion, reading["skeleton"]), [out])
    person = read_motion(motion, **reading)
    if person.tpose is None:
        raise CalibrationError(f"{person.name} has no T-pose: give its moment with --tpose-at")
    subject = measure(person.tpose)
    with whole(out) as path:
        save_subject(subject, path)
    body = subject.body
    click.echo(f"{out}: height {body.stature:.2f} m, arms {body.arm[0]:.2f} and {body.arm[1]:.2f} m, ", nl=False)
    click.echo(f"legs {body.leg[0]:.2f} and {body.leg[1]:.2f} m; {person.tpose_note}")
