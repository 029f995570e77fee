"""Simulated motors on a CAN bus, to try the driver on without a robot.

They speak the bytes of the DBC file, read with cantools and sealed with crccheck, and share no code with the driver
and its codec: what both understand is what the file says.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable
from pathlib import Path

import can
import cantools
from cantools.database import Database
from cantools.database.namedsignalvalue import NamedSignalValue
from crccheck.crc import Crc8SaeJ1850

from naoimitate.core.errors import DriverError
from naoimitate.hw.can.stub_faults import StubFault
from naoimitate.hw.can.stub_motor import AMBIENT, StubMotor
from naoimitate.robot.model import RobotModel

LOOK = 0.01
"""s between two looks at the motors while nothing arrives."""
CURRENT = 0.4
"""A that a motor takes at full stiffness: a plausible figure, the simulated motors carry no load."""
ERROR_FRAMES = 16
"""Error frames that a motor sends before it is bus-off: each adds 8 to its error counter, which ends at 256."""


class CanStub:
    """The motors of a robot on a bus that is already open; it runs in a thread between ``start`` and ``stop``.

    database: DBC file, None = the robot's own. faults: what shall go wrong, and when. posture: of the robot, by name,
    in which the motors are found. ``motors`` are the simulated motors by number.
    """

    def __init__(
        self,
        robot: RobotModel,
        bus: can.BusABC,
        faults: Iterable[StubFault] = (),
        database: Path | None = None,
        posture: str = "stand",
    ) -> None:
        self.motors = _motors(robot, posture)
        for fault in faults:
            self.motors[fault.node].faults.append(fault)
        self.damaged = 0
        """Commands with a wrong checksum or length."""
        self.repeated = 0
        """Commands with the counter of the one before."""
        self.unsent = 0
        """Answers that the bus did not take."""
        self._bus = bus
        self._database = _load(robot, database)
        self._node = {f"Command_{node:02d}": node for node in self.motors}
        self._last: dict[int, int] = {}
        self._sent = dict.fromkeys(self.motors, 0)
        self._told = dict.fromkeys(self.motors, "off")
        self._gone: set[int] = set()
        self._halt = threading.Event()
        self._thread: threading.Thread | None = None
        self._start = time.monotonic()

    def start(self) -> None:
        """Begin to answer; the clock of the faults starts."""
        self._start = time.monotonic()
        self._halt.clear()
        self._thread = threading.Thread(target=self._run, name="can-stub", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Fall silent, all motors at once; the bus stays open."""
        self._halt.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _run(self) -> None:
        look = 0.0
        while not self._halt.is_set():
            message = self._bus.recv(LOOK)
            now = time.monotonic() - self._start
            if message is not None and not message.is_error_frame:
                self._hear(message, now)
            if now - look >= LOOK:
                look = now
                self._watch(now)

    def _hear(self, message: can.Message, now: float) -> None:
        """What one frame of the host does; frames of others are not for us."""
        try:
            layout = self._database.get_message_by_frame_id(message.arbitration_id)
        except KeyError:
            return
        listening = {node: motor for node, motor in self.motors.items() if not motor.has("bus-off", now)}
        if layout.name == "EmergencyStop":
            for motor in listening.values():
                motor.emergency_stop(now)
        elif layout.name == "Heartbeat" and self._valid(message, layout.length):
            for motor in listening.values():
                motor.heartbeat(now)
        elif (node := self._node.get(layout.name)) in listening and self._valid(message, layout.length):
            self._obey(node, layout.decode(bytes(message.data)), now)

    def _obey(self, node: int, values: object, now: float) -> None:
        assert isinstance(values, dict)
        counter = int(values["counter"])
        if self._last.get(node) == counter:
            self.repeated += 1
            return
        self._last[node] = counter
        limit, stiffness = float(values["speed_limit"]), float(values["stiffness"])
        self.motors[node].command(str(values["mode"]), float(values["position"]), limit, stiffness, now)
        self._answer(node, now)

    def _watch(self, now: float) -> None:
        """Let time pass where no commands come, and tell unasked when a motor's status has changed."""
        for node, motor in self.motors.items():
            motor.advance(now)
            if motor.has("bus-off", now) and node not in self._gone:
                self._gone.add(node)
                for _ in range(ERROR_FRAMES):
                    self._send(can.Message(is_error_frame=True))
            if motor.status != self._told[node]:
                self._answer(node, now)

    def _valid(self, message: can.Message, length: int) -> bool:
        valid = len(message.data) == length and message.data[-1] == _seal(message.arbitration_id, message.data[:-1])
        self.damaged += not valid
        return valid

    def _answer(self, node: int, now: float) -> None:
        motor = self.motors[node]
        if motor.has("silent", now) or motor.has("bus-off", now):
            return
        layout = self._database.get_message_by_name(f"Feedback_{node:02d}")
        self._sent[node] = (self._sent[node] + 1) % 16
        self._told[node] = motor.status
        values: dict[str, int | float | str | NamedSignalValue] = {
            "position": motor.position,
            "speed": motor.speed,
            "current": CURRENT * motor.stiffness,
            "temperature": min(motor.temperature, AMBIENT + 150.0),
            "status": motor.status,
            "counter": self._sent[node],
            "crc": 0,
        }
        data = bytearray(layout.encode(values))
        data[-1] = _seal(layout.frame_id, data[:-1]) ^ (0x55 if motor.has("crc", now) else 0)
        self._send(can.Message(arbitration_id=layout.frame_id, is_extended_id=False, data=data))

    def _send(self, message: can.Message) -> None:
        try:
            self._bus.send(message)
        except (can.CanError, OSError):
            self.unsent += 1


def motor_numbers(robot: RobotModel) -> dict[str, int]:
    """Numbers of the motors by joint or hand, from robot.yaml."""
    section = robot.data.get("can")
    if not isinstance(section, dict):
        raise DriverError(f"{robot.name} has no motors on a CAN bus: add a section `can` to its robot.yaml")
    return {name: int(entry["id"]) for part in ("joints", "hands") for name, entry in section.get(part, {}).items()}


def _motors(robot: RobotModel, posture: str) -> dict[int, StubMotor]:
    """Motors by number in a posture of the robot, hands closed."""
    motor_numbers(robot)
    if posture not in robot.postures:
        raise DriverError(f"{robot.name} has no posture {posture!r}: give one of {', '.join(robot.postures)}")
    section = robot.data["can"]
    start = dict(zip(robot.joint_names, robot.postures[posture], strict=True))
    speed = dict(zip(robot.joint_names, robot.speed, strict=True))
    motors = {}
    for name, own in {**section["joints"], **section.get("hands", {})}.items():
        entry = {"sign": 1, "gear": 1.0, "zero": 0.0, **section.get("defaults", {}), **own}
        ratio = entry["sign"] * entry["gear"]
        angle = ratio * (float(start.get(name, 0.0)) - entry["zero"])
        motors[int(entry["id"])] = StubMotor(angle, abs(ratio) * float(speed.get(name, 5.0)))
    return motors


def _load(robot: RobotModel, path: Path | None) -> Database:
    name = robot.data["can"].get("database", "can.dbc")
    file = path or Path(robot.data.get("folder", "."), name)
    if not file.is_file():
        raise DriverError(f"there is no CAN database {file}: put it beside robot.yaml, or name another")
    try:
        database = cantools.database.load_file(file, database_format="dbc")
    except (OSError, cantools.Error) as error:
        raise DriverError(f"the CAN database {file} cannot be read ({' '.join(str(error).split())})") from error
    assert isinstance(database, Database)
    return database


def _seal(identifier: int, data: bytes | bytearray) -> int:
    """CRC-8/SAE-J1850 over the identifier, low byte first, and the data."""
    return int(Crc8SaeJ1850.calc(identifier.to_bytes(2, "little") + bytes(data)))
