"""The formats that can be read: one entry each, chosen by the file's ending and its first bytes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from naoimitate.core.errors import MotionFormatError
from naoimitate.motion.acclaim import read_amc
from naoimitate.motion.bvh import read_bvh
from naoimitate.motion.clip import Clip
from naoimitate.motion.deepmimic import read_deepmimic
from naoimitate.motion.mvnx import read_mvnx
from naoimitate.motion.text import decode

LARGEST = 500_000_000
"""Bytes; a whole clip is held in memory, some ten times its file."""
_SNIFFED = 4096
"""Bytes at the start of a file that tell its format."""


@dataclass(frozen=True)
class Reader:
    """A format. endings: of its files. marks: texts of which one is near the start of every such file.

    read: path, content and skeleton to a clip. needs_skeleton: whether a skeleton file can be given.
    """

    name: str
    endings: tuple[str, ...]
    marks: tuple[bytes, ...]
    read: Callable[[Path, bytes, Path | None], Clip]
    needs_skeleton: bool = False


READERS = (
    Reader("BVH", (".bvh",), (b"HIERARCHY",), lambda path, data, _: read_bvh(decode(data))),
    Reader("AMC", (".amc",), (b":FULLY-SPECIFIED", b":DEGREES", b"#!OML:ASF"), read_amc, needs_skeleton=True),
    Reader("MVNX", (".mvnx",), (b"<mvnx",), lambda path, data, _: read_mvnx(data)),
    Reader("DeepMimic", (".txt", ".json"), (b'"Frames"',), read_deepmimic, needs_skeleton=True),
)


def read(path: Path, skeleton: Path | None) -> tuple[Clip, bytes]:
    """Read a motion file; returns its clip and its bytes.

    Raises MotionFormatError when it cannot be read or is of no known format.
    """
    data = _content(path)
    reader = _reader(path, data)
    if skeleton is not None and not reader.needs_skeleton:
        raise MotionFormatError(f"a {reader.name} file has its own skeleton: leave --skeleton away")
    return reader.read(path, data, skeleton), data


def _content(path: Path) -> bytes:
    try:
        if path.is_dir():
            raise MotionFormatError(f"{path} is a folder: name a motion file in it")
        size = path.stat().st_size
        if size > LARGEST:
            raise MotionFormatError(
                f"{path.name} has {size / 1e6:.0f} MB, more than {LARGEST / 1e6:.0f}: cut it into parts"
            )
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise MotionFormatError(f"{path} cannot be read: {reason}") from error
    if not data.strip():
        raise MotionFormatError(f"{path.name} is empty: get the complete file")
    return data


def _reader(path: Path, data: bytes) -> Reader:
    """The format by what the file starts with; else by its ending, so that a damaged file is called by its name."""
    start = data[:_SNIFFED].replace(b"\0", b"")
    for reader in READERS:
        if any(mark in start for mark in reader.marks):
            return reader
    ending = path.suffix.lower()
    if ending == ".asf":
        raise MotionFormatError(f"{path.name} is a skeleton: name a motion (.amc) and give it with --skeleton")
    for reader in READERS:
        if ending in reader.endings:
            return reader
    known = ", ".join(e for r in READERS for e in r.endings)
    raise MotionFormatError(f"{path.name} is no motion file that is known ({known}): export it as BVH")
