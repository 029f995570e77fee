"""CRC-8/SAE-J1850: the checksum in the last byte of our frames."""

from __future__ import annotations

POLYNOMIAL = 0x1D
"""x^8 + x^4 + x^3 + x^2 + 1 (SAE J1850; also AUTOSAR E2E profile 1): every burst of up to 8 bits is found."""
START = 0xFF
FINAL = 0xFF


def _remainder(byte: int) -> int:
    for _ in range(8):
        byte = (byte << 1) ^ (POLYNOMIAL if byte & 0x80 else 0)
    return byte & 0xFF


_TABLE = bytes(_remainder(byte) for byte in range(256))


def crc8(identifier: int, data: bytes) -> int:
    """Checksum of a frame: its 11-bit identifier, low byte first, then the data before the checksum.

    With the identifier in it, a frame that reaches the wrong motor is found too.
    """
    crc = _TABLE[START ^ (identifier & 0xFF)]
    crc = _TABLE[crc ^ (identifier >> 8)]
    for byte in data:
        crc = _TABLE[crc ^ byte]
    return crc ^ FINAL
