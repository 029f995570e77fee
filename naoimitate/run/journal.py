"""The run file of a live session while it is written: a journal that loses at most its last half second.

``RUN.npz.journal`` begins with the run's constants and goes on with chunks of frames, each a NumPy archive behind its
length; a killed program leaves at most a torn last chunk. ``finish`` makes the run file of it, also later.
"""

from __future__ import annotations

import io
import os
import struct
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from naoimitate.core.errors import RunFileError
from naoimitate.core.frames import Array, RobotCommand
from naoimitate.run.columns import columns
from naoimitate.run.file import DAMAGE, Run, save

CHUNK = 0.5
"""[s] of the robot's clock in a chunk."""
_LENGTH = struct.Struct("<Q")
LARGEST = 1 << 28
"""Bytes of one chunk at most: a longer one is damage."""


def journal_path(out: Path) -> Path:
    """Where the journal of a run file is."""
    return out.with_name(out.name + ".journal")


class Moved(NamedTuple):
    """As the simulated robot really was at a frame: joints (J,) rad, torso (3,) m and (4,), force sensors (2, 4) N,
    whether it had fallen."""

    q: Array
    base_pos: Array
    base_quat: Array
    fsr: Array
    fell: bool


class Row(NamedTuple):
    """One frame. human_time, latency: s, NaN where there is none. moved: None without a simulation."""

    command: RobotCommand
    human_time: float
    session: str
    latency: float
    step_time: float
    moved: Moved | None = None


class Journal:
    """A run that grows by a frame at a time. Raises RunFileError where it cannot be written."""

    def __init__(self, out: Path, constants: dict[str, Any]) -> None:
        self.out, self._path = out, journal_path(out)
        self._rows: list[Row] = []
        try:
            self._file: BinaryIO = self._path.open("wb")
        except OSError as error:
            raise RunFileError(f"cannot write {self._path}: {error.strerror}; choose another folder") from error
        self._write(constants)

    def add(self, row: Row) -> None:
        """One frame; all of a run with, or all without a simulation."""
        self._rows.append(row)
        if row.command.time - self._rows[0].command.time >= CHUNK:
            self._flush()

    def end(self) -> None:
        """Write what is left; ``finish`` makes the run file."""
        self._flush()
        self._file.close()

    def close(self) -> Run | None:
        """Write what is left and make the run file; None where no frame was added."""
        self.end()
        return finish(self.out)

    def _flush(self) -> None:
        if not self._rows:
            return
        commands, human, session, latency, step, moved = zip(*self._rows, strict=True)
        arrays = columns(commands)
        tracked = np.isfinite(np.array(human))
        arrays["human_posture"] = np.where(tracked[:, None, None], arrays["human_posture"], np.nan)
        arrays |= {
            "human_time": np.array(human),
            "session": np.array(session),
            "latency": np.array(latency),
            "step_time": np.array(step),
        }
        if None not in moved:
            names = ("sim_q", "sim_base_pos", "sim_base_quat", "sim_fsr", "sim_fell")
            arrays |= dict(zip(names, map(np.array, zip(*moved, strict=True)), strict=True))
        self._write(arrays)
        self._rows.clear()

    def _write(self, arrays: dict[str, Any]) -> None:
        packed = io.BytesIO()
        np.savez(packed, **arrays)
        try:
            self._file.write(_LENGTH.pack(packed.tell()) + packed.getvalue())
            self._file.flush()
        except OSError as error:
            raise RunFileError(f"cannot write {self._path}: {error.strerror}") from error


def finish(out: Path) -> Run | None:
    """Make the run file ``out`` from its journal, which then goes; None, and no file, where it holds no frame.

    Raises RunFileError where there is no journal, or it is no journal.
    """
    path = journal_path(out)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RunFileError(f"{path}: {error.strerror}; it is there only after a live session was killed") from error
    chunks = _chunks(data)
    if not chunks:
        raise RunFileError(f"{path} is no journal of a run")
    constants, frames = chunks[0], chunks[1:]
    if not frames:
        path.unlink()
        return None
    shared = set(frames[0]).intersection(*frames)
    values = {key: np.concatenate([frame[key] for frame in frames]) for key in shared}
    if "sim_fell" in values:
        values["sim_fell"] = np.asarray(values["sim_fell"].any())
    run = Run(**{key: value.item() if value.ndim == 0 else value for key, value in {**constants, **values}.items()})
    save(run, out)
    os.unlink(path)
    return run


def _chunks(data: bytes) -> list[dict[str, Any]]:
    """Whole chunks from the beginning on, up to the first that is torn."""
    found, at = [], 0
    while at + _LENGTH.size <= len(data):
        (length,) = _LENGTH.unpack_from(data, at)
        begin, at = at + _LENGTH.size, at + _LENGTH.size + length
        if length > LARGEST or at > len(data):
            break
        try:
            with np.load(io.BytesIO(data[begin:at]), allow_pickle=False) as archive:
                found.append({key: archive[key] for key in archive.files})
        except DAMAGE:
            break
    return found
