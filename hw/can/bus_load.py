"""How full a classic CAN bus gets at worst, and what to lower when that is too much."""

from __future__ import annotations

from collections.abc import Iterable

from naoimitate.core.errors import DriverError
from naoimitate.hw.can.codec import Traffic

HIGHEST_LOAD = 0.8
"""Share of the bit rate that cyclic frames may take; the rest is for repeats, error frames and emergencies."""


def frame_bits(length: int, extended: bool = False) -> int:
    """Bits of a classic data frame with ``length`` bytes at worst, with the 3 bits of space behind it.

    Stuffing adds at worst one bit to the first 5 and every 4 after them, of the 34 (29-bit identifier: 54) control and
    8 data bits per byte that are stuffed. Davis, Burns, Bril, Lukkien, "Controller Area Network (CAN) schedulability
    analysis", Real-Time Systems 35 (2007), equations (1) and (2).
    """
    stuffed = (54 if extended else 34) + 8 * length
    return stuffed + 13 + (stuffed - 1) // 4


def bus_load(traffic: Iterable[Traffic], bitrate: float) -> float:
    """Share of the bit rate (bit/s) that cyclic frames take at worst."""
    return sum(frame_bits(frame.length, frame.extended) * frame.rate for frame in traffic) / bitrate


def check_load(traffic: Iterable[Traffic], bitrate: float, period: float) -> float:
    """The bus load; DriverError when it is too high, with the command rate that would fit.

    period: s between commands. All traffic is taken to slow down with the commands, which is on the safe side.
    """
    load = bus_load(traffic, bitrate)
    if load > HIGHEST_LOAD:
        fitting = int(HIGHEST_LOAD / load / period)
        raise DriverError(
            f"the commands would take {load:.0%} of the CAN bus, more than {HIGHEST_LOAD:.0%} of {bitrate:g} bit/s: "
            f"lower the rate from {1.0 / period:g} to {fitting} Hz, or use a faster bus or fewer motors on it"
        )
    return load
