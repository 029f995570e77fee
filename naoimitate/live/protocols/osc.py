"""OSC 1.0 packets to messages, within bounds; python-osc builds the messages.

They are read here, because python-osc follows any nesting and any element size, takes arguments that were cut off as
zero, and reads all of however many.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

from pythonosc.osc_message_builder import OscMessageBuilder

from naoimitate.core.errors import DatagramError

BUNDLE = b"#bundle\0"
NESTING = 4
"""Bundles in bundles; senders of motion do not nest at all."""
MESSAGES = 512
"""Messages and bundles of a datagram; a person with fingers and a face has some 120."""
IMMEDIATELY = b"\0\0\0\0\0\0\0\1"
_SIZES = {"i": 4, "f": 4}


def messages(datagram: bytes) -> list[bytes]:
    """The messages of a datagram, still packed, out of all its bundles in their order.

    Raises DatagramError when it is no OSC, cut off, or nested or filled beyond reason.
    """
    found: list[bytes] = []
    for count, message in enumerate(_opened(datagram, NESTING)):
        if count > MESSAGES:
            raise DatagramError(f"an OSC datagram has more than {MESSAGES} messages: no sender of motion needs so many")
        if message[:1] == b"/":
            found.append(message)
    return found


def address_of(message: bytes) -> str:
    """The address of a packed message. Raises DatagramError when it is none."""
    return _string(message, 0)[0]


def arguments(message: bytes, types: str) -> list[float | str]:
    """The arguments of a packed message that has these types (of ``s``, ``f``, ``i``; strings first).

    More numbers may follow them. Raises DatagramError for others, or when bytes are missing.
    """
    address, at = _string(message, 0)
    tags, at = _string(message, at)
    if not tags.startswith("," + types) or not set(tags[len(types) + 1 :]) <= set(_SIZES):
        raise DatagramError(
            f"{address} has arguments {tags[1:20]!r}, not {types!r}: choose the sender's VMC protocol 2"
        )
    found: list[float | str] = []
    numbers = types.lstrip("s")
    for _ in range(len(types) - len(numbers)):
        text, at = _string(message, at)
        found.append(text)
    if at + sum(_SIZES[tag] for tag in numbers) > len(message):
        raise DatagramError(f"the arguments of {address} are cut off: look for loss on the way")
    return [*found, *struct.unpack_from(">" + numbers, message, at)]


def message(address: str, *values: float | str) -> bytes:
    """A packed message; every number goes as a 32-bit float, but ``int`` as an integer."""
    builder = OscMessageBuilder(address)
    for value in values:
        builder.add_arg(value)
    return builder.build().dgram


def bundles(packed: list[bytes], largest: int) -> list[bytes]:
    """Packed messages in as few bundles of at most ``largest`` bytes as keep their order."""
    out = [BUNDLE + IMMEDIATELY]
    for content in packed:
        if len(out[-1]) + 4 + len(content) > largest and len(out[-1]) > len(BUNDLE + IMMEDIATELY):
            out.append(BUNDLE + IMMEDIATELY)
        out[-1] += struct.pack(">i", len(content)) + content
    return out


def _opened(packet: bytes, nesting: int) -> Iterator[bytes]:
    """A packet, and if it is a bundle all that is in it, bundles and messages."""
    yield packet
    if packet[:1] == b"/":
        return
    if packet[: len(BUNDLE)] != BUNDLE:
        raise DatagramError("this is no OSC datagram: choose the --source that fits the sender")
    if not nesting:
        raise DatagramError(f"an OSC datagram has bundles in more than {NESTING} bundles: no sender of motion nests")
    at = len(BUNDLE) + len(IMMEDIATELY)
    if at > len(packet):
        raise DatagramError("an OSC bundle is cut off: look for loss on the way")
    while at < len(packet):
        size = int.from_bytes(packet[at : at + 4], "big")
        at += 4
        if not 0 < size <= len(packet) - at:
            raise DatagramError(f"an element of {size} bytes in an OSC bundle is cut off: look for loss on the way")
        yield from _opened(packet[at : at + size], nesting - 1)
        at += size


def _string(message: bytes, at: int) -> tuple[str, int]:
    """A string that starts at a byte, and where the next value starts."""
    end = message.find(b"\0", at)
    if end < 0:
        raise DatagramError("a text in an OSC message is cut off: look for loss on the way")
    return message[at:end].decode(errors="replace"), 4 * (end // 4 + 1)
