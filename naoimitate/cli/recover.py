"""``naoimitate recover``: the run file of a live session that was killed."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("run", metavar="RUN.npz", type=click.Path(path_type=Path))
def recover(run: Path) -> None:
    """Make RUN.npz from the journal beside it, which a killed live session has left."""
    from naoimitate.run.journal import finish

    made = finish(run)
    click.echo(f"{run}: {len(made)} frames, {made.duration:.2f} s" if made else f"{run}: no frame was written")
