"""Joint zeros of a specimen: kept in a file, applied by drivers, refused where they cannot be true."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from naoimitate import load_robot
from naoimitate.calib.zeros import LARGEST, JointZeros, load_zeros, no_zeros, save_zeros
from naoimitate.core.errors import CalibrationError
from naoimitate.robot.model import RobotModel

NAO = load_robot("nao", "v4")
JOINTS = len(NAO.joint_names)


def some_zeros(robot: RobotModel) -> JointZeros:
    offsets = np.random.default_rng(0).uniform(-0.1, 0.1, len(robot.joint_names)).round(6)
    for leader, follower in robot.coupled:
        offsets[follower] = offsets[leader]
    return JointZeros("Hugo", offsets)


def test_zeros_survive_their_file(robot: RobotModel, tmp_path: Path) -> None:
    zeros = some_zeros(robot)
    save_zeros(zeros, robot, tmp_path / "hugo.yaml")
    again = load_zeros(tmp_path / "hugo.yaml", robot)
    assert again.specimen == "Hugo"
    np.testing.assert_array_equal(again.offsets, zeros.offsets)


def test_a_robot_as_drawn_has_none(robot: RobotModel, tmp_path: Path) -> None:
    save_zeros(no_zeros(robot), robot, tmp_path / "z.yaml")
    q = robot.postures["stand"]
    np.testing.assert_array_equal(load_zeros(tmp_path / "z.yaml", robot).to_servos(q), q)


@given(
    arrays(np.float64, JOINTS, elements=st.floats(-LARGEST, LARGEST)),
    arrays(np.float64, JOINTS, elements=st.floats(-3, 3)),
)
def test_what_is_sent_to_the_servos_is_read_back_as_the_pose(offsets: np.ndarray, q: np.ndarray) -> None:
    zeros = JointZeros("", offsets)
    np.testing.assert_allclose(zeros.from_servos(zeros.to_servos(q)), q, atol=1e-12)
    np.testing.assert_array_equal(zeros.to_servos(np.zeros(JOINTS)), offsets)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "not a file of joint zeros"),
        ("[1, 2", "cannot be read"),
        ("format: naoimitate-subject/1\n", "not a file of joint zeros"),
        ("format: naoimitate-zeros/1\nrobot: other\n", "the robot is 'nao'"),
        ("format: naoimitate-zeros/1\nrobot: nao\nzeros_rad: [1]\n", "table"),
        ("format: naoimitate-zeros/1\nrobot: nao\nzeros_rad: {LElbow: 0.1}\n", "no joint 'LElbow'"),
        ("format: naoimitate-zeros/1\nrobot: nao\nzeros_rad: {HeadYaw: 2.0}\n", "HeadYaw"),
        ("format: naoimitate-zeros/1\nrobot: nao\nzeros_rad: {HeadYaw: .nan}\n", "HeadYaw"),
        ("format: naoimitate-zeros/1\nrobot: nao\nzeros_rad: {HeadYaw: much}\n", "HeadYaw"),
        ("format: naoimitate-zeros/1\nrobot: nao\nzeros_rad: {HeadYaw: true}\n", "HeadYaw"),
        ("format: naoimitate-zeros/1\nrobot: nao\nzeros_rad: {LHipYawPitch: 0.01}\n", "one motor"),
    ],
)
def test_a_file_that_cannot_be_true_is_one_clear_line(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "zeros.yaml"
    path.write_text(text)
    with pytest.raises(CalibrationError, match=says) as caught:
        load_zeros(path, NAO)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="no such file"):
        load_zeros(tmp_path / "none.yaml", NAO)
    with pytest.raises(CalibrationError, match="cannot be read"):
        load_zeros(tmp_path, NAO)
