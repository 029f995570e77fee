"""Unpacking an LZ4 frame from a stranger into bounded room.

The frame's layout: LZ4 frame format 1.6 (github.com/lz4/lz4, doc/lz4_Frame_format.md). The library's own frame decoder
sets aside as much room as the header claims, up to 8 MB, so here it reads the header alone, and the blocks are unpacked
one by one into no more room than is left. Checksums are not compared: UDP has one, and what was damaged is no JSON.
"""

from __future__ import annotations

import lz4.block
import lz4.frame

from naoimitate.core.errors import DatagramError

MAGIC = bytes.fromhex("04224d18")
MOST_BLOCKS = 64
"""Blocks of a frame; 256 kB in the smallest usual blocks (64 kB) are four."""
EXPANSION = 255
"""Bytes that a byte of an LZ4 block can become at most."""
WINDOW = 65536
"""Bytes back that a linked block may refer to."""
_CONTENT_SIZE, _DICTIONARY = 0x08, 0x01
"""Flags of the frame's descriptor."""
_STORED = 0x80000000
"""Flag of a block's size: the bytes are not packed."""


def unpack(frame: bytes, largest: int) -> bytearray:
    """What an LZ4 frame holds, at most ``largest`` bytes.

    Raises DatagramError where the frame is damaged or would become larger; nothing larger is ever allocated.
    """
    try:
        info = lz4.frame.get_frame_info(frame)
    except (RuntimeError, ValueError) as error:
        raise DatagramError("this LZ4 frame has a damaged header") from error
    if info["skippable"] or frame[4] & _DICTIONARY:
        raise DatagramError("this LZ4 frame holds nothing that can be read alone")
    if info["content_size"] > largest:
        raise DatagramError(
            f"this LZ4 frame says that it unpacks to {info['content_size']} bytes: {largest} are allowed"
        )
    start = 15 if frame[4] & _CONTENT_SIZE else 7
    return _blocks(frame, start, largest, 4 if info["block_checksum"] else 0, bool(info["block_linked"]))


def _blocks(frame: bytes, start: int, largest: int, checksum: int, linked: bool) -> bytearray:
    out = bytearray()
    for _ in range(MOST_BLOCKS):
        size = int.from_bytes(frame[start : start + 4], "little")
        if size == 0 and len(frame) >= start + 4:
            return out
        stored, size = bool(size & _STORED), size & ~_STORED
        block = frame[start + 4 : start + 4 + size]
        if len(block) < size or size == 0:
            raise DatagramError("this LZ4 frame ends too early")
        room = largest - len(out)
        if stored and size > room:
            raise DatagramError(f"this LZ4 frame unpacks to more than {largest} bytes")
        out += block if stored else _block(block, room, bytes(out[-WINDOW:]) if linked else b"")
        start += 4 + size + checksum
    raise DatagramError(f"this LZ4 frame has more than {MOST_BLOCKS} blocks")


def _block(block: bytes, room: int, before: bytes) -> bytes:
    try:
        return bytes(lz4.block.decompress(block, min(room, EXPANSION * len(block)), dict=before))
    except (lz4.block.LZ4BlockError, ValueError, OverflowError) as error:
        raise DatagramError("this LZ4 frame is damaged, or unpacks to more than is allowed") from error
