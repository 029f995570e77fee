"""Kinds of option values: a speed, a moment or a word, a file that can be written."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import click


class Number(click.ParamType):  # type: ignore[type-arg]
    """A finite number within bounds, or one of some words."""

    def __init__(
        self,
        metavar: str,
        *,
        above: float = -math.inf,
        least: float = -math.inf,
        most: float = math.inf,
        words: tuple[str, ...] = (),
    ):
        self.name = metavar
        self._above, self._least, self._most, self._words = above, least, most, words

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """What help shows in place of the value."""
        return "|".join((self.name, *self._words))

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float | str:
        """The number, or the word as it is."""
        if value in self._words:
            return str(value)
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not (math.isfinite(number) and number > self._above and self._least <= number <= self._most):
            self.fail(f"{value!r} is not {self._expected()}", param, ctx)
        return number

    def _expected(self) -> str:
        bound = ""
        if self._above > -math.inf:
            bound = f" above {self._above:g}"
        elif self._most < math.inf:
            bound = f" from {self._least:g} to {self._most:g}"
        return " or ".join((f"a number{bound}", *self._words))


class OutputFile(click.ParamType):  # type: ignore[type-arg]
    """A file to be written: tried before the work, so that long work is not lost at its end."""

    def __init__(self, metavar: str, *endings: str):
        self.name = metavar
        self._endings = endings

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """What help shows in place of the value."""
        return self.name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """The path, checked; a link stands for the file that it leads to."""
        path = Path(value)
        if self._endings and path.suffix.lower() not in self._endings:
            self.fail(f"{value!r} does not end in {' or '.join(self._endings)}", param, ctx)
        path = path.resolve() if path.is_symlink() else path
        if (path.exists() and not path.is_file()) or not is_writable(path.parent):
            self.fail(f"{value!r} cannot be written: choose a file in a folder that exists and is yours", param, ctx)
        return path


def is_writable(folder: Path) -> bool:
    """Whether a file can be made in a folder: tried, because permissions do not tell of every file system."""
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


FACTOR_OR_AUTO = Number("FACTOR", least=0.05, most=20.0, words=("auto",))
"""Slower, a run would meet the bound on its length before it ends; faster, nothing is left to follow."""
STIFFNESS = Number("K", least=10.0, most=10000.0)
SECONDS = Number("S")
MOMENT = Number("S", words=("auto", "none"))
FILE_RATE = Number("HZ", least=1.0, most=10000.0)
"""Of a recording: from a time lapse to the fastest cameras."""
SAMPLE_RATE = Number("HZ", least=1.0, most=1000.0)
"""Seen less often than once a second, a person's steps are missed."""
RUN_RATE = Number("HZ", least=50.0, most=1000.0)
"""A run file holds 50 frames a second or more (its contract); drivers of servos take at most 1000."""
METRES = Number("M", above=0.0)
RUN_FILE = OutputFile("RUN.npz")
SUBJECT_FILE = OutputFile("SUBJECT.yaml")
RECORDING_FILE = OutputFile("STREAM.rec")
VIDEO_FILE = OutputFile("OUT.mp4", ".mp4")
REPORT_FILE = OutputFile("OUT.html", ".html", ".htm")
PICTURE_FILE = OutputFile("OUT.png", ".png")
