"""Falls of the simulated robot, limp and braced: how hard the head lands after a push from every side.

python benchmarks/fall.py      # 8 directions, 3 pushes each
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import mujoco
import numpy as np

from naoimitate import load_robot
from naoimitate.command_gate import CommandGate
from naoimitate.core.frames import Array, RobotCommand
from naoimitate.hw.condition import RESPONSES
from naoimitate.hw.guarded import Condition, GuardedDriver, GuardSettings
from naoimitate.robot.model import RobotModel
from naoimitate.sim.driver import MujocoDriver
from naoimitate.sim.placement import stand_on_floor
from naoimitate.sim.settings import SimSettings

DIRECTIONS = {"front": 0.0, "front-left": 45.0, "left": 90.0, "back-left": 135.0, "back": 180.0}
DIRECTIONS |= {"back-right": 225.0, "right": 270.0, "front-right": 315.0}
"""deg, of the push, from +x to +y."""
FORCES = (67.0, 82.0, 100.0)
"""N on the torso for ``PUSH`` s; 5.3 kg are 52 N. The postures were chosen with 60, 75 and 90 N."""
PUSH, STAND, FALL, LOOK = 0.1, 0.3, 2.0, 0.02
"""s: of the push, before it, after it, and between two readings of the guard."""


@dataclass
class Landing:
    """The head against the floor.

    force: N, largest. impulse: N s, that of lying there included. speed: m/s as it first touches, 0: never.
    """

    force: float = 0.0
    impulse: float = 0.0
    speed: float = 0.0
    condition: Condition = Condition.LIVE


def stand(robot: RobotModel) -> RobotCommand:
    """The robot's stand as a command."""
    q = robot.postures["stand"]
    pos, quat = stand_on_floor(robot, q)
    empty: dict[str, Any] = {field.name: None for field in fields(RobotCommand)}
    return RobotCommand(**{**empty, "time": 0.0, "q": q, "base_pos": pos, "base_quat": quat, "support": "D"})


def fall(
    robot: RobotModel, gate: CommandGate, command: RobotCommand, response: str, angle: float, force: float
) -> Landing:
    """Push a standing robot (angle rad, force N) and let it fall."""
    settings = SimSettings(period=0.002)
    driver = MujocoDriver(robot, settings, real_time=False)
    guard = GuardedDriver(driver, gate, GuardSettings(fall_response=response), clock=lambda: driver.read().time)
    guard.connect()
    guard.write(command)
    physics = driver._physics
    head = {i for i in range(physics.model.ngeom) if _is_head(physics.model, i)}
    result, every = Landing(), round(LOOK / settings.period)
    for step in range(round((STAND + PUSH + FALL) / settings.period)):
        pushed = STAND <= step * settings.period < STAND + PUSH
        physics.push(force * np.array([math.cos(angle), math.sin(angle), 0.0]) if pushed else np.zeros(3))
        before = _head_speed(physics.model, physics.data)
        driver.advance(settings.period)
        load = _load(physics.model, physics.data, head)
        if load > 0.0 and result.force == 0.0:
            result.speed = before
        result.force = max(result.force, load)
        result.impulse += load * settings.period
        if step % every == 0:
            guard.read()
    result.condition = guard.status.condition
    return result


def _is_head(model: mujoco.MjModel, geom: int) -> bool:
    return "head" in model.body(model.geom_bodyid[geom]).name.lower()


def _head_speed(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    velocity = np.zeros(6)
    head = next(i for i in range(model.nbody) if "head" in model.body(i).name.lower())
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, head, velocity, 0)
    return float(np.linalg.norm(velocity[3:]))


def _load(model: mujoco.MjModel, data: mujoco.MjData, head: set[int]) -> float:
    """N of the floor on the head."""
    total, force = 0.0, np.zeros(6)
    for index in range(data.ncon):
        pair: Array = data.contact[index].geom
        one, other = int(pair[0]), int(pair[1])
        if (one in head) != (other in head) and 0 in (model.geom_bodyid[one], model.geom_bodyid[other]):
            mujoco.mj_contactForce(model, data, index, force)
            total += float(force[0])
    return total


def main() -> None:
    """Print a line for every direction and response: how hard the head lands after pushes of growing force."""
    robot = load_robot("nao", "v4")
    gate, command = CommandGate(robot), stand(robot)
    for name, degrees in DIRECTIONS.items():
        for response in RESPONSES:
            falls = [fall(robot, gate, command, response, math.radians(degrees), force) for force in FORCES]
            cells = (f"{f.force:6.0f} N {f.impulse:5.2f} N s {f.speed:5.2f} m/s {f.condition.value}" for f in falls)
            print(f"{name:12} {response:6} {' | '.join(cells)}", flush=True)


if __name__ == "__main__":
    main()
