"""``naoimitate live``: a robot follows a stream of motion capture."""

from __future__ import annotations

import math
import signal
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from naoimitate.cli import types

if TYPE_CHECKING:
    from naoimitate.hw.driver import Driver
    from naoimitate.hw.guarded import GuardedDriver
    from naoimitate.live.loop import Loop
    from naoimitate.live.session import Session
    from naoimitate.robot.model import RobotModel

DRIVERS = ("mujoco", "can", "naoqi", "none")


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
@click.option("--robot", default="nao", show_default=True, help="A built-in robot, or a folder with one.")
@click.option("--robot-version", metavar="VERSION", help="Version of the robot [default: v4 for nao].")
@click.option("--mirror", is_flag=True, help="The operator faces the robot: left and right are exchanged.")
@click.option("--upper-body", is_flag=True, help="The robot stands, and imitates arms and head only.")
@click.option("--no-filter", is_flag=True, help="Use landmarks as they come.")
@click.option("--speed-limit", type=click.FloatRange(0.1, 1.0), default=1.0, help="Share of the usual speeds.")
@click.option("--subject", type=click.Path(path_type=Path), metavar="FILE", help="Operator measured by 'calibrate'.")
@click.option("--duration", type=types.SECONDS, help="End after so many seconds.")
@click.option("--record", type=click.Path(path_type=Path, dir_okay=False), help="Write the raw stream to this file.")
@click.option("--out", type=types.RUN_FILE, help="Run file to write.")
def live(**options: Any) -> None:
    """Let a robot follow a person whose motion capture comes over the network.

    Stand in a T-pose and hold it until the robot begins to follow. Ctrl-C ends the session safely.
    """
    from naoimitate.calib.subject import load_subject
    from naoimitate.command_gate import CommandGate
    from naoimitate.hw.guarded import GuardedDriver
    from naoimitate.live.session import Session, SessionSettings
    from naoimitate.robot import load_robot

    robot = load_robot(options["robot"], options["robot_version"])
    subject = load_subject(options["subject"]) if options["subject"] else None
    choices = SessionSettings(filtered=not options["no_filter"], mirror=options["mirror"])
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    session = Session(robot, _settings(options["speed_limit"], options["upper_body"]), choices, subject)
    driver = GuardedDriver(_driver(options, robot), CommandGate(robot))
    if options["source"].startswith("replay:"):
        _replay(Path(options["source"][len("replay:") :]), session, driver, robot, options)
    else:
        _listen(session, driver, robot, options)


def _settings(share: float, upper_body: bool) -> Any:
    """The usual settings, slower, and for the upper body alone where that is asked for."""
    from dataclasses import replace

    from naoimitate.settings import Settings

    usual = Settings()
    limits = usual.limits
    slower = replace(
        limits,
        hand_speed=share * limits.hand_speed,
        foot_speed=share * limits.foot_speed,
        head_speed=share * limits.head_speed,
        joint_share=share * limits.joint_share,
    )
    return replace(usual, limits=slower, upper_body=upper_body)


def _driver(options: dict[str, Any], robot: RobotModel) -> Driver:
    if options["driver"] == "none":
        from naoimitate.hw.none import NoDriver

        return NoDriver(robot)
    if options["driver"] == "can":
        from naoimitate.hw.can import CanDriver

        names = {key: options[f"can_{key}"] for key in ("interface", "channel", "codec")}
        return CanDriver(robot, **names)
    if options["driver"] == "naoqi":
        from naoimitate.hw.naoqi import NaoqiDriver, NaoqiSettings

        return NaoqiDriver(robot, NaoqiSettings(url=options["url"]), notice=click.echo)
    from naoimitate.sim.driver import MujocoDriver

    return MujocoDriver(robot)


def _listen(session: Session, driver: GuardedDriver, robot: RobotModel, options: dict[str, Any]) -> None:
    """The session with a stream from the network."""
    from naoimitate.cli.run_writer import Writer
    from naoimitate.core.errors import StreamError
    from naoimitate.live.loop import Loop
    from naoimitate.live.protocols.registry import PROTOCOLS
    from naoimitate.live.receiver import Receiver
    from naoimitate.live.recording import Recorder
    from naoimitate.live.stream import Stream

    protocol = PROTOCOLS.get(options["source"])
    if protocol is None:
        raise StreamError(f"no source {options['source']}: there are {', '.join(PROTOCOLS)} and replay:FILE")
    port = protocol.port if options["port"] is None else options["port"]
    receiver = Receiver(options["bind"], port)
    stream = Stream(protocol, tuple(PROTOCOLS.values()), options["allow"])
    writer = Writer(options["out"], session, robot, f"live:{protocol.name}")
    loop = Loop(session, stream, receiver, driver, [writer.take])
    recorder = None
    if options["record"] is not None:
        recorder = Recorder(options["record"], {"protocol": protocol.name, "robot": robot.name, **_texts(options)})
        loop.record = recorder.datagram
        loop.watch.append(lambda beat: recorder.step(beat.now))
    try:
        session.warm_up()
        driver.connect()
        click.echo(f"ready: listening for {protocol.title} on {options['bind']} port {receiver.port}")
        _run(loop, math.inf if options["duration"] is None else options["duration"])
    except KeyboardInterrupt:
        click.echo("ended by the operator", err=True)
    finally:
        driver.stop()
        receiver.close()
        if recorder is not None:
            recorder.close()
        lines = writer.close()
        if stream.counts.datagrams:
            lines += [_summary(stream), _passed(driver)]
        click.echo("\n".join(lines), nl=bool(lines))


def _run(loop: Loop, duration: float) -> None:
    """The loop, with keys and a panel where there is a terminal."""
    from naoimitate.live.keys import listening, obey, pressed
    from naoimitate.live.panel import Panel

    with listening() as keys:
        if not keys:
            loop.run(duration)
            return
        with Panel(loop.session, loop.stream, loop.driver) as panel:
            loop.watch.append(panel.take)
            loop.run(duration, lambda: obey(pressed(), loop.session, loop.driver))


def _replay(path: Path, session: Session, driver: GuardedDriver, robot: RobotModel, options: dict[str, Any]) -> None:
    """A recorded session again, with the times and the commands of then."""
    import time

    from naoimitate.cli.run_writer import Writer
    from naoimitate.core.errors import StreamError
    from naoimitate.live.loop import Beat
    from naoimitate.live.protocols.registry import PROTOCOLS
    from naoimitate.live.recording import play, read_recording
    from naoimitate.live.stream import Stream

    recording = read_recording(path)
    protocol = PROTOCOLS.get(str(recording.header.get("protocol")))
    if protocol is None:
        raise StreamError(f"{path} holds a stream of {recording.header.get('protocol')}, which is not known here")
    stream = Stream(protocol, tuple(PROTOCOLS.values()), options["allow"])
    writer = Writer(options["out"], session, robot, f"replay:{path.name}")
    try:
        session.warm_up()
        driver.connect()
        click.echo(f"ready: playing {path}")
        begin, first = time.monotonic(), None
        for now, tick in play(recording, session, stream):
            first = now if first is None else first
            if options["duration"] is not None and now - first > options["duration"]:
                break
            time.sleep(max(0.0, begin + now - first - time.monotonic()))
            driver.write(tick.command)
            writer.take(Beat(tick, now, math.nan, 0.0))
    except KeyboardInterrupt:
        click.echo("ended by the operator", err=True)
    finally:
        driver.stop()
        lines = writer.close()
        if stream.counts.datagrams:
            lines += [_summary(stream), _passed(driver)]
        click.echo("\n".join(lines), nl=bool(lines))


def _texts(options: dict[str, Any]) -> dict[str, str]:
    return {"options": ", ".join(f"{key}={value}" for key, value in sorted(options.items()) if value is not None)}


def _summary(stream: Any) -> str:
    c = stream.counts
    return (
        f"{c.datagrams} datagrams, {c.frames} frames used in order, {c.late} late, {c.lost} lost, {c.damaged} damaged, "
        f"{c.foreign} of other senders"
    )


def _passed(driver: GuardedDriver) -> str:
    status = driver.status
    refused = ", ".join(f"{count} {reason}" for reason, count in sorted(status.refused.items())) or "none refused"
    return f"{status.accepted} commands passed the gate; {refused}; the robot: {status.condition.value}"
