"""The command line: one file a command. A user's mistake is one line on standard error and exit status 2.

Commands import the rest of the program only when they run, so that ``--help`` answers at once.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

import click

from naoimitate.cli.calibrate import calibrate
from naoimitate.cli.can_stub import can_stub
from naoimitate.cli.check import check
from naoimitate.cli.demo import demo
from naoimitate.cli.imitate import imitate
from naoimitate.cli.live import live
from naoimitate.cli.motions import motions
from naoimitate.cli.recover import recover
from naoimitate.cli.reproduce import reproduce
from naoimitate.cli.robots import robots
from naoimitate.cli.scene import scene
from naoimitate.cli.score import score
from naoimitate.cli.stream import stream
from naoimitate.cli.stress import stress
from naoimitate.core.errors import NaoimitateError

MISTAKE = 2
"""Exit status when the user or the data are wrong."""
INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells have it."""


@click.group(invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="naoimitate", prog_name="naoimitate")
@click.pass_context
def cli(context: click.Context) -> None:
    """A small humanoid imitates a person, statically stable in every frame."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


for _command in (
    demo, imitate, live, stream, score, check, calibrate, motions, robots, recover, reproduce, scene, stress,
    can_stub,
):  # fmt: skip
    cli.add_command(_command)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; ends the process with its exit status."""
    sys.exit(run(sys.argv[1:] if arguments is None else arguments))


def run(arguments: Sequence[str]) -> int:
    """Run the command line and return its exit status; mistakes become one line on standard error."""
    try:
        status = cli.main(args=list(arguments), prog_name="naoimitate", standalone_mode=False)
    except click.ClickException as error:
        return _complain(error.format_message(), error)
    except (NaoimitateError, OSError) as error:
        if isinstance(error, BrokenPipeError):
            return _closed_pipe()
        return _complain(str(error), error)
    except (click.Abort, KeyboardInterrupt):
        return _interrupted()
    except SystemError as error:
        if isinstance(error.__cause__, KeyboardInterrupt):  # Ctrl-C while a compiled function was starting
            return _interrupted()
        raise
    except MemoryError:
        return _complain("not enough memory for this: give it less at a time, with --start and --end", MemoryError())
    return status if isinstance(status, int) else 0


def _interrupted() -> int:
    click.echo("naoimitate: interrupted", err=True)
    return INTERRUPTED


def _complain(message: str, error: Exception) -> int:
    context = error.ctx if isinstance(error, click.UsageError) else None
    name = context.command_path if context is not None else "naoimitate"
    hint = f" (see {name} --help)" if context is not None else ""
    click.echo(f"{name}: {' '.join(message.split())}{hint}", err=True)
    return MISTAKE


def _closed_pipe() -> int:
    """The reader of our output left (``| head``): no error, and nothing more to write at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0
