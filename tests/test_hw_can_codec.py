"""Frames carry what was put into them, within a step of their scale, and damage is found."""

from __future__ import annotations

from pathlib import Path

import can
import cantools
import numpy as np
import pytest
from crccheck.crc import Crc8SaeJ1850
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate.core.errors import DriverError
from naoimitate.hw.can.codec import CorruptFrame, MotorStatus, Targets
from naoimitate.hw.can.crc import crc8
from naoimitate.hw.can.dbc import DbcCodec
from naoimitate.robot.load import BUILT_IN

FILE = BUILT_IN / "nao" / "can.dbc"
DATABASE = cantools.database.load_file(FILE)
NODES = range(1, 26)
CODEC = DbcCodec(FILE, NODES)


def test_the_checksum_of_the_standard_string_is_that_of_the_catalogue() -> None:
    assert crc8(int.from_bytes(b"12", "little"), b"3456789") == 0x4B


@settings(deadline=None)
@given(st.integers(0, 0x7FF), st.binary(max_size=7))
def test_the_checksum_is_that_of_an_independent_library(identifier: int, data: bytes) -> None:
    assert crc8(identifier, data) == Crc8SaeJ1850.calc(identifier.to_bytes(2, "little") + data)


def feedback(node: int = 1, **values: float | str) -> can.Message:
    layout = DATABASE.get_message_by_name(f"Feedback_{node:02d}")
    usual = {
        "position": 0.0,
        "speed": 0.0,
        "current": 0.0,
        "temperature": 30.0,
        "status": "off",
        "counter": 0,
        "crc": 0,
    }
    data = bytearray(layout.encode({**usual, **values}))
    data[-1] = Crc8SaeJ1850.calc(layout.frame_id.to_bytes(2, "little") + data[:-1])
    return can.Message(arbitration_id=layout.frame_id, is_extended_id=False, data=data)


@settings(deadline=None)
@given(
    st.lists(st.floats(-6.55, 6.55), min_size=25, max_size=25),
    st.floats(0.0, 65.0),
    st.floats(0.0, 1.0),
)
def test_commands_carry_their_targets_within_half_a_step(position: list[float], speed: float, stiffness: float) -> None:
    """Read back with cantools alone, so that codec and file cannot be wrong together."""
    frames = CODEC.command(Targets(np.array(position), np.full(25, speed), np.full(25, stiffness)))
    assert [frame.arbitration_id for frame in frames] == [0x100 + node for node in NODES]
    for frame, wanted in zip(frames, position, strict=True):
        values = DATABASE.decode_message(frame.arbitration_id, bytes(frame.data))
        assert abs(values["position"] - wanted) <= 0.0001 + 1e-9
        assert abs(values["speed_limit"] - speed) <= 0.0005 + 1e-9
        assert abs(values["stiffness"] - stiffness) <= 0.002 + 1e-9
        assert values["mode"] == "follow"
        assert frame.data[-1] == Crc8SaeJ1850.calc(frame.arbitration_id.to_bytes(2, "little") + frame.data[:-1])


@settings(deadline=None)
@given(
    st.sampled_from(list(NODES)),
    st.floats(-6.55, 6.55),
    st.floats(-20.4, 20.4),
    st.floats(-10.2, 10.2),
    st.floats(-40.0, 215.0),
    st.sampled_from(MotorStatus),
    st.integers(0, 15),
)
def test_feedback_is_read_within_half_a_step(
    node: int, position: float, speed: float, current: float, temperature: float, status: MotorStatus, counter: int
) -> None:
    read = CODEC.decode(
        feedback(
            node,
            position=position,
            speed=speed,
            current=current,
            temperature=temperature,
            status=status.value,
            counter=counter,
        )
    )
    assert read is not None
    assert (read.motor, read.status, read.counter) == (node - 1, status, counter)
    errors = np.abs(np.subtract(read[1:5], (position, speed, current, temperature)))
    assert np.all(errors <= np.array([0.0001, 0.005, 0.0025, 0.5]) + 1e-9)


@settings(deadline=None)
@given(st.floats(allow_nan=False), st.floats(allow_nan=False), st.floats(allow_nan=False))
def test_targets_beyond_what_a_frame_can_carry_are_clipped_and_never_wrap(p: float, v: float, k: float) -> None:
    frame = CODEC.command(Targets(np.full(25, p), np.full(25, v), np.full(25, k)))[0]
    values = DATABASE.decode_message(frame.arbitration_id, bytes(frame.data))
    assert abs(values["position"] - np.clip(p, -6.5534, 6.5534)) <= 0.0002
    assert abs(values["speed_limit"] - np.clip(v, 0.0, 65.535)) <= 0.001
    assert abs(values["stiffness"] - np.clip(k, 0.0, 1.0)) <= 0.004


@settings(deadline=None)
@given(st.integers(0, 63), st.integers(1, 0xFF))
def test_every_burst_of_up_to_eight_wrong_bits_is_found(place: int, burst: int) -> None:
    message = feedback(7, position=1.234, speed=-3.0, counter=9)
    wrong = (int.from_bytes(message.data, "big") ^ (burst << place)) & (2**64 - 1)
    if wrong == int.from_bytes(message.data, "big"):
        return  # the burst lies beyond the frame
    message.data = bytearray(wrong.to_bytes(8, "big"))
    with pytest.raises(CorruptFrame) as found:
        CODEC.decode(message)
    assert found.value.motor == 6


def test_a_frame_that_reaches_us_under_another_identifier_is_damaged() -> None:
    message = feedback(7)
    message.arbitration_id = 0x200 + 8
    with pytest.raises(CorruptFrame, match="wrong checksum"):
        CODEC.decode(message)


@settings(deadline=None)
@given(st.integers(0, 0x1FFFFFFF), st.booleans(), st.binary(max_size=8))
def test_no_frame_of_the_bus_raises_anything_but_a_corrupt_frame(identifier: int, extended: bool, data: bytes) -> None:
    identifier = identifier if extended else identifier & 0x7FF
    try:
        read = CODEC.decode(can.Message(arbitration_id=identifier, is_extended_id=extended, data=data))
    except CorruptFrame:
        return
    assert read is None or identifier in range(0x201, 0x21A)


def test_counters_go_up_by_one_and_around() -> None:
    codec = DbcCodec(FILE, NODES)
    still = Targets(np.zeros(25), np.zeros(25), np.zeros(25))
    counters = []
    for _ in range(40):
        frame = codec.command(still)[3]
        counters.append(DATABASE.decode_message(frame.arbitration_id, bytes(frame.data))["counter"])
    assert np.all(np.diff(counters) % 16 == 1)


def test_the_emergency_stop_wins_the_bus_over_every_other_frame() -> None:
    (frame,) = CODEC.emergency_stop()
    assert frame.arbitration_id < min(m.frame_id for m in DATABASE.messages if m.name != "EmergencyStop")


def test_motorola_byte_order_and_other_scales_are_the_files_own_business(tmp_path: Path) -> None:
    """Another builder's file: the position big-endian and in other steps."""
    text = FILE.read_text().replace("position : 0|16@1- (0.0002,0)", "position : 7|16@0- (0.0005,0.1)")
    (tmp_path / "other.dbc").write_text(text)
    codec, database = DbcCodec(tmp_path / "other.dbc", NODES), cantools.database.load_file(tmp_path / "other.dbc")
    frame = codec.command(Targets(np.full(25, 1.5), np.ones(25), np.ones(25)))[0]
    assert frame.data[:2] == (2800).to_bytes(2, "big")
    assert abs(database.decode_message(frame.arbitration_id, bytes(frame.data))["position"] - 1.5) <= 0.00025


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("BO_ 263 Command_07", "BO_ 263 Order_07", "no message Command_07"),
        ("SG_ stiffness", "SG_ softness", "needs in Command_01 the signals"),
        ("SG_ crc : 48|8@1+", "SG_ crc : 46|8@1+", "crc of Command_01 in its last byte"),
        ('VAL_ 513 status 0 "off"', 'VAL_ 513 status 0 "idle"', "needs the value 'off' for status in Feedback_01"),
        ("BU_: Host", "BU_ Host", "no readable DBC file"),
    ],
)
def test_a_wrong_database_is_refused_with_its_mistake(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = FILE.read_text()
    assert old in text
    (tmp_path / "wrong.dbc").write_text(
        text.replace(old, new).replace("counter : 44|4", "counter : 54|2" if "46|8" in new else "counter : 44|4")
    )
    with pytest.raises(DriverError, match=message) as error:
        DbcCodec(tmp_path / "wrong.dbc", NODES)
    assert "\n" not in str(error.value)


def test_a_database_without_cycle_times_is_refused(tmp_path: Path) -> None:
    lines = [line for line in FILE.read_text().splitlines() if not line.startswith('BA_ "GenMsgCycleTime"')]
    (tmp_path / "wrong.dbc").write_text("\n".join(lines))
    with pytest.raises(DriverError, match="no cycle time for Command_01"):
        _ = DbcCodec(tmp_path / "wrong.dbc", NODES).period


def test_a_missing_database_is_named(tmp_path: Path) -> None:
    with pytest.raises(DriverError, match=r"there is no CAN database .*none\.dbc"):
        DbcCodec(tmp_path / "none.dbc", NODES)
