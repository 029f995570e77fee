"""Load compensation gives the torque that the ground and the limbs ask for, on one foot and on two."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from sim_poses import one_foot_pose

from naoimitate.core.geometry import polygon_centroid, quat_from_matrix
from naoimitate.hw.compensation import GRAVITY, LoadCompensation, share_of_weight
from naoimitate.robot import RobotModel
from naoimitate.robot.kernel import center_of_mass, forward
from naoimitate.robot.model import Array
from naoimitate.sim.placement import stand_on_floor

STRONG = 1e6
"""N m: no limit."""
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def strong(robot: RobotModel) -> RobotModel:
    return replace(robot, effort=np.full(len(robot.joint_names), STRONG))


def height_over_sole(robot: RobotModel, q: Array, side: str, up: Array) -> float:
    """Height (m) of the centre of mass over a sole that stays where it is; up: (3,) in the sole's frame."""
    pos, rot = np.zeros((len(q) + 1, 3)), np.zeros((len(q) + 1, 3, 3))
    com = np.zeros(3)
    forward(robot.tree, q, pos, rot)
    center_of_mass(robot.tree, pos, rot, com)
    link = robot.points[f"{side}_sole"].joint + 1
    return float(up @ rot[link].T @ (com - pos[link]))


def sole_rotation(robot: RobotModel, q: Array, side: str) -> Array:
    pos, rot = np.zeros((len(q) + 1, 3)), np.zeros((len(q) + 1, 3, 3))
    forward(robot.tree, q, pos, rot)
    return rot[robot.points[f"{side}_sole"].joint + 1]


@pytest.mark.parametrize("side", ["l", "r"])
def test_on_one_foot_the_torque_is_the_slope_of_the_potential_energy_with_that_sole_fixed(
    robot: RobotModel, side: str
) -> None:
    """A fixed sole does no work, so virtual work knows nothing of contact forces: an independent derivation."""
    compensation = LoadCompensation(strong(robot))
    rng = np.random.default_rng(0)
    step = 1e-6
    for _ in range(25):
        q = rng.uniform(robot.lower, robot.upper)
        base_from_sole = sole_rotation(robot, q, side)  # the sole is level, the torso wherever that leaves it
        torque = compensation.torque(q, quat_from_matrix(base_from_sole.T), side.upper())
        expected = np.zeros(len(q))
        for joint in range(len(q)):
            heights = []
            for sign in (1.0, -1.0):
                moved = q.copy()
                moved[joint] += sign * step
                heights.append(height_over_sole(robot, moved, side, np.array([0.0, 0.0, 1.0])))
            expected[joint] = robot.mass * GRAVITY * (heights[0] - heights[1]) / (2.0 * step)
        for leader, follower in robot.coupled:
            expected[leader] += expected[follower]
            expected[follower] = 0.0
        np.testing.assert_allclose(torque, expected, atol=1e-6)


def centres_over_sole(robot: RobotModel, q: Array, side: str) -> Array:
    """Centres of mass of all links, (J + 1, 3) m, in the frame of a sole."""
    pos, rot = np.zeros((len(q) + 1, 3)), np.zeros((len(q) + 1, 3, 3))
    forward(robot.tree, q, pos, rot)
    link = robot.points[f"{side}_sole"].joint + 1
    return (pos + np.einsum("kij,kj->ki", rot, robot.tree.com) - pos[link]) @ rot[link]


@pytest.mark.parametrize("side", ["l", "r"])
def test_on_one_foot_a_moving_body_takes_the_work_that_its_links_forces_do(robot: RobotModel, side: str) -> None:
    """Virtual work of ``m (g u + a)`` with the sole fixed, for accelerations of any size and direction."""
    compensation = LoadCompensation(strong(robot))
    rng = np.random.default_rng(1)
    step = 1e-6
    for _ in range(15):
        q = rng.uniform(robot.lower, robot.upper)
        base_from_sole = sole_rotation(robot, q, side)
        acceleration = rng.normal(0.0, 3.0, (len(q) + 1, 3))
        torque = compensation.torque(q, quat_from_matrix(base_from_sole.T), side.upper(), acceleration)
        force = robot.tree.mass[:, None] * (GRAVITY * np.array([0.0, 0.0, 1.0]) + acceleration @ base_from_sole)
        expected = np.zeros(len(q))
        for joint in range(len(q)):
            moved = [q + sign * step * (np.arange(len(q)) == joint) for sign in (1.0, -1.0)]
            ahead, behind = (centres_over_sole(robot, m, side) for m in moved)
            expected[joint] = (force * (ahead - behind)).sum() / (2.0 * step)
        for leader, follower in robot.coupled:
            expected[leader] += expected[follower]
            expected[follower] = 0.0
        np.testing.assert_allclose(torque, expected, atol=2e-6)


def test_a_body_that_speeds_up_to_a_side_leans_on_the_other_foot(robot: RobotModel) -> None:
    compensation = LoadCompensation(robot)
    stand, still = robot.postures["stand"], np.zeros((len(robot.joint_names) + 1, 3))
    compensation.torque(stand, UPRIGHT, "D", np.where([0, 1, 0], 0.3, still))
    assert compensation.share[1] > 0.55
    compensation.torque(stand, UPRIGHT, "D", np.where([0, 1, 0], 9.0, still))
    np.testing.assert_allclose(compensation.share, (0.0, 1.0), atol=1e-12)


def test_the_torques_of_the_arms_do_not_depend_on_the_feet(robot: RobotModel) -> None:
    compensation = LoadCompensation(robot)
    stand = robot.postures["stand"]
    arms = [*robot.chains["l_arm"], *robot.chains["r_arm"], *robot.chains["head"]]
    torques = [compensation.torque(stand, UPRIGHT, support)[arms] for support in "DLR"]
    np.testing.assert_allclose(torques[1], torques[0], atol=1e-12)
    np.testing.assert_allclose(torques[2], torques[0], atol=1e-12)


def test_double_support_hands_over_to_single_support_without_a_jump(robot: RobotModel) -> None:
    """With the centre of mass over one foot the other carries nothing, in both modes."""
    compensation = LoadCompensation(robot)
    for side in ("l", "r"):
        q = one_foot_pose(robot, side, lift=0.0)
        _, base_quat = stand_on_floor(robot, q, side)
        one, two = (compensation.torque(q, base_quat, support) for support in (side.upper(), "D"))
        np.testing.assert_allclose(two, one, atol=0.02)


def test_a_lifted_leg_carries_itself_and_the_stance_leg_everything_else(robot: RobotModel) -> None:
    compensation = LoadCompensation(robot)
    q = one_foot_pose(robot, "l")
    _, base_quat = stand_on_floor(robot, q, "l")
    torque = compensation.torque(q, base_quat, "L")
    assert abs(torque[robot.chains["l_leg"][1]]) > 1.0  # the hip roll holds the whole upper body
    assert np.abs(torque[list(robot.chains["r_leg"][-2:])]).max() < 0.1  # the free ankle holds its foot


def test_the_weight_is_shared_as_the_centre_of_mass_lies_between_the_feet() -> None:
    soles = np.array([[0.0, 0.05, -0.3], [0.0, -0.05, -0.3]])
    up = np.array([0.0, 0.0, 1.0])
    for y, share in ((0.05, (1.0, 0.0)), (0.025, (0.75, 0.25)), (0.0, (0.5, 0.5)), (-0.2, (0.0, 1.0))):
        np.testing.assert_allclose(share_of_weight(np.array([0.02, y, 0.0]), soles, up, "D"), share, atol=1e-12)
    np.testing.assert_array_equal(share_of_weight(np.zeros(3), soles, up, "R"), (0.0, 1.0))


def test_the_command_moves_by_torque_over_stiffness_and_never_beyond_the_motors_limit(robot: RobotModel) -> None:
    weak = replace(robot, effort=np.full(len(robot.joint_names), 0.3))
    compensation = LoadCompensation(weak)
    q = one_foot_pose(robot, "r")
    _, base_quat = stand_on_floor(robot, q, "r")
    command = compensation.command(q, base_quat, "R", 150.0)
    assert np.isclose(np.abs(command - q).max(), 0.3 / 150.0)


def test_joints_that_share_a_motor_get_one_command(nao: RobotModel) -> None:
    compensation = LoadCompensation(nao)
    q = one_foot_pose(nao, "l")
    _, base_quat = stand_on_floor(nao, q, "l")
    command = compensation.command(q, base_quat, "L", 300.0)
    for leader, follower in nao.coupled:
        assert command[leader] == command[follower] != q[leader]


def test_a_command_costs_less_than_a_hundred_microseconds(nao: RobotModel) -> None:
    """About 30 us on an idle machine; the best of many, because the machine may be busy."""
    compensation = LoadCompensation(nao)
    stand = nao.postures["stand"]
    compensation.command(stand, UPRIGHT, "D", 300.0)
    times = []
    for _ in range(200):
        start = time.perf_counter()
        compensation.command(stand, UPRIGHT, "D", 300.0)
        times.append(time.perf_counter() - start)
    assert min(times) < 100e-6


def test_soles_are_loaded_at_their_centroids(nao: RobotModel) -> None:
    """The reference point of the share is the same foot centre as that of the offset (6)."""
    compensation = LoadCompensation(nao)
    for row, side in enumerate("lr"):
        offset = nao.points[f"{side}_sole"].offset
        expected = offset + np.array([*polygon_centroid(nao.soles[side]), 0.0])
        np.testing.assert_allclose(compensation.sole_offset[row], expected)
