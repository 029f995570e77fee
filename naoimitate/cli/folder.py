"""Folders for results."""

from __future__ import annotations

from pathlib import Path

from naoimitate.core.errors import RunFileError


def make_folder(path: Path) -> Path:
    """The folder, made where it does not exist; RunFileError where it cannot be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunFileError(f"cannot make the folder {path}: {error.strerror}; choose another with --out") from error
    return path
