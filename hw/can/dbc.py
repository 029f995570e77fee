"""The codec of motors that a DBC file describes, through cantools.

The file has, for the motor number n, ``Command_n`` (position, speed_limit, stiffness, mode, counter, crc) and
``Feedback_n`` (position, speed, current, temperature, status, counter, crc), n with two digits; ``Heartbeat`` (counter,
crc) and ``EmergencyStop`` (no data). Identifiers, bit positions, scales and cycle times are the file's own. ``crc``
fills the last byte of its frame: CRC-8/SAE-J1850 over the identifier and the bytes before it (``crc.py``).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import cast

import can
import cantools
import numpy as np
from cantools.database import Database
from cantools.database.can import Message as Layout

from naoimitate.core.errors import DriverError
from naoimitate.core.frames import Array
from naoimitate.hw.can.codec import CorruptFrame, Feedback, MotorStatus, Targets, Traffic
from naoimitate.hw.can.crc import crc8

COMMAND_SIGNALS = ("position", "speed_limit", "stiffness", "mode", "counter", "crc")
FEEDBACK_SIGNALS = ("position", "speed", "current", "temperature", "status", "counter", "crc")
MODES = ("ask", "off", "follow")


class DbcCodec:
    """Frames of the motors ``nodes`` as the DBC file at ``path`` lays them out; DriverError where it does not fit."""

    def __init__(self, path: Path, nodes: Sequence[int]) -> None:
        self._path = path
        database = _load(path)
        self._commands = [self._layout(database, f"Command_{node:02d}", COMMAND_SIGNALS) for node in nodes]
        self._feedbacks = [self._layout(database, f"Feedback_{node:02d}", FEEDBACK_SIGNALS) for node in nodes]
        self._heartbeat = self._layout(database, "Heartbeat", ("counter", "crc"))
        self._emergency = self._layout(database, "EmergencyStop", ())
        self._motor = {layout.frame_id: motor for motor, layout in enumerate(self._feedbacks)}
        self._modes = [self._choices(layout, "mode", MODES) for layout in self._commands]
        states = [status.value for status in MotorStatus]
        self._states = [
            {raw: MotorStatus(name) for name, raw in self._choices(layout, "status", states).items()}
            for layout in self._feedbacks
        ]
        self._range = [_range(self._commands, name) for name in ("position", "speed_limit", "stiffness")]
        self._counters = [2 ** layout.get_signal_by_name("counter").length for layout in self._feedbacks]
        self._modulus = 2 ** min(layout.get_signal_by_name("counter").length for layout in self._commands)
        self._counter = self._beat = 0

    @property
    def period(self) -> float:
        """Cycle time of the commands, s."""
        return self._cycle(self._commands[0])

    @property
    def position_range(self) -> tuple[Array, Array]:
        """Lowest and highest position (N,) rad that a command can carry."""
        return self._range[0]

    def traffic(self, period: float) -> list[Traffic]:
        """Commands and their answers every ``period`` s, and the heartbeat."""
        cyclic = [Traffic(layout.length, layout.is_extended_frame, 1.0 / period) for layout in self._pairs()]
        return [*cyclic, Traffic(self._heartbeat.length, self._heartbeat.is_extended_frame, 1.0 / period)]

    def ask(self) -> list[can.Message]:
        """A command of mode ask for every motor."""
        nothing = np.zeros(len(self._commands))
        return self._encode(Targets(nothing, nothing, nothing), "ask")

    def enable(self, targets: Targets) -> list[can.Message]:
        """The same as ``command``: a motor that is off begins to follow with the first one of stiffness 0."""
        return self._encode(targets, "follow")

    def command(self, targets: Targets) -> list[can.Message]:
        """A command of mode follow for every motor."""
        return self._encode(targets, "follow")

    def disable(self) -> list[can.Message]:
        """A command of mode off for every motor."""
        nothing = np.zeros(len(self._commands))
        return self._encode(Targets(nothing, nothing, nothing), "off")

    def heartbeat(self) -> list[can.Message]:
        """The host's heartbeat."""
        self._beat = (self._beat + 1) % 2 ** self._heartbeat.get_signal_by_name("counter").length
        return [_sealed(self._heartbeat, {"counter": self._beat, "crc": 0})]

    def emergency_stop(self) -> list[can.Message]:
        """The frame of the lowest identifier, which wins the bus over all others."""
        return [can.Message(arbitration_id=self._emergency.frame_id, is_extended_id=False, dlc=0)]

    def decode(self, message: can.Message) -> Feedback | None:
        """What a motor says, or None; raises CorruptFrame for a wrong length, checksum or status."""
        motor = self._motor.get(message.arbitration_id)
        if motor is None or message.is_extended_id or message.is_error_frame or message.is_remote_frame:
            return None
        layout, data = self._feedbacks[motor], bytes(message.data)
        if len(data) != layout.length:
            raise CorruptFrame(motor, f"{layout.name} has {len(data)} bytes instead of {layout.length}")
        if data[-1] != crc8(layout.frame_id, data[:-1]):
            raise CorruptFrame(motor, f"{layout.name} has a wrong checksum")
        value = cast(dict[str, float], layout.decode_simple(data, decode_choices=False))  # plain numbers, no names
        status = self._states[motor].get(int(value["status"]))
        if status is None:
            raise CorruptFrame(motor, f"{layout.name} has the unknown status {value['status']}")
        return Feedback(
            motor,
            position=float(value["position"]),
            speed=float(value["speed"]),
            current=float(value["current"]),
            temperature=float(value["temperature"]),
            status=status,
            counter=int(value["counter"]),
            counters=self._counters[motor],
        )

    def _encode(self, targets: Targets, mode: str) -> list[can.Message]:
        self._counter = (self._counter + 1) % self._modulus
        columns = [np.clip(values, *span).tolist() for values, span in zip(targets, self._range, strict=True)]
        return [
            _sealed(
                layout,
                {
                    "position": position,
                    "speed_limit": speed,
                    "stiffness": stiffness,
                    "mode": modes[mode],
                    "counter": self._counter,
                    "crc": 0,
                },
            )
            for layout, modes, position, speed, stiffness in zip(self._commands, self._modes, *columns, strict=True)
        ]

    def _pairs(self) -> list[Layout]:
        return [*self._commands, *self._feedbacks]

    def _layout(self, database: Database, name: str, signals: Sequence[str]) -> Layout:
        """A message of the file, checked: classic, with the signals that we need and the checksum in its last byte."""
        try:
            layout = database.get_message_by_name(name)
        except KeyError:
            raise self._unfit(f"has no message {name}") from None
        if layout.is_extended_frame or layout.length > 8:
            raise self._unfit(f"has {name} as a 29-bit or FD frame, which this codec does not speak")
        if set(signals) != {signal.name for signal in layout.signals}:
            raise self._unfit(f"needs in {name} the signals {', '.join(signals) or '(none)'} and no others")
        if "crc" in signals:
            crc = layout.get_signal_by_name("crc")
            place = 8 * (layout.length - 1) + (7 if crc.byte_order == "big_endian" else 0)
            if (crc.start, crc.length, crc.is_signed) != (place, 8, False):
                raise self._unfit(f"must have the crc of {name} in its last byte")
        return layout

    def _choices(self, layout: Layout, signal: str, names: Sequence[str]) -> dict[str, int]:
        """Raw values of a signal by the names that the file gives them."""
        choices = {str(name): raw for raw, name in (layout.get_signal_by_name(signal).choices or {}).items()}
        if missing := [name for name in names if name not in choices]:
            raise self._unfit(f"needs the value {missing[0]!r} for {signal} in {layout.name} (VAL_)")
        return {name: choices[name] for name in names}

    def _cycle(self, layout: Layout) -> float:
        if not layout.cycle_time:
            raise self._unfit(f"has no cycle time for {layout.name} (GenMsgCycleTime)")
        return layout.cycle_time / 1000.0

    def _unfit(self, what: str) -> DriverError:
        return DriverError(f"{self._path} {what}: compare it with the CAN database of a built-in robot")


def _load(path: Path) -> Database:
    try:
        database = cantools.database.load_file(path, database_format="dbc")
    except FileNotFoundError:
        raise DriverError(
            f"there is no CAN database {path}: put it beside robot.yaml, or correct `database` in its section can"
        ) from None
    except (cantools.Error, UnicodeDecodeError, OSError) as error:
        raise DriverError(f"{path} is no readable DBC file ({' '.join(str(error).split())}): correct it") from error
    assert isinstance(database, Database)  # the format dbc has no other kind
    return database


def _range(layouts: Sequence[Layout], signal: str) -> tuple[Array, Array]:
    """Lowest and highest value (N,) of a signal that the frames can carry."""
    bounds = []
    for layout in layouts:
        field = layout.get_signal_by_name(signal)
        size = 2**field.length
        low, high = (-(size // 2), size // 2 - 1) if field.is_signed else (0, size - 1)
        ends = sorted(raw * field.scale + field.offset for raw in (low, high))
        bounds.append((max(ends[0], _or(field.minimum, ends[0])), min(ends[1], _or(field.maximum, ends[1]))))
    table = np.array(bounds, dtype=float)
    return table[:, 0], table[:, 1]


def _or(value: float | None, other: float) -> float:
    return other if value is None else float(value)


def _sealed(layout: Layout, values: dict[str, float]) -> can.Message:
    """A frame with its checksum."""
    data = bytearray(layout.encode(values, strict=False))
    data[-1] = crc8(layout.frame_id, bytes(data[:-1]))
    return can.Message(arbitration_id=layout.frame_id, is_extended_id=False, data=data)
