"""Numbers out of text files that may be damaged."""

from __future__ import annotations

import math

import numpy as np

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import Array

MOST_DAMAGED = 0.1
"""Share of damaged frames beyond which a file is not worth reading."""


def decode(data: bytes) -> str:
    """Text of a file: UTF-8 (with or without mark) or UTF-16 with a mark, else Latin-1; line ends become newlines.

    What old programs put behind the end of a file (zeros, Ctrl-Z) is left out.
    """
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.rstrip("\0\x1a").replace("\r\n", "\n").replace("\r", "\n")


def numbers(body: str, columns: int, frames: int | None) -> tuple[Array, list[str]]:
    """A table (T, columns) out of lines of numbers, and sentences about damage.

    frames: as declared. Lines that are wrapped, or one behind the other, are put together again where that gives so
    many. An incomplete last line is dropped; another damaged line becomes NaN.
    Raises MotionFormatError when no line is complete, or too many are damaged.
    """
    lines = [line for line in body.split("\n") if line and not line.isspace()]
    notes: list[str] = []
    table = _table(lines, columns)
    if table is not None:
        return table, notes
    rows = [_row(line) for line in lines]
    if rows and len(rows[-1]) != columns and any(len(row) == columns for row in rows):
        rows.pop()
        notes.append("The last frame is cut off and was dropped.")
    good = [row for row in rows if len(row) == columns]
    if not good:
        return _reflowed(rows, columns, frames), notes
    notes += damaged(len(rows) - len(good), len(rows))
    return np.array([row if len(row) == columns else [math.nan] * columns for row in rows]), notes


def _table(lines: list[str], columns: int) -> Array | None:
    """The lines as a table where all of them are complete, read quickly."""
    try:
        table = np.loadtxt(lines, ndmin=2, comments=None) if lines else np.empty((0, 0))
    except ValueError:
        return None
    return table if table.shape == (len(lines), columns) and len(lines) else None


def _reflowed(rows: list[list[float]], columns: int, frames: int | None) -> Array:
    """The table of frames of which no line holds exactly one.

    Raises MotionFormatError when their numbers do not fill whole frames.
    """
    values = [value for row in rows for value in row]
    if columns and frames and len(values) == frames * columns and all(rows):
        return np.array(values).reshape(-1, columns)
    if not values or len(values) < columns:
        raise MotionFormatError("the file has no complete frame of motion: get the complete file")
    most = max(map(len, rows))
    raise MotionFormatError(
        f"the frames have {most} numbers, not one for each of the {columns} channels: export the file again"
    )


def damaged(bad: int, frames: int) -> list[str]:
    """A sentence about damaged frames, none when there are none.

    Raises MotionFormatError when they are more than a tenth.
    """
    if bad > max(1, MOST_DAMAGED * frames):
        raise MotionFormatError(f"{bad} of {frames} frames of the file are damaged: get the complete file")
    return [f"{bad} damaged frames were taken as missing."] if bad else []


def _row(line: str) -> list[float]:
    """The numbers of a line; none when one of its words is no number."""
    try:
        return [float(word) for word in line.split()]
    except ValueError:
        return []
