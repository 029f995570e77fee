"""``naoimitate robots``: the robots that are built in."""

from __future__ import annotations

import click


@click.command()
def robots() -> None:
    """List the built-in robots and their versions."""
    from naoimitate.robot import load_robot, robot_names, robot_versions

    for name in robot_names():
        for version in robot_versions(name):
            robot = load_robot(name, version)
            joints = len(robot.joint_names) - len(robot.coupled)
            title = robot.data.get("title", name)
            click.echo(f"{name} {version}: {title}, {robot.mass:.2f} kg, {joints} joints that move by themselves")
