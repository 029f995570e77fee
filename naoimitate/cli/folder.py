"""Folders for results."""

from __future__ import annotations

from pathlib import Path

from naoimitate.cli.types import is_writable
from naoimitate.core.errors import RunFileError


def make_folder(path: Path) -> Path:
    """The folder, made where it does not exist; RunFileError where it cannot be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunFileError(f"cannot make the folder {path}: {error.strerror}; choose another with --out") from error
    if not is_writable(path):
        raise RunFileError(f"cannot write into the folder {path}; choose another with --out")
    return path
