"""Biovision BVH files. The hierarchy and the Euler angles are pybvh's; what pybvh 0.9 refuses is put right before.

pybvh refuses joints with position channels (MotionBuilder, Axis Neuron, Blender), joints with fewer than three
rotations, other orders of the root's positions, names with spaces, text that is not UTF-8, and files whose number of
frames is not the declared one (cut off). Its forward kinematics takes the root channels as absolute and leaves the
root's OFFSET out, as all known exporters mean it; it gives no rotations, so the kinematics is ``clip.forward``.
"""

from __future__ import annotations

import re
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pybvh
from pybvh.rotations import euler_to_rotmat

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import Array
from naoimitate.motion.clip import Clip, Skeleton, forward
from naoimitate.motion.text import numbers

_FRAME_TIME = re.compile(r"^[ \t]*Frame[ \t]+Time:[ \t]*(\S*)[^\n]*$", re.MULTILINE)
_CHANNELS = re.compile(r"^[ \t]*CHANNELS[ \t]+\d+([^\n]*)$", re.MULTILINE)
_NAME = re.compile(r"^([ \t]*(?:ROOT|JOINT)[ \t]+)([^\n{]+)", re.MULTILINE)
_MAX_CHANNELS = 5000
"""More channels than any skeleton has: such a header is garbage."""


@dataclass(frozen=True)
class _Header:
    """channels: per joint, in file order, e.g. ("Xposition", "Zrotation"). frames: as declared. step: s per frame."""

    text: str
    channels: list[tuple[str, ...]]
    frames: int | None
    step: float


def read_bvh(text: str) -> Clip:
    """Read a BVH file from its text.

    Raises MotionFormatError when the hierarchy is damaged or no frame is complete.
    """
    header, body = _split(text)
    skeleton, orders = _hierarchy(header)
    table, notes = numbers(body, sum(len(c) for c in header.channels))
    if header.frames is not None and header.frames != len(table):
        notes.append(f"The header declares {header.frames} frames, {len(table)} complete ones are there and were read.")
    root, angles, skeleton = _columns(table, header.channels, skeleton)
    joints = np.flatnonzero(~skeleton.ends)
    local = np.tile(np.eye(3), (len(table), len(skeleton), 1, 1))
    with np.errstate(invalid="ignore"):
        local[:, joints] = euler_to_rotmat(angles, orders, degrees=True)
    root, note = _root_path(root, skeleton)
    positions, rotations = forward(skeleton, root, local)
    rate = round(1.0 / header.step, 6) if header.step > 0.0 else None
    return Clip("BVH", skeleton, positions, rotations, rate=_snapped(rate), notes=tuple(notes + note))


def _split(text: str) -> tuple[_Header, str]:
    """Header and the text of the motion."""
    found = _FRAME_TIME.search(text)
    if found is None:
        raise MotionFormatError("the BVH file ends before its motion data: get the complete file")
    head = text[: found.start()]
    declared = re.search(r"^[ \t]*Frames:[ \t]*(\d+)", head, re.MULTILINE)
    channels = [tuple(m.group(1).split()) for m in _CHANNELS.finditer(head)]
    if not channels or sum(map(len, channels)) > _MAX_CHANNELS:
        raise MotionFormatError("the BVH file has no readable hierarchy of joints: export it again")
    try:
        step = float(found.group(1))
    except ValueError:
        step = 0.0
    frames = int(declared.group(1)) if declared and len(declared.group(1)) < 12 else None
    return _Header(head, channels, frames, step if np.isfinite(step) else 0.0), text[found.end() :]


def _snapped(rate: float | None) -> float | None:
    """A rate whose frame time was cut to six or seven digits becomes the whole number it was (120.005 -> 120)."""
    if rate is None:
        return None
    whole = round(rate)
    return float(whole) if whole > 0 and abs(rate / whole - 1.0) < 1e-4 else rate


def _hierarchy(header: _Header) -> tuple[Skeleton, list[str]]:
    """Skeleton and Euler order of every joint, by pybvh from a header with three rotations a joint and one frame."""
    orders = [_order(c) for c in header.channels]
    blocks = iter(orders)
    first = [True]

    def channels(_: re.Match[str]) -> str:
        position = "6 Xposition Yposition Zposition" if first.pop() else "3"
        first.append(False)
        return f"CHANNELS {position} " + " ".join(f"{axis}rotation" for axis in next(blocks))

    plain = _NAME.sub(lambda m: m.group(1) + re.sub(r"\s+", "_", m.group(2).strip()) + "\n", header.text)
    plain = _CHANNELS.sub(channels, plain.split("MOTION")[0])
    zeros = " ".join(["0"] * (3 + 3 * len(orders)))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hierarchy.bvh"
        path.write_text(f"{plain}\nMOTION\nFrames: 1\nFrame Time: 1\n{zeros}\n", encoding="utf-8")
        try:
            nodes = pybvh.read_bvh_file(path, world_up="+y").nodes
        except Exception as error:  # pybvh raises whatever its parser stumbles over
            raise MotionFormatError(f"the BVH hierarchy is damaged: {_reason(error)}; export it again") from error
    index = {id(node): i for i, node in enumerate(nodes)}
    return Skeleton(
        names=tuple(node.name for node in nodes),
        parents=np.array([-1 if node.parent is None else index[id(node.parent)] for node in nodes]),
        offsets=np.array([node.offset for node in nodes]),
        ends=np.array([node.is_end_site() for node in nodes]),
    ), orders


def _reason(error: Exception) -> str:
    """The first sentence of pybvh's message without the temporary path."""
    return re.sub(r"\s*(at|in|,).{0,20}(line|file) .*", "", str(error).split("\n")[0])[:120] or type(error).__name__


def _order(channels: tuple[str, ...]) -> str:
    """Euler order of a joint's rotations, the missing axes appended: ``ZYX``."""
    given = [c[0].upper() for c in channels if c.lower().endswith("rotation")]
    order = list(dict.fromkeys(a for a in given if a in "XYZ"))
    if len(order) != len(given) or not all(c.lower().endswith(("rotation", "position")) for c in channels):
        raise MotionFormatError(f"the BVH file has the unknown channels {' '.join(channels)[:60]}: export Euler angles")
    return "".join(order + [a for a in "XYZ" if a not in order])


def _columns(table: Array, channels: list[tuple[str, ...]], skeleton: Skeleton) -> tuple[Array, Array, Skeleton]:
    """Root positions (T, 3) and angles (T, N, 3) in deg in each joint's order; joints with own positions keep theirs."""
    angles = np.zeros((len(table), len(channels), 3))
    root = np.zeros((len(table), 3))
    offsets = skeleton.offsets.copy()
    joints = np.flatnonzero(~skeleton.ends)
    column = 0
    for i, block in enumerate(channels):
        order = _order(block)
        for channel in block:
            axis = "XYZ".find(channel[0].upper())
            if channel.lower().endswith("rotation"):
                angles[:, i, order.index(channel[0].upper())] = table[:, column]
            elif i == 0:
                root[:, axis] = table[:, column]
            else:
                place = _steady(table[:, column])
                if abs(place) > 1e-6:  # zeros: the channel is relative to OFFSET
                    offsets[joints[i], axis] = place
            column += 1
    return root, angles, Skeleton(skeleton.names, skeleton.parents, offsets, skeleton.ends)


def _steady(values: Array) -> float:
    """Mean place of a joint in its parent: bones do not stretch."""
    good = values[np.isfinite(values)]
    return float(np.median(good)) if len(good) else 0.0


def _root_path(root: Array, skeleton: Skeleton) -> tuple[Array, list[str]]:
    """The root's path. Its OFFSET is not added: exporters which write one write absolute channels as well.

    Where all channels are relative (they start near zero while the OFFSET is the height of the hips) it is added.
    """
    offset = skeleton.offsets[0]
    size = float(np.ptp(skeleton.rest, axis=0).max())
    start = root[np.isfinite(root).all(axis=1)][:1]
    if np.linalg.norm(offset) < 1e-3 * size or not len(start):
        return root, []
    if np.abs(start).max() < 0.05 * size and np.abs(offset).max() > 0.3 * size:
        return root + offset, ["The root's OFFSET was added: its channels are relative to it."]
    return root, ["The root's OFFSET was not added: its channels are absolute already."]
