"""The MuJoCo model is the robot of the URDF: masses, motors, limits, soles, shapes, sensors."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from naoimitate.core.errors import RobotModelError
from naoimitate.core.geometry import convex_hull, polygon_margin
from naoimitate.robot import RobotModel, load_robot
from naoimitate.robot.kernel import center_of_mass, forward
from naoimitate.sim.contacts import OUTLINE_TOLERANCE, carrying_corners
from naoimitate.sim.model import build_model
from naoimitate.sim.physics import Physics
from naoimitate.sim.placement import stand_on_floor
from naoimitate.sim.settings import SimSettings

REST = (0.0, 0.0, 9.81)


@pytest.mark.parametrize("version", ["v4", "v5", "v6"])
def test_masses_are_those_of_every_version(version: str) -> None:
    robot = load_robot("nao", version)
    model = build_model(robot)
    assert model.body_mass.sum() == pytest.approx(robot.mass, abs=1e-9)
    for index, name in enumerate(robot.joint_names):
        body = model.jnt_bodyid[model.joint(name).id]
        assert model.body_subtreemass[body] == pytest.approx(_mass_beyond(robot, index), abs=1e-9)


def _mass_beyond(robot: RobotModel, joint: int) -> float:
    return float(robot.tree.mass[1:][robot.tree.ancestor[:, joint]].sum())


def test_masses_and_joints_of_the_second_robot(second_robot: RobotModel) -> None:
    model = build_model(second_robot)
    assert model.body_mass.sum() == pytest.approx(second_robot.mass, abs=1e-9)
    assert model.nu == len(second_robot.joint_names) and model.neq == 0


def test_centre_of_mass_agrees_with_the_kernel(robot: RobotModel) -> None:
    physics = Physics(robot, SimSettings())
    rng = np.random.default_rng(1)
    pos, rot = np.zeros((len(robot.joint_names) + 1, 3)), np.zeros((len(robot.joint_names) + 1, 3, 3))
    com = np.zeros(3)
    for _ in range(20):
        q = rng.uniform(robot.lower, robot.upper)
        physics.place(q, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
        forward(robot.tree, q, pos, rot)
        center_of_mass(robot.tree, pos, rot, com)
        np.testing.assert_allclose(physics.data.subtree_com[0], com, atol=1e-7)


def test_one_motor_moves_both_hip_yaw_pitch_joints(nao: RobotModel) -> None:
    model = build_model(nao)
    servos = {model.actuator(index).name for index in range(model.nu)}
    followers = {nao.joint_names[follower] for _, follower in nao.coupled}
    assert servos - {"l_fingers", "r_fingers"} == set(nao.joint_names) - followers
    physics = Physics(nao, SimSettings())
    stand = nao.postures["stand"]
    physics.place(stand, *stand_on_floor(nao, stand))
    leader, follower = nao.coupled[0]
    command = stand.copy()
    command[leader] -= 0.2
    physics.advance(command, 1.0)
    assert physics.q[leader] == pytest.approx(command[leader], abs=0.01)
    assert physics.q[follower] == pytest.approx(physics.q[leader], abs=1e-3)


def test_servos_stop_at_the_torque_limit(nao: RobotModel) -> None:
    stand = nao.postures["stand"]
    joint = nao.joint("LShoulderPitch")
    for limit, ceiling in (("effort", nao.effort), ("stall", nao.data["stall_torque"]["LShoulderPitch"])):
        physics = Physics(nao, SimSettings(torque_limit=limit))  # type: ignore[arg-type]
        physics.place(stand, *stand_on_floor(nao, stand))
        command = stand.copy()
        command[joint] -= 1.0
        physics.advance(command, 0.002)
        assert physics.torque[joint] == pytest.approx(-np.broadcast_to(ceiling, stand.shape)[joint])


def test_a_robot_without_stall_torques_says_so(second_robot: RobotModel) -> None:
    with pytest.raises(RobotModelError, match="stall_torque"):
        build_model(second_robot, SimSettings(torque_limit="stall"))


def test_the_carrying_corners_are_the_outline_within_a_millimetre_and_never_more(robot: RobotModel) -> None:
    for outline in robot.soles.values():
        corners = carrying_corners(outline)
        assert 4 <= len(corners) <= len(outline)
        hull = convex_hull(corners)
        assert min(polygon_margin(hull, *point) for point in outline) >= -OUTLINE_TOLERANCE - 1e-9
        assert min(polygon_margin(convex_hull(outline), *corner) for corner in corners) >= -1e-9


def test_only_the_robots_own_pairs_of_shapes_can_touch(robot: RobotModel) -> None:
    model = build_model(robot)
    pairs = {frozenset((int(a), int(b))) for a, b in zip(model.pair_geom1, model.pair_geom2, strict=True)}
    names = [shape.name for shape in robot.shapes]
    assert pairs == {frozenset((model.geom(names[a]).id, model.geom(names[b]).id)) for a, b in robot.pairs}
    body = np.array([model.geom(name).id for name in names])
    assert not (model.geom_contype[body][:, None] & model.geom_conaffinity[body]).any()


def test_an_upright_robot_at_rest_reads_gravity_upwards_and_its_weight_under_the_feet(robot: RobotModel) -> None:
    physics = Physics(robot, SimSettings())
    stand = robot.postures["stand"]
    physics.place(stand, *stand_on_floor(robot, stand))
    physics.advance(stand, 1.5)
    np.testing.assert_allclose(physics.accelerometer, REST, atol=0.2)
    np.testing.assert_allclose(physics.gyro, 0.0, atol=0.01)
    assert physics.fsr.sum() == pytest.approx(robot.mass * 9.81, rel=1e-3)
    assert (physics.fsr > 0.0).all()


def test_the_force_sensors_tell_front_from_rear_and_left_from_right(nao: RobotModel) -> None:
    """Columns are those of FSR_NAMES. Ankle pitch leans the body over flat soles; ankle roll cannot (the legs are a
    parallelogram), it presses the edges of the soles down."""
    stand = nao.postures["stand"]
    loads = {}
    for edge, ankle, angle in (
        ("front", "AnklePitch", -0.1),
        ("rear", "AnklePitch", 0.1),
        ("left", "AnkleRoll", -0.02),
        ("right", "AnkleRoll", 0.02),
    ):
        physics = Physics(nao, SimSettings())
        physics.place(stand, *stand_on_floor(nao, stand))
        command = stand.copy()
        for side in "LR":
            command[nao.joint(f"{side}{ankle}")] += angle
        physics.advance(command, 1.5)
        loads[edge] = physics.fsr.sum(axis=0)
    columns = {"front": [0, 1], "rear": [2, 3], "left": [0, 2], "right": [1, 3]}
    for edge, opposite in (("front", "rear"), ("rear", "front"), ("left", "right"), ("right", "left")):
        assert loads[edge][columns[edge]].sum() > 1.5 * loads[edge][columns[opposite]].sum(), edge


def test_the_head_cameras_look_forward_and_down_by_their_pitch(nao: RobotModel) -> None:
    model = build_model(nao)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for name, camera in nao.data["cameras"].items():
        right, up, back = data.camera(name).xmat.reshape(3, 3).T
        np.testing.assert_allclose(right, (0.0, -1.0, 0.0), atol=1e-9)
        np.testing.assert_allclose(-back, (np.cos(camera["pitch"]), 0.0, -np.sin(camera["pitch"])), atol=1e-9)
        assert up[2] > 0.0
