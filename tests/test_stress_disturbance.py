"""Each disturbance changes what it names, and nothing else; the neutral one changes nothing."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
import pytest

from naoimitate.core.errors import RobotModelError
from naoimitate.hw.driver import RobotState
from naoimitate.hw.target import Target
from naoimitate.robot import RobotModel
from naoimitate.robot.model import Array
from naoimitate.sim.disturbance import PUSH_TIME, Disturbance, disturb_model, disturbed_settings
from naoimitate.sim.disturbance_line import CommandLine
from naoimitate.sim.disturbance_sensors import ANGLE_NOISE, ENCODER_NOISE, NoisySensors
from naoimitate.sim.model import torque_limits
from naoimitate.sim.physics import Physics
from naoimitate.sim.placement import stand_on_floor
from naoimitate.sim.settings import SimSettings
from naoimitate.sim.simulate import SimResult, simulate

PERIOD = 0.01


def disturbed(robot: RobotModel, disturbance: Disturbance) -> Physics:
    physics = Physics(robot, disturbed_settings(SimSettings(), disturbance))
    disturb_model(physics.model, physics.data, physics.torso, disturbance)
    return physics


def reach(robot: RobotModel, seconds: float = 1.0, **options: object) -> SimResult:
    """Both arms rise slowly from the stand."""
    frames = round(seconds / PERIOD)
    q = np.tile(robot.postures["stand"], (frames, 1))
    for arm in ("l_arm", "r_arm"):
        q[:, robot.chains[arm][0]] -= np.linspace(0.0, 0.3, frames)
    base = [np.tile(row, (frames, 1)) for row in stand_on_floor(robot, q[0])]
    return simulate(robot, PERIOD * np.arange(frames), q, *base, np.full(frames, "D"), **options)


def test_the_neutral_disturbance_is_the_plain_simulation_bit_for_bit(robot: RobotModel) -> None:
    plain, neutral = reach(robot), reach(robot, disturbance=Disturbance())
    for name in ("q", "base_pos", "base_quat", "tilt", "load", "cop_margin"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(neutral, name), name)


def test_equal_disturbances_move_the_robot_equally(nao: RobotModel) -> None:
    disturbance = Disturbance(mass=0.1, com=0.1, noise=1.0, push=0.3, push_at=0.3, tilt=0.02, seed=5)
    np.testing.assert_array_equal(*(reach(nao, disturbance=disturbance).base_pos for _ in range(2)))


def test_servos_and_friction_reach_the_model(nao: RobotModel) -> None:
    model = disturbed(nao, Disturbance(stiffness=77.0, friction=0.35)).model
    servo = model.actuator("LKneePitch")
    assert servo.gainprm[0] == 77.0 and servo.biasprm[1] == -77.0
    assert servo.biasprm[2] == pytest.approx(-77.0 * SimSettings.damping_time)
    for side in "lr":
        assert model.geom(f"{side}_sole_0").friction[0] == 0.35
    assert model.geom("floor").friction[0] == 0.35


def test_torque_limits_go_from_the_planning_limit_to_stall(nao: RobotModel) -> None:
    stall = np.array([nao.data["stall_torque"][name] for name in nao.joint_names])
    limits = {share: torque_limits(nao, SimSettings(torque_limit=share)) for share in (-0.3, 0.0, 0.5, 1.0)}
    np.testing.assert_array_equal(limits[0.0], nao.effort)
    np.testing.assert_array_equal(limits[1.0], stall)
    np.testing.assert_allclose(limits[0.5], 0.5 * (nao.effort + stall))
    np.testing.assert_allclose(limits[-0.3], 0.7 * nao.effort)
    knee = disturbed(nao, Disturbance(torque=0.5)).model.actuator("LKneePitch").forcerange
    assert knee[1] == -knee[0] == limits[0.5][nao.joint("LKneePitch")]


def test_a_robot_that_states_no_stall_torque_says_so(second_robot: RobotModel) -> None:
    assert torque_limits(second_robot, SimSettings(torque_limit=-0.5)) == pytest.approx(0.5 * second_robot.effort)
    with pytest.raises(RobotModelError, match="stall_torque"):
        torque_limits(second_robot, SimSettings(torque_limit=0.5))


def test_every_link_is_misjudged_within_its_bounds(robot: RobotModel) -> None:
    true, plain = (disturbed(robot, Disturbance(mass=0.1 * on, com=0.1 * on, seed=3)).model for on in (1, 0))
    links = np.flatnonzero(plain.body_mass > 0.0)
    factor = true.body_mass[links] / plain.body_mass[links]
    assert np.abs(factor - 1.0).max() < 0.1 and np.abs(factor - 1.0).min() > 0.0
    assert factor.min() < 0.97 and factor.max() > 1.03
    np.testing.assert_allclose(true.body_inertia[links], plain.body_inertia[links] * factor[:, None])
    shift = np.linalg.norm(true.body_ipos - plain.body_ipos, axis=1)[links]
    assert np.all(shift <= 0.1 * np.linalg.norm(plain.body_ipos[links], axis=1) + 1e-12) and shift.max() > 1e-3
    other = disturbed(robot, Disturbance(mass=0.1, seed=4)).model
    assert np.abs(other.body_mass[links] - true.body_mass[links]).max() > 1e-3


def test_misjudged_masses_weigh_on_the_feet(nao: RobotModel) -> None:
    disturbance = Disturbance(mass=0.1, com=0.1, seed=1)
    physics = disturbed(nao, disturbance)
    assert abs(physics.weight / (9.81 * nao.mass) - 1.0) > 1e-3
    load = reach(nao, disturbance=disturbance).load[-20:].sum(axis=1).mean()
    assert load == pytest.approx(physics.weight, rel=2e-3)


@pytest.mark.parametrize("heading", [0.0, 2.0, 4.0])
def test_on_a_tilted_floor_gravity_pulls_downhill(nao: RobotModel, heading: float) -> None:
    disturbance = Disturbance(tilt=0.05, tilt_heading=heading)
    physics = disturbed(nao, disturbance)
    gravity = physics.model.opt.gravity
    assert np.linalg.norm(gravity) == pytest.approx(9.81)
    assert np.arctan2(gravity[1], gravity[0]) % (2.0 * np.pi) == pytest.approx(heading)
    assert np.arccos(-gravity[2] / 9.81) == pytest.approx(0.05)
    pose = stand_on_floor(nao, nao.postures["stand"])
    physics.place(nao.postures["stand"], *pose)
    roll, pitch = NoisySensors(physics, disturbance).read(*pose).angles
    assert pitch == pytest.approx(np.arctan(np.tan(0.05) * np.cos(heading)), abs=1e-3)  # downhill ahead: nose down
    assert roll == pytest.approx(-np.arctan(np.tan(0.05) * np.sin(heading)), abs=1e-3)


def test_the_tilt_shows_in_the_load_of_the_feet(nao: RobotModel) -> None:
    downhill_left = reach(nao, disturbance=Disturbance(tilt=0.03, tilt_heading=0.5 * np.pi)).load[-1]
    assert downhill_left[0] > 1.15 * downhill_left[1]


@pytest.mark.parametrize(("delay", "samples"), [(0.0, 0), (0.02, 2), (0.025, 3), (0.05, 5)])
def test_delay_is_a_queue_of_whole_samples(delay: float, samples: int) -> None:
    line = CommandLine(delay)
    arrived = [line.through(PERIOD * frame, np.array([float(frame)]))[0] for frame in range(20)]
    assert arrived == [max(0, frame - samples) for frame in range(20)]


def test_dropped_commands_keep_the_last_one() -> None:
    line = CommandLine(0.0, dead_from=0.05, dead_time=0.1)
    arrived = [line.through(PERIOD * frame, np.array([float(frame)]))[0] for frame in range(20)]
    assert arrived == [0, 1, 2, 3, 4, *[4] * 10, 15, 16, 17, 18, 19]


def test_commands_dropped_from_the_start_leave_the_robot_in_its_first_pose() -> None:
    line = CommandLine(0.02, dead_from=0.0, dead_time=0.03)
    arrived = [line.through(PERIOD * frame, np.array([float(frame)]))[0] for frame in range(8)]
    assert arrived == [0, 0, 0, 0, 0, 3, 4, 5]


def test_delay_and_loss_show_in_the_motion(nao: RobotModel) -> None:
    joint = nao.chains["l_arm"][0]
    plain = reach(nao).q[:, joint]
    late = reach(nao, disturbance=Disturbance(delay=0.05)).q[:, joint]
    np.testing.assert_allclose(late[15:], plain[10:-5], atol=1e-4)
    lost = reach(nao, disturbance=Disturbance(drop_at=0.4, drop_time=0.2)).q[:, joint]
    assert abs(lost[58] - lost[52]) < 0.2 * abs(plain[58] - plain[52])
    np.testing.assert_allclose(lost[-5:], plain[-5:], atol=2e-3)


def test_a_push_gives_its_impulse_whatever_the_frames() -> None:
    push = Disturbance(push=0.4, push_heading=1.0, push_at=0.25)
    for frames in (40, 333):
        edges = np.linspace(0.0, 4.0, frames)
        forces = [push.push_force(a, b, 4.0) * (b - a) for a, b in itertools.pairwise(edges)]
        np.testing.assert_allclose(np.sum(forces, axis=0), [0.4 * np.cos(1.0), 0.4 * np.sin(1.0), 0.0])
    assert not push.push_force(0.5, 0.99, 4.0).any() and not push.push_force(1.0 + PUSH_TIME, 1.2, 4.0).any()


def test_a_push_moves_a_floating_robot_by_its_impulse(nao: RobotModel) -> None:
    physics = Physics(nao, SimSettings())
    physics.model.opt.gravity[:] = 0.0
    physics.place(nao.postures["stand"], np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    physics.push(np.array([6.0, 0.0, 0.0]))
    physics.advance(nao.postures["stand"], 0.05)
    mujoco.mj_forward(physics.model, physics.data)  # velocities of the links after the last step
    mujoco.mj_subtreeVel(physics.model, physics.data)
    momentum = physics.model.body_subtreemass[physics.torso] * physics.data.subtree_linvel[physics.torso]
    np.testing.assert_allclose(momentum, [0.3, 0.0, 0.0], atol=2e-3)


def test_the_driver_sees_the_noise_and_the_world_does_not(nao: RobotModel) -> None:
    states: list[RobotState] = []

    def watch(target: Target, state: RobotState) -> Array:
        states.append(state)
        return target.q

    result = reach(nao, disturbance=Disturbance(noise=1.0, seed=2), control=watch)
    quiet = reach(nao, control=lambda target, state: target.q)
    np.testing.assert_array_equal(result.q, quiet.q)
    assert len(states) > len(result.q), "it also stands before the motion"
    states = states[-len(result.q) :]
    seen = np.array([state.q for state in states])[1:] - result.q[:-1]
    assert seen.std() == pytest.approx(ENCODER_NOISE, rel=0.1)
    angles = np.array([state.angles for state in states])
    assert angles.std(axis=0) == pytest.approx(ANGLE_NOISE, rel=0.4)
    assert np.array([state.gyro for state in states]).std() > 0.01
    assert states[0].base_pos is None and not states[-1].fell


def test_a_closed_loop_takes_the_place_of_gravity_compensation(nao: RobotModel) -> None:
    """A loop that leans the body forwards by its ankles, as long as the encoders say that it has not yet leant."""
    ankles = [nao.joint(f"{side}AnklePitch") for side in "LR"]

    def lean(target: Target, state: RobotState) -> Array:
        q = target.q.copy()
        q[ankles] -= 0.05
        return q

    assert np.degrees(reach(nao, control=lean).tilt[-1]) > 2.0


def test_it_ends_when_the_robot_lies(nao: RobotModel) -> None:
    push = Disturbance(push=4.0, push_at=0.1)
    whole, short = (reach(nao, 2.0, disturbance=push, until_tipped=ended) for ended in (False, True))
    assert len(short.time) < len(whole.time) and short.fell[-1] and not short.fell[-2]
    np.testing.assert_array_equal(short.q, whole.q[: len(short.q)])
