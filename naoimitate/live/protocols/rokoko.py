"""Rokoko Studio Live, "Custom Streaming": JSON v3, plain or in an LZ4 frame; a datagram is a frame of all actors.

Joints have positions and rotations in Unity's world; joint frames are not those of any T-pose, so orientations come
once the stream has shown one (``turns``). Fields and units: Rokoko's own Unity plugin and JSON v3 sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import msgspec
import numpy as np

from naoimitate.core.errors import DatagramError
from naoimitate.core.frames import LANDMARK, LANDMARKS, Array, HumanFrame
from naoimitate.human.body import LEG_BY_STATURE
from naoimitate.live.protocols.lz4_frame import MAGIC, unpack
from naoimitate.live.protocols.rokoko_encoder import RokokoEncoder
from naoimitate.live.protocols.rokoko_joints import FINGERS, FIST, JOINT_OF, PHALANGES, SEGMENT_JOINT, SIDE, leg_length
from naoimitate.live.protocols.strict_json import parse
from naoimitate.live.protocols.turns import SegmentTurns
from naoimitate.live.protocols.unity import quaternions_to_world, to_world
from naoimitate.live.sample import LARGEST, Sample, StreamProtocol
from naoimitate.motion.person import HEAD_CENTRE

TITLE = "a frame of Rokoko's JSON v3"
MOST_ACTORS = 8
"""Actors of a datagram that are read; more do not fit into the suits' radio."""
MOST_PEOPLE = 32
"""Names whose numbers and T-poses are kept."""
LONGEST_NAME = 64
"""Bytes of a name that count."""
CENTIMETRES_FROM = 10.0
"""A hip higher than this is given in cm (one of the vendor's samples is)."""
_GAP = (np.nan,) * 3

_Place = Annotated[float, msgspec.Meta(ge=-1e5, le=1e5)]
_Turn = Annotated[float, msgspec.Meta(ge=-2.0, le=2.0)]
_Clock = Annotated[float, msgspec.Meta(ge=-1e12, le=1e12)]


def _struct(name: str, /, **fields: Any) -> Any:
    """A record of fields, each (type, default) or a type alone."""
    listed = [(key, *value) if isinstance(value, tuple) else (key, value) for key, value in fields.items()]
    return msgspec.defstruct(name, listed, gc=False)


def _optional(kind: Any) -> tuple[Any, None]:
    return kind | None, None


_JOINT = _struct(
    "Joint",
    position=_optional(_struct("Position", x=_Place, y=_Place, z=_Place)),
    rotation=_optional(_struct("Rotation", x=_Turn, y=_Turn, z=_Turn, w=_Turn)),
)
_FINGER_JOINTS = [f"{side}{finger}{part}" for side in SIDE.values() for finger in FINGERS for part in PHALANGES]
_USED = dict.fromkeys((*JOINT_OF.values(), *SEGMENT_JOINT.values(), "neck", "hip", *_FINGER_JOINTS))
_ACTOR = _struct(
    "Actor",
    name=(msgspec.Raw, msgspec.Raw()),
    meta=_optional(_struct("Meta", hasLeftGlove=(bool, False), hasRightGlove=(bool, False))),
    dimensions=_optional(_struct("Dimensions", totalHeight=_optional(_Place), hipHeight=_optional(_Place))),
    body=_optional(_struct("Body", **{name: _optional(_JOINT) for name in _USED})),
)
_ACTORS = msgspec.defstruct("Actors", [(f"actor{i}", _ACTOR | None, None) for i in range(MOST_ACTORS)], array_like=True)
"""Read like an array of fixed length: actors beyond it are skipped."""
_SCENE = _struct("Scene", timestamp=_Clock, actors=_ACTORS, trackers=(msgspec.Raw, msgspec.Raw()))
_DECODER: msgspec.json.Decoder[Any] = msgspec.json.Decoder(_struct("Frame", version=msgspec.Raw, scene=_SCENE))


@dataclass(frozen=True)
class _Person:
    number: int
    turns: SegmentTurns


class RokokoDecoder:
    """Datagrams of Rokoko Studio to samples, one an actor.

    Actors are numbered by their names as they come, so that nobody takes another's number when one leaves the list.
    """

    def __init__(self) -> None:
        self._people: dict[tuple[bytes, int], _Person] = {}

    def feed(self, datagram: bytes) -> list[Sample]:
        """The actors that a datagram shows, those without a body left out.

        Raises DatagramError, and nothing else, for whatever is not a frame of JSON v3.
        """
        scene = _scene(datagram)
        samples: list[Sample] = []
        names: list[bytes] = []
        for actor in msgspec.structs.astuple(scene.actors):
            if actor is not None and actor.body is not None:
                name = bytes(memoryview(actor.name)[:LONGEST_NAME])
                person = self._person((name, names.count(name)))
                names.append(name)
                samples.append(Sample(_frame(scene.timestamp, person.turns, actor), None, person.number))
        return samples

    def _person(self, name: tuple[bytes, int]) -> _Person:
        """Whoever has this name, and is the n-th of it in the list; of too many the longest unseen is forgotten."""
        person = self._people.pop(name, None)
        if person is None:
            number = len(self._people)
            if number == MOST_PEOPLE:
                number = self._people.pop(next(iter(self._people))).number
            person = _Person(number, SegmentTurns())
        self._people[name] = person
        return person


def _frame(time: float, turns: SegmentTurns, actor: Any) -> HumanFrame:
    landmarks = _landmarks(actor, _metres(actor.dimensions))
    joints = quaternions_to_world(np.array([_rotation(actor.body, name) for name in SEGMENT_JOINT.values()]))
    return HumanFrame(time, landmarks, turns.update(time, landmarks, joints), hand_opening=_hand_opening(actor))


def _scene(datagram: bytes) -> Any:
    text = unpack(datagram, LARGEST) if datagram.startswith(MAGIC) else datagram
    frame = parse(_DECODER, text, TITLE)
    version = bytes(memoryview(frame.version)[:8]).strip(b'"')
    if version[:1] != b"3" or version[1:2] not in (b"", b",", b".") or len(memoryview(frame.scene.trackers)):
        raise DatagramError(f"this is not {TITLE} but another version: choose JSON v3 in Rokoko Studio")
    return frame.scene


def _metres(dimensions: Any) -> float:
    """Metres per unit of an actor's positions."""
    hip = None if dimensions is None else dimensions.hipHeight
    return 0.01 if hip is not None and hip > CENTIMETRES_FROM else 1.0


def _position(body: Any, name: str) -> tuple[float, ...]:
    joint = getattr(body, name)
    place = None if joint is None else joint.position
    return _GAP if place is None else (place.x, place.y, place.z)


def _rotation(body: Any, name: str) -> tuple[float, ...]:
    """Unit quaternion (x, y, z, w) of a joint, NaN where there is none; Unity's unset one is all zero."""
    joint = getattr(body, name)
    turn = None if joint is None else joint.rotation
    if turn is None or turn.x**2 + turn.y**2 + turn.z**2 + turn.w**2 < 0.5:
        return (np.nan,) * 4
    return (turn.x, turn.y, turn.z, turn.w)


def _landmarks(actor: Any, scale: float) -> Array:
    """Landmarks (19, 3) m of an actor: mid-hip where both legs are there, the head's centre above its joint."""
    places = [_position(actor.body, JOINT_OF[name]) if name in JOINT_OF else _GAP for name in LANDMARKS]
    places.append(_position(actor.body, "neck"))
    world = to_world(np.array(places) * scale)
    landmarks, neck = world[:-1], world[-1]
    hips = landmarks[LANDMARK["l_hip"]] + landmarks[LANDMARK["r_hip"]]
    if np.isfinite(hips).all():
        landmarks[LANDMARK["pelvis"]] = 0.5 * hips
    joint = landmarks[LANDMARK["head"]].copy()
    up = joint - neck
    with np.errstate(invalid="ignore", divide="ignore"):
        landmarks[LANDMARK["head"]] += (
            HEAD_CENTRE * _stature(actor.dimensions, scale, landmarks) * up / np.linalg.norm(up)
        )
    return landmarks


def _stature(dimensions: Any, scale: float, landmarks: Array) -> float:
    """Height of an actor, m: as set in Studio, else by the legs."""
    height = None if dimensions is None else dimensions.totalHeight
    return height * scale if height is not None and height > 0.0 else leg_length(landmarks) / LEG_BY_STATURE


def _hand_opening(actor: Any) -> Array | None:
    """Opening (2,) of gloved hands by the bends of their fingers, NaN for a hand without a glove."""
    gloves = (False, False) if actor.meta is None else (actor.meta.hasLeftGlove, actor.meta.hasRightGlove)
    if not any(gloves):
        return None
    opening = np.full(2, np.nan)
    for i, side in enumerate(SIDE.values()):
        chains = np.array([[_position(actor.body, f"{side}{f}{part}") for part in PHALANGES] for f in FINGERS])
        bends = _bend(chains[np.isfinite(chains).all(axis=(1, 2))])
        if gloves[i] and len(bends):
            opening[i] = np.clip(1.0 - bends.mean() / FIST, 0.0, 1.0)
    return opening


def _bend(chains: Array) -> Array:
    """Sum of the bends between the bones of fingers (N, 4, 3), rad; a bone without length bends nothing."""
    bones = np.diff(chains, axis=1)
    bones = bones / np.maximum(np.linalg.norm(bones, axis=-1, keepdims=True), 1e-9)
    return np.asarray(np.arccos(np.clip(np.sum(bones[:, 1:] * bones[:, :-1], axis=-1), -1.0, 1.0)).sum(axis=-1))


def recognises(datagram: bytes) -> bool:
    """Whether a datagram looks like Rokoko Studio's: an LZ4 frame, or a JSON text with a scene of actors."""
    if datagram.startswith(MAGIC):
        return True
    return datagram.lstrip()[:1] == b"{" and b'"scene"' in datagram and b'"actors"' in datagram


ROKOKO = StreamProtocol("rokoko", "Rokoko Studio", 14043, RokokoDecoder, RokokoEncoder, recognises)
