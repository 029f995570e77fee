"""The run file ``naoimitate-run/1``: one imitated motion as arrays, in a NumPy ``.npz`` that opens without pickle.

Readers ignore keys that they do not know, so a later program may add some.
"""

from __future__ import annotations

import math
import os
import tempfile
import zipfile
import zlib
from dataclasses import dataclass, fields
from pathlib import Path
from tokenize import TokenError
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from naoimitate.core.errors import RunFileError
from naoimitate.core.frames import Array
from naoimitate.run.schema import FORMAT, check, convert

Strings = npt.NDArray[np.str_]
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Run:
    """One run: T frames of J joints with K possible contacts; the fields are the keys of the file.

    format: ``naoimitate-run/1``. robot, robot_version, method, retarget, source: names. provenance: JSON (program
        version, settings, sha256 of source and subject, seed).
    time: (T,) s on the robot's clock, strictly increasing. human_time: (T,) s from the file's first frame: the moment
        that the frame imitates; NaN where a live session was not tracking.
    joint_names: (J,). q: (T, J) rad, the commanded joints after all limits.
    base_pos, base_quat: (T, 3) m, (T, 4) unit (w, x, y, z): torso link in the world, floor at z = 0.
    support: (T,) ``D``, ``L``, ``R``. human_support: (T,) also ``F``, flight.
    contact_names, contacts, contact_points: (K,), (T, K), (T, K, 3) m, world, NaN where a link is not planted.
    offset, human_offset: (T,), 0 left foot to 1 right foot. com: (T, 3) m, world.
    human_posture, ref_human, ref_robot, scale: (T, 4, 3) m, (4, 3) m, (4, 3) m, (4,): equation (1) of Koenemann et al.
        2014 for l_hand, l_foot, r_hand, r_foot, its references, and m of equation (4).
    hand_opening: (T, 2), left and right, 0 closed to 1 open, NaN where the source has none.
    given_up: (T,) bits of ``GivenUp``. step_time: (T,) s of wall time. ik_iterations: (T,).
    session, latency: (T,) state of a live session; (T,) s from datagram to driver, NaN where none caused the step.
    sim_base_pos, sim_base_quat, sim_q, sim_fell: as the simulated robot really moved, and whether it fell.
    sim_fsr: (T, 2, 4) N, what its force sensors read, left and right foot, columns as ``hw.driver.FSR_NAMES``.
    """

    robot: str
    robot_version: str
    method: str
    retarget: str
    source: str
    provenance: str
    time: Array
    human_time: Array
    joint_names: Strings
    q: Array
    base_pos: Array
    base_quat: Array
    support: Strings
    human_support: Strings
    contact_names: Strings
    contacts: Bools
    contact_points: Array
    offset: Array
    human_offset: Array
    com: Array
    human_posture: Array
    ref_human: Array
    ref_robot: Array
    scale: Array
    hand_opening: Array
    given_up: npt.NDArray[np.uint8]
    step_time: Array
    ik_iterations: npt.NDArray[np.int64]
    session: Strings | None = None
    latency: Array | None = None
    sim_base_pos: Array | None = None
    sim_base_quat: Array | None = None
    sim_q: Array | None = None
    sim_fsr: Array | None = None
    sim_fell: bool | None = None
    format: str = FORMAT

    def __len__(self) -> int:
        return len(self.time)

    @property
    def duration(self) -> float:
        """Time from the first to the last frame on the robot's clock, s."""
        return float(self.time[-1] - self.time[0])


LARGEST = 1 << 30
"""Most that one array of a run may hold, bytes: a day of the largest, ``human_posture``, at 100 Hz."""
DAMAGE = (ValueError, EOFError, KeyError, RuntimeError, TokenError, zlib.error, zipfile.BadZipFile)
"""What reading a damaged archive raises; RuntimeError: zipfile, where flags ask for a password or another method."""

KEYS = tuple(field.name for field in fields(Run))
"""Every key that a run file can hold, in the order of the fields."""


def save(run: Run, path: str | Path) -> None:
    """Write a run so that the file appears whole or not at all.

    Raises RunFileError when the run breaks the schema, or the folder cannot be written.
    """
    arrays: dict[str, Any] = {key: np.asarray(value) for key in KEYS if (value := getattr(run, key)) is not None}
    check(convert(arrays))
    path = Path(path)
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise RunFileError(f"cannot write {path}: {error.strerror}; choose another folder with --out") from error
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez_compressed(file, **arrays)
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, path)
    except OSError as error:
        raise RunFileError(f"cannot write {path}: {error.strerror}; choose another folder with --out") from error
    finally:
        Path(name).unlink(missing_ok=True)


def load_run(path: str | Path) -> Run:
    """Read and check a run file.

    Raises RunFileError, in one line that names the key, when the file is damaged or does not follow the schema.
    """
    arrays = _read(Path(path))
    try:
        checked = convert(arrays)
        check(checked)
    except RunFileError as error:
        raise RunFileError(f"{path}: {error}") from error
    values: dict[str, Any] = {key: value.item() if value.ndim == 0 else value for key, value in checked.items()}
    return Run(**values)


def _read(path: Path) -> dict[str, npt.NDArray[Any]]:
    """The known keys of an .npz file as they are."""
    try:
        with path.open("rb") as raw:
            _check_sizes(raw)
            with np.lib.npyio.NpzFile(raw, allow_pickle=False) as file:
                return {key: file[key] for key in file.files if key in KEYS}
    except FileNotFoundError as error:
        raise RunFileError(f"{path}: no such file; make one with 'naoimitate imitate MOTION --out {path}'") from error
    except OSError as error:
        raise RunFileError(f"{path}: cannot be read ({error.strerror})") from error
    except DAMAGE as error:
        raise RunFileError(f"{path}: not a whole .npz run file; make it again with 'naoimitate imitate'") from error


def _check_sizes(raw: BinaryIO) -> None:
    """Raise ValueError for arrays that no run can fill: small files can claim to hold more than any memory."""
    with zipfile.ZipFile(raw) as archive:
        for member in {f"{key}.npy" for key in KEYS} & set(archive.namelist()):
            with archive.open(member) as stream:
                old = np.lib.format.read_magic(stream) == (1, 0)
                header = np.lib.format.read_array_header_1_0 if old else np.lib.format.read_array_header_2_0
                shape, _, dtype = header(stream)
            size = math.prod(shape) * dtype.itemsize
            if size > min(archive.getinfo(member).file_size, LARGEST):
                raise ValueError(f"{member} claims to hold {size} bytes")


def _umask() -> int:
    """The process's umask; there is no call that reads it without setting it."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
