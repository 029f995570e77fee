"""Packets of the Xsens MVN network streamer, as the protocol sheet shows them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from naoimitate.core.frames import HumanFrame
from naoimitate.live.protocols import mxtp
from naoimitate.live.protocols.xsens import XSENS
from naoimitate.motion.builtin import builtin_motion, builtin_names

EXAMPLES = {
    name: bytes.fromhex(text)
    for name, text in (
        line.split(": ") for line in (Path(__file__).parent / "data/xsens_datagrams.txt").read_text().splitlines()
    )
}
"""The worked examples of shared/protocols.md, section 1.8."""

MOTIONS = {name: builtin_motion(name) for name in builtin_names()}

PERSON = replace(MOTIONS["paper"][200], com=MOTIONS["paper"][200]["pelvis"] + [0.02, -0.01, 0.08])


def pose_datagram(frame: HumanFrame = PERSON, sequence: int = 1, time: float = 0.5) -> bytes:
    return XSENS.encoder().encode(frame, sequence, time)[-1]


def changed(datagram: bytes, **fields: object) -> bytes:
    """A pose datagram with other header fields."""
    header, payload = mxtp.open_datagram(datagram)
    return mxtp.make_datagram(header._replace(**fields), payload)


def values_of(datagram: bytes) -> tuple[np.ndarray, np.ndarray]:
    header, payload = mxtp.open_datagram(datagram)
    return mxtp.read_poses(mxtp.pose_items(header, payload))


def with_values(datagram: bytes, values: np.ndarray) -> bytes:
    header, _ = mxtp.open_datagram(datagram)
    with np.errstate(all="ignore"):
        return mxtp.make_datagram(header, mxtp.write_poses(np.arange(1, len(values) + 1), values))


def parts_of(datagram: bytes, sizes: tuple[int, ...]) -> list[bytes]:
    """The same sample split over several datagrams."""
    header, payload = mxtp.open_datagram(datagram)
    ends = np.cumsum(sizes)
    return [
        mxtp.make_datagram(
            header._replace(part=i, last=i == len(sizes) - 1, items=size), payload[32 * (end - size) : 32 * end]
        )
        for i, (size, end) in enumerate(zip(sizes, ends, strict=True))
    ]


def only(samples: list) -> HumanFrame:
    assert len(samples) == 1
    return samples[0].frame
