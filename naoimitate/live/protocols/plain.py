"""Our own protocol, ``json``: a datagram is a frame, in the words and units of ``HumanFrame`` (docs/json-stream.md)."""

from __future__ import annotations

import json
from importlib import resources
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from naoimitate.core.errors import DatagramError
from naoimitate.core.frames import LANDMARKS, SEGMENTS, Array, HumanFrame
from naoimitate.live.protocols.strict_json import parse
from naoimitate.live.sample import Sample, StreamProtocol

FORMAT = "naoimitate-frame/1"
TITLE = f"a frame of {FORMAT}"
FEET = ("l_foot", "r_foot")
HANDS = ("l_hand", "r_hand")
PORT = 14500
"""UDP; free of the other protocols'."""
FARTHEST = 1000.0
"""m from the origin on each axis."""
LAST_TIME = 1e12
"""s, either way; clocks that count from 1970 are far from it."""
LAST_SEQUENCE = 2**53
"""What every language can count to, also those whose numbers are all doubles."""
LAST_PERSON = 255
UNIT_LENGTH = (0.9, 1.1)
"""A quaternion of other length is no rotation."""
DIGITS = 6
"""Of what the encoder writes: 1 um."""

_Length = Annotated[float, msgspec.Meta(ge=-FARTHEST, le=FARTHEST)]
_Turn = Annotated[float, msgspec.Meta(ge=-UNIT_LENGTH[1], le=UNIT_LENGTH[1])]
_Share = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
_Point = tuple[_Length, _Length, _Length]
_Quaternion = tuple[_Turn, _Turn, _Turn, _Turn]


def _named(name: str, keys: tuple[str, ...], kind: Any) -> Any:
    """A record of values that may each be missing or null; no other key is taken."""
    fields = [(key, kind | None, None) for key in keys]
    return msgspec.defstruct(name, fields, forbid_unknown_fields=True, gc=False)


_FRAME = msgspec.defstruct(
    "Frame",
    [
        ("format", Literal["naoimitate-frame/1"]),
        ("sequence", Annotated[float, msgspec.Meta(ge=0, le=LAST_SEQUENCE)]),
        ("time", Annotated[float, msgspec.Meta(ge=-LAST_TIME, le=LAST_TIME)]),
        ("landmarks", _named("Landmarks", LANDMARKS, _Point)),
        ("person", Annotated[float, msgspec.Meta(ge=0, le=LAST_PERSON)], 0),
        ("orientations", _named("Orientations", SEGMENTS, _Quaternion) | None, None),
        ("com", _Point | None, None),
        (
            "contacts",
            msgspec.defstruct("Contacts", [(key, bool) for key in FEET], forbid_unknown_fields=True) | None,
            None,
        ),
        ("hand_opening", _named("HandOpening", HANDS, _Share) | None, None),
    ],
    forbid_unknown_fields=True,
    gc=False,
)
_DECODER: msgspec.json.Decoder[Any] = msgspec.json.Decoder(_FRAME)


def schema() -> dict[str, Any]:
    """The JSON Schema (2020-12) of a datagram."""
    text = resources.files("naoimitate.live.protocols").joinpath("json-frame.schema.json").read_text("utf-8")
    return dict(json.loads(text))


class JsonDecoder:
    """Datagrams of ``naoimitate-frame/1`` to samples, one a datagram; nothing is kept."""

    def feed(self, datagram: bytes) -> list[Sample]:
        """The frame of a datagram. Raises DatagramError, and nothing else, where it breaks the schema."""
        found = parse(_DECODER, datagram, TITLE)
        contacts, hands = found.contacts, found.hand_opening
        frame = HumanFrame(
            time=found.time,
            landmarks=_rows(found.landmarks, 3),
            orientations=None if found.orientations is None else _rotations(_rows(found.orientations, 4)),
            com=None if found.com is None else np.array(found.com),
            contacts=None if contacts is None else np.array(msgspec.structs.astuple(contacts)),
            hand_opening=None if hands is None else np.array(msgspec.structs.astuple(hands), dtype=np.float64),
        )
        return [Sample(frame, _whole(found.sequence), _whole(found.person))]


def _whole(number: float) -> int:
    """A counter; some languages write it as 1.0. Raises DatagramError for 1.5."""
    if number != int(number):
        raise DatagramError(f"this is not {TITLE}: sequence and person are whole numbers")
    return int(number)


def _rows(record: Any, width: int) -> Array:
    """The values of a record as rows, NaN where one is missing."""
    gap = (np.nan,) * width
    return np.array([gap if row is None else row for row in msgspec.structs.astuple(record)], dtype=np.float64)


def _rotations(quaternions: Array) -> Array:
    """The same at unit length. Raises DatagramError where the length is far from it."""
    size = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    if (size < UNIT_LENGTH[0]).any() or (size > UNIT_LENGTH[1]).any():
        raise DatagramError(f"this is not {TITLE}: quaternions (w, x, y, z) have length 1")
    return np.asarray(quaternions / size)


class JsonEncoder:
    """Frames as ``naoimitate-frame/1``: what a frame does not have is left out."""

    def encode(self, frame: HumanFrame, sequence: int, time: float) -> list[bytes]:
        """One datagram."""
        said: dict[str, Any] = {"format": FORMAT, "sequence": sequence, "time": round(float(time), DIGITS)}
        said["landmarks"] = _known(LANDMARKS, frame.landmarks)
        if frame.orientations is not None:
            said["orientations"] = _known(SEGMENTS, frame.orientations)
        if frame.com is not None and np.isfinite(frame.com).all():
            said["com"] = frame.com.round(DIGITS).tolist()
        if frame.contacts is not None:
            said["contacts"] = dict(zip(FEET, frame.contacts.tolist(), strict=True))
        if frame.hand_opening is not None:
            said["hand_opening"] = _known(HANDS, frame.hand_opening)
        return [msgspec.json.encode(said)]


def _known(names: tuple[str, ...], rows: Array) -> dict[str, Any]:
    """Rows by name, those with NaN left out."""
    known = np.isfinite(rows.reshape(len(names), -1).sum(axis=1)).tolist()
    return {name: row for name, row, good in zip(names, rows.round(DIGITS).tolist(), known, strict=True) if good}


def recognises(datagram: bytes) -> bool:
    """Whether a datagram looks like this protocol, of whatever version."""
    return datagram.lstrip()[:1] == b"{" and b'"naoimitate-frame/' in datagram


JSON = StreamProtocol("json", "naoimitate's own JSON", PORT, JsonDecoder, JsonEncoder, recognises)
