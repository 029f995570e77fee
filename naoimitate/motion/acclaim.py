"""Acclaim skeletons (ASF) and motions (AMC), as the CMU data base publishes them.

No well-kept reader was found on PyPI: asfamc-parser 0.0.2 demands ``dof`` of every bone and a fixed order of sections,
and refuses CMU's files. A bone turns about its start: with C the rotation of its ``axis`` and M that of its channels,
its rotation against its parent is C M C^-1, and its child starts at its end.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import Array
from naoimitate.motion.clip import Clip, Skeleton, forward
from naoimitate.motion.text import damaged, decode

INCH = 0.0254
"""m; ASF lengths are inches times the header's ``length``."""
ROOT_ORDER = ("tx", "ty", "tz", "rx", "ry", "rz")
"""The root's numbers where the skeleton does not say their order."""


@dataclass(frozen=True)
class _Bone:
    """offset: (3,) from its start to its end. axis: (3, 3). order: of its axis. dof: e.g. ("rx", "rz")."""

    name: str
    offset: Array
    axis: Array
    order: str
    dof: tuple[str, ...]


@dataclass(frozen=True)
class _Asf:
    """parent: of each bone. order: of the root's six numbers. axis: order of its rotations. length: unit, inches."""

    bones: dict[str, _Bone]
    parent: dict[str, str]
    order: tuple[str, ...]
    axis: str
    length: float
    degrees: bool


def read_amc(path: Path, data: bytes, skeleton: Path | None) -> Clip:
    """Read an AMC file and its skeleton: ``skeleton``, or the ASF file beside it.

    Raises MotionFormatError when one of them is damaged or the skeleton cannot be found.
    """
    asf_path = skeleton if skeleton is not None else _beside(path)
    try:
        asf = _parse_asf(decode(asf_path.read_bytes()), asf_path.name)
    except OSError as error:
        raise MotionFormatError(f"the skeleton {asf_path} cannot be read: {error.strerror}") from error
    text = decode(data)
    marks = text[:2000].upper()
    degrees = ":DEGREES" in marks or (asf.degrees and ":RADIANS" not in marks)
    frames, notes = _parse_amc(text)
    nodes, names = _skeleton(asf)
    _check_fit(asf, frames, asf_path.name)
    root, local = _channels(asf, frames, names, degrees)
    positions, rotations = forward(nodes, root, local)
    notes.append(f"The skeleton is that of {asf_path.name}.")
    unit = INCH / asf.length if asf.length > 0.0 else None
    return Clip("AMC", nodes, positions, rotations, rate=None, unit=unit, notes=tuple(notes))


def _beside(path: Path) -> Path:
    """The skeleton of a motion in the same folder: of the same name, of the same subject, or the only one."""
    found = [p for p in sorted(path.parent.iterdir()) if p.suffix.lower() == ".asf"]
    for stem in (path.stem, path.stem.split("_")[0]):
        for candidate in found:
            if candidate.stem.lower() == stem.lower():
                return candidate
    if len(found) == 1:
        return found[0]
    raise MotionFormatError(f"{path.name} needs its skeleton: name it with --skeleton FILE.asf")


def _parse_asf(text: str, name: str) -> _Asf:
    sections: dict[str, list[list[str]]] = {}
    section = ""
    for line in text.split("\n"):
        words = line.split("#")[0].split()
        if words and words[0].startswith(":"):
            section = words[0].lower()
            sections[section] = []
            words = words[1:]
        if words and section:
            sections[section].append(words)
    try:
        units = {words[0].lower(): words[1] for words in sections.get(":units", []) if len(words) > 1}
        degrees = units.get("angle", "deg").lower().startswith("deg")
        bones = dict(_bone(block, degrees) for block in _blocks(sections[":bonedata"]))
        parent = {child: words[0] for words in sections[":hierarchy"] for child in words[1:]}
        root = {words[0].lower(): [w.lower() for w in words[1:]] for words in sections.get(":root", [])}
        order, axis = tuple(root.get("order", ROOT_ORDER)), root.get("axis", ["xyz"])[0]
        if sorted(order) != sorted(ROOT_ORDER) or sorted(axis) != ["x", "y", "z"]:
            raise ValueError("root")
        asf = _Asf(bones, parent, order, axis, float(units.get("length", 1.0)), degrees)
    except (KeyError, ValueError, IndexError, StopIteration) as error:
        where = f"no {error.args[0]}" if isinstance(error, KeyError) else str(error)
        raise MotionFormatError(f"the ASF skeleton {name} is damaged ({where}): get the complete file") from error
    if not bones or not np.isfinite([b.offset for b in bones.values()]).all() or not np.isfinite(asf.length):
        raise MotionFormatError(f"the ASF skeleton {name} has no bones with finite lengths: get the complete file")
    return asf


def _blocks(lines: list[list[str]]) -> list[dict[str, list[str]]]:
    """The bones between ``begin`` and ``end``, each a dictionary of its lines."""
    blocks: list[dict[str, list[str]]] = []
    for words in lines:
        if words[0] == "begin":
            blocks.append({})
        elif words[0] != "end" and blocks:
            blocks[-1][words[0].lower()] = words[1:]
    return blocks


def _bone(block: dict[str, list[str]], degrees: bool) -> tuple[str, _Bone]:
    direction = np.array([float(v) for v in block["direction"][:3]])
    length = float(block["length"][0])
    axis = block.get("axis", ["0", "0", "0", "XYZ"])
    order = axis[3].upper()
    if sorted(order) != ["X", "Y", "Z"] or direction.shape != (3,):
        raise ValueError(f"bone {block['name'][0]}")
    turn = Rotation.from_euler(order.lower(), [float(v) for v in axis[:3]], degrees=degrees).as_matrix()
    offset = direction * length
    dof = tuple(d.lower() for d in block.get("dof", []))
    return block["name"][0], _Bone(block["name"][0], offset, turn, order, dof)


def _skeleton(asf: _Asf) -> tuple[Skeleton, list[str]]:
    """Nodes at the bones' starts and an end for every bone without children; names of the bones ("" for ends)."""
    nodes: list[tuple[str, int, Array, bool]] = [("root", -1, np.zeros(3), False)]
    index = {"root": 0}
    todo = [name for name, parent in asf.parent.items() if parent == "root"]
    while todo:
        name = todo.pop(0)
        if name in index or name not in asf.bones:
            continue
        parent = asf.parent[name]
        start = np.zeros(3) if parent == "root" else asf.bones[parent].offset
        index[name] = len(nodes)
        nodes.append((name, index[parent], start, False))
        children = [child for child, above in asf.parent.items() if above == name]
        todo += children
        if not children:
            nodes.append((f"{name}_end", index[name], asf.bones[name].offset, True))
    return Skeleton(
        names=tuple(n[0] for n in nodes),
        parents=np.array([n[1] for n in nodes]),
        offsets=np.array([n[2] for n in nodes]),
        ends=np.array([n[3] for n in nodes]),
    ), ["" if n[3] else n[0] for n in nodes]


def _parse_amc(text: str) -> tuple[list[dict[str, list[float]]], list[str]]:
    """Frames as {bone: numbers}; an incomplete last frame is dropped and said."""
    frames: list[dict[str, list[float]]] = []
    for number, line in enumerate(text.split("\n"), 1):
        words = line.split()
        if not words or words[0].startswith(("#", ":")):
            continue
        if len(words) == 1 and words[0].isdigit():
            frames.append({})
        elif not frames:
            raise MotionFormatError(
                f"line {number} of the AMC file comes before the first frame: get the complete file"
            )
        else:
            try:
                frames[-1][words[0]] = [float(v) for v in words[1:]]
            except ValueError:
                frames[-1][words[0]] = []
    notes = []
    shape = _usual_shape(frames)
    if frames and not _complete(frames[-1], shape):
        frames.pop()
        notes.append("The last frame is cut off and was dropped.")
    if not frames or "root" not in shape:
        raise MotionFormatError("the AMC file has no complete frame of motion: get the complete file")
    bad = [i for i, frame in enumerate(frames) if not _complete(frame, shape)]
    for i in bad:
        frames[i] = {name: [math.nan] * n for name, n in shape.items()}
    return frames, notes + damaged(len(bad), len(frames))


def _usual_shape(frames: list[dict[str, list[float]]]) -> dict[str, int]:
    """How many numbers each bone has, in most of the first frames."""
    shapes = Counter(tuple((name, len(values)) for name, values in frame.items()) for frame in frames[:9])
    return dict(shapes.most_common(1)[0][0]) if shapes else {}


def _complete(frame: dict[str, list[float]], shape: dict[str, int]) -> bool:
    return bool(frame) and all(n > 0 and len(frame.get(name, [])) == n for name, n in shape.items())


def _check_fit(asf: _Asf, frames: list[dict[str, list[float]]], name: str) -> None:
    """Raise MotionFormatError when the motion is that of another skeleton."""
    moves = {bone: count for bone, count in _usual_shape(frames).items() if bone != "root"}
    can = {bone: len(asf.bones[bone].dof) for bone in asf.bones if asf.bones[bone].dof}
    for bone in [*moves, *can]:
        if moves.get(bone) != can.get(bone):
            raise MotionFormatError(f"the bone {bone} does not move like that of {name}: name its own with --skeleton")


def _channels(asf: _Asf, frames: list[dict[str, list[float]]], names: list[str], degrees: bool) -> tuple[Array, Array]:
    """Root positions (T, 3) and rotations of the nodes against their parents (T, J, 3, 3)."""
    table = {name: np.array([frame[name] for frame in frames]) for name in _usual_shape(frames)}
    local = np.tile(np.eye(3), (len(frames), len(names), 1, 1))
    root = _padded(table["root"], 6)[:, [asf.order.index(name) for name in ROOT_ORDER]]
    local[:, 0] = _turns(asf.axis, root[:, 3:], degrees)
    for i, name in enumerate(names[1:], 1):
        if name not in table or not name:
            continue
        bone = asf.bones[name]
        angles = np.zeros((len(frames), 3))
        for column, dof in enumerate(bone.dof):
            if dof in ("rx", "ry", "rz"):
                angles[:, "xyz".index(dof[1])] = table[name][:, column]
        local[:, i] = bone.axis @ _turns(bone.order, angles, degrees) @ bone.axis.T
    return root[:, :3], local


def _padded(values: Array, columns: int) -> Array:
    if values.shape[1] < columns:
        raise MotionFormatError("the root of the AMC file does not have six numbers: get the complete file")
    return values


def _turns(order: str, xyz: Array, degrees: bool) -> Array:
    """Rotations (T, 3, 3) of angles about fixed axes, taken in the given order; NaN where an angle is not finite."""
    good = np.isfinite(xyz).all(axis=1)
    turned = np.full((len(xyz), 3, 3), np.nan)
    columns = ["xyz".index(a) for a in order.lower()]
    if good.any():
        turned[good] = Rotation.from_euler(order.lower(), xyz[good][:, columns], degrees=degrees).as_matrix()
    return turned
