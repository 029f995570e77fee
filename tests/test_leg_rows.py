"""Rows of the leg solver against what the robot does: finite differences, torques from statics, momentum."""

from __future__ import annotations

import numpy as np
import pytest

from naoimitate.balance.leg_rows import SLACKS, load_rows, sway_rows
from naoimitate.balance.legs import POSE, LegLimits, Stance, build_legs, free_goal
from naoimitate.balance.tangent import differentiate, make_tangent, place
from naoimitate.core.geometry import quat_from_matrix
from naoimitate.core.physics import GRAVITY
from naoimitate.hw.compensation import LoadCompensation
from naoimitate.robot.model import RobotModel

STEP = 1e-6
"""[rad] of the differences."""


class Scene:
    """A robot with bent legs on one sole, in some posture."""

    def __init__(self, robot: RobotModel, seed: int, share: tuple[float, float]) -> None:
        rng = np.random.default_rng(seed)
        self.robot, self.legs = robot, build_legs(robot, LegLimits())
        self.side = int(share[1] > 0.5)
        self.stance = Stance(self.side, np.zeros((2, 3)), np.stack([np.eye(3), np.eye(3)]), POSE, 0.0)
        self.q = np.clip(
            robot.postures["stand"] + rng.uniform(-0.3, 0.3, len(robot.joint_names)), robot.lower, robot.upper
        )
        for leader, follower in robot.coupled:
            self.q[follower] = self.q[leader]
        self.goal = free_goal(np.zeros((2, 3)), np.zeros(2), np.ones(2), np.array(share))
        self.goal = self.goal._replace(about=np.array([0.01, -0.02, 0.0]))
        self.tangent = make_tangent(len(self.q), len(self.legs.joints))

    def at(self, q: np.ndarray) -> None:
        place(self.robot.tree, self.legs, self.stance, q, self.tangent)
        differentiate(self.robot.tree, self.legs, self.stance, self.goal.about, self.tangent)

    def moved(self, variable: int, way: float) -> np.ndarray:
        q = self.q.copy()
        q[self.legs.variable == variable] += way
        return q

    def loads(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Levers (2 M,) m of the loaded joints, and the rows (2 M, n)."""
        self.at(q)
        n, count = len(self.legs.joints), 2 * self.legs.loaded.size
        C, b = np.zeros((count + 1, n + SLACKS)), np.zeros(count + 1)
        most = np.full(self.legs.holds.shape, 1.0)
        load_rows(self.robot.tree, self.legs, self.goal, self.tangent, 1.0, most, C, b, 0)
        return -1.0 - b[:count:2], C[:count:2, :n]

    def links(self, q: np.ndarray) -> np.ndarray:
        """Centres of the links in the world, (J + 1, 3) m."""
        self.at(q)
        t = self.tangent
        local = t.pos + np.einsum("kij,kj->ki", t.rot, self.robot.tree.com)
        return np.asarray(local @ t.R.T + t.p)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("share", [(1.0, 0.0), (0.0, 1.0), (0.4, 0.6)])
def test_rows_of_load_are_the_derivatives_of_the_levers(
    robot: RobotModel, seed: int, share: tuple[float, float]
) -> None:
    scene = Scene(robot, seed, share)
    _, rows = scene.loads(scene.q)
    for v in range(len(scene.legs.joints)):
        after, before = scene.loads(scene.moved(v, STEP))[0], scene.loads(scene.moved(v, -STEP))[0]
        assert rows[:, v] == pytest.approx((after - before) / (2.0 * STEP), abs=1e-7)


@pytest.mark.parametrize("side", [0, 1])
def test_levers_of_load_are_the_torques_that_hold_the_body(robot: RobotModel, side: int) -> None:
    scene = Scene(robot, 7, (1.0 - side, float(side)))
    levers, _ = scene.loads(scene.q)
    quat = quat_from_matrix(scene.tangent.R)
    torque = LoadCompensation(robot).torque(scene.q, quat, "LR"[side])
    expected = np.abs(torque[scene.legs.loaded.ravel()])
    within = expected < robot.effort[scene.legs.loaded.ravel()]
    assert within.any()
    weight = robot.tree.mass.sum() * GRAVITY
    assert np.abs(levers[within]) * weight == pytest.approx(expected[within], abs=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_rows_of_sway_are_the_momentum_of_all_links(robot: RobotModel, seed: int) -> None:
    scene = Scene(robot, seed, (1.0, 0.0))
    n, m = len(scene.legs.joints), robot.tree.mass / robot.tree.mass.sum()
    scene.at(scene.q)
    rows = 2 * 8 + 2  # two bounds on each of eight ways, and a slack of at least zero for torso and momentum
    C, b = np.zeros((rows, n + SLACKS)), np.zeros(rows)
    sway_rows(scene.legs, scene.goal, scene.tangent, np.zeros(n), C, b, 0)
    here = scene.links(scene.q)
    for v in range(n):
        way = (scene.links(scene.moved(v, STEP)) - scene.links(scene.moved(v, -STEP))) / (2.0 * STEP)
        momentum = (m[:, None] * np.cross(here - scene.goal.about, way)).sum(axis=0)
        assert C[0:4:2, v] == pytest.approx(momentum[:2], abs=1e-7)
