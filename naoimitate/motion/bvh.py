"""Biovision BVH files. The hierarchy and the Euler angles are pybvh's; what pybvh 0.9 refuses is put right before.

pybvh refuses joints with position channels (MotionBuilder, Axis Neuron, Blender), joints with fewer than three
rotations, other orders of the root's positions, names with spaces, keywords in other cases, text that is not UTF-8, and
files whose number of frames is not the declared one (cut off). Its forward kinematics takes the root's channels as
absolute and leaves the root's OFFSET out, as exporters mean it; but it gives no rotations, so that ``clip.forward`` is
used.
"""

from __future__ import annotations

import re
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pybvh
from pybvh.rotations import euler_to_rotmat

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import Array
from naoimitate.motion.clip import Clip, Skeleton, forward
from naoimitate.motion.text import numbers

MAX_CHANNELS = 5000
"""More channels than any skeleton has: such a header is damage."""
RELATIVE_ROOT = (0.05, 0.3)
"""Root channels that start within the first share of the skeleton's size, with an OFFSET beyond the second, are
relative to the OFFSET."""

_LOOSE = re.MULTILINE | re.IGNORECASE
_FRAME_TIME = re.compile(r"^[ \t]*Frame[ \t]*Time[ \t]*:[ \t]*(\S*)[^\n]*$", _LOOSE)
_FRAMES = re.compile(r"^[ \t]*Frames[ \t]*:[ \t]*(\d{1,12})", _LOOSE)
_KEYWORD = re.compile(r"^[ \t]*(HIERARCHY|ROOT|JOINT|End Site|OFFSET|CHANNELS|MOTION)\b", _LOOSE)
_WITHOUT_CHANNELS = re.compile(r"^((?:ROOT|JOINT)[^\n]*\n{\nOFFSET[^\n]*\n)(?!CHANNELS)", re.MULTILINE)
_CHANNELS = re.compile(r"^[ \t]*CHANNELS[ \t]+\d+([^\n]*)$", re.MULTILINE)
_NAME = re.compile(r"^([ \t]*(?:ROOT|JOINT)[ \t]+)([^\n{]+)", re.MULTILINE)


@dataclass(frozen=True)
class _Header:
    """text: the hierarchy. channels: per joint, in file order. frames: as declared. rate: Hz, or None."""

    text: str
    channels: list[tuple[str, ...]]
    frames: int | None
    rate: float | None

    @property
    def orders(self) -> list[str]:
        """Euler order of every joint, e.g. ``ZYX``; axes that a joint does not turn about come last."""
        return [_order(block) for block in self.channels]


def read_bvh(text: str) -> Clip:
    """Read a BVH file from its text.

    Raises MotionFormatError when the hierarchy is damaged or no frame is complete.
    """
    header, body = _split(text)
    skeleton = _hierarchy(header)
    table, notes = numbers(_with_points(body), sum(len(block) for block in header.channels), header.frames)
    if header.frames is not None and header.frames != len(table):
        notes.append(f"The header declares {header.frames} frames, the file has {len(table)} complete ones.")
    angles, places = _columns(table, header, skeleton)
    root, skeleton, moving = _in_parents(skeleton, places)
    local = np.tile(np.eye(3), (len(table), len(skeleton), 1, 1))
    with np.errstate(invalid="ignore", over="ignore"):
        local[:, ~skeleton.ends] = euler_to_rotmat(angles, header.orders, degrees=True)
    root, root_notes = _root_path(root, skeleton)
    positions, rotations = forward(skeleton, root, local, moving)
    return Clip("BVH", skeleton, positions, rotations, rate=header.rate, notes=tuple(notes + root_notes))


def _split(text: str) -> tuple[_Header, str]:
    """The header, and the text of the motion."""
    found = _FRAME_TIME.search(text)
    if found is None:
        raise MotionFormatError("the BVH file ends before its motion: get the complete file")
    head = _canonical(_with_points(text[: found.start()]))
    channels = [tuple(m.group(1).split()) for m in _CHANNELS.finditer(head)]
    if not channels or sum(map(len, channels)) > MAX_CHANNELS:
        raise MotionFormatError("the BVH file has no readable hierarchy of joints: export it again")
    if len(re.findall(r"^[ \t]*ROOT\b", head, re.MULTILINE)) > 1:
        raise MotionFormatError("the BVH file has more than one skeleton: export one person a file")
    declared = _FRAMES.search(head)
    frames = int(declared.group(1)) if declared else None
    return _Header(head, channels, frames, _rate(found.group(1))), text[found.end() :]


def _with_points(text: str) -> str:
    """Text with decimal points where its numbers have decimal commas, and without commas between numbers."""
    if "," not in text:
        return text
    return text.replace(",", " ") if re.search(r"\d\.\d", text) else re.sub(r"(?<=\d),(?=\d)", ".", text)


def _canonical(head: str) -> str:
    """The hierarchy with each keyword and brace on a line of its own, and channels, perhaps none, for every joint."""
    head = "\n".join(" ".join(line.split()) for line in re.sub(r"[{}]", r"\n\g<0>\n", head).split("\n") if line.strip())
    head = re.sub(r" (?=(?:OFFSET|CHANNELS) [-+.\d])", "\n", head, flags=re.IGNORECASE)
    head = _KEYWORD.sub(lambda m: "End Site" if m.group(1)[:3].lower() == "end" else m.group(1).upper(), head)
    return _WITHOUT_CHANNELS.sub(r"\1CHANNELS 0\n", head)


def _rate(frame_time: str) -> float | None:
    """Hz; a frame time that was cut to six or seven digits is meant as a whole number of Hz (120.005 -> 120)."""
    try:
        step = float(frame_time.replace(",", "."))
    except ValueError:
        return None
    if not 1e-6 < step < 1e6:
        return None
    rate = 1.0 / step
    whole = round(rate)
    return float(whole) if whole > 0 and abs(rate / whole - 1.0) < 1e-4 else rate


def _order(channels: tuple[str, ...]) -> str:
    turns = [c[0].upper() for c in channels if c.lower().endswith("rotation")]
    known = all(re.fullmatch(r"[XYZ](rotation|position)", c, re.IGNORECASE) for c in channels)
    if not known or len(set(turns)) != len(turns):
        raise MotionFormatError("the BVH file has channels that are no positions and Euler angles: export it again")
    return "".join(turns + [axis for axis in "XYZ" if axis not in turns])


def _hierarchy(header: _Header) -> Skeleton:
    """The skeleton by pybvh, from the same hierarchy with three rotations a joint and one frame of zeros."""
    turns = [" ".join(f"{axis}rotation" for axis in order) for order in header.orders]
    lines = iter([f"CHANNELS 6 Xposition Yposition Zposition {turns[0]}", *(f"CHANNELS 3 {t}" for t in turns[1:])])
    text = _NAME.sub(lambda m: m.group(1) + "_".join(m.group(2).split()) + "\n", header.text)
    text = _CHANNELS.sub(lambda _: next(lines), text).split("\nMOTION")[0]
    zeros = " ".join(["0"] * (3 + 3 * len(turns)))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hierarchy.bvh"
        path.write_text(f"{text}\nMOTION\nFrames: 1\nFrame Time: 1\n{zeros}\n", encoding="utf-8", errors="replace")
        try:
            nodes = pybvh.read_bvh_file(path, world_up="+y").nodes
        except Exception as error:  # pybvh raises whatever its parser stumbles over
            raise MotionFormatError("the hierarchy of the BVH file is damaged: export it again") from error
    index = {id(node): i for i, node in enumerate(nodes)}
    skeleton = Skeleton(
        names=tuple(node.name for node in nodes),
        parents=np.array([-1 if node.parent is None else index[id(node.parent)] for node in nodes]),
        offsets=np.array([node.offset for node in nodes], dtype=np.float64),
        ends=np.array([node.is_end_site() for node in nodes]),
    )
    if not np.isfinite(skeleton.offsets).all():
        raise MotionFormatError("the BVH file has bones of no finite length: export it again")
    return skeleton


def _columns(table: Array, header: _Header, skeleton: Skeleton) -> tuple[Array, dict[int, Array]]:
    """Angles (T, N, 3) in deg in each joint's order, and position channels (T, 3) by the node of their joint."""
    angles, orders, column = np.zeros((len(table), len(header.channels), 3)), header.orders, 0
    places = {0: np.zeros((len(table), 3))}
    for i, (node, block) in enumerate(zip(np.flatnonzero(~skeleton.ends), header.channels, strict=True)):
        for channel in block:
            axis = channel[0].upper()
            if channel.lower().endswith("rotation"):
                angles[:, i, orders[i].index(axis)] = table[:, column]
            else:
                place = places.setdefault(int(node), np.zeros((len(table), 3)))
                place[:, "XYZ".index(axis)] = table[:, column]
            column += 1
    return angles, places


def _in_parents(skeleton: Skeleton, places: dict[int, Array]) -> tuple[Array, Skeleton, dict[int, Array]]:
    """The root's channels (T, 3), the skeleton with bones as the channels say, and joints that move in their parents.

    Programs that put a reference above the hips have the person's path in the channels of the hips.
    """
    offsets, moving = skeleton.offsets.copy(), {}
    for node, place in places.items():
        if node == 0:
            continue
        known = place[np.isfinite(place).all(axis=1)]
        median = np.median(known, axis=0) if len(known) else np.zeros(3)
        if np.linalg.norm(median) < np.linalg.norm(median - offsets[node]):  # relative to the OFFSET, or without use
            place, median = place + offsets[node], median + offsets[node]
        offsets[node], moving[node] = median, place
    return places[0], replace(skeleton, offsets=offsets), moving


def _root_path(root: Array, skeleton: Skeleton) -> tuple[Array, list[str]]:
    """The root's path: its OFFSET is not added, for who writes one writes absolute channels as well.

    Only where the channels start near zero, and the OFFSET is the height of the hips, they are relative to it.
    """
    offset, size = np.abs(skeleton.offsets[0]).max(), float(np.ptp(skeleton.rest, axis=0).max())
    start = root[np.isfinite(root).all(axis=1)][:1]
    if offset < 1e-3 * size or not len(start):
        return root, []
    if np.abs(start).max() < RELATIVE_ROOT[0] * size and offset > RELATIVE_ROOT[1] * size:
        return root + skeleton.offsets[0], ["The root's OFFSET was added: its channels are relative to it."]
    return root, ["The root's OFFSET was not added: its channels are absolute already."]
