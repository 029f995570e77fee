"""Plans on simulated servos: what stands keeps standing, what cannot stand is reported as fallen."""

from __future__ import annotations

import numpy as np
import pytest
from sim_poses import one_foot_pose

from naoimitate.core.falling import TILT_LIMIT
from naoimitate.robot import RobotModel
from naoimitate.robot.model import Array
from naoimitate.sim.placement import stand_on_floor
from naoimitate.sim.sensors import roll_pitch
from naoimitate.sim.simulate import SimResult, simulate

PERIOD = 0.01
SAG = 1e-3
"""rad that remain with compensation."""


def hold(
    robot: RobotModel, q: Array, support: str, seconds: float = 2.0, shift: float = 0.0, **options: object
) -> SimResult:
    frames = round(seconds / PERIOD)
    base_pos, base_quat = stand_on_floor(robot, q, None if support == "D" else support.lower())
    return simulate(
        robot,
        PERIOD * np.arange(frames),
        np.tile(q, (frames, 1)),
        np.tile(base_pos, (frames, 1)),
        np.tile(base_quat, (frames, 1)),
        np.full(frames, support),
        **options,
    )


def standing_postures(robot: RobotModel) -> list[str]:
    """Postures whose arms do not overlap the body; Crouch sets the foot boxes into each other."""
    return [name for name in robot.postures if name not in ("zero", "Crouch", "T_pose_ideal", "arms_down")]


@pytest.mark.parametrize("stiffness", [300.0, 150.0])
def test_every_standing_posture_stands_where_it_should_with_compensation(robot: RobotModel, stiffness: float) -> None:
    for name in standing_postures(robot):
        q = robot.postures[name]
        result = hold(robot, q, "D", stiffness=stiffness)
        assert result.survived, name
        assert np.abs(result.q[-1] - q).max() < SAG, name
        assert np.degrees(result.tilt.max()) < 0.2, name
        assert result.load[-1].sum() == pytest.approx(robot.mass * 9.81, rel=1e-3)


@pytest.mark.parametrize("stiffness", [300.0, 150.0])
def test_crouching_survives_though_the_feet_touch(nao: RobotModel, stiffness: float) -> None:
    assert hold(nao, nao.postures["Crouch"], "D", stiffness=stiffness).survived


def test_without_compensation_the_joints_sag(robot: RobotModel) -> None:
    q = robot.postures["stand"]
    sag = [np.abs(hold(robot, q, "D", stiffness=150.0, compensation=on).q[-1] - q).max() for on in (True, False)]
    assert sag[0] < 0.5 * SAG and sag[1] > 1.5 * SAG


@pytest.mark.parametrize("side", ["L", "R"])
def test_one_foot_stands_with_soft_servos(robot: RobotModel, side: str) -> None:
    q = one_foot_pose(robot, side.lower())
    for stiffness in (300.0, 150.0):
        result = hold(robot, q, side, 3.0, stiffness=stiffness)
        assert result.survived
        assert np.abs(result.q[-1] - q).max() < SAG
        assert result.swing_load.max() < 0.001
        assert result.cop_margin.min() > 0.02


def test_on_one_foot_compensation_keeps_the_hip_from_sinking(nao: RobotModel) -> None:
    q = one_foot_pose(nao, "l")
    sag = [np.abs(hold(nao, q, "L", stiffness=150.0, compensation=on).q[-1] - q).max() for on in (True, False)]
    assert sag[0] < SAG and sag[1] > 5.0 * SAG


def test_a_plan_that_leans_off_its_foot_falls(robot: RobotModel) -> None:
    """The stance ankle rolls by 0.3 rad although the plan says that nothing moves."""
    q = one_foot_pose(robot, "l")
    frames = 300
    base_pos, base_quat = stand_on_floor(robot, q, "l")
    plan = np.tile(q, (frames, 1))
    plan[100:, robot.chains["l_leg"][-1]] -= 0.3 * robot.tree.axis[robot.chains["l_leg"][-1]][0]
    result = simulate(
        robot,
        PERIOD * np.arange(frames),
        plan,
        np.tile(base_pos, (frames, 1)),
        np.tile(base_quat, (frames, 1)),
        np.full(frames, "L"),
    )
    assert not result.survived and not result.fell[:90].any() and result.fell[-1]
    assert result.tilt.max() > TILT_LIMIT or result.swing_load.max() > 0.1


def test_a_foot_that_carries_weight_in_its_swing_is_reported(robot: RobotModel) -> None:
    """A stand with both feet down, but the plan says that one is in the air."""
    result = hold(robot, robot.postures["stand"], "R", 0.5)
    assert result.swing_load.min() > 0.2 and result.fell.all()


@pytest.mark.parametrize("rate", [50.0, 120.0, 240.0])
def test_time_keeps_pace_at_every_frame_rate(nao: RobotModel, rate: float) -> None:
    """Over 2 s an arm goes down by 0.4 rad; frames need not be multiples of the integrator's step."""
    frames = round(2.0 * rate)
    q, joint = nao.postures["stand"], nao.joint("LShoulderPitch")
    base_pos, base_quat = stand_on_floor(nao, q)
    plan = np.tile(q, (frames, 1))
    plan[:, joint] += 0.2 * np.arange(frames) / rate
    result = simulate(
        nao,
        np.arange(frames) / rate,
        plan,
        np.tile(base_pos, (frames, 1)),
        np.tile(base_quat, (frames, 1)),
        np.full(frames, "D"),
    )
    assert result.q[-1, joint] == pytest.approx(plan[-1, joint] - 0.2 * 0.02, abs=1.5e-3)  # 20 ms of servo lag


def test_frames_may_be_uneven_in_time(nao: RobotModel) -> None:
    q = nao.postures["stand"]
    time = np.cumsum(np.resize([0.01, 0.004, 0.02], 60))
    base_pos, base_quat = stand_on_floor(nao, q)
    plan = [np.tile(row, (len(time), 1)) for row in (q, base_pos, base_quat)]
    result = simulate(nao, time, *plan, np.full(len(time), "D"))
    assert result.survived and len(result.q) == len(time)
    assert result.base_pos[-1] == pytest.approx(base_pos, abs=1e-3)


def test_roll_and_pitch_have_the_right_signs() -> None:
    np.testing.assert_allclose(roll_pitch(np.array([np.cos(0.1), np.sin(0.1), 0.0, 0.0])), (0.2, 0.0), atol=1e-12)
    np.testing.assert_allclose(roll_pitch(np.array([np.cos(0.1), 0.0, np.sin(0.1), 0.0])), (0.0, 0.2), atol=1e-12)
