"""A fake NAO: the services of NAOqi that the driver uses, offered by ``qi`` itself over TCP on this machine.

It runs as a process of its own (this file, as a script), since qi and pinocchio do not go together in one.
"""

# ruff: noqa: N802 - the names are NAOqi's
from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from typing import Any

import qi

PREFIX = "Device/SubDeviceList/"


@qi.multiThreaded()
class _Motion:
    """ALMotion: joints are at once where they are told to be."""

    def __init__(self, fake: FakeNao) -> None:
        self._fake = fake

    def getBodyNames(self, name: str) -> list[str]:
        return list(self._fake.names)

    def getLimits(self, name: str) -> list[list[float]]:
        return [list(row) for row in self._fake.limits]

    def getAngles(self, names: list[str], use_sensors: bool) -> list[float]:
        return [self._fake.angles[name] for name in names]

    def setAngles(self, names: list[str], angles: list[float], fraction: float) -> None:
        if not 0.0 < fraction <= 1.0 or len(names) != len(angles):
            raise ValueError("setAngles")
        with self._fake.lock:
            self._fake.sent.append((time.monotonic(), dict(zip(names, angles, strict=True)), fraction))
            self._fake.angles.update(zip(names, angles, strict=True))

    def stiffnessInterpolation(self, name: str, stiffness: float, ramp: float) -> None:
        self._fake.did("stiffnessInterpolation", stiffness, ramp)

    def angleInterpolation(self, names: list[str], angles: list[float], times: list[float], absolute: bool) -> None:
        if not absolute or not len(names) == len(angles) == len(times):
            raise ValueError("angleInterpolation")
        self._fake.did("angleInterpolation", max(times))
        if self._fake.awake.wait(5.0 if not self._fake.awake.is_set() else 0.0):
            moved = [(n, a) for n, a in zip(names, angles, strict=True) if n not in self._fake.blocked]
            self._fake.angles.update(moved)

    def setStiffnesses(self, name: str, stiffness: float) -> None:
        self._fake.did("setStiffnesses", stiffness)

    def wakeUp(self) -> None:
        self._fake.did("wakeUp")
        self._fake.awake.wait(5.0)

    def rest(self) -> None:
        self._fake.did("rest")
        self._fake.resting.wait(5.0)

    def killAll(self) -> None:
        self._fake.did("killAll")
        self._fake.awake.set()

    def getBreathEnabled(self, chain: str) -> bool:
        return self._fake.moves_alone

    def setBreathEnabled(self, chain: str, on: bool) -> None:
        self._fake.did("setBreathEnabled", on)

    def getIdlePostureEnabled(self, chain: str) -> bool:
        return self._fake.moves_alone

    def setIdlePostureEnabled(self, chain: str, on: bool) -> None:
        self._fake.did("setIdlePostureEnabled", on)

    def getCollisionProtectionEnabled(self, chain: str) -> bool:
        return self._fake.reflexes

    def setCollisionProtectionEnabled(self, chain: str, on: bool) -> None:
        self._fake.did("setCollisionProtectionEnabled", on)

    def getFallManagerEnabled(self) -> bool:
        return self._fake.reflexes

    def setFallManagerEnabled(self, on: bool) -> None:
        self._fake.did("setFallManagerEnabled", on)

    def getSmartStiffnessEnabled(self) -> bool:
        return self._fake.reflexes

    def setSmartStiffnessEnabled(self, on: bool) -> None:
        self._fake.did("setSmartStiffnessEnabled", on)


class _Memory:
    def __init__(self, fake: FakeNao) -> None:
        self._fake = fake

    def getListData(self, keys: list[str]) -> list[Any]:
        self._fake.answering.wait()
        return [self._fake.memory.get(key) for key in keys]


class _Posture:
    def __init__(self, fake: FakeNao) -> None:
        self._fake = fake

    def getPostureFamily(self) -> str:
        return self._fake.posture

    def goToPosture(self, name: str, speed: float) -> bool:
        self._fake.did("goToPosture", name)
        self._fake.angles.update(self._fake.postures[name])
        return self._fake.can_stand


class _Life:
    def __init__(self, fake: FakeNao) -> None:
        self._fake = fake

    def getState(self) -> str:
        return self._fake.life

    def setState(self, state: str) -> None:
        self._fake.did("setState", state)
        self._fake.life = state


class _System:
    def __init__(self, fake: FakeNao) -> None:
        self._fake = fake

    def systemVersion(self) -> str:
        return self._fake.version


class FakeNao:
    """A standing NAO V6; its public fields are what a test sets up, ``done`` and ``sent`` what was asked of it."""

    def __init__(self, joints: list[str], lower: list[float], upper: list[float], speed: list[float]) -> None:
        self.names = [*joints, "LHand", "RHand"]
        self.limits = [[*row, 1.0] for row in zip(lower, upper, speed, strict=True)] + 2 * [[0.0, 1.0, 8.0, 1.0]]
        self.postures: dict[str, dict[str, float]] = {}
        self.angles = dict.fromkeys(self.names, 0.0)
        self.version, self.posture, self.life = "2.8.6.23", "Standing", "disabled"
        self.offers = ["ALMotion", "ALMemory", "ALRobotPosture", "ALAutonomousLife", "ALSystem"]
        self.blocked: list[str] = []
        self.moves_alone, self.reflexes, self.can_stand = False, True, True
        self.done: list[tuple[Any, ...]] = []
        self.sent: list[tuple[float, dict[str, float], float]] = []
        self.lock, self.answering = threading.Lock(), threading.Event()
        self.answering.set()
        self.awake = threading.Event()
        self.awake.set()
        self.resting = threading.Event()
        self.resting.set()
        self.memory = self._standing()
        self._session: Any = None

    def _standing(self) -> dict[str, float | int]:
        sensor = {f"InertialSensor/{k}": 0.0 for k in ("AngleX", "AngleY", "GyroscopeX", "GyroscopeY", "GyroscopeZ")}
        sensor |= {"InertialSensor/AccelerometerX": 0.3, "InertialSensor/AccelerometerY": 0.0}
        sensor |= {"InertialSensor/AccelerometerZ": -9.8, "Battery/Charge": 0.9}
        feet = [f"{s}Foot/FSR/{p}{w}" for s in "LR" for p in ("Front", "Rear") for w in ("Left", "Right")]
        sensor |= {foot: 0.1 * (i + 1) for i, foot in enumerate(feet)}
        status = {f"{PREFIX}{name}/Temperature/Sensor/Status": 0 for name in self.names}
        return {**{f"{PREFIX}{k}/Sensor/Value": v for k, v in sensor.items()}, **status}

    def did(self, *what: Any) -> None:
        with self.lock:
            self.done.append(what)

    def serve(self) -> str:
        """Listen on a free port; returns the URL."""
        self._session = qi.Session()
        self._session.listenStandalone("tcp://127.0.0.1:0")
        for name, service in (
            ("ALMotion", _Motion), ("ALMemory", _Memory), ("ALRobotPosture", _Posture),
            ("ALAutonomousLife", _Life), ("ALSystem", _System),
        ):  # fmt: skip
            if name in self.offers:
                self._session.registerService(name, service(self))
        return str(self._session.endpoints()[0])

    def close(self) -> None:
        """Vanish from the network."""
        self.answering.set()
        self._session.close()

    def order(self, what: str, *arguments: Any) -> Any:
        """What a test asks for, see ``RemoteNao``."""
        if what == "get":
            return getattr(self, arguments[0])
        if what == "set":
            setattr(self, *arguments)
        elif what == "memory":
            self.memory.update(arguments[0])
        elif what == "lack":
            self.memory = {k: v for k, v in self.memory.items() if not any(word in k for word in arguments)}
        elif what == "event":
            event = getattr(self, arguments[0])
            (event.set if arguments[1] else event.clear)()
        return getattr(self, what)() if what in ("serve", "close") else None


class RemoteNao:
    """A ``FakeNao`` in its own process, as a test sees it: its fields can be read and assigned."""

    def __init__(self, robot: Any) -> None:
        command = [sys.executable, __file__]
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        vars(self)["_process"] = process
        self._say([list(robot.joint_names), robot.lower.tolist(), robot.upper.tolist(), robot.speed.tolist()])
        posture = dict(zip(robot.joint_names, robot.postures["StandInit"].tolist(), strict=True))
        self.postures = {"StandInit": posture}

    def feels(self, key: str, value: float) -> None:
        """Change a sensor by its short name."""
        self.order("memory", {f"{PREFIX}{key}/Sensor/Value": value})

    def heats(self, joint: str, status: int) -> None:
        """Change a joint's temperature status."""
        self.order("memory", {f"{PREFIX}{joint}/Temperature/Sensor/Status": status})

    def order(self, *what: Any) -> Any:
        """Ask the other process, and wait until it is done."""
        self._say(what)
        return json.loads(self._process.stdout.readline())

    def quit(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        self._process.stdin.close()
        self._process.stdout.close()

    def _say(self, what: Any) -> None:
        self._process.stdin.write(json.dumps(what) + "\n")
        self._process.stdin.flush()

    def __getattr__(self, name: str) -> Any:
        value = self.order("get", name)
        return [tuple(item) for item in value] if name in ("done", "sent") else value

    def __setattr__(self, name: str, value: Any) -> None:
        self.order("set", name, value)


def main() -> None:
    """Build the robot from the first line, then do as told, line by line."""
    qi.logging.setLevel(qi.logging.SILENT)
    fake = FakeNao(*json.loads(sys.stdin.readline()))
    for line in sys.stdin:
        print(json.dumps(fake.order(*json.loads(line))), flush=True)


if __name__ == "__main__":
    main()
