"""``naoimitate calibrate``: measure a person once, for later runs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from naoimitate.cli import types
from naoimitate.cli.source import motion_options, read_motion

if TYPE_CHECKING:
    from naoimitate.calib.subject import Subject

PATIENCE = types.Number("S", least=1.0, most=86400.0)


@click.command()
@click.argument("motion", required=False)
@click.option("--source", metavar="PROTOCOL", help="Measure the operator of a stream: xsens, vmc, rokoko or json.")
@click.option("--bind", default="127.0.0.1", show_default=True, help="Address of this machine to listen on.")
@click.option("--port", type=click.IntRange(0, 65535), help="UDP port [default: the protocol's own; 0: any].")
@click.option("--allow", metavar="ADDRESS", help="Listen to this sender only [default: the first that comes].")
@click.option("--wait", type=PATIENCE, default=60.0, show_default=True, help="For the operator's T-pose.")
@click.option("--out", type=types.SUBJECT_FILE, required=True, help="Subject file to write.")
@motion_options
def calibrate(motion: str | None, out: Path, **options: Any) -> None:
    """Measure a person in the T-pose.

    Writes a subject file of the person in MOTION, or of the operator of a stream, for 'imitate' and 'live --subject'.
    """
    from naoimitate.calib.subject import save_subject
    from naoimitate.cli.outputs import keep_apart, whole

    stream = {key: options.pop(key) for key in ("source", "bind", "port", "allow", "wait")}
    if (motion is None) == (stream["source"] is None):
        raise click.UsageError("give either a MOTION or a --source")
    keep_apart((motion or "", options["skeleton"]), [out])
    subject, note = _operator(**stream) if motion is None else _person(motion, options)
    with whole(out) as path:
        save_subject(subject, path)
    body = subject.body
    click.echo(f"{out}: height {body.stature:.2f} m, arms {body.arm[0]:.2f} and {body.arm[1]:.2f} m, ", nl=False)
    click.echo(f"legs {body.leg[0]:.2f} and {body.leg[1]:.2f} m; {note}")


def _person(motion: str, reading: dict[str, Any]) -> tuple[Subject, str]:
    """The person of a motion, and what is known of the T-pose."""
    from naoimitate.calib.subject import calibrate as measure
    from naoimitate.core.errors import CalibrationError

    person = read_motion(motion, **reading)
    if person.tpose is None:
        raise CalibrationError(f"{person.name} has no T-pose: give its moment with --tpose-at")
    return measure(person.tpose), person.tpose_note


def _operator(source: str, bind: str, port: int | None, allow: str | None, wait: float) -> tuple[Subject, str]:
    """The operator of a stream."""
    from naoimitate.cli.feeds import new_stream, protocol_named
    from naoimitate.live.measure import measure_operator
    from naoimitate.live.receiver import Receiver

    protocol = protocol_named(source)
    receiver = Receiver(bind, protocol.port if port is None else port)
    click.echo(f"ready: stand in a T-pose and hold it still; listening for {protocol.title} on port {receiver.port}")
    try:
        subject = measure_operator(new_stream(protocol, allow), receiver, _countdown, wait)
    finally:
        receiver.close()
        _tell("\n")
    return subject, "from a T-pose that the operator held"


def _countdown(left: float) -> None:
    _tell(f"\rhold it for {left:.1f} s ")


def _tell(text: str) -> None:
    """Something that only a person who looks at a terminal wants to see."""
    if sys.stderr.isatty():
        click.echo(text, nl=False, err=True)
