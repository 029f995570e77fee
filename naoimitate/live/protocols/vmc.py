"""VMC protocol (OSC over UDP) to landmarks: local bones of a Unity humanoid through its forward kinematics.

A frame has no end mark. It begins with a datagram that brings the time, the root, the hips, or a bone that it already
has; it is complete, and becomes a sample at once, when it has every bone of the frames before. So a bundle is a frame,
and so are the bundles over which a sender splits one, and single messages. Bones that do not come keep their values.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from naoimitate.core.errors import DatagramError
from naoimitate.core.frames import LANDMARK, LANDMARKS, SEGMENT, SEGMENTS, SIDES, Array, HumanFrame
from naoimitate.live.protocols import osc
from naoimitate.live.protocols.humanoid import (
    BODY,
    BONES,
    BONES_OF,
    FINGERS,
    PHALANGES,
    REST,
    ROOT,
    SIDE,
    TURNED_BY,
    Joint,
    forward,
)  # fmt: skip
from naoimitate.live.protocols.proportions import ENDS, add_ends, opening, same_signs
from naoimitate.live.protocols.unity import quaternions_to_world, to_world
from naoimitate.live.protocols.vmc_encoder import VmcEncoder
from naoimitate.live.sample import Sample, StreamProtocol

PORT = 39539
"""Where a VMC "Marionette" listens."""
FAR = 1000.0
"""m; places beyond are no places."""
PATIENCE = 3
"""Frames in a row that may lack bones before those are no longer waited for."""
TIME, BONE, ROOT_PLACE = "/VMC/Ext/T", "/VMC/Ext/Bone/Pos", "/VMC/Ext/Root/Pos"
HIPS = "Hips"
_NOWHERE = Joint((math.nan,) * 3, (math.nan,) * 4)


class _News(NamedTuple):
    """What a message tells: the time (name empty), or where the root or a bone is."""

    name: str
    joint: Joint
    time: float


class VmcDecoder:
    """VMC datagrams to samples of one person."""

    def __init__(self) -> None:
        self._root = Joint((0.0, 0.0, 0.0), REST)
        self._local: dict[str, Joint] = {}
        self._time = math.nan
        self._pending: set[str] = set()
        self._expected: set[str] = set()
        self._missed = 0
        self._signs: Array | None = None

    def feed(self, datagram: bytes) -> list[Sample]:
        """The samples that a datagram completes. Raises DatagramError for damaged bytes."""
        news = [_read(message) for message in osc.messages(datagram)]
        told = [item for item in news if item is not None]
        samples = self._closed() if self._pending and any(self._begins(item.name) for item in told) else []
        for item in told:
            self._take(item)
        if self._pending and self._complete(datagram.startswith(osc.BUNDLE)):
            samples += self._closed()
        return samples

    def _begins(self, name: str) -> bool:
        return name in ("", ROOT, HIPS) or name in self._pending

    def _take(self, item: _News) -> None:
        if not item.name:
            self._time = item.time
        elif item.name == ROOT:
            self._root = item.joint
        else:
            self._local[item.name] = item.joint
            if item.name in BODY:
                self._pending.add(item.name)

    def _complete(self, bundle: bool) -> bool:
        """Whether the frame has all that is expected; a bundle may bring more than was known before."""
        if not self._expected:
            return bundle and HIPS in self._pending
        return self._expected <= self._pending or (bundle and not self._pending <= self._expected)

    def _closed(self) -> list[Sample]:
        """End the frame and give it, unless it has no hips and nothing new: then it is the rest of a lost one."""
        bones, self._pending = self._pending, set()
        lacking, new = not self._expected <= bones, not bones <= self._expected
        if HIPS not in bones and (not self._expected or not new):
            return []
        self._missed = self._missed + 1 if lacking and not new else 0
        if self._missed < PATIENCE:
            self._expected |= bones
        else:
            self._expected, self._missed = bones, 0
        return [Sample(self._frame())]

    def _frame(self) -> HumanFrame:
        with np.errstate(all="ignore"):  # numbers of damaged datagrams may be anything
            landmarks, orientations = _person(forward(self._root, self._local))
        self._signs = orientations = same_signs(orientations, self._signs)
        return HumanFrame(self._time, landmarks, orientations, hand_opening=self._hands())

    def _hands(self) -> Array | None:
        """How open the left and right hand are, (2,); None without the fingers of both."""
        names = [[SIDE[s] + finger + part for finger in FINGERS for part in PHALANGES] for s in SIDES]
        if any(name not in self._local for side in names for name in side):
            return None
        turns = np.array([[self._local[name].turn[3] for name in side] for side in names])
        return np.array([opening(bends) for bends in 2.0 * np.arccos(np.minimum(np.abs(turns), 1.0))])


def _read(message: bytes) -> _News | None:
    """What a message tells, None for those and for bones that do not matter. Raises DatagramError."""
    address = osc.address_of(message)
    if address == TIME:
        (time, *_) = osc.arguments(message, "f")
        return _News("", _NOWHERE, float(time) if math.isfinite(float(time)) else math.nan)
    if address not in (BONE, ROOT_PLACE):
        return None
    name, *numbers = osc.arguments(message, "sfffffff")
    if address == ROOT_PLACE:
        name = ROOT
    elif name not in BONES:
        return None
    return _News(str(name), _joint([float(number) for number in numbers[:7]]), math.nan)


def _joint(numbers: list[float]) -> Joint:
    """A joint from its place and turn; nowhere when they cannot be true."""
    x, y, z, a, b, c, w = numbers
    size = math.sqrt(a * a + b * b + c * c + w * w)
    if not (0.5 < size < 2.0 and max(abs(x), abs(y), abs(z)) < FAR and x == x and y == y and z == z):
        return _NOWHERE
    return Joint((x, y, z), (a / size, b / size, c / size, w / size))


def _person(world: dict[str, Joint]) -> tuple[Array, Array]:
    """Landmarks (19, 3) m and orientations (7, 4), NaN where the sender has no bone."""
    places = np.full((len(LANDMARKS), 3), np.nan)
    turns = np.full((len(SEGMENTS), 4), np.nan)
    for landmark, bones in BONES_OF.items():
        for bone in [bone for bone in bones if bone in world][:1]:
            places[LANDMARK[landmark]] = world[bone].place
    for segment, bones in TURNED_BY.items():
        for bone in [bone for bone in bones if bone in world][:1]:
            turns[SEGMENT[segment]] = world[bone].turn
    places[LANDMARK["pelvis"]] = 0.5 * (places[LANDMARK["l_hip"]] + places[LANDMARK["r_hip"]])
    landmarks, orientations = to_world(places), quaternions_to_world(turns)
    lacking = [name for name in ENDS if name == "head" or BONES_OF[name][0] not in world]
    add_ends(landmarks, orientations, lacking, {})
    landmarks[~(np.abs(landmarks) < FAR).all(axis=1)] = np.nan
    return landmarks, orientations


def recognises(datagram: bytes) -> bool:
    """Whether a datagram has messages of VMC; other OSC is not."""
    try:
        return any(osc.address_of(message).startswith("/VMC/") for message in osc.messages(datagram))
    except DatagramError:
        return False


VMC = StreamProtocol("vmc", "VMC protocol (OSC)", PORT, VmcDecoder, VmcEncoder, recognises)
