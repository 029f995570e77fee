"""Xsens MVNX files: 23 segments with global positions and quaternions, z up, metres (XML, MVN manual).

The frames of type ``identity``, ``tpose`` and ``tpose-isb`` are calibration postures; only ``normal`` ones are motion.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from lxml import etree
from scipy.spatial.transform import Rotation

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import Array
from naoimitate.motion.clip import Clip, Posture, Skeleton

PARENTS = {
    "Pelvis": "", "L5": "Pelvis", "L3": "L5", "T12": "L3", "T8": "T12", "Neck": "T8", "Head": "Neck",
    **{f"{s}Shoulder": "T8" for s in ("Right", "Left")},
    **{f"{s}UpperArm": f"{s}Shoulder" for s in ("Right", "Left")},
    **{f"{s}ForeArm": f"{s}UpperArm" for s in ("Right", "Left")},
    **{f"{s}Hand": f"{s}ForeArm" for s in ("Right", "Left")},
    **{f"{s}UpperLeg": "Pelvis" for s in ("Right", "Left")},
    **{f"{s}LowerLeg": f"{s}UpperLeg" for s in ("Right", "Left")},
    **{f"{s}Foot": f"{s}LowerLeg" for s in ("Right", "Left")},
    **{f"{s}Toe": f"{s}Foot" for s in ("Right", "Left")},
}  # fmt: skip
"""Segment above each segment; the file's own order of segments is kept otherwise."""
ENDS = {
    "Head": "pTopOfHead",
    "RightHand": "pRightTopOfHand",
    "LeftHand": "pLeftTopOfHand",
    "RightToe": "pRightToe",
    "LeftToe": "pLeftToe",
}
"""Bony points that end the last segments."""
NUMBER = "number"
"""Among the values of a frame its place in the recording, which counts lost frames, too."""


@dataclass
class _File:
    """What was collected until the end of the file, or until it broke off."""

    segments: list[str] = field(default_factory=list)
    points: dict[tuple[str, str], list[float]] = field(default_factory=dict)
    contacts: dict[int, str] = field(default_factory=dict)
    rate: float | None = None
    frames: dict[str, list[dict[str, list[float]]]] = field(default_factory=dict)
    broken: bool = False


def read_mvnx(data: bytes) -> Clip:
    """Read an MVNX file; one that is cut off gives its complete frames.

    Raises MotionFormatError when there is no complete frame. Entities are not resolved, nothing is fetched.
    """
    file = _collect(data)
    rows = [name for name in PARENTS if name in file.segments]
    frames = [f for f in file.frames.get("normal", []) if _fits(f, len(file.segments))]
    if not rows or not frames:
        raise MotionFormatError(
            "the MVNX file has no complete frame of motion: get the complete file, or export it again"
        )
    columns = [file.segments.index(name) for name in rows]
    positions, rotations = _pose(frames, columns)
    calibration = [f for f in file.frames.get("tpose", []) if _fits(f, len(file.segments))]
    tposes = _pose(calibration[:1], columns) if calibration else None
    skeleton = _skeleton(rows, file, tposes or (positions, rotations))
    positions, rotations = _with_ends(skeleton, positions, rotations)
    posture = None
    if tposes is not None:
        posture = Posture(*(part[0] for part in _with_ends(skeleton, *tposes)))
    notes = [] if not file.broken else [f"The file is cut off; its {len(frames)} complete frames were read."]
    return Clip(
        "MVNX", skeleton, positions, rotations, rate=file.rate, time=_time(file.rate, frames), unit=1.0, up="z",
        tpose=posture, contacts=_contacts(file, frames), com=_com(frames), notes=tuple(notes),
    )  # fmt: skip


def _collect(data: bytes) -> _File:
    file = _File()
    try:
        for _, element in etree.iterparse(
            io.BytesIO(data), events=("end",), resolve_entities=False, no_network=True, load_dtd=False
        ):
            if isinstance(element.tag, str):
                _take(file, _local(element.tag), element)
    except etree.XMLSyntaxError as error:
        file.broken = True
        if not file.frames.get("normal"):
            raise MotionFormatError(
                "the MVNX file is cut off or damaged before its motion: get the complete file"
            ) from error
    return file


def _local(tag: str) -> str:
    """The name of a tag without its name space; damaged ones have any letters."""
    return tag.rpartition("}")[2]


def _take(file: _File, tag: str, element: etree._Element) -> None:
    """Keep what matters of one complete XML element."""
    if tag == "segment":
        name = element.get("label", "")
        file.segments.append(name)
        for point in element.iter("{*}point"):
            position = _floats(point.findtext("{*}pos_b"))
            if len(position) == 3:
                file.points[name, point.get("label", "")] = position
    elif tag == "contactDefinition":
        file.contacts[_number(element, len(file.contacts))] = element.get("label", "")
    elif tag == "subject" or (tag == "segments" and file.rate is None):
        _take_rate(file, element)
    elif tag == "frame":
        _take_frame(file, element)


def _take_rate(file: _File, element: etree._Element) -> None:
    subject = element if element.get("frameRate") else element.getparent()
    try:
        file.rate = float(subject.get("frameRate", "")) if subject is not None else None
    except ValueError:
        file.rate = None


def _take_frame(file: _File, element: etree._Element) -> None:
    kind = element.get("type") or "normal"
    values = {_local(child.tag): _floats(child.text) for child in element if isinstance(child.tag, str)}
    planted = [c.get("segment", "") for c in element.iter("{*}contact")]
    if planted:
        values["contactSegments"] = [
            float(any("Left" in p for p in planted)),
            float(any("Right" in p for p in planted)),
        ]
    kept = file.frames.setdefault(kind, [])
    kept.append({**values, NUMBER: [_number(element, len(kept))]})
    element.clear()


def _number(element: etree._Element, otherwise: int) -> int:
    """The index that an element has, or the one that it would have by its place."""
    index = element.get("index", "")
    return int(index) if index.isascii() and index.isdigit() and len(index) < 10 else otherwise


def _floats(text: str | None) -> list[float]:
    try:
        return [float(word) for word in (text or "").split()]
    except ValueError:
        return []


def _fits(frame: dict[str, list[float]], segments: int) -> bool:
    """Whether a frame has a position and an orientation for each segment (more for props and fingers)."""
    place, turn = frame.get("position", []), frame.get("orientation", [])
    return len(place) >= 3 * segments and len(turn) >= 4 * segments


def _pose(frames: list[dict[str, list[float]]], columns: list[int]) -> tuple[Array, Array]:
    """Positions (T, N, 3) and rotations (T, N, 3, 3) of the segments in ``columns``."""
    last = max(columns) + 1
    positions = np.array([f["position"][: 3 * last] for f in frames]).reshape(len(frames), last, 3)[:, columns]
    quats = np.array([f["orientation"][: 4 * last] for f in frames]).reshape(len(frames), last, 4)[:, columns]
    rotations = np.full((*quats.shape[:2], 3, 3), np.nan)
    size = np.linalg.norm(quats, axis=-1)
    good = np.isfinite(size) & (size > 1e-6)
    if good.any():
        rotations[good] = Rotation.from_quat(np.roll(quats[good], -1, axis=-1)).as_matrix()
    return positions, rotations


def _skeleton(rows: list[str], file: _File, pose: tuple[Array, Array]) -> Skeleton:
    """Segments at their origins, with offsets as the posture shows them, and the bony points that end them."""
    positions, rotations = pose[0][0], pose[1][0]
    names, parents, offsets, ends = list(rows), [], [], [False] * len(rows)
    for i, name in enumerate(rows):
        parent = rows.index(PARENTS[name]) if PARENTS[name] in rows else -1
        parents.append(parent)
        offsets.append(positions[i] if parent < 0 else rotations[parent].T @ (positions[i] - positions[parent]))
    for name, point in ENDS.items():
        if name in rows and (name, point) in file.points:
            names.append(point)
            parents.append(rows.index(name))
            offsets.append(np.array(file.points[name, point]))
            ends.append(True)
    return Skeleton(tuple(names), np.array(parents), np.array(offsets), np.array(ends))


def _with_ends(skeleton: Skeleton, positions: Array, rotations: Array) -> tuple[Array, Array]:
    """Add the bony points to positions and rotations of the segments."""
    ends = np.flatnonzero(skeleton.ends)
    above = skeleton.parents[ends]
    tips = positions[:, above] + np.einsum("tnij,nj->tni", rotations[:, above], skeleton.offsets[ends])
    return np.concatenate([positions, tips], axis=1), np.concatenate([rotations, rotations[:, above]], axis=1)


def _time(rate: float | None, frames: list[dict[str, list[float]]]) -> Array | None:
    """Time by the frames' numbers, so that a frame which Xsens lost leaves a gap, not a jerk."""
    index = np.array([f[NUMBER][0] for f in frames])
    if rate is None or not rate > 0.0 or len(index) < 2 or (np.diff(index) <= 0.0).any():
        return None
    return np.asarray((index - index[0]) / rate)


def _contacts(file: _File, frames: list[dict[str, list[float]]]) -> npt.NDArray[np.bool_] | None:
    """Left and right foot planted: heel or toe touches, (T, 2)."""
    if all("contactSegments" in f for f in frames):
        return np.array([f["contactSegments"] for f in frames]) > 0.5
    sides = [[i for i, label in file.contacts.items() if label.startswith(side)] for side in ("Left", "Right")]
    if not all(sides):
        return None
    flags = [f.get("footContacts", []) for f in frames]
    if any(len(f) <= max(max(sides[0]), max(sides[1])) for f in flags):
        return None
    return np.array([[any(f[i] > 0.5 for i in side) for side in sides] for f in flags])


def _com(frames: list[dict[str, list[float]]]) -> Array | None:
    """The file's own centre of mass, (T, 3) m."""
    if any(len(f.get("centerOfMass", [])) < 3 for f in frames):
        return None
    return np.array([f["centerOfMass"][:3] for f in frames])
