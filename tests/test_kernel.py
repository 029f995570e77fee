"""The compiled kinematics agree with pinocchio on thousands of random poses of both robots."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pinocchio_oracle import Oracle

from naoimitate.robot import RobotModel
from naoimitate.robot.kernel import angular_jacobian, center_of_mass, com_jacobian, forward, point_jacobian
from naoimitate.robot.model import Array

POSES = 1500
TOLERANCE = 1e-9


def frames(robot: RobotModel, q: Array) -> tuple[Array, Array]:
    count = len(robot.joint_names) + 1
    pos, rot = np.full((count, 3), np.nan), np.full((count, 3, 3), np.nan)
    forward(robot.tree, q, pos, rot)
    return pos, rot


def random_poses(robot: RobotModel, seed: int) -> Array:
    """Angles far beyond the limits too: kinematics knows no limits."""
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (POSES, len(robot.joint_names)))


def test_link_frames_equal_pinocchios(robot: RobotModel) -> None:
    oracle = Oracle(robot)
    for q in random_poses(robot, 1):
        oracle.update(q)
        pos, rot = frames(robot, q)
        expected = [oracle.data.oMi[i] for i in oracle.ids]
        np.testing.assert_allclose(pos[1:], [placement.translation for placement in expected], atol=TOLERANCE)
        np.testing.assert_allclose(rot[1:], [placement.rotation for placement in expected], atol=TOLERANCE)
        assert not pos[0].any() and np.array_equal(rot[0], np.eye(3))


def test_center_of_mass_and_its_jacobian_equal_pinocchios(robot: RobotModel) -> None:
    oracle = Oracle(robot)
    com, jacobian = np.empty(3), np.empty((3, len(robot.joint_names)))
    for q in random_poses(robot, 2):
        oracle.update(q)
        pos, rot = frames(robot, q)
        center_of_mass(robot.tree, pos, rot, com)
        com_jacobian(robot.tree, pos, rot, jacobian)
        np.testing.assert_allclose(com, oracle.data.com[0], atol=TOLERANCE)
        np.testing.assert_allclose(jacobian, oracle.data.Jcom[:, oracle.columns], atol=TOLERANCE)


def test_point_and_angular_jacobians_equal_pinocchios(robot: RobotModel) -> None:
    oracle, rng = Oracle(robot), np.random.default_rng(3)
    count = len(robot.joint_names)
    linear, angular = np.empty((3, count)), np.empty((3, count))
    for q in random_poses(robot, 4):
        oracle.update(q)
        pos, rot = frames(robot, q)
        joint, arm = int(rng.integers(count)), rng.uniform(-0.2, 0.2, 3)
        point_jacobian(robot.tree, pos, rot, joint, pos[joint + 1] + arm, linear)
        angular_jacobian(robot.tree, pos, rot, joint, angular)
        expected = oracle.jacobian(joint)
        np.testing.assert_allclose(angular, expected[3:], atol=TOLERANCE)
        np.testing.assert_allclose(linear, expected[:3] + np.cross(expected[3:].T, arm).T, atol=TOLERANCE)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_a_small_joint_step_moves_points_as_the_jacobian_says(nao: RobotModel, seed: int) -> None:
    rng = np.random.default_rng(seed)
    q, step = rng.uniform(nao.lower, nao.upper), rng.normal(size=len(nao.joint_names)) * 1e-6
    jacobian, name = np.empty((3, len(q))), str(rng.choice(list(nao.points)))
    point = nao.points[name]

    def place(angles: Array) -> Array:
        pos, rot = frames(nao, angles)
        return np.asarray(pos[point.joint + 1] + rot[point.joint + 1] @ point.offset)

    pos, rot = frames(nao, q)
    point_jacobian(nao.tree, pos, rot, point.joint, place(q), jacobian)
    np.testing.assert_allclose(place(q + step) - place(q - step), 2.0 * jacobian @ step, atol=1e-12)


def test_points_of_the_base_do_not_move_with_any_joint(robot: RobotModel) -> None:
    pos, rot = frames(robot, robot.postures["stand"])
    out = np.ones((3, len(robot.joint_names)))
    point_jacobian(robot.tree, pos, rot, -1, np.array([0.1, 0.0, 0.2]), out)
    assert not out.any()
    out[:] = 1.0
    angular_jacobian(robot.tree, pos, rot, -1, out)
    assert not out.any()


@pytest.mark.parametrize("budget_us", [20.0])
def test_forward_kinematics_costs_microseconds(nao: RobotModel, budget_us: float) -> None:
    pos, rot = frames(nao, nao.postures["stand"])
    best = np.inf
    for _ in range(20):
        start = time.perf_counter()
        for _ in range(100):
            forward(nao.tree, nao.postures["stand"], pos, rot)
        best = min(best, (time.perf_counter() - start) / 100)
    assert best * 1e6 < budget_us
