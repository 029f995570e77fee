"""The score of the simulated force sensors: where they can tell the centre of pressure it is that, else it says so."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from synthetic import standing

from naoimitate.core.physics import GRAVITY
from naoimitate.hw.force_sensors import sensor_places
from naoimitate.motion.builtin import builtin_motion
from naoimitate.robot import RobotModel
from naoimitate.robot.model import Array
from naoimitate.run.file import Run
from naoimitate.run.measure import Value
from naoimitate.run.pressure import at_the_edge, pressure, sensed_pressure
from naoimitate.run.recorded import imitate
from naoimitate.run.replay import frames, moved
from naoimitate.sim.force_sensors import shares_of
from naoimitate.sim.simulate import simulate

KEYS = ("sim_cop_margin_min_mm", "sim_cop_margin_p01_mm", "sim_cop_edge_frames")


def scores(run: Run, robot: RobotModel) -> dict[str, Value]:
    return {measure.key: measure.value for measure in pressure(run, robot, moved(run, robot))}


def pressed(robot: RobotModel, run: Run, left: Array, right: Array, share: float = 1.0) -> Run:
    """A run whose robot stood as commanded, each foot pressing with half of its weight at a place of its sole."""
    force = 0.5 * share * robot.mass * GRAVITY
    feet = [force * shares_of(places, at) for places, at in zip(sensor_places(robot), (left, right), strict=True)]
    return dataclasses.replace(
        run,
        sim_q=run.q, sim_base_pos=run.base_pos, sim_base_quat=run.base_quat, sim_fell=False,
        sim_fsr=np.tile(np.array(feet), (len(run), 1, 1)),
    )  # fmt: skip


def test_a_robot_that_stands_presses_where_its_centre_of_mass_is(robot: RobotModel) -> None:
    run = standing(robot, 60)
    stood = simulate(robot, run.time, run.q, run.base_pos, run.base_quat, run.support)
    run = dataclasses.replace(
        run,
        sim_q=stood.q,
        sim_base_pos=stood.base_pos,
        sim_base_quat=stood.base_quat,
        sim_fsr=stood.fsr,
        sim_fell=False,
    )
    poses = frames(run, robot)
    point = sensed_pressure(robot, stood.fsr, poses)
    np.testing.assert_allclose(point, poses.com[:, :2], atol=1e-3)
    values = scores(run, robot)
    least = 1e3 * poses.margins(run.support).min()
    assert values["sim_cop_margin_min_mm"] == pytest.approx(least, abs=1.0)
    assert values["sim_cop_margin_p01_mm"] == pytest.approx(least, abs=1.0)
    assert values["sim_cop_edge_frames"] == 0


def test_pressure_beyond_the_sensors_seems_to_be_on_their_edge_and_is_counted(nao: RobotModel) -> None:
    toes = np.array([0.09, 0.0])
    run = pressed(nao, standing(nao, 10), toes, toes)
    assert at_the_edge(nao, run.sim_fsr).all()
    values = scores(run, nao)
    inner = sensor_places(nao)[:, 0, 0].min()
    front = min(nao.soles[side][:, 0].max() for side in "lr")
    assert values["sim_cop_margin_min_mm"] == pytest.approx(1e3 * (front - inner), abs=3.0)
    assert values["sim_cop_margin_min_mm"] > 1e3 * (front - toes[0])
    assert values["sim_cop_edge_frames"] == 10


def test_a_foot_that_hardly_carries_does_not_count_at_its_edge(nao: RobotModel) -> None:
    run = pressed(nao, standing(nao, 10), np.zeros(2), np.array([0.09, 0.0]))
    assert at_the_edge(nao, run.sim_fsr).all()
    assert not at_the_edge(nao, run.sim_fsr * [[[1.9], [0.1]]]).any()


def test_feet_in_the_air_or_hardly_on_the_floor_are_not_scored(nao: RobotModel) -> None:
    run = pressed(nao, standing(nao, 10), np.zeros(2), np.zeros(2))
    assert scores(run, nao)["sim_cop_margin_min_mm"] > 0.0
    for share in (0.0, 0.05):
        light = dataclasses.replace(run, sim_fsr=share * run.sim_fsr)
        assert scores(light, nao) == dict.fromkeys(KEYS)
    hop = np.where(np.arange(10)[:, None, None] < 5, run.sim_fsr, 0.0)
    assert np.isnan(sensed_pressure(nao, hop, frames(run, nao))[5:]).all()
    assert scores(dataclasses.replace(run, sim_fsr=hop), nao) == scores(run, nao)


def test_a_foot_that_should_be_in_the_air_and_carries_moves_the_pressure_out_of_the_other(nao: RobotModel) -> None:
    run = pressed(nao, standing(nao, 10, support=np.full(10, "L")), np.zeros(2), np.zeros(2))
    assert scores(run, nao)["sim_cop_margin_min_mm"] < 0.0


def test_a_run_without_simulation_or_of_an_older_program_has_no_such_score(nao: RobotModel) -> None:
    run = standing(nao, 10)
    assert scores(run, nao) == dict.fromkeys(KEYS)
    older = pressed(nao, run, np.zeros(2), np.zeros(2))
    assert scores(dataclasses.replace(older, sim_fsr=None), nao) == dict.fromkeys(KEYS)


def test_through_a_lift_off_it_is_the_true_pressure_but_for_few_frames_that_are_counted(nao: RobotModel) -> None:
    """Weight to the left, right foot up, lean, hold; the contacts themselves say what is true."""
    run = imitate(builtin_motion("paper"), nao, start=3.0, end=12.0)
    result = simulate(nao, run.time, run.q, run.base_pos, run.base_quat, run.support)
    run = dataclasses.replace(
        run, sim_q=result.q, sim_base_pos=result.base_pos, sim_base_quat=result.base_quat, sim_fsr=result.fsr
    )
    poses = moved(run, nao)
    assert poses is not None and "L" in run.support
    margin = poses.margins(run.support, sensed_pressure(nao, result.fsr, poses))
    edge = at_the_edge(nao, result.fsr)
    assert np.isfinite(margin).all() and edge.mean() < 0.1
    assert np.abs(margin - result.cop_margin)[~edge].max() < 1e-3
