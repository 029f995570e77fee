"""``naoimitate can-stub``: simulated motors on a CAN bus, to try ``live --driver can`` without a robot."""

from __future__ import annotations

import math
import time
from pathlib import Path

import click

PIECE = 0.2
"""[s] of waiting at a time."""


@click.command("can-stub")
@click.option("--robot", default="nao", show_default=True, help="A built-in robot, or a folder with its data.")
@click.option("--robot-version", default=None, help="One of its versions; its default one otherwise.")
@click.option("--interface", default="udp_multicast", show_default=True, help="An interface of python-can.")
@click.option("--channel", default="239.74.163.2", show_default=True, help="The interface's channel, such as can0.")
@click.option(
    "--fault",
    "faults",
    multiple=True,
    metavar="NODE:KIND@SECONDS",
    help="NODE: a motor's number or joint; KIND: stuck, silent, crc, hot or bus-off; SECONDS after the start.",
)
@click.option("--database", type=click.Path(path_type=Path, dir_okay=False), help="DBC file, not the robot's own.")
@click.option("--posture", default="stand", show_default=True, help="In which the robot is found, such as Crouch.")
@click.option("--duration", type=click.FloatRange(min=0.0), help="s to run; until Ctrl-C otherwise.")
def can_stub(
    robot: str,
    robot_version: str | None,
    interface: str,
    channel: str,
    faults: tuple[str, ...],
    database: Path | None,
    posture: str,
    duration: float | None,
) -> None:
    """Simulate a robot's motors on a CAN bus.

    They answer commands, move with their speed limits, and hold when no commands come for 0.1 s.
    """
    from naoimitate.hw.can.bus import bitrate_of, open_bus
    from naoimitate.hw.can.stub import CanStub, motor_numbers
    from naoimitate.hw.can.stub_faults import parse_fault
    from naoimitate.robot import load_robot

    model = load_robot(robot, robot_version)
    motors = motor_numbers(model)
    wanted = [parse_fault(text, motors) for text in faults]
    bus = open_bus(interface, channel, bitrate_of(model))
    with bus:
        stub = CanStub(model, bus, wanted, database, posture)
        stub.start()
        try:
            click.echo(f"ready: {len(stub.motors)} motors of {model.name} on {interface} {channel}")
            end = math.inf if duration is None else time.monotonic() + duration
            while (left := end - time.monotonic()) > 0.0:  # in pieces: a signal just before an endless wait is lost
                time.sleep(min(left, PIECE))
        finally:
            stub.stop()
            ignored = f"{stub.damaged} damaged and {stub.repeated} repeated commands were ignored"
            click.echo(f"{ignored}, {stub.unsent} answers were not sent")
