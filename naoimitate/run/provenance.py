"""Where a run comes from: program version, settings, hashes and seed as the JSON text of the run file."""

from __future__ import annotations

import dataclasses
import json
from importlib.metadata import version
from typing import Any

PROGRAM = "naoimitate"


def provenance(
    settings: Any,
    *,
    source_sha256: str,
    seed: int,
    subject_sha256: str | None = None,
    notes: tuple[str, ...] = (),
    **more: Any,
) -> str:
    """The value of the key ``provenance``: a JSON object with sorted keys.

    settings: a settings dataclass or a mapping; all its fields are written. source_sha256, subject_sha256: hex digest
    of the motion and of the subject file, None without one. notes: what the reader recognised, corrected or assumed.
    more: further settings of the run that are no part of ``settings`` (speed, rate, start, end...).
    """
    return json.dumps(
        {
            "program": PROGRAM,
            "version": version(PROGRAM),
            "settings": {**_values(settings), **more},
            "source_sha256": source_sha256,
            "subject_sha256": subject_sha256,
            "seed": seed,
            "notes": list(notes),
        },
        sort_keys=True,
        default=str,
    )


def settings_of(provenance_text: str) -> dict[str, Any]:
    """The settings that a run's provenance records; empty for a run of another program."""
    settings = json.loads(provenance_text).get("settings", {})
    return settings if isinstance(settings, dict) else {}


def _values(settings: Any) -> dict[str, Any]:
    if dataclasses.is_dataclass(settings) and not isinstance(settings, type):
        return dataclasses.asdict(settings)
    return dict(settings)
