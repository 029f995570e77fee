"""Files that commands write: each whole or not at all, and never over something that is still needed."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A file beside ``path`` to write to: it becomes ``path`` when all went well, and vanishes when not."""
    beside = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield beside
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def keep_apart(inputs: Iterable[Path | str | None], outputs: Iterable[Path | None]) -> None:
    """Raise a UsageError when a command would write over what it reads, or two things into one file."""
    taken = {Path(path).resolve() for path in inputs if path is not None}
    for path in outputs:
        if path is None:
            continue
        if path.resolve() in taken:
            raise click.UsageError(f"'{path}' is asked for twice: write to a file of its own")
        taken.add(path.resolve())
