"""Numbers out of text files that may be damaged."""

from __future__ import annotations

import numpy as np

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import Array


def decode(data: bytes) -> str:
    """Text of a file: UTF-8 (with or without mark) or UTF-16 with a mark, else Latin-1; line ends become newlines."""
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def numbers(body: str, columns: int) -> tuple[Array, list[str]]:
    """A table (T, columns) out of lines of numbers; an incomplete last line is dropped and said.

    Raises MotionFormatError when a line in between is damaged or no line is complete.
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
    if table.shape != (len(lines), columns):
        bad = next((i for i, line in enumerate(lines) if _row(line, columns) is None), 0)
        raise MotionFormatError(f"frame {bad + 1} of the file does not have {columns} numbers: export it again")
    return table, notes


def _row(line: str, columns: int) -> list[float] | None:
    """The numbers of a line, or None when there are not ``columns`` of them."""
    try:
        row = [float(word) for word in line.split()]
    except ValueError:
        return None
    return row if len(row) == columns else None
