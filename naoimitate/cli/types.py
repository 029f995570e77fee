"""Kinds of option values: a speed, a moment or a word, a file that can be written."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import click


class Number(click.ParamType):  # type: ignore[type-arg]
    """A finite number within bounds, or one of some words."""

    def __init__(
        self, metavar: str, *, above: float = -math.inf, least: float = -math.inf, words: tuple[str, ...] = ()
    ):
        self.name = metavar
        self._above, self._least, self._words = above, least, words

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
        if not (math.isfinite(number) and number > self._above and number >= self._least):
            self.fail(f"{value!r} is not {self._expected()}", param, ctx)
        return number

    def _expected(self) -> str:
        bound = ""
        if self._above > -math.inf:
            bound = f" above {self._above:g}"
        elif self._least > -math.inf:
            bound = f" of {self._least:g} or more"
        return " or ".join((f"a number{bound}", *self._words))


class OutputFile(click.ParamType):  # type: ignore[type-arg]
    """A file to be written: its folder must exist and be writable, so that long work is not lost at its end."""

    def __init__(self, metavar: str, *endings: str):
        self.name = metavar
        self._endings = endings

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """What help shows in place of the value."""
        return self.name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """The path, checked."""
        path = Path(value)
        if self._endings and path.suffix.lower() not in self._endings:
            self.fail(f"{value!r} does not end in {' or '.join(self._endings)}", param, ctx)
        if path.is_dir() or not path.parent.is_dir() or not os.access(path.parent, os.W_OK):
            self.fail(f"{value!r} cannot be written: choose a file in a folder that exists and is yours", param, ctx)
        return path


FACTOR_OR_AUTO = Number("FACTOR", above=0.0, words=("auto",))
SECONDS = Number("S")
MOMENT = Number("S", words=("auto", "none"))
HERTZ = Number("HZ", above=0.0)
RUN_RATE = Number("HZ", least=50.0)
"""A run file holds 50 frames a second or more (its contract)."""
METRES = Number("M", above=0.0)
RUN_FILE = OutputFile("RUN.npz")
SUBJECT_FILE = OutputFile("SUBJECT.yaml")
VIDEO_FILE = OutputFile("OUT.mp4", ".mp4")
REPORT_FILE = OutputFile("OUT.html", ".html", ".htm")
PICTURE_FILE = OutputFile("OUT.png", ".png")
