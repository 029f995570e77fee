"""``naoimitate robots``: the robots that are built in."""

from __future__ import annotations

import click


@click.command()
@click.option(
    "--landing-set",
    "landing",
    metavar="ROBOT",
    help="Compute where the feet of a robot (a name or a folder) may be set down, for its robot.yaml: minutes of work.",
)
def robots(landing: str | None) -> None:
    """List the built-in robots and their versions."""
    from naoimitate.robot import load_robot, robot_names, robot_versions

    if landing is not None:
        _print_landing_set(landing)
        return
    for name in robot_names():
        for version in robot_versions(name):
            robot = load_robot(name, version)
            joints = len(robot.joint_names) - len(robot.coupled)
            title = robot.data.get("title", name)
            click.echo(f"{name} {version}: {title}, {robot.mass:.2f} kg, {joints} joints that move by themselves")


def _print_landing_set(name: str) -> None:
    """The ``landing`` section of a robot.yaml, computed anew, on standard output."""
    import yaml

    from naoimitate.balance.landing_tool import compute_landing_set
    from naoimitate.cli.progress import progress
    from naoimitate.robot import load_robot

    robot = load_robot(name)
    with progress(f"landing set of {robot.name}") as advance:
        data = compute_landing_set(robot, progress=advance)
    click.echo(yaml.safe_dump({"landing": data}, default_flow_style=None, sort_keys=False, width=120), nl=False)
