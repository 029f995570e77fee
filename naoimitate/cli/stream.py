"""``naoimitate stream``: a motion as a live stream, to try receivers with."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from naoimitate.cli import types
from naoimitate.cli.source import motion_options, read_motion

if TYPE_CHECKING:
    from naoimitate.live.sender import Tally

SHARE = types.Number("P", least=0.0, most=1.0)
DELAY = types.Number("MS", least=0.0, most=10000.0)
HOLD = types.Number("S", least=0.0, most=3600.0)


@click.command()
@click.argument("motion")
@click.option(
    "--protocol",
    type=click.Choice(["xsens", "vmc", "rokoko", "json"]),
    required=True,
    help="What the stream looks like.",
)
@click.option("--to", metavar="HOST[:PORT]", default="127.0.0.1", show_default=True, help="Port: the protocol's own.")
@click.option("--rate", type=types.SAMPLE_RATE, help="Frames a second [default: the motion's].")
@click.option("--loss", type=SHARE, default=0.0, help="Share of the datagrams that get lost.")
@click.option("--jitter", type=DELAY, default=0.0, help="Delay each datagram by 0 to MS milliseconds.")
@click.option("--duplicate", type=SHARE, default=0.0, help="Share of the datagrams that come twice.")
@click.option("--reorder", type=SHARE, default=0.0, help="Share of the datagrams that later ones overtake.")
@click.option("--tpose", type=HOLD, default=3.0, show_default=True, help="First hold a T-pose for S seconds.")
@click.option("--seed", type=int, default=0, show_default=True, help="Of everything random.")
@click.option("--repeat", type=click.IntRange(1), default=1, show_default=True, help="Play the motion N times.")
@motion_options
def stream(motion: str, **options: Any) -> None:
    """Send a motion as a live stream.

    MOTION is a file or builtin:NAME. The person holds a T-pose, goes into the motion within a second, and moves at
    their own speed; 'naoimitate live' is the other half. Ctrl-C ends it.
    """
    from naoimitate.live.performance import Performance
    from naoimitate.live.protocols.registry import PROTOCOLS
    from naoimitate.live.sender import DEFAULT_RATE, Conditions, Tally, UdpSender, address, frames, play, through

    protocol = PROTOCOLS[options["protocol"]]
    to = address(options["to"], protocol.port)
    person = read_motion(motion, **{key: options[key] for key in ("tpose_at", "fps", "unit", "up", "skeleton")})
    performance = Performance(person, options["tpose"], options["repeat"])
    rate = options["rate"] or person.rate or DEFAULT_RATE
    network = Conditions(
        options["loss"], options["jitter"] / 1000.0, options["duplicate"], options["reorder"], options["seed"]
    )
    tally = Tally()
    schedule = through(network, frames(performance, protocol.encoder(), rate), 1.0 / rate, tally)
    with UdpSender(to) as sender:
        click.echo(
            f"streaming {person.name} as {protocol.name} to {to.text}: {rate:g} Hz, {performance.duration:.1f} s, "
            f"T-pose for {options['tpose']:g} s first"
        )
        try:
            play(schedule, sender.send)
        except KeyboardInterrupt:
            click.echo("stopped")
    click.echo(_summary(tally))


def _summary(tally: Tally) -> str:
    return (
        f"sent {tally.sent} datagrams; of {tally.given} made {tally.lost} were lost, {tally.doubled} doubled, "
        f"{tally.held_back} held back"
    )
