"""The zero-moment point is where mechanics says it is, and where the simulated floor pushes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from pinocchio_oracle import Oracle
from scipy.integrate import solve_ivp
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation
from synthetic import of_poses, standing

from naoimitate.core.physics import GRAVITY
from naoimitate.motion.builtin import builtin_motion
from naoimitate.robot import RobotModel
from naoimitate.robot.model import Array
from naoimitate.run.file import Run
from naoimitate.run.measure import Measure
from naoimitate.run.recorded import imitate
from naoimitate.run.replay import frames, replay
from naoimitate.run.scores import score_run
from naoimitate.run.zmp import BANDWIDTH, SMOOTHING, WINDOW, derivatives, zero_moment_point, zmp_margins, zmp_of
from naoimitate.sim.simulate import SimResult, simulate

RATE = 100.0
EVEN = np.arange(0.0, 0.5, 1.0 / RATE)
UNEVEN = np.concatenate([[0.0], np.cumsum(np.random.default_rng(3).uniform(0.004, 0.016, 50))])
CLOCKS = pytest.mark.parametrize("time", [EVEN, UNEVEN], ids=["even", "uneven"])
ASIDE = Rotation.from_euler("z", 0.6)
"""So that x and y both matter."""
EDGE = np.array([0.3, -0.2, 0.0])


def toppling(time: Array, mass: float, arm: float, inertia: float) -> Array:
    """Angle from upright (T,) rad of a body that falls about a pivot: inertia there kg m^2, arm m to its centre."""

    def rates(_: float, state: Array) -> list[float]:
        return [state[1], mass * GRAVITY * arm / inertia * float(np.sin(state[0]))]

    return np.asarray(solve_ivp(rates, (0.0, time[-1]), [0.1, 0.0], t_eval=time, rtol=1e-9, atol=1e-12).y[0])


def of_one_body(time: Array, mass: float, inertia: Array, centre: Array, turns: Rotation) -> Array:
    """Zero-moment points (T, 2) of one body; inertia (3, 3), centre (T, 3) m, turns (T,)."""
    return zero_moment_point(time, np.array([mass]), inertia[None], centre[:, None], turns.as_matrix()[:, None])


def known(points: Array) -> Array:
    return points[np.isfinite(points[:, 0])]


def measures(run: Run, robot: RobotModel) -> dict[str, Measure]:
    return {measure.key: measure for measure in score_run(run, robot)}


@CLOCKS
def test_a_point_mass_that_falls_with_its_rod_pushes_on_the_pivot(time: Array) -> None:
    mass, length = 2.0, 0.5
    angle = toppling(time, mass, length, mass * length**2)
    centre = EDGE + ASIDE.apply(length * np.column_stack([np.sin(angle), 0.0 * angle, np.cos(angle)]))
    points = of_one_body(time, mass, np.zeros((3, 3)), centre, Rotation.identity(len(time)))
    assert angle[-1] > 0.4
    np.testing.assert_allclose(known(points), np.tile(EDGE[:2], (len(known(points)), 1)), atol=1e-3)


@CLOCKS
def test_a_box_that_falls_over_its_edge_pushes_on_the_edge(time: Array) -> None:
    mass, wide, high = 3.0, 0.2, 0.6
    inertia = mass / 12.0 * np.diag([wide**2 + high**2, wide**2 + high**2, 2.0 * wide**2])
    arm = 0.5 * np.hypot(wide, high)
    angle = toppling(time, mass, arm, inertia[1, 1] + mass * arm**2)
    turns = ASIDE * Rotation.from_rotvec(np.multiply.outer(angle - np.arctan2(wide, high), [0.0, 1.0, 0.0]))
    centre = EDGE + turns.apply([0.5 * wide, 0.0, 0.5 * high])
    points = known(of_one_body(time, mass, inertia, centre, turns))
    np.testing.assert_allclose(points, np.tile(EDGE[:2], (len(points), 1)), atol=1e-3)
    as_point = known(of_one_body(time, mass, 0.0 * inertia, centre, turns))
    assert np.linalg.norm(as_point - EDGE[:2], axis=1).max() > 0.02


def test_a_body_that_tumbles_freely_on_a_needle_under_its_centre_pushes_on_the_needle() -> None:
    """Torque-free rotation: the angular momentum stays, though velocity and inertia in the world do not."""
    inertia, time = np.diag([0.01, 0.02, 0.025]), np.arange(0.0, 2.0, 0.005)

    def rates(_: float, state: Array) -> Array:
        w = state[4:]
        turn = 0.5 * (Rotation.from_quat(state[:4]).as_quat()[3] * w + np.cross(state[:3], w))
        return np.concatenate([turn, [-0.5 * state[:3] @ w], np.linalg.solve(inertia, -np.cross(w, inertia @ w))])

    state = solve_ivp(rates, (0.0, 2.0), [0.0, 0.0, 0.0, 1.0, 0.3, 3.0, 0.3], t_eval=time, rtol=1e-9, atol=1e-12).y
    centre = np.tile([0.1, 0.2, 0.5], (len(time), 1))
    points = known(of_one_body(time, 1.0, inertia, centre, Rotation.from_quat(state[:4].T)))
    np.testing.assert_allclose(points, np.tile([0.1, 0.2], (len(points), 1)), atol=2e-4)


def test_what_falls_freely_has_no_zero_moment_point() -> None:
    centre = np.column_stack([EVEN, 0.0 * EVEN, 3.0 - 0.5 * GRAVITY * EVEN**2])
    assert np.isnan(of_one_body(EVEN, 1.0, np.eye(3), centre, Rotation.identity(len(EVEN)))).all()


def test_in_a_static_pose_it_is_the_projection_of_the_centre_of_mass(robot: RobotModel) -> None:
    run = standing(robot, 60)
    poses = frames(run, robot)
    points = zmp_of(robot, run.time, poses)
    assert np.isfinite(points[:, 0]).sum() == 60 - 2 * round(WINDOW * RATE)
    np.testing.assert_allclose(known(points), np.tile(poses.com[0, :2], (len(known(points)), 1)), atol=1e-9)
    sheet = measures(run, robot)
    assert sheet["zmp_margin_min_mm"].value == pytest.approx(sheet["margin_min_mm"].value, abs=1e-6)
    assert sheet["zmp_outside_frames"].value == 0 and sheet["sim_zmp_margin_min_mm"].value is None


def test_every_link_and_its_inertia_count(robot: RobotModel) -> None:
    """All joints and the torso swing at once; pinocchio's inverse dynamics says what the floor must give."""
    time, rng = np.arange(0.0, 3.0, 1.0 / RATE), np.random.default_rng(1)
    speed, phase = rng.uniform(2.0, 5.0, (2, len(robot.joint_names) + 6))
    swing = np.sin(np.multiply.outer(time, speed) + phase)
    q = robot.postures["stand"] + 0.25 * swing[:, 6:]
    base = np.array([0.0, 0.0, 0.35]) + 0.03 * swing[:, :3]
    turns = Rotation.from_rotvec(0.15 * swing[:, 3:6]).as_quat()
    points = zmp_of(robot, time, replay(robot, q, base, np.roll(turns, 1, axis=1)))
    oracle = Oracle(robot)

    def configuration(moment: float) -> Array:
        at = np.sin(moment * speed + phase)
        full = oracle.configuration(robot.postures["stand"] + 0.25 * at[6:])
        full[:3] = [0.0, 0.0, 0.35] + 0.03 * at[:3]
        full[3:7] = Rotation.from_rotvec(0.15 * at[3:6]).as_quat()
        return full

    def wanted(moment: float, h: float = 1e-4) -> Array:
        """From the wrench on the torso, taken to the world's origin."""
        before, here, after = (configuration(moment + step) for step in (-h, 0.0, h))
        slow, fast = (pin.difference(oracle.model, *pair) / h for pair in ((before, here), (here, after)))
        pin.rnea(oracle.model, oracle.data, here, 0.5 * (slow + fast), (fast - slow) / h)
        pin.forwardKinematics(oracle.model, oracle.data, here)
        wrench = oracle.data.oMi[1].act(oracle.data.f[1])
        return np.array([-wrench.angular[1], wrench.angular[0]]) / wrench.linear[2]

    for frame in range(20, 280, 13):
        np.testing.assert_allclose(points[frame], wanted(float(time[frame])), atol=1e-3)


def test_derivatives_are_exact_for_parabolas_and_damp_what_is_faster_than_the_bandwidth() -> None:
    once, twice, whole = derivatives(UNEVEN)
    values = 2.0 + 3.0 * UNEVEN - 4.0 * UNEVEN**2
    np.testing.assert_allclose((once @ values)[whole], (3.0 - 8.0 * UNEVEN)[whole], atol=1e-9)
    np.testing.assert_allclose((twice @ values)[whole], -8.0, atol=1e-7)
    time = np.arange(0.0, 2.0, 0.005)
    once, twice, whole = derivatives(time)
    for frequency, share in ((0.5, 1.0), (BANDWIDTH, 0.5**0.5), (4.0 * BANDWIDTH, 0.0)):
        circular = 2.0 * np.pi * frequency
        kept = (twice @ np.sin(circular * time))[whole] / circular**2
        assert np.abs(kept).max() == pytest.approx(share, abs=0.03)


def test_a_run_that_is_too_short_or_has_gaps_is_not_measured_there(nao: RobotModel) -> None:
    short = standing(nao, 10)
    assert measures(short, nao)["zmp_margin_min_mm"].value is None
    assert measures(short, nao)["zmp_outside_frames"].value is None
    gap = standing(nao, 100)
    time = gap.time + np.where(np.arange(100) >= 50, 1.0, 0.0)
    assert np.isfinite(zmp_margins(nao, dataclasses.replace(gap, time=time), frames(gap, nao))[15:40]).all()


def test_a_torso_that_is_thrown_sideways_has_its_zero_moment_point_outside(nao: RobotModel) -> None:
    """The centre of mass stays well inside: only the acceleration tells."""
    run = standing(nao, 200)
    base = run.base_pos + np.multiply.outer(0.02 * np.sin(12.0 * run.time), [0.0, 1.0, 0.0])
    thrown = of_poses(nao, run.q, base, run.base_quat)
    soles = frames(run, nao).soles
    shaken = dataclasses.replace(frames(thrown, nao), soles=soles)
    margin = zmp_margins(nao, thrown, shaken)
    assert np.nanmin(shaken.margins(run.support)) > 0.03
    assert np.nanmin(margin) < np.nanmin(shaken.margins(run.support)) - 0.03


def simulated(name: str, robot: RobotModel, **options: float) -> tuple[Run, SimResult, Array]:
    """A built-in motion on simulated servos, and the margin (T,) m of its zero-moment point."""
    run = imitate(builtin_motion(name), robot, **options)
    result = simulate(robot, run.time, run.q, run.base_pos, run.base_quat, run.support)
    moved = {"sim_q": result.q, "sim_base_pos": result.base_pos, "sim_base_quat": result.base_quat}
    margin = zmp_margins(robot, run, replay(robot, *moved.values()))
    return dataclasses.replace(run, **moved, sim_fell=not result.survived), result, margin


def test_on_quiet_feet_it_is_the_centre_of_pressure_of_the_simulated_soles(nao: RobotModel) -> None:
    run, result, margin = simulated("wave", nao, start=1.5, end=8.0)
    inside = np.isfinite(margin)
    pressed = gaussian_filter1d(result.cop_margin, SMOOTHING * RATE)
    assert np.abs(margin - pressed)[inside].max() < 0.5e-3
    assert measures(run, nao)["sim_zmp_margin_min_mm"].value == pytest.approx(1e3 * margin[inside].min())


def test_it_is_the_centre_of_pressure_within_millimetres_through_a_lift_off(nao: RobotModel) -> None:
    """Weight to the left, right foot up, lean, hold. While the sole rings after the lift-off they differ most."""
    run, result, margin = simulated("paper", nao, start=3.0, end=12.0)
    assert result.survived and "L" in run.support
    apart = np.abs(margin - result.cop_margin)[np.isfinite(margin)]
    assert np.median(apart) < 0.2e-3 and np.percentile(apart, 95) < 2e-3 and np.percentile(apart, 99) < 5e-3
