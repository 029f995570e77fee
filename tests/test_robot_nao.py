"""NAO's own URDF and data reproduce the published check values in every version."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yaml
from pinocchio_oracle import Oracle

from naoimitate.robot import RobotModel, load_robot
from naoimitate.robot.kernel import center_of_mass, forward
from naoimitate.robot.model import Array

CHECKS: dict[str, Any] = yaml.safe_load((Path(__file__).parent / "data" / "nao_checks.yaml").read_text())
LENGTH, MASS, TORQUE = (CHECKS["tolerance"][key] for key in ("length", "mass", "torque"))
ROUNDING = 1.1e-5
"""The values are given to five decimals; m and rad."""


@pytest.fixture(scope="module", params=["v4", "v5", "v6"])
def version(request: pytest.FixtureRequest) -> RobotModel:
    return load_robot("nao", request.param)


def posture(model: RobotModel, name: str) -> Array:
    if name in model.postures:
        return model.postures[name]
    q = np.zeros(len(model.joint_names))
    for joint, angle in CHECKS[name].items():
        q[model.joint(joint)] = angle
    return q


class Pose:
    """Frames of a posture in the torso frame."""

    def __init__(self, model: RobotModel, name: str) -> None:
        self.model, self.q = model, posture(model, name)
        self.pos, self.rot = np.empty((25, 3)), np.empty((25, 3, 3))
        forward(model.tree, self.q, self.pos, self.rot)
        self.com = np.empty(3)
        center_of_mass(model.tree, self.pos, self.rot, self.com)

    def on(self, joint: int, offset: Any) -> Array:
        return np.asarray(self.pos[joint + 1] + self.rot[joint + 1] @ np.asarray(offset))

    def point(self, name: str) -> Array:
        if name == "head_top":
            return self.on(self.model.joint("HeadPitch"), [0.0, 0.0, 0.1136])
        if name == "top_camera":
            return self.on(self.model.joint("HeadPitch"), self.model.data["cameras"]["top"]["at"])
        return self.on(self.model.points[name].joint, self.model.points[name].offset)

    def rotation(self, name: str) -> Array:
        return np.asarray(self.rot[self.model.points[name].joint + 1])


def test_total_mass(version: RobotModel) -> None:
    assert version.mass == pytest.approx(CHECKS["total_mass"][version.version], abs=MASS)


@pytest.mark.parametrize("name", CHECKS["com_in_torso"])
def test_center_of_mass_in_the_torso(version: RobotModel, name: str) -> None:
    expected = CHECKS["com_in_torso"][name][version.version]
    np.testing.assert_allclose(Pose(version, name).com, expected, atol=ROUNDING)


@pytest.mark.parametrize("name", CHECKS["com_in_left_sole"])
def test_center_of_mass_above_the_left_sole(version: RobotModel, name: str) -> None:
    pose = Pose(version, name)
    com = pose.rotation("l_sole").T @ (pose.com - pose.point("l_sole"))
    np.testing.assert_allclose(com, CHECKS["com_in_left_sole"][name][version.version], atol=2.0 * ROUNDING)


@pytest.mark.parametrize("name", CHECKS["torso_in_left_sole"])
def test_torso_above_the_left_sole(nao: RobotModel, name: str) -> None:
    pose, expected = Pose(nao, name), CHECKS["torso_in_left_sole"][name]
    turn = pose.rotation("l_sole").T
    np.testing.assert_allclose(turn @ -pose.point("l_sole"), expected["xyz"], atol=ROUNDING)
    np.testing.assert_allclose(pin.rpy.matrixToRpy(turn), expected["rpy"], atol=ROUNDING)


@pytest.mark.parametrize("name", CHECKS["frames_in_torso"])
def test_hands_wrists_elbows_soles_and_head_in_the_torso(nao: RobotModel, name: str) -> None:
    pose = Pose(nao, name)
    for point, expected in CHECKS["frames_in_torso"][name].items():
        np.testing.assert_allclose(pose.point(point), expected, atol=ROUNDING, err_msg=point)


@pytest.mark.parametrize("name", CHECKS["sole_rpy_in_torso"])
def test_sole_orientation_in_the_torso(nao: RobotModel, name: str) -> None:
    pose = Pose(nao, name)
    for point, expected in CHECKS["sole_rpy_in_torso"][name].items():
        np.testing.assert_allclose(pin.rpy.matrixToRpy(pose.rotation(point)), expected, atol=ROUNDING, err_msg=point)


def test_centroidal_inertia_at_zero(version: RobotModel) -> None:
    oracle = Oracle(version)
    q = oracle.configuration(version.postures["zero"])
    pin.ccrba(oracle.model, oracle.data, q, np.zeros(oracle.model.nv))
    np.testing.assert_allclose(
        np.diag(oracle.data.Ig.inertia), CHECKS["centroidal_inertia_zero"][version.version], atol=ROUNDING
    )


@pytest.mark.parametrize("name", CHECKS["gravity_torque_torso_fixed_v5"])
def test_gravity_torques_with_the_torso_held(name: str) -> None:
    model = load_robot("nao", "v5")
    oracle = Oracle(model)
    torque = pin.computeGeneralizedGravity(oracle.model, oracle.data, oracle.configuration(posture(model, name)))
    for joint, expected in CHECKS["gravity_torque_torso_fixed_v5"][name].items():
        assert torque[oracle.columns[model.joint(joint)]] == pytest.approx(expected, abs=TORQUE), joint


def test_right_side_is_the_mirror_image_of_the_left(version: RobotModel) -> None:
    links = {link.get("name", ""): link for link in ElementTree.fromstring(version.urdf).findall("link")}
    sided = [name for name in links if name.startswith("l_")]
    assert len(sided) == 13
    for name in sided:
        left, right = links[name], links["r_" + name[2:]]
        for tag in ("inertial", "collision", "visual"):
            for a, b in zip(left.findall(tag), right.findall(tag), strict=True):
                assert attributes(b) == mirrored(attributes(a)), name


def attributes(element: ElementTree.Element) -> dict[str, list[float]]:
    return {
        f"{child.tag}.{key}": [float(x) + 0.0 for x in value.split()]
        for child in element.iter()
        for key, value in child.attrib.items()
        if key != "name"
    }


def mirrored(values: dict[str, list[float]]) -> dict[str, list[float]]:
    def flip(key: str, v: list[float]) -> list[float]:
        if key == "origin.xyz":
            return [v[0], 0.0 - v[1], v[2]]
        if key == "origin.rpy":
            return [0.0 - v[0], v[1], 0.0 - v[2]]
        return [0.0 - v[0]] if key in ("inertia.ixy", "inertia.iyz") else v

    return {key: flip(key, value) for key, value in values.items()}


def test_a_joint_range_that_is_not_mirrored_differs_by_less_than_a_degree(nao: RobotModel) -> None:
    for left in (name for name in nao.joint_names if name.startswith("L")):
        i, j = nao.joint(left), nao.joint("R" + left[1:])
        one, other = (nao.lower[i], nao.upper[i]), (nao.lower[j], nao.upper[j])
        assert np.allclose(one, other, atol=0.0175) or np.allclose(one, (-other[1], -other[0]), atol=0.0175), left


def test_both_hip_yaw_pitch_joints_are_one_motor(nao: RobotModel) -> None:
    assert nao.coupled == ((nao.joint("LHipYawPitch"), nao.joint("RHipYawPitch")),)


def test_joint_order_is_that_of_the_body_without_hands(nao: RobotModel) -> None:
    assert nao.joint_names[:8] == (
        "HeadYaw", "HeadPitch", "LShoulderPitch", "LShoulderRoll", "LElbowYaw", "LElbowRoll", "LWristYaw",
        "LHipYawPitch",
    )  # fmt: skip
    assert nao.joint_names[13] == "RHipYawPitch" and nao.joint_names[19] == "RShoulderPitch"
    assert len(nao.joint_names) == 24


def test_versions_differ_in_motors_where_the_data_sheets_do() -> None:
    v4, v5, v6 = (load_robot("nao", name) for name in ("v4", "v5", "v6"))
    assert np.array_equal(v4.speed, v5.speed)
    changed = {v4.joint_names[j] for j in np.flatnonzero(v4.speed != v6.speed)}
    legs = ("HipYawPitch", "HipRoll", "HipPitch", "KneePitch", "AnklePitch", "AnkleRoll")
    assert changed == {side + joint for side in "LR" for joint in ("ShoulderPitch", *legs)}
    assert v4.speed[v4.joint("RKneePitch")] == 6.643 and v6.speed[v6.joint("RKneePitch")] == 6.963
    assert v4.data["stall_torque"]["RKneePitch"] == v4.data["stall_torque"]["LKneePitch"] == 8.505


@pytest.mark.parametrize("name", ["stand", "calibration"])
def test_stance_is_flat_upright_and_balanced_in_the_middle(nao: RobotModel, name: str) -> None:
    pose = Pose(nao, name)
    left, right = pose.point("l_sole"), pose.point("r_sole")
    np.testing.assert_allclose(pose.rotation("l_sole"), np.eye(3), atol=1e-9)
    np.testing.assert_allclose(pose.rotation("r_sole"), np.eye(3), atol=1e-9)
    np.testing.assert_allclose(left - right, [0.0, 0.1, 0.0], atol=1e-9)
    middle = 0.5 * (left[:2] + centroid(nao.soles["l"]) + right[:2] + centroid(nao.soles["r"]))
    np.testing.assert_allclose(pose.com[:2], middle, atol=2e-5)
    assert nao.postures[name][nao.joint("LKneePitch")] == pytest.approx(0.3)


def test_calibration_holds_the_arms_of_the_t_pose(nao: RobotModel) -> None:
    arms = [*nao.chains["l_arm"], *nao.chains["r_arm"]]
    assert np.array_equal(nao.postures["calibration"][arms], nao.postures["T_pose_frontal_plane"][arms])


def centroid(outline: Array) -> Array:
    """Centroid of a polygon (shoelace formula)."""
    following = np.roll(outline, -1, axis=0)
    cross = outline[:, 0] * following[:, 1] - following[:, 0] * outline[:, 1]
    return np.asarray((outline + following).T @ cross / (3.0 * cross.sum()))


def test_sole_outlines_mirror_each_other_and_keep_their_area(nao: RobotModel) -> None:
    left, right = nao.soles["l"], nao.soles["r"]
    np.testing.assert_allclose(right[::-1], left * [1.0, -1.0])
    np.testing.assert_allclose(centroid(left), [0.0223, 0.0053], atol=5e-5)
