"""The schema of the run file: which keys, of which type, shape and values."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from naoimitate.core.errors import RunFileError

FORMAT = "naoimitate-run/1"
MIN_RATE = 50.0
"""Lowest mean frame rate of a run, Hz (the contract of the run file)."""
RATE_TOLERANCE = 0.01
"""How far the mean rate may stay below ``MIN_RATE``, Hz: rounding of the clock over a long run."""
QUATERNION_TOLERANCE = 1e-6
"""Largest deviation of a quaternion's norm from 1."""

LARGEST = 1e9
"""Bound on every number, in its unit: beyond it, damage; it would overflow in what is computed from it."""
MIN_STEP = 1e-6
"""Least step of the clock, s: below it, damage; speeds could not be told."""

Arrays = Mapping[str, npt.NDArray[Any]]


@dataclass(frozen=True)
class Key:
    """What one key holds. kind: str, float, int or bool. shape: sizes, a letter stands for a size shared by keys."""

    kind: type
    shape: tuple[str | int, ...] = ()
    optional: bool = False
    nan: bool = False
    """NaN has a meaning here."""


SCHEMA: dict[str, Key] = {
    "format": Key(str),
    "robot": Key(str),
    "robot_version": Key(str),
    "method": Key(str),
    "retarget": Key(str),
    "source": Key(str),
    "provenance": Key(str),
    "time": Key(float, ("T",)),
    "human_time": Key(float, ("T",), nan=True),
    "joint_names": Key(str, ("J",)),
    "q": Key(float, ("T", "J")),
    "base_pos": Key(float, ("T", 3)),
    "base_quat": Key(float, ("T", 4)),
    "support": Key(str, ("T",)),
    "human_support": Key(str, ("T",)),
    "contact_names": Key(str, ("K",)),
    "contacts": Key(bool, ("T", "K")),
    "contact_points": Key(float, ("T", "K", 3), nan=True),
    "offset": Key(float, ("T",)),
    "human_offset": Key(float, ("T",), nan=True),
    "com": Key(float, ("T", 3)),
    "human_posture": Key(float, ("T", 4, 3), nan=True),
    "ref_human": Key(float, (4, 3)),
    "ref_robot": Key(float, (4, 3)),
    "scale": Key(float, (4,)),
    "hand_opening": Key(float, ("T", 2), nan=True),
    "given_up": Key(np.uint8, ("T",)),
    "step_time": Key(float, ("T",)),
    "ik_iterations": Key(int, ("T",)),
    "session": Key(str, ("T",), optional=True),
    "latency": Key(float, ("T",), optional=True, nan=True),
    "sim_base_pos": Key(float, ("T", 3), optional=True),
    "sim_base_quat": Key(float, ("T", 4), optional=True),
    "sim_q": Key(float, ("T", "J"), optional=True),
    "sim_fsr": Key(float, ("T", 2, 4), optional=True),
    "sim_fell": Key(bool, optional=True),
}

_DTYPES = {str: np.str_, float: np.float64, int: np.int64, bool: np.bool_, np.uint8: np.uint8}
_KINDS = {str: "U", float: "fiu", int: "iu", bool: "b", np.uint8: "u"}


def convert(arrays: Arrays) -> dict[str, npt.NDArray[Any]]:
    """The arrays of a run in the types of the schema. Raises RunFileError for a missing key or another type."""
    result: dict[str, npt.NDArray[Any]] = {}
    for name, key in SCHEMA.items():
        if name not in arrays:
            if not key.optional:
                raise RunFileError(f"key '{name}' is missing")
            continue
        value = np.asarray(arrays[name])
        if value.dtype.kind not in _KINDS[key.kind]:
            raise RunFileError(f"key '{name}' holds {value.dtype}, not {np.dtype(_DTYPES[key.kind]).name}")
        result[name] = value.astype(_DTYPES[key.kind])
    return result


def check(arrays: Arrays) -> None:
    """Check shapes and values of converted arrays. Raises RunFileError, one line that names the key."""
    if str(arrays["format"]) != FORMAT:
        raise RunFileError(f"key 'format' is '{arrays['format']}'; this program reads '{FORMAT}'")
    _check_shapes(arrays)
    for name, rule, complaint in _RULES:
        if name in arrays and not rule(arrays):
            raise RunFileError(f"key '{name}' {complaint}")


def _check_shapes(arrays: Arrays) -> None:
    sizes: dict[str, int] = {}
    for name, value in arrays.items():
        key = SCHEMA[name]
        if value.ndim != len(key.shape):
            raise RunFileError(f"key '{name}' has {value.ndim} dimensions, not {len(key.shape)}")
        for size, want in zip(value.shape, key.shape, strict=True):
            known = sizes.setdefault(want, size) if isinstance(want, str) else want
            if size != known:
                raise RunFileError(f"key '{name}' has shape {value.shape}, expected {want} = {known}")
        if key.kind is float and not _plausible(value, key.nan):
            raise RunFileError(f"key '{name}' holds infinity, {'' if key.nan else 'NaN '}or numbers beyond {LARGEST:g}")
    for letter in ("T", "J"):
        if sizes[letter] < 1:
            raise RunFileError(f"key '{'time' if letter == 'T' else 'joint_names'}' is empty")


def _plausible(value: npt.NDArray[Any], nan: bool) -> bool:
    return bool(np.all((np.abs(value) <= LARGEST) | (nan & np.isnan(value))))


def _unit(name: str) -> Callable[[Arrays], bool]:
    return lambda a: bool(np.all(np.abs(np.linalg.norm(a[name], axis=1) - 1.0) < QUATERNION_TOLERANCE))


def _among(name: str, values: str) -> Callable[[Arrays], bool]:
    return lambda a: bool(np.all(np.isin(a[name], list(values))))


def _fast_enough(a: Arrays) -> bool:
    time = a["time"]
    return len(time) < 2 or (len(time) - 1) / (time[-1] - time[0]) >= MIN_RATE - RATE_TOLERANCE


def _known_human(a: Arrays) -> bool:
    """The person's posture is known exactly where the moment that it is imitated is."""
    return bool(np.array_equal(np.isnan(a["human_posture"]).any(axis=(1, 2)), np.isnan(a["human_time"])))


def _is_json_object(a: Arrays) -> bool:
    try:
        return isinstance(json.loads(str(a["provenance"])), dict)
    except (ValueError, RecursionError):
        return False


def _fractions(value: npt.NDArray[Any]) -> bool:
    known = value[~np.isnan(value)]
    return bool(np.all((known >= 0.0) & (known <= 1.0)))


def _not_falling(value: npt.NDArray[Any]) -> bool:
    known = value[~np.isnan(value)]
    return bool(np.all(np.diff(known) >= 0.0)) and not bool(np.any(np.isinf(known)))


_RULES: tuple[tuple[str, Callable[[Arrays], bool], str], ...] = (
    ("time", lambda a: bool(np.all(np.diff(a["time"]) >= MIN_STEP)), "does not increase strictly"),
    ("time", _fast_enough, f"has fewer than {MIN_RATE:.0f} frames a second"),
    ("human_time", lambda a: _not_falling(a["human_time"]), "decreases"),
    ("human_posture", _known_human, "must be NaN exactly where human_time is"),
    ("joint_names", lambda a: len(set(a["joint_names"])) == len(a["joint_names"]), "repeats a name"),
    ("contact_names", lambda a: {"l_sole", "r_sole"} <= set(a["contact_names"]), "lacks l_sole or r_sole"),
    ("base_quat", _unit("base_quat"), "holds quaternions that are not unit"),
    ("sim_base_quat", _unit("sim_base_quat"), "holds quaternions that are not unit"),
    ("support", _among("support", "DLR"), "holds other values than D, L, R"),
    ("human_support", _among("human_support", "DLRF"), "holds other values than D, L, R, F"),
    ("offset", lambda a: _fractions(a["offset"]), "leaves 0 to 1"),
    ("hand_opening", lambda a: _fractions(a["hand_opening"]), "leaves 0 to 1"),
    ("scale", lambda a: bool(np.all(a["scale"] > 0.0)), "is not positive"),
    ("step_time", lambda a: bool(np.all(a["step_time"] >= 0.0)), "is negative"),
    ("sim_fsr", lambda a: bool(np.all(a["sim_fsr"] >= 0.0)), "is negative"),
    ("ik_iterations", lambda a: bool(np.all(a["ik_iterations"] >= 0)), "is negative"),
    ("provenance", _is_json_object, "is not a JSON object"),
)
