"""A robot's driver and its simulated motors on one virtual bus, with a witness that writes down every frame."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import can
import cantools
import numpy as np

from naoimitate.core.frames import Array, GivenUp, RobotCommand
from naoimitate.hw.can import CanDriver, CanSettings
from naoimitate.hw.can.codecs import database_path
from naoimitate.hw.can.stub import CanStub, motor_numbers
from naoimitate.hw.can.stub_faults import parse_fault
from naoimitate.robot import RobotModel

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
QUICK = CanSettings(ramp=0.1, patience=0.5, approach=20.0)
_CHANNELS = itertools.count()


@dataclass
class Rig:
    """What a test needs to look at: times of frames are s of the bus's clock."""

    driver: CanDriver
    stub: CanStub
    channel: str
    seen: can.BufferedReader
    database: Any

    def frames(self) -> list[tuple[float, str, dict[str, Any]]]:
        """All frames since the last call: time, name, values; error frames as ``error``."""
        found = []
        while (message := self.seen.get_message(timeout=0.0)) is not None:
            if message.is_error_frame:
                found.append((message.timestamp, "error", {}))
                continue
            layout = self.database.get_message_by_frame_id(message.arbitration_id)
            found.append((message.timestamp, layout.name, dict(layout.decode(bytes(message.data)))))
        return found


@contextmanager
def rig(
    robot: RobotModel,
    *faults: str,
    settings: CanSettings = QUICK,
    stub_robot: RobotModel | None = None,
    posture: str = "stand",
    **options: Any,
) -> Iterator[Rig]:
    """A driver that is not connected yet, and motors that answer in a posture; stub_robot: what they believe to be."""
    channel = f"rig{next(_CHANNELS)}"
    believed = stub_robot or robot
    bus, witness = (can.Bus(interface="virtual", channel=channel) for _ in range(2))
    stub = CanStub(believed, bus, [parse_fault(text, motor_numbers(believed)) for text in faults], posture=posture)
    seen = can.BufferedReader()
    notifier = can.Notifier(witness, [seen], timeout=0.05)
    driver = CanDriver(robot, interface="virtual", channel=channel, settings=settings, **options)
    database = cantools.database.load_file(database_path(robot))
    stub.start()
    try:
        yield Rig(driver, stub, channel, seen, database)
    finally:
        driver.stop()
        stub.stop()
        notifier.stop()
        bus.shutdown()
        witness.shutdown()


def command(robot: RobotModel, q: Array, opening: tuple[float, float] = (np.nan, np.nan)) -> RobotCommand:
    """A command of nothing but joints and hands."""
    return RobotCommand(
        time=0.0,
        q=q,
        base_pos=np.zeros(3),
        base_quat=UPRIGHT,
        support="D",
        offset=0.5,
        com=np.zeros(3),
        soles=np.zeros((2, 3)),
        posture=np.zeros((4, 3)),
        human_support="D",
        human_offset=0.5,
        hand_opening=np.array(opening),
        given_up=GivenUp(0),
        ik_iterations=0,
    )


def wait_for(condition: Callable[[], bool], patience: float = 2.0) -> bool:
    """Whether a condition comes true within some seconds."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.005)
    return condition()


def all_follow(it: Rig, but: int = 0) -> bool:
    """Whether every motor follows, but one that need not; those that held while the computer paused come again."""
    return wait_for(lambda: {m.status for node, m in it.stub.motors.items() if node != but} == {"following"})
