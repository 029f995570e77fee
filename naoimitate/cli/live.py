"""``naoimitate live``: a robot follows a stream of motion capture."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from naoimitate.cli import types
from naoimitate.cli.conduct import Rig, conduct
from naoimitate.cli.method import head_option, robot_options, shift_option

if TYPE_CHECKING:
    from naoimitate.hw.driver import Driver
    from naoimitate.live.recording import Recorder
    from naoimitate.live.setup import Setup
    from naoimitate.robot.model import RobotModel

DRIVERS = ("mujoco", "can", "naoqi", "none")
FEELING = ("mujoco", "naoqi")
"""Those with an inertial board and force sensors."""


@click.command()
@click.option("--source", required=True, metavar="PROTOCOL", help="xsens, vmc, rokoko, json or replay:FILE.")
@click.option("--bind", default="127.0.0.1", show_default=True, help="Address of this machine to listen on.")
@click.option("--port", type=click.IntRange(0, 65535), help="UDP port [default: the protocol's own; 0: any].")
@click.option("--allow", metavar="ADDRESS", help="Listen to this sender only [default: the first that comes].")
@click.option("--driver", type=click.Choice(DRIVERS), required=True, help="The robot to command.")
@click.option("--can-interface", default="socketcan", show_default=True, help="Of the CAN bus, as python-can has it.")
@click.option("--can-channel", default="can0", show_default=True, help="Of the CAN bus.")
@click.option("--can-codec", type=click.Choice(["dbc"]), default="dbc", show_default=True, help="What motors speak.")
@click.option("--url", default="tcp://nao.local:9559", show_default=True, help="Of a real NAO, for --driver naoqi.")
@robot_options
@click.option("--mirror", is_flag=True, help="The operator faces the robot: left and right are exchanged.")
@head_option
@shift_option
@click.option("--upper-body", is_flag=True, help="The robot stands, and imitates arms and head only.")
@click.option("--no-filter", is_flag=True, help="Use landmarks as they come.")
@click.option(
    "--fall", type=click.Choice(["limp", "brace"]), default="limp", show_default=True, help="Response to a fall."
)
@click.option(
    "--feedback/--no-feedback",
    default=False,
    show_default=True,
    help="Let the driver balance by the robot's sensors: --driver mujoco or naoqi.",
)
@click.option("--speed-limit", type=click.FloatRange(0.1, 1.0), default=1.0, help="Share of the usual speeds.")
@click.option("--subject", type=click.Path(path_type=Path), metavar="FILE", help="Operator measured by 'calibrate'.")
@click.option("--duration", type=types.SECONDS, help="End after so many seconds.")
@click.option("--view", is_flag=True, help="Open a window on the simulated robot.")
@click.option("--video", type=types.VIDEO_FILE, help="Film what the simulated robot sees with its head camera.")
@click.option("--camera", metavar="NAME", help="What window and film look through [default: free; the head's first].")
@click.option("--record", type=types.RECORDING_FILE, help="Write the raw stream to this file.")
@click.option("--out", type=types.RUN_FILE, help="Run file to write.")
@click.pass_context
def live(context: click.Context, /, **options: Any) -> None:
    """Let a robot follow a person whose motion capture comes over the network.

    Stand in a T-pose and hold it until the robot begins to follow. Ctrl-C ends the session safely.
    """
    from naoimitate.cli.feeds import open_feed
    from naoimitate.cli.outputs import keep_apart
    from naoimitate.command_gate import CommandGate
    from naoimitate.hw.guarded import GuardedDriver, GuardSettings
    from naoimitate.robot import load_robot

    source = options["source"].removeprefix("replay:")
    keep_apart([source, options["subject"]], [options["out"], options["record"], options["video"]])
    feed = open_feed(options["source"], options["bind"], options["port"], options["allow"])
    chosen = {key: value for key, value in options.items() if _is_chosen(context, key)}
    robot = load_robot(*_robot(chosen, feed.header))
    setup = _setup(chosen, feed.header)
    gate = CommandGate(robot)
    driver = _driver(options, robot)
    settings = GuardSettings(fall_response=options["fall"])
    guarded, watch = GuardedDriver(driver, gate, settings), _watch(options, driver)
    rig = Rig(feed, setup, setup.session(robot), guarded, gate, robot, watch)
    conduct(rig, options["duration"], options["out"], _recorder(rig, options))


def _is_chosen(context: click.Context, option: str) -> bool:
    """Whether the operator gave an option."""
    return context.get_parameter_source(option) is not click.core.ParameterSource.DEFAULT


def _robot(chosen: dict[str, Any], header: dict[str, Any]) -> tuple[str, str | None]:
    """Name and version of the robot: the operator's, or that of the recording, or NAO."""
    if "robot" in chosen or "robot_version" in chosen or not header:
        return chosen.get("robot", "nao"), chosen.get("robot_version")
    return str(header.get("robot", "nao")), header.get("robot_version")


def _setup(chosen: dict[str, Any], header: dict[str, Any]) -> Setup:
    """The setup of the recording, changed by what the operator chose."""
    from naoimitate.calib.subject import read_subject
    from naoimitate.live.setup import Setup

    setup = Setup.of(header.get("setup")) if header else Setup()
    for option in ("speed_limit", "upper_body", "mirror", "head", "shift"):
        if option in chosen:
            setup = replace(setup, **{option: chosen[option]})
    if "no_filter" in chosen:
        setup = replace(setup, filtered=False)
    return replace(setup, subject=read_subject(chosen["subject"])) if "subject" in chosen else setup


def _recorder(rig: Rig, options: dict[str, Any]) -> Recorder | None:
    """What writes the recording, where one is wished."""
    from naoimitate.live.recording import Recorder

    path = options["record"]
    if path is None:
        return None
    if rig.feed.header:
        raise click.UsageError("--record: this session is a recording already")
    header = {"robot": options["robot"], "robot_version": rig.robot.version, "allow": options["allow"]}
    return Recorder(path, {"protocol": rig.feed.protocol, "setup": rig.setup.header(), **header})


def _driver(options: dict[str, Any], robot: RobotModel) -> Driver:
    if options["feedback"] and options["driver"] not in FEELING:
        raise click.UsageError(
            f"--feedback needs a robot that feels its torso and feet: --driver {' or '.join(FEELING)}"
        )
    if options["driver"] == "none":
        from naoimitate.hw.none import NoDriver

        return NoDriver(robot)
    if options["driver"] == "can":
        from naoimitate.hw.can import CanDriver

        names = {key: options[f"can_{key}"] for key in ("interface", "channel", "codec")}
        return CanDriver(robot, **names, notice=click.echo)
    if options["driver"] == "naoqi":
        from naoimitate.hw.naoqi import NaoqiDriver
        from naoimitate.hw.naoqi_settings import NaoqiSettings

        return NaoqiDriver(robot, NaoqiSettings(url=options["url"], balance=options["feedback"]), notice=click.echo)
    from naoimitate.sim.driver import MujocoDriver

    return MujocoDriver(robot, balance=options["feedback"])


def _watch(options: dict[str, Any], driver: Driver) -> AbstractContextManager[object]:
    """Window and film of a simulated robot, where they are wished."""
    from naoimitate.sim.driver import MujocoDriver

    if not options["view"] and options["video"] is None:
        return nullcontext()
    if not isinstance(driver, MujocoDriver):
        raise click.UsageError("--view and --video show a simulated robot: choose --driver mujoco")
    from naoimitate.sim.onlookers import FREE
    from naoimitate.sim.watch import Watch

    camera = options["camera"]
    return Watch(
        driver,
        view=options["view"],
        camera=camera or FREE,
        video=options["video"],
        video_camera=camera,
        notice=lambda line: click.echo(line, err=True),
    )
