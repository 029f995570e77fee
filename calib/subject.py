"""A person's calibration: measured from a T-pose, kept in a file (Koenemann 2014, section IV-A)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import yaml

from naoimitate.core.errors import CalibrationError
from naoimitate.core.frames import LANDMARKS, SEGMENTS, HumanFrame
from naoimitate.human.body import EFFECTORS, Body, measure, observe

Array = npt.NDArray[np.float64]

FORMAT = "naoimitate-subject/1"


@dataclass(frozen=True)
class Subject:
    """A measured person: their body, the T-pose, and the reference posture f_ref,H, (4, 3) m."""

    body: Body
    tpose: HumanFrame
    reference: Array


def calibrate(tpose: HumanFrame) -> Subject:
    """Measure a person who stands in a T-pose; CalibrationError where the posture cannot serve."""
    body = measure(tpose)
    return Subject(body, tpose, observe(body, tpose).posture)


def save_subject(subject: Subject, path: str | Path) -> None:
    """Write a subject as YAML: the T-pose's landmarks (m) and orientations, and for people the measures."""
    tpose, body = subject.tpose, subject.body
    document = {
        "format": FORMAT,
        "measures_m": {
            "stature": round(body.stature, 4),
            "arms": [round(x, 4) for x in body.arm],
            "legs": [round(x, 4) for x in body.leg],
            "ankle_height": round(body.ankle_height, 4),
        },
        "reference_m": {
            e: [round(float(x), 5) for x in row] for e, row in zip(EFFECTORS, subject.reference, strict=True)
        },
        "tpose": {
            "landmarks_m": _rows(LANDMARKS, tpose.landmarks),
            "orientations_wxyz": None if tpose.orientations is None else _rows(SEGMENTS, tpose.orientations),
        },
    }
    Path(path).write_text(yaml.safe_dump(document, sort_keys=False, default_flow_style=None), encoding="utf-8")


def load_subject(path: str | Path) -> Subject:
    """Read a subject file; CalibrationError where it is missing, damaged or of another format."""
    return parse_subject(read_subject(path), str(path))


def read_subject(path: str | Path) -> str:
    """The text of a subject file; CalibrationError where it is none."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise CalibrationError(f"{path}: no such subject file; make one with `naoimitate calibrate`") from None
    except (OSError, UnicodeDecodeError):
        raise CalibrationError(f"{path}: not a subject file; make one with `naoimitate calibrate`") from None
    parse_subject(text, str(path))
    return text


def parse_subject(text: str, name: str) -> Subject:
    """The subject of a subject file's text; name: of the file, for CalibrationError."""
    try:
        document = yaml.safe_load(text)
        if document["format"] != FORMAT:
            raise CalibrationError(f"{name}: format {document['format']!r} is not {FORMAT}")
        tpose = document["tpose"]
        landmarks = np.array([tpose["landmarks_m"][mark] for mark in LANDMARKS], dtype=np.float64)
        given = tpose["orientations_wxyz"]
        orientations = None if given is None else np.array([given[part] for part in SEGMENTS], dtype=np.float64)
    except (yaml.YAMLError, KeyError, TypeError, ValueError, RecursionError):
        raise CalibrationError(f"{name}: not a subject file; make one with `naoimitate calibrate`") from None
    if landmarks.shape != (len(LANDMARKS), 3) or (
        orientations is not None and orientations.shape != (len(SEGMENTS), 4)
    ):
        raise CalibrationError(f"{name}: a landmark or orientation has the wrong number of values; calibrate again")
    return calibrate(HumanFrame(0.0, landmarks, orientations))


def _rows(names: tuple[str, ...], values: Array) -> dict[str, list[float]]:
    return {name: [round(float(x), 6) for x in row] for name, row in zip(names, values, strict=True)}
