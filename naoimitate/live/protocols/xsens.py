"""Xsens MVN (MXTP) to landmarks: poses of 23 segments, with the suit's centre of mass and the character's scaling.

A pose (MXTP02) becomes a sample at once. The points of a scaling datagram (MXTP13) give the ends of head and hands
from when they come; until then a person's proportions do. Joint angles, kinematics of segments and trackers, time
codes, and types that we do not know pass without effect.
"""

from __future__ import annotations

import math
from collections import OrderedDict

import numpy as np

from naoimitate.core.frames import LANDMARK, LANDMARKS, SIDES, Array, HumanFrame
from naoimitate.core.frames import SEGMENTS as OUR_SEGMENTS
from naoimitate.live.protocols import mxtp
from naoimitate.live.protocols.mxtp import ROW, Header
from naoimitate.live.protocols.mxtp_com import CentreOfMass, Convention
from naoimitate.live.protocols.mxtp_parts import Parts
from naoimitate.live.protocols.proportions import add_ends, opening, same_signs
from naoimitate.live.protocols.xsens_body import JOINT_OF, POINT_OF, POINT_SHARE, SEGMENT_OF, SIDE
from naoimitate.live.protocols.xsens_encoder import XsensEncoder
from naoimitate.live.sample import Sample, StreamProtocol

PORT = 9763
CHARACTERS = 8
"""So many characters are kept; the one that was silent longest makes room."""
FAR = 1000.0
"""m; positions beyond are no positions."""
LONGEST_LEG = 10.0
"""Thigh and shank of more than this are in centimetres (people: 0.5 to 1.2 m, 50 to 120 cm),"""
NO_LEG = 300.0
"""and of more than this they are damaged."""
LONGEST_POINT = 0.5
"""m from a segment's origin to one of its points; more is no metre."""
_ENDS = tuple(POINT_OF)
_ROWS = np.array([ROW[JOINT_OF[name]] for name in LANDMARKS])
_TURNS = np.array([ROW[SEGMENT_OF[name]] for name in OUR_SEGMENTS])
_HIPS = [LANDMARK["l_hip"], LANDMARK["r_hip"]]
_LEGS = tuple(tuple(ROW[SIDE[s] + name] for name in ("UpperLeg", "LowerLeg", "Foot")) for s in SIDES)
_UPPER, _LOWER = (np.array([first + 4 * finger for finger in range(4)]) for first in (5, 6))
"""Among a hand's 20 segments the first and second phalanges of the four fingers; the carpus is the first of all."""


class _Character:
    """What is kept of one character between datagrams."""

    def __init__(self) -> None:
        self.parts = Parts()
        self.com = CentreOfMass()
        self.points: dict[str, tuple[float, float, float]] = {}
        self.turns: Array | None = None


class XsensDecoder:
    """MXTP datagrams to samples."""

    def __init__(self) -> None:
        self._characters: OrderedDict[int, _Character] = OrderedDict()
        self.names: dict[int, str] = {}
        """Names of characters by number, as the sender gave them."""

    def feed(self, datagram: bytes) -> list[Sample]:
        """The sample that a pose completes; everything else gives none. Raises DatagramError for damaged bytes."""
        header, payload = mxtp.open_datagram(datagram)
        if header.kind == mxtp.POSE:
            return self._pose(header, mxtp.pose_items(header, payload))
        if header.kind == mxtp.COM:
            com = mxtp.read_com(payload)
            self._character(header.person).com.take(header.counter, com)
        elif header.kind == mxtp.SCALING:
            self._scale(header, mxtp.read_scaling(payload))
        elif header.kind == mxtp.META:
            self._name(header, mxtp.read_meta(payload))
        return []

    def _character(self, number: int) -> _Character:
        character = self._characters.pop(number, None) or _Character()
        self._characters[number] = character
        if len(self._characters) > CHARACTERS:
            gone, _ = self._characters.popitem(last=False)
            self.names.pop(gone, None)
        return character

    def _scale(self, header: Header, scaling: mxtp.Scaling) -> None:
        character = self._character(header.person)
        for name, point in POINT_OF.items():
            x, y, z = scaling.points.get(point, (math.nan, math.nan, math.nan))
            if math.hypot(x, y, z) < LONGEST_POINT:
                share = POINT_SHARE[name]
                character.points[name] = (share * x, share * y, share * z)

    def _name(self, header: Header, tags: dict[str, str]) -> None:
        self._character(header.person)
        if "name" in tags:
            self.names[header.person] = tags["name"][:80]

    def _pose(self, header: Header, items: bytes) -> list[Sample]:
        character = self._character(header.person)
        joined = character.parts.add(header, items)
        if joined is None:
            return []
        with np.errstate(all="ignore"):  # numbers of damaged datagrams may be anything
            numbers, values = mxtp.read_poses(joined)
            body = header.body or len(mxtp.SEGMENTS)
            frame = _frame(character, header, mxtp.body_rows(numbers[:body], values[:body]), _hands(header, values))
        return [Sample(frame, header.counter, header.person)] if frame is not None else []


def _frame(character: _Character, header: Header, table: Array, hands: Array | None) -> HumanFrame | None:
    """A person from the segments (23, 7); None for a tracked object, which has none of a person's joints."""
    positions, turns = table[:, :3], _unit(table[:, 3:])
    convention = _convention(positions, turns)
    positions, turns = _finite(convention.points(positions)), convention.quaternions(turns)
    landmarks, orientations = positions[_ROWS], turns[_TURNS]
    landmarks[0] = 0.5 * (landmarks[_HIPS[0]] + landmarks[_HIPS[1]])
    com = character.com.at(header.counter, landmarks[0], convention)
    add_ends(landmarks, orientations, _ENDS, character.points)
    if np.isnan(landmarks).all():
        return None
    character.turns = orientations = same_signs(orientations, character.turns)
    return HumanFrame(0.001 * header.milliseconds, landmarks, orientations, com=com, hand_opening=hands)


def _unit(turns: Array) -> Array:
    """Quaternions (N, 4) of unit length; NaN where they are far from it."""
    size = np.sqrt(np.einsum("ij,ij->i", turns, turns))
    return np.where((size > 0.5) & (size < 2.0), 1.0 / size, np.nan)[:, None] * turns


def _finite(positions: Array) -> Array:
    """Positions (N, 3) m, NaN where they cannot be true."""
    good = np.abs(positions) < FAR
    return positions if good.all() else np.where(good.all(axis=1, keepdims=True), positions, np.nan)


def _convention(positions: Array, turns: Array) -> Convention:
    """Unit and up axis of a pose, whatever its posture: by the length of the legs, and by where the spine leaves the
    pelvis in the pelvis' own frame, which is along its up axis.

    MVN offers Y-up (x forward, y up, z right), and some documents say centimetres; no datagram tells.
    """
    points = positions.tolist()
    legs = [math.dist(points[h], points[k]) + math.dist(points[k], points[a]) for h, k, a in _LEGS]
    w, x, y, z = turns[0].tolist()
    a, b, c = (end - start for start, end in zip(points[0], points[1], strict=True))
    up_y = 2.0 * (x * y - w * z) * a + (1.0 - 2.0 * (x * x + z * z)) * b + 2.0 * (y * z + w * x) * c
    up_z = 2.0 * (x * z + w * y) * a + 2.0 * (y * z - w * x) * b + (1.0 - 2.0 * (x * x + y * y)) * c
    shortest = min((leg for leg in legs if leg < NO_LEG), default=0.0)
    return Convention(0.01 if shortest > LONGEST_LEG else 1.0, abs(up_y) > abs(up_z))


def _hands(header: Header, values: Array) -> Array | None:
    """How open the left and right hand are, (2,), from the finger segments after body and props; None without."""
    first = header.body + header.props
    if header.fingers != mxtp.FINGERS or not header.body or len(values) < first + mxtp.FINGERS:
        return None
    turns = _unit(values[first : first + mxtp.FINGERS, 3:]).reshape(2, mxtp.FINGERS // 2, 4)
    pairs = ((turns[:, :1], turns[:, _UPPER]), (turns[:, _UPPER], turns[:, _LOWER]))
    cosines = np.concatenate([np.abs((inner * outer).sum(axis=-1)) for inner, outer in pairs], axis=-1)
    return np.array([opening(bends) for bends in 2.0 * np.arccos(np.minimum(cosines, 1.0))])


def recognises(datagram: bytes) -> bool:
    """Whether a datagram is MXTP of any type."""
    return datagram[:4] == mxtp.MAGIC and datagram[4:6].isalnum()


XSENS = StreamProtocol("xsens", "Xsens MVN network streamer (MXTP)", PORT, XsensDecoder, XsensEncoder, recognises)
