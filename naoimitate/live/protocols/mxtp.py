"""The wire format of Xsens MVN's network streamer (MXTP): big-endian datagrams of 24 header bytes and items.

Source: "MVN real-time network streaming protocol specification", MV0305P, and the readers that are named with it in
the project's protocol sheet, section 1. Everything here is bytes to values and back; what they mean is in ``xsens``.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from naoimitate.core.errors import DatagramError
from naoimitate.core.frames import Array

POSE, META, SCALING, COM = b"02", b"12", b"13", b"24"
"""Types that are read: quaternion poses, character meta data, null pose and points, centre of mass."""
SEGMENTS = (
    "Pelvis", "L5", "L3", "T12", "T8", "Neck", "Head",
    "RightShoulder", "RightUpperArm", "RightForeArm", "RightHand",
    "LeftShoulder", "LeftUpperArm", "LeftForeArm", "LeftHand",
    "RightUpperLeg", "RightLowerLeg", "RightFoot", "RightToe",
    "LeftUpperLeg", "LeftLowerLeg", "LeftFoot", "LeftToe",
)  # fmt: skip
"""The body's segments; on the wire their number is the place here + 1."""
ROW = {name: row for row, name in enumerate(SEGMENTS)}
FINGERS = 40
"""Finger segments after body and props, the left hand's 20 first."""
POSE_BYTES = 32
MAGIC = b"MXTP"
LONGEST_LIST = 512
"""Segments, or points of them, of a scaling datagram; a person with fingers has 63 and a few points on each."""
LAST = 0x80
"""Bit of the datagram counter that marks the last part of a sample."""
_HEADER = struct.Struct(">6sIBBIBBBBHH")
_COM_SIZES = (12, 36)
_NUMBERS = np.arange(1, len(SEGMENTS) + 1, dtype=np.uint32).tobytes()


class Header(NamedTuple):
    """The header of a datagram; body, props and fingers are 0 from MVN before 2019."""

    kind: bytes
    counter: int
    part: int
    last: bool
    items: int
    milliseconds: int
    person: int
    body: int = 0
    props: int = 0
    fingers: int = 0


class Scaling(NamedTuple):
    """A part of a character's null pose: origins of segments by name, points by segment number and name, m."""

    origins: dict[str, tuple[float, float, float]]
    points: dict[tuple[int, str], tuple[float, float, float]]


def open_datagram(datagram: bytes) -> tuple[Header, bytes]:
    """The header and what follows it.

    Raises DatagramError when it is no MXTP, cut off, or longer or shorter than its header says.
    """
    if datagram[:4] != MAGIC:
        raise DatagramError("this is no Xsens MXTP datagram: choose the --source that fits the sender")
    if len(datagram) < _HEADER.size:
        raise DatagramError(f"an MXTP datagram of {len(datagram)} bytes is cut off: look for loss on the way")
    name, counter, part, items, time, person, body, props, fingers, _, size = _HEADER.unpack_from(datagram)
    payload = datagram[_HEADER.size :]
    if size and size != len(payload):
        raise DatagramError(f"an MXTP datagram brings {len(payload)} of {size} bytes: look for loss on the way")
    kind = name[4:6]
    return Header(kind, counter, part & ~LAST, part >= LAST, items, time, person, body, props, fingers), payload


def make_datagram(header: Header, payload: bytes) -> bytes:
    """A datagram as MVN sends it."""
    kind, counter, part, last, items, time, person, body, props, fingers = header
    part |= LAST if last else 0
    return (
        _HEADER.pack(MAGIC + kind, counter, part, items, time, person, body, props, fingers, 0, len(payload)) + payload
    )


def pose_items(header: Header, payload: bytes) -> bytes:
    """The items of a pose datagram. Raises DatagramError when there are fewer than its header says."""
    size = POSE_BYTES * header.items
    if size > len(payload):
        raise DatagramError(
            f"an MXTP02 datagram brings {len(payload)} bytes for {header.items} segments: look for loss on the way"
        )
    return payload[:size]


def read_poses(items: bytes) -> tuple[npt.NDArray[np.uint32], Array]:
    """Segment numbers (N,), and positions and quaternions (w, x, y, z) side by side (N, 7), in the sender's unit."""
    words = np.frombuffer(items, dtype=">u4").astype(np.uint32).reshape(-1, 8)
    return words[:, 0], words.view(np.float32)[:, 1:].astype(np.float64)


def write_poses(numbers: npt.NDArray[np.uint32], values: Array) -> bytes:
    """The items of a pose datagram: the reverse of ``read_poses``."""
    words = np.empty((len(values), 8), dtype=">u4")
    words[:, 0] = numbers
    words.view(">f4")[:, 1:] = values
    return words.tobytes()


def body_rows(numbers: npt.NDArray[np.uint32], values: Array) -> Array:
    """The body's segments in their order, (23, 7), NaN where the sender has none."""
    if len(values) == len(SEGMENTS) and numbers.tobytes() == _NUMBERS:
        return values
    table = np.full((len(SEGMENTS), 7), np.nan)
    known = (numbers >= 1) & (numbers <= len(SEGMENTS))
    table[numbers[known] - 1] = values[known]
    return table


def read_com(payload: bytes) -> tuple[float, float, float]:
    """A centre of mass (3,) in the sender's unit; velocity and acceleration may follow on the wire.

    Raises DatagramError when it is neither of the two known sizes.
    """
    if len(payload) not in _COM_SIZES:
        raise DatagramError(f"an MXTP24 datagram of {len(payload)} payload bytes has no known form: update MVN")
    x, y, z = struct.unpack_from(">3f", payload)
    return x, y, z


def write_com(com: Array) -> bytes:
    """The short form of a centre of mass (3,) m."""
    return np.asarray(com, dtype=">f4").tobytes()


def read_meta(payload: bytes) -> dict[str, str]:
    """Tags of a character: name, xmid, color and so on. Raises DatagramError when the text is cut off."""
    text = _Reader(payload).text()
    return {tag: value for tag, mark, value in (line.partition(":") for line in text.splitlines()) if mark}


def read_scaling(payload: bytes) -> Scaling:
    """A part of the null pose; a list of points may be missing. Raises DatagramError when it is cut off."""
    reader, origins, points = _Reader(payload), {}, {}
    for _ in range(reader.count()):
        name = reader.text()
        origins[name] = reader.vector()
    for _ in range(reader.count() if reader.left else 0):
        segment, _point = reader.number(">H"), reader.number(">H")
        name, _flags = reader.text(), reader.number(">I")
        points[segment, name] = reader.vector()
    return Scaling(origins, points)


def write_scaling(scaling: Scaling) -> bytes:
    """A part of the null pose; the points of a segment are numbered from 1."""
    out = [struct.pack(">I", len(scaling.origins))]
    out += [_text(name) + struct.pack(">3f", *origin) for name, origin in scaling.origins.items()]
    out += [struct.pack(">I", len(scaling.points))]
    count: dict[int, int] = {}
    for (segment, name), place in scaling.points.items():
        count[segment] = count.get(segment, 0) + 1
        out.append(struct.pack(">HH", segment, count[segment]) + _text(name) + struct.pack(">I3f", 0, *place))
    return b"".join(out)


def _text(text: str) -> bytes:
    data = text.encode()
    return struct.pack(">i", len(data)) + data


class _Reader:
    """Takes values from the front of a payload; every one needs its bytes, so damaged counts end soon."""

    def __init__(self, payload: bytes) -> None:
        self._payload, self._at = payload, 0

    @property
    def left(self) -> int:
        return len(self._payload) - self._at

    def number(self, form: str) -> int:
        return int(self._take(form)[0])

    def count(self) -> int:
        """Raises DatagramError where a list is longer than any of MVN's."""
        count = self.number(">I")
        if count > LONGEST_LIST:
            raise DatagramError(f"a list of {count} in an MXTP datagram is longer than any person's: choose Xsens MVN")
        return count

    def vector(self) -> tuple[float, float, float]:
        """Three numbers."""
        x, y, z = self._take(">3f")
        return x, y, z

    def text(self) -> str:
        """A text behind its length; raises DatagramError where it does not fit."""
        size = self.number(">i")
        if not 0 <= size <= self.left:
            raise DatagramError(f"a text of {size} bytes in an MXTP datagram is cut off: look for loss on the way")
        self._at += size
        return self._payload[self._at - size : self._at].decode(errors="replace")

    def _take(self, form: str) -> tuple[float, ...]:
        if struct.calcsize(form) > self.left:
            raise DatagramError("an MXTP datagram ends in the middle of a list: look for loss on the way")
        values = struct.unpack_from(form, self._payload, self._at)
        self._at += struct.calcsize(form)
        return values
