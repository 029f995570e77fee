"""What goes wrong on the bus becomes one clear error at the start, or an alarm while driving."""

from __future__ import annotations

import time
from typing import Any

import can
import numpy as np
import pytest
from can_rig import Rig, all_follow, command, rig, wait_for

from naoimitate.core.errors import DriverError
from naoimitate.hw.can import CanDriver
from naoimitate.hw.can.stub_faults import parse_fault
from naoimitate.robot import RobotModel


def alarm(it: Rig, sentence: str, patience: float = 2.0) -> bool:
    return wait_for(lambda: sentence in it.driver.read().alarms, patience)


def fault(it: Rig, sentence: str, patience: float = 3.0) -> bool:
    return wait_for(lambda: sentence in it.driver.read().faults, patience)


def test_a_silent_motor_is_a_fault_within_its_watchdog_and_the_others_go_on(nao: RobotModel) -> None:
    with rig(nao, "LKneePitch:silent@0.6", compensation=False) as it:
        it.driver.connect()
        assert it.driver.read().alarms == ()
        assert fault(it, "motor 11 (LKneePitch) is silent", 1.5)
        assert it.driver.read().faults == ("motor 11 (LKneePitch) is silent",)
        assert it.driver.read().alarms == ()
        assert all_follow(it)


def test_a_motor_with_wrong_checksums_is_counted_and_a_fault_and_not_believed(nao: RobotModel) -> None:
    with rig(nao, "3:crc@0.6", compensation=False) as it:
        it.driver.connect()
        assert fault(it, "motor 3 (LShoulderPitch) sends damaged frames only", 1.5)
        assert it.driver.counts.damaged > 0
        before = it.driver.read().q[2]
        it.stub.motors[3].position += 0.5
        time.sleep(0.05)
        assert it.driver.read().q[2] == before


def test_a_hot_motor_is_an_alarm_before_it_switches_itself_off(nao: RobotModel) -> None:
    with rig(nao, "LAnkleRoll:hot@0", compensation=False) as it:
        it.stub.motors[13].temperature = 60.0
        it.driver.connect()
        assert alarm(it, "motor 13 (LAnkleRoll) is hot (over 75 degrees)")
        assert it.stub.motors[13].status == "following"
        assert it.driver.read().faults == ()
        assert fault(it, "motor 13 (LAnkleRoll) has switched itself off: hot")


def test_a_motor_that_is_stuck_is_found_by_where_it_does_not_go(nao: RobotModel) -> None:
    with rig(nao, "HeadYaw:stuck@0", compensation=False) as it:
        it.driver.connect()
        q = nao.postures["stand"].copy()
        q[0] = 0.8
        it.driver.write(command(nao, q))
        assert alarm(it, "motor 1 (HeadYaw) is behind where it is sent")
        assert it.driver.read().faults == ()
        assert fault(it, "motor 1 (HeadYaw) does not get where it is sent")
        assert it.driver.read().alarms == ()


def test_a_motor_that_leaves_the_bus_is_missed_and_then_found_off(nao: RobotModel) -> None:
    with rig(nao, "20:bus-off@0.6", compensation=False) as it:
        it.driver.connect()
        assert alarm(it, "error frames on the CAN bus")
        assert it.driver.counts.errors >= 1
        assert fault(it, "motor 20 (RShoulderRoll) is silent")
        assert wait_for(lambda: not it.stub.motors[20].has("bus-off", time.monotonic() - it.stub._start))
        assert fault(it, "motor 20 (RShoulderRoll) has stopped following: off")
        assert it.stub.motors[20].stiffness == 0.0  # it does not jump back to full stiffness by itself
        it.driver.connect()
        assert it.driver.read().alarms == ()


def test_one_damaged_frame_is_an_alarm_for_a_second_and_no_fault(nao: RobotModel) -> None:
    with rig(nao, compensation=False) as it:
        it.driver.connect()
        with can.Bus(interface="virtual", channel=it.channel) as other:
            other.send(can.Message(arbitration_id=0x203, is_extended_id=False, data=bytes(8)))
            assert alarm(it, "motor 3 (LShoulderPitch) sends damaged frames")
        for _ in range(20):
            assert it.driver.read().faults == ()
            time.sleep(0.02)
        assert wait_for(lambda: it.driver.read().alarms == ())


def test_our_own_bus_off_is_told_apart(nao: RobotModel) -> None:
    """The error frame that Linux sends when its controller gives up: bit 6 of the identifier."""
    with rig(nao, compensation=False) as it:
        it.driver.connect()
        with can.Bus(interface="virtual", channel=it.channel) as other:
            other.send(can.Message(arbitration_id=0x40, is_error_frame=True, is_extended_id=False))
            assert alarm(it, "the CAN controller is off the bus (bus-off)")


def test_a_bus_that_takes_nothing_is_an_alarm_and_the_driver_lives(
    nao: RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    with rig(nao, compensation=False) as it:
        it.driver.connect()

        def refuse(self: object, message: can.Message, timeout: float | None = None) -> None:
            raise can.CanOperationError("Transmit buffer full")

        with monkeypatch.context() as patch:
            patch.setattr(can.interfaces.virtual.VirtualBus, "send", refuse)
            assert alarm(it, "the CAN bus takes no commands (Transmit buffer full)")
            assert fault(it, "every motor is silent (the CAN bus takes no commands (Transmit buffer full))")
        assert it.driver.counts.unsent > 0
        assert wait_for(lambda: it.driver.read().alarms == it.driver.read().faults == ())


def test_frames_that_get_lost_are_counted(nao: RobotModel) -> None:
    with rig(nao, compensation=False) as it:
        it.driver.connect()
        time.sleep(0.1)
        before = it.driver.counts.lost
        it.stub._sent[5] += 3
        assert wait_for(lambda: it.driver.counts.lost == before + 3)


def test_nobody_on_the_bus_is_one_sentence(nao: RobotModel) -> None:
    driver = CanDriver(nao, interface="virtual", channel="empty", compensation=False)
    with pytest.raises(DriverError, match="no motor answers on virtual empty: check the power") as error:
        driver.connect()
    assert "\n" not in str(error.value)
    driver.stop()


def test_motors_of_another_database_are_recognised_as_such(nao: RobotModel) -> None:
    """Each answers on our identifiers with other bytes."""
    driver = CanDriver(nao, interface="virtual", channel="foreign", compensation=False)
    with can.Bus(interface="virtual", channel="foreign") as bus:
        answers = [can.Message(arbitration_id=0x200 + n, is_extended_id=False, data=bytes(8)) for n in range(1, 26)]
        tasks = [bus.send_periodic(message, 0.05) for message in answers]
        with pytest.raises(DriverError, match="what answers on virtual foreign does not fit the CAN database"):
            driver.connect()
        for task in tasks:
            task.stop()


def test_a_motor_whose_fault_stays_is_named(nao: RobotModel) -> None:
    with rig(nao, "LAnkleRoll:hot@0", compensation=False) as it:
        it.stub.motors[13].temperature = 95.0
        with pytest.raises(DriverError, match=r"motor 13 \(LAnkleRoll\): the fault does not go away"):
            it.driver.connect()
        assert {motor.status for motor in it.stub.motors.values()} == {"off", "hot"}


@pytest.mark.parametrize(
    ("interface", "channel", "raised", "message"),
    [
        ("nonsense", "x", None, "there is no CAN interface 'nonsense': give one of"),
        ("udp_multicast", "239.0.0.1", can.CanInterfaceNotImplementedError("no msgpack"), r"naoimitate\[can-udp\]"),
        ("socketcan", "", None, "which CAN bus"),
        ("socketcan", "can0", OSError(97, "Address family not supported"), "this kernel has no SocketCAN"),
        ("socketcan", "can7", OSError(19, "No such device"), "there is no CAN channel 'can7' of socketcan"),
        ("socketcan", "can0", OSError(100, "Network is down"), "ip link set can0 up type can bitrate 1000000"),
        ("udp_multicast", "239.0.0.1", OSError(19, "No such device"), "ip route add 224.0.0.0/4 dev lo"),
        ("kvaser", "0", NameError("no canlib"), r"'0' of kvaser cannot be opened \(no canlib\)"),
        ("slcan", "/dev/ttyNone", can.CanInitializationError("no\nport"), r"cannot be opened \(no port\)"),
    ],
)
def test_a_bus_that_cannot_be_opened_is_one_sentence(
    nao: RobotModel,
    monkeypatch: pytest.MonkeyPatch,
    interface: str,
    channel: str,
    raised: Exception | None,
    message: str,
) -> None:
    if raised is not None:

        def fail(**options: Any) -> can.BusABC:
            raise raised

        monkeypatch.setattr(can, "Bus", fail)
    driver = CanDriver(nao, interface=interface, channel=channel, compensation=False)
    with pytest.raises(DriverError, match=message) as error:
        driver.connect()
    assert "\n" not in str(error.value)


def test_an_unknown_codec_is_refused(nao: RobotModel) -> None:
    with pytest.raises(DriverError, match="unknown CAN codec 'morse'"):
        CanDriver(nao, codec="morse")


@pytest.mark.parametrize(
    ("text", "message"),
    [("99:silent@1", "no motor '99'"), ("1:tired@1", "unknown kind 'tired'"), ("1:crc@soon", "'soon' is no time")],
)
def test_a_fault_that_cannot_be_meant_is_refused(text: str, message: str) -> None:
    with pytest.raises(DriverError, match=message):
        parse_fault(text, {"HeadYaw": 1})


def test_a_fault_is_read_by_number_or_name() -> None:
    assert parse_fault("1:hot@2.5", {"HeadYaw": 1}) == parse_fault("HeadYaw:hot@2.5", {"HeadYaw": 1})
    assert parse_fault("1:stuck", {"HeadYaw": 1}).start == 0.0


def test_states_before_connect_are_nan(nao: RobotModel) -> None:
    state = CanDriver(nao, interface="virtual", channel="unused", compensation=False).read()
    assert np.isnan(state.q).all() and state.alarms == ()
