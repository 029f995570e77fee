"""The simulated motors are what a driver has to expect of real ones."""

from __future__ import annotations

import ast
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import can
import cantools
import numpy as np
import pytest
from can_rig import QUICK, command, wait_for
from click.testing import CliRunner
from crccheck.crc import Crc8SaeJ1850
from hypothesis import given, settings
from hypothesis import strategies as st

import naoimitate.hw.can.stub as stub_module
from naoimitate.cli import cli, run
from naoimitate.core.errors import DriverError
from naoimitate.hw.can import CanDriver
from naoimitate.hw.can.stub import CanStub
from naoimitate.hw.can.stub_motor import StubMotor
from naoimitate.robot import RobotModel
from naoimitate.robot.load import BUILT_IN

DATABASE = cantools.database.load_file(BUILT_IN / "nao" / "can.dbc")
GROUP = "239.74.163.2"


def test_it_shares_no_code_with_the_driver_and_its_codec() -> None:
    folder = Path(stub_module.__file__).parent
    for name in ("stub.py", "stub_motor.py", "stub_faults.py"):
        for node in ast.walk(ast.parse((folder / name).read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("naoimitate.hw"):
                assert node.module.startswith("naoimitate.hw.can.stub"), (name, node.module)


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(-2.0, 2.0), st.floats(0.0, 10.0), st.floats(0.001, 0.08)), min_size=1, max_size=40))
def test_a_motor_never_turns_faster_than_commanded_or_possible(path: list[tuple[float, float, float]]) -> None:
    motor, now = StubMotor(0.0, 6.0), 0.0
    motor.command("follow", 0.0, 0.0, 0.0, now)
    limit = 0.0
    for target, new_limit, dt in path:
        before = motor.position
        now += dt
        motor.heartbeat(now)
        assert abs(motor.position - before) <= min(limit, 6.0) * dt + 1e-9
        limit = new_limit
        motor.command("follow", target, limit, 1.0, now)


@settings(deadline=None)
@given(st.floats(0.0, 3.0), st.booleans(), st.integers(1, 30))
def test_a_motor_without_commands_or_heartbeat_holds_after_a_tenth_of_a_second(
    silence: float, heartbeat: bool, looks: int
) -> None:
    """Wherever it is by then, however often one looks: the way is that of 0.1 s."""
    motor = StubMotor(0.0, 100.0)
    motor.heartbeat(0.0)
    motor.command("follow", 0.0, 0.0, 0.0, 0.0)
    motor.command("follow", 10.0, 1.0, 1.0, 0.0)
    for now in np.linspace(0.0, silence, looks + 1)[1:]:
        (motor.heartbeat if heartbeat else motor.advance)(float(now))
    assert motor.position == pytest.approx(min(silence, 0.1))
    assert motor.status == ("holding" if silence > 0.1 else "following")


def test_a_limp_motor_does_not_move_and_one_that_is_off_obeys_only_from_stiffness_zero_on() -> None:
    motor = StubMotor(0.3, 5.0)
    motor.heartbeat(0.0)
    motor.command("follow", 1.0, 5.0, 1.0, 0.0)
    assert motor.status == "off"
    motor.command("follow", 1.0, 5.0, 0.0, 0.01)
    motor.heartbeat(0.05)
    assert (motor.status, motor.position) == ("following", 0.3)
    motor.command("follow", 1.0, 5.0, 0.5, 0.05)
    motor.heartbeat(0.06)
    assert motor.position == pytest.approx(0.35)


class Host:
    """A host that was written by hand from the database."""

    def __init__(self, channel: str) -> None:
        self.bus = can.Bus(interface="virtual", channel=channel)
        self._counter = 0

    def send(self, name: str, damage: int = 0, count: int = 1, **values: float | str) -> None:
        layout = DATABASE.get_message_by_name(name)
        self._counter = (self._counter + count) % 16
        data = bytearray(layout.encode({"counter": self._counter, "crc": 0, **values}))
        data[-1] = Crc8SaeJ1850.calc(layout.frame_id.to_bytes(2, "little") + data[:-1]) ^ damage
        self.bus.send(can.Message(arbitration_id=layout.frame_id, is_extended_id=False, data=data))

    def follow(self, position: float, stiffness: float = 1.0, damage: int = 0, count: int = 1) -> None:
        values = {"position": position, "speed_limit": 9.0, "stiffness": stiffness, "mode": "follow"}
        self.send("Command_01", damage, count, **values)

    def answers(self) -> list[can.Message]:
        found = []
        while (message := self.bus.recv(0.05)) is not None:
            found.append(message)
        return found


@pytest.fixture
def host(nao: RobotModel, request: pytest.FixtureRequest) -> Iterator[tuple[Host, CanStub]]:
    channel = request.node.name
    with can.Bus(interface="virtual", channel=channel) as bus:
        stub, host = CanStub(nao, bus), Host(channel)
        stub.start()
        yield host, stub
        stub.stop()
        host.bus.shutdown()


def test_every_valid_command_is_answered_with_a_sealed_frame(host: tuple[Host, CanStub]) -> None:
    us, _ = host
    for _ in range(3):
        us.send("Command_05", position=0.0, speed_limit=0.0, stiffness=0.0, mode="ask")
    answers = us.answers()
    assert [message.arbitration_id for message in answers] == [0x205] * 3
    values = [DATABASE.decode_message(message.arbitration_id, bytes(message.data)) for message in answers]
    assert [value["counter"] for value in values] == [1, 2, 3]
    assert {str(value["status"]) for value in values} == {"off"}
    for message in answers:
        assert message.data[-1] == Crc8SaeJ1850.calc(b"\x05\x02" + bytes(message.data[:-1]))


def test_damaged_and_repeated_commands_are_ignored(host: tuple[Host, CanStub]) -> None:
    us, stub = host
    us.follow(0.5, damage=0x10)
    assert us.answers() == [] and stub.damaged == 1
    us.follow(0.5, stiffness=0.0)
    us.follow(0.5, count=0)
    assert len([m for m in us.answers() if m.arbitration_id == 0x201]) >= 1
    assert stub.repeated == 1
    assert stub.motors[1].stiffness == 0.0


def test_a_motor_tells_unasked_that_it_holds(host: tuple[Host, CanStub]) -> None:
    us, _ = host
    us.send("Heartbeat")
    us.follow(0.5, stiffness=0.0)
    us.answers()
    deadline = time.monotonic() + 1.0
    told: list[str] = []
    while time.monotonic() < deadline and "holding" not in told:
        told += [str(DATABASE.decode_message(m.arbitration_id, bytes(m.data))["status"]) for m in us.answers()]
    us.send("Command_01", position=0.0, speed_limit=0.0, stiffness=0.0, mode="ask")
    told += [str(DATABASE.decode_message(m.arbitration_id, bytes(m.data))["status"]) for m in us.answers()]
    assert told[-1] == "holding"


def test_the_command_says_ready_and_ends_after_its_duration() -> None:
    arguments = [
        "can-stub",
        "--interface",
        "virtual",
        "--channel",
        "cli",
        "--fault",
        "HeadYaw:hot@1",
        "--duration",
        "0.1",
    ]
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code == 0, result.output
    assert result.output.startswith("ready: 25 motors of nao on virtual cli\n")


def test_an_interrupted_command_leaves_without_a_traceback(tmp_path: Path) -> None:
    arguments = ["can-stub", "--interface", "virtual", "--channel", "cli"]
    program = [sys.executable, "-m", "naoimitate.cli", *arguments]
    stub = subprocess.Popen(program, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert stub.stdout is not None and stub.stdout.readline().startswith("ready")
    stub.send_signal(signal.SIGINT)
    output, errors = stub.communicate(timeout=10.0)
    assert stub.returncode == 130
    assert "0 damaged" in output and errors.strip() == "naoimitate: interrupted"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--fault", "HeadYaw:lazy@1"], "unknown kind 'lazy'"),
        (["--posture", "handstand"], "nao has no posture 'handstand': give one of zero, stand"),
        (["--interface", "nonsense"], "no CAN interface 'nonsense'"),
        (["--database", "/nowhere/can.dbc"], "there is no CAN database /nowhere/can.dbc"),
    ],
)
def test_mistakes_of_the_command_line_are_one_line(
    arguments: list[str], message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(["can-stub", "--interface", "virtual", "--channel", "cli", *arguments]) == 2
    error = capfd.readouterr().err
    assert message in error and error.count("\n") == 1


def test_driver_and_motors_find_each_other_across_processes(nao: RobotModel, tmp_path: Path) -> None:
    try:
        can.Bus(interface="udp_multicast", channel=GROUP).shutdown()
    except (OSError, can.CanError) as error:
        pytest.skip(f"no multicast on this machine ({error})")
    stub = subprocess.Popen(
        [sys.executable, "-m", "naoimitate.cli", "can-stub", "--channel", GROUP, "--duration", "30"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        text=True,
    )
    driver = CanDriver(nao, interface="udp_multicast", channel=GROUP, settings=QUICK, compensation=False)
    try:
        assert stub.stdout is not None
        assert stub.stdout.readline().startswith("ready")
        try:
            driver.connect()
        except DriverError as error:
            if driver.counts.received == 0:
                pytest.skip(f"multicast opens but does not arrive on this machine ({error})")
            raise
        goal = nao.postures["StandInit"]
        driver.write(command(nao, goal))
        assert wait_for(lambda: bool(np.abs(driver.read().q - goal).max() < 0.001), 3.0)
        assert driver.read().alarms == ()
    finally:
        driver.stop()
        stub.terminate()
        stub.wait()
