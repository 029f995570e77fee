"""When a step ends: only a sole that is where the plan has it is on the floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from naoimitate import load_motion
from naoimitate.balance.legs import DOWN
from naoimitate.balance.stride import TOUCHING, Plan
from naoimitate.fsm import Mode
from naoimitate.imitator import Imitator
from naoimitate.robot import RobotModel

DT = 0.01


def test_a_sole_that_is_higher_than_planned_has_not_landed(nao: RobotModel) -> None:
    motion, imitator = load_motion("builtin:march"), Imitator(nao)
    assert motion.tpose is not None
    imitator.calibrate(motion.tpose)
    for support in ("L", "D"):
        for _ in range(400):
            imitator.step(motion[0], DT, support=support)
            if imitator.mode is (Mode.LEFT if support == "L" else Mode.LANDING_ON_LEFT):
                break
    assert imitator.mode is Mode.LANDING_ON_LEFT
    stride, pose = imitator._retargeting._stride, imitator._pose  # type: ignore[attr-defined]
    assert pose is not None
    floor = pose.sole_pos * [[1.0, 1.0, 1.0], [1.0, 1.0, 0.0]]
    plan = Plan(0.0, 0.0, 0.0, floor[1], np.eye(3), DOWN, touchdown=True)
    high = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0 * TOUCHING]])
    stride.accept(plan, 1.0, replace(pose, sole_pos=floor + high), DT)
    assert stride.mode is Mode.LANDING_ON_LEFT
    stride.accept(plan, 1.0, replace(pose, sole_pos=floor), DT)
    assert stride.mode is Mode.DOUBLE
