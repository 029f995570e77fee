"""The bus load is the worst that bit stuffing can do, and a bus that is too full is refused."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate.core.errors import DriverError
from naoimitate.hw.can import CanDriver
from naoimitate.hw.can.bus_load import bus_load, check_load, frame_bits
from naoimitate.hw.can.codec import Traffic
from naoimitate.robot import RobotModel

PLAIN_END = 1 + 1 + 1 + 7 + 3
"""CRC delimiter, acknowledge slot and delimiter, end of frame, space between frames: never stuffed."""


def stuffed_length(identifier: int, data: bytes) -> int:
    """Bits of a standard data frame on the wire, by building and stuffing it (ISO 11898-1)."""
    bits = [0, *_bits(identifier, 11), 0, 0, 0, *_bits(len(data), 4), *(b for byte in data for b in _bits(byte, 8))]
    crc = 0
    for bit in bits:
        crc = ((crc << 1) & 0x7FFF) ^ (0x4599 if bit ^ (crc >> 14) else 0)
    bits += _bits(crc, 15)
    sent, run = 0, 0
    last = None
    for bit in bits:
        run = run + 1 if bit == last else 1
        last, sent = bit, sent + 1
        if run == 5:
            last, run, sent = 1 - bit, 1, sent + 1
    return sent + PLAIN_END


def _bits(value: int, count: int) -> list[int]:
    return [value >> i & 1 for i in range(count - 1, -1, -1)]


@settings(deadline=None)
@given(st.integers(0, 0x7FF), st.binary(max_size=8))
def test_no_frame_is_longer_than_its_worst_length(identifier: int, data: bytes) -> None:
    assert stuffed_length(identifier, data) <= frame_bits(len(data))


def test_a_bad_frame_comes_near_its_worst_length() -> None:
    """Zeros, then runs of four: a stuff bit after nearly every fourth bit."""
    assert stuffed_length(0x000, bytes([0b00001111] * 8)) > 0.8 * frame_bits(8)
    assert stuffed_length(0x078, bytes.fromhex("3c3c3c3c3c3c3c3c")) >= frame_bits(8) - 12


@pytest.mark.parametrize(
    ("length", "extended", "bits"), [(8, False, 135), (6, False, 115), (0, False, 55), (8, True, 160)]
)
def test_worst_lengths_are_those_of_the_literature(length: int, extended: bool, bits: int) -> None:
    assert frame_bits(length, extended) == bits


def test_the_load_of_the_built_in_robot_fits_a_fast_bus_with_room(nao: RobotModel) -> None:
    driver = CanDriver(nao, interface="virtual", channel="unused", compensation=False)
    by_hand = (25 * (125 + 135) + 75) * 100 / 1e6  # commands of 7 and answers of 8 bytes, heartbeat of 2
    assert driver.load == pytest.approx(by_hand)
    assert driver.load < 0.8


@pytest.mark.parametrize("options", [{"period": 0.005}, {"bitrate": 500_000}])
def test_a_bus_that_is_too_full_is_refused_with_a_rate_that_fits(nao: RobotModel, options: dict[str, float]) -> None:
    with pytest.raises(DriverError, match="lower the rate from") as error:
        CanDriver(nao, interface="virtual", channel="unused", compensation=False, **options)  # type: ignore[arg-type]
    rate = float(str(error.value).split(" to ")[1].split()[0])
    CanDriver(nao, channel="unused", compensation=False, **{**options, "period": 1.0 / rate})  # type: ignore[arg-type]


@settings(deadline=None)
@given(st.integers(1, 60), st.floats(10.0, 1000.0))
def test_everything_over_eighty_percent_and_nothing_under_it_is_refused(motors: int, rate: float) -> None:
    traffic = [Traffic(8, False, rate)] * motors
    if bus_load(traffic, 1e6) > 0.8:
        with pytest.raises(DriverError):
            check_load(traffic, 1e6, 1.0 / rate)
    else:
        check_load(traffic, 1e6, 1.0 / rate)
