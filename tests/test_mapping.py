"""Equations (2) to (5): from the person's posture to the robot's targets."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from people import BODY, tpose

from naoimitate.human.body import measure, observe
from naoimitate.mapping import Mapping, reachable_mapping, robot_posture, scales, virtual_mapping
from naoimitate.robot.model import RobotModel

PERSON = measure(tpose())
REFERENCE = observe(PERSON, tpose()).posture
NUMBER = st.floats(-1.5, 1.5)
POSTURES = st.lists(NUMBER, min_size=12, max_size=12).map(lambda v: np.array(v).reshape(4, 3))
L_HAND, L_FOOT, R_HAND, R_FOOT = range(4)


def test_scale_is_the_ratio_of_the_limbs(robot: RobotModel) -> None:
    """Equation (4), per kinematic chain."""
    arm, leg = robot.limb_length["l_arm"] / (BODY.upper_arm + BODY.forearm), robot.limb_length["l_leg"] / BODY.leg
    assert scales(robot, PERSON) == pytest.approx([arm, leg, arm, leg])


def test_scale_of_each_limb_is_its_own(robot: RobotModel) -> None:
    lopsided = measure(tpose())
    lopsided = type(lopsided)((0.5, 0.6), (0.8, 0.9), 0.07, (0.2, 0.2), 1.75)
    lengths = robot.limb_length
    expected = [lengths["l_arm"] / 0.5, lengths["l_leg"] / 0.8, lengths["r_arm"] / 0.6, lengths["r_leg"] / 0.9]
    assert scales(robot, lopsided) == pytest.approx(expected)


@given(posture=POSTURES)
@settings(max_examples=100, deadline=None)
def test_with_the_virtual_reference_all_equations_collapse_to_a_scaled_posture(
    robot: RobotModel, posture: np.ndarray
) -> None:
    mapping = virtual_mapping(robot, PERSON, REFERENCE)
    assert mapping.targets(posture) == pytest.approx(mapping.scale[:, None] * posture, abs=1e-12)


def test_a_hanging_arm_stays_within_reach_of_the_virtual_reference(robot: RobotModel) -> None:
    hanging = REFERENCE.copy()
    hanging[L_HAND] = [0.0, 0.0, -(BODY.upper_arm + BODY.forearm)]
    target = virtual_mapping(robot, PERSON, REFERENCE).targets(hanging)[L_HAND]
    assert np.linalg.norm(target) == pytest.approx(robot.limb_length["l_arm"])


def test_with_the_reachable_reference_the_t_pose_is_the_robots_own(robot: RobotModel) -> None:
    targets = reachable_mapping(robot, PERSON, REFERENCE).targets(REFERENCE)
    assert targets == pytest.approx(robot_posture(robot, robot.postures["calibration"]))


@given(posture=POSTURES)
@settings(max_examples=100, deadline=None)
def test_both_references_scale_the_way_from_the_t_pose(robot: RobotModel, posture: np.ndarray) -> None:
    """Equations (2), (3) and (5) step by step."""
    for make in (virtual_mapping, reachable_mapping):
        mapping = make(robot, PERSON, REFERENCE)
        human_way = posture - mapping.ref_human
        robot_way = mapping.scale[:, None] * human_way
        assert mapping.targets(posture) == pytest.approx(mapping.ref_robot + robot_way, abs=1e-12)


def test_equation_5_by_hand() -> None:
    mapping = Mapping(np.ones((4, 3)), np.full((4, 3), 0.2), np.array([0.5, 0.25, 0.5, 0.25]))
    posture = np.tile([3.0, 1.0, 0.0], (4, 1))
    assert mapping.targets(posture)[0] == pytest.approx([1.2, 0.2, -0.3])
    assert mapping.targets(posture)[1] == pytest.approx([0.7, 0.2, -0.05])


def test_posture_of_the_robot_is_symmetric_and_as_long_as_its_limbs(robot: RobotModel) -> None:
    for name in ("zero", "stand", "calibration"):
        posture = robot_posture(robot, robot.postures[name])
        assert posture[R_HAND] == pytest.approx(posture[L_HAND] * [1.0, -1.0, 1.0], abs=2e-3)
        assert posture[R_FOOT] == pytest.approx(posture[L_FOOT] * [1.0, -1.0, 1.0], abs=2e-3)
    zero = robot_posture(robot, robot.postures["zero"])
    assert np.linalg.norm(zero[L_FOOT]) <= robot.limb_length["l_leg"] + 1e-9
    assert np.linalg.norm(zero[L_HAND]) <= robot.limb_length["l_arm"] + 1e-9
