"""Numbers out of text files that may be damaged."""

from __future__ import annotations

import math

import numpy as np

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import Array

MOST_DAMAGED = 0.1
"""Share of damaged frames beyond which a file is not worth reading."""


def decode(data: bytes) -> str:
    """Text of a file: UTF-8 (with or without mark) or UTF-16 with a mark, else Latin-1; line ends become newlines."""
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def numbers(body: str, columns: int) -> tuple[Array, list[str]]:
    """A table (T, columns) out of lines of numbers, and sentences about damage.

    An incomplete last line is dropped; another damaged line becomes NaN.
    Raises MotionFormatError when no line is complete, or too many are damaged.
    """
    lines = [line for line in body.split("\n") if line and not line.isspace()]
    notes: list[str] = []
    if lines and _row(lines[-1], columns) is None:
        lines.pop()
        notes.append("The last frame is cut off and was dropped.")
    if not lines:
        raise MotionFormatError("the file has no complete frame of motion: get the complete file")
    try:
        table = np.loadtxt(lines, ndmin=2, comments=None)
    except ValueError:
        table = np.empty((0, 0))
    if table.shape == (len(lines), columns):
        return table, notes
    rows = [_row(line, columns) for line in lines]
    notes += damaged(rows.count(None), len(rows))
    return np.array([[math.nan] * columns if row is None else row for row in rows]), notes


def damaged(bad: int, frames: int) -> list[str]:
    """A sentence about damaged frames, none when there are none.

    Raises MotionFormatError when they are more than a tenth.
    """
    if bad > max(1, MOST_DAMAGED * frames):
        raise MotionFormatError(f"{bad} of {frames} frames of the file are damaged: get the complete file")
    return [f"{bad} damaged frames were taken as missing."] if bad else []


def _row(line: str, columns: int) -> list[float] | None:
    """The numbers of a line, or None when there are not ``columns`` of them."""
    try:
        row = [float(word) for word in line.split()]
    except ValueError:
        return None
    return row if len(row) == columns else None
