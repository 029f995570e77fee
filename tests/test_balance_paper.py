"""Retargeting as published: the solve of both soles, and the robot stable, flat and live whatever the person does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from people import person, tpose

from naoimitate.balance.legs import LegLimits, Legs, build_legs
from naoimitate.balance.paper import PaperIk
from naoimitate.balance.soles import SoleGoal, headings, into_tables, soles_at, solve_soles
from naoimitate.core.frames import GivenUp, HumanFrame
from naoimitate.gate import build_gate, range_excess
from naoimitate.imitator import Imitator
from naoimitate.motion.builtin import builtin_motion, builtin_names
from naoimitate.robot.kernel import forward
from naoimitate.robot.model import RobotModel
from naoimitate.run.contact import dragging, penetration, sole_height, sole_tilt
from naoimitate.run.overlap import nearest_pairs
from naoimitate.run.recorded import imitate
from naoimitate.run.replay import frames
from naoimitate.settings import PAPER, Settings

IK = PaperIk()
SETS = {"theirs": PAPER, "ours": Settings(retarget="paper")}
RATE = 40.0
"""Hz of the commands here: coarse, to stay quick; the limits hold per wall-clock frame."""
TAKEN = 1.5
"""The published tolerances, taken so much larger: the last step before them is linear."""


def between_soles(robot: RobotModel, legs: Legs, q: np.ndarray, up: np.ndarray) -> float:
    pos, rot = np.empty((len(q) + 1, 3)), np.empty((len(q) + 1, 3, 3))
    forward(robot.tree, q, pos, rot)
    return float(headings(legs, rot, up)[1])


def reachable(robot: RobotModel, legs: Legs, rng: np.random.Generator) -> np.ndarray:
    """A posture near the stand, its legs within their limits and tables."""
    q = robot.postures["stand"].copy()
    move = rng.uniform(-0.3, 0.3, len(legs.joints))
    legged = legs.variable >= 0
    q[legged] += move[legs.variable[legged]]
    inside = (legs.upper - legs.lower) * 0.1
    q[legged] = np.clip(q, legs.lower + inside, legs.upper - inside)[legged]
    into_tables(legs, q)
    return q


def test_both_soles_reach_what_can_be_reached_within_the_published_tolerance(robot: RobotModel) -> None:
    legs, rng = build_legs(robot, LegLimits()), np.random.default_rng(0)
    arrived = 0
    for _ in range(150):
        there = reachable(robot, legs, rng)
        soles, q = soles_at(robot.tree, legs, there), robot.postures["stand"].copy()
        normals = soles.frames[:, :, 2].copy()
        goal = SoleGoal(soles.centres, normals, normals[0], between_soles(robot, legs, there, normals[0]))
        used, done = solve_soles(robot.tree, legs, goal, q, IK.damping, 1e-3, 0.033, IK.max_iterations)
        arrived += done
        found = soles_at(robot.tree, legs, q)
        assert 0 <= used <= IK.max_iterations
        assert range_excess(build_gate(robot), q) <= 0.0
        if done:
            assert np.linalg.norm(found.centres - goal.places, axis=1).max() < 1e-3
            assert np.linalg.norm(np.cross(found.frames[:, :, 2], normals), axis=1).max() < 0.033
            assert abs(between_soles(robot, legs, q, normals[0]) - goal.between) < 0.04
    assert arrived >= 145


def test_a_solve_that_cannot_arrive_ends_early_within_its_limits(robot: RobotModel) -> None:
    legs, q = build_legs(robot, LegLimits()), robot.postures["stand"].copy()
    soles = soles_at(robot.tree, legs, q)
    up = np.array([0.0, 0.0, 1.0])
    goal = SoleGoal(soles.centres - [0.0, 0.0, 0.1], np.array([up, up]), up, 0.0)
    used, done = solve_soles(robot.tree, legs, goal, q, IK.damping, 1e-3, 0.033, 100_000)
    assert not done and used < 20_000
    assert range_excess(build_gate(robot), q) <= 0.0


@pytest.mark.parametrize("parameters", SETS)
@pytest.mark.parametrize("name", builtin_names())
def test_the_robot_is_stable_flat_and_live_through_every_builtin(nao: RobotModel, name: str, parameters: str) -> None:
    run = imitate(builtin_motion(name), nao, SETS[parameters], rate=RATE, sample=30.0)
    poses = frames(run, nao)
    assert poses.margins(run.support).min() >= 0.005
    assert np.mean(run.given_up & GivenUp.HOLD > 0) < 0.02
    assert sole_tilt(run, poses) < TAKEN * IK.angle_tolerance
    assert sole_height(run, poses) < 0.008
    assert penetration(nao, poses) < 0.008
    assert dragging(run, poses).mean() < 0.01
    assert nearest_pairs(nao, poses).min() > -0.001
    speed = np.abs(np.diff(run.q, axis=0)) / np.diff(run.time)[:, None] / nao.speed
    assert speed.max() <= 0.9
    assert max(range_excess(build_gate(nao), q) for q in run.q) <= 0.0
    if name != "walk":
        assert np.mean(run.support == run.human_support) > 0.9


@pytest.mark.parametrize("parameters", SETS)
def test_another_robot_steps_and_reaches_too(second_robot: RobotModel, parameters: str) -> None:
    run = imitate(builtin_motion("step-and-reach"), second_robot, SETS[parameters], rate=RATE, sample=30.0, end=15.0)
    poses = frames(run, second_robot)
    assert poses.margins(run.support).min() >= 0.005
    assert sole_tilt(run, poses) < IK.angle_tolerance
    assert np.mean(run.support == run.human_support) > 0.9


def still(frame: HumanFrame, seconds: float, dt: float = 0.02) -> Iterator[HumanFrame]:
    for k in range(round(seconds / dt)):
        yield replace(frame, time=frame.time + k * dt)


def test_the_shifts_of_one_frame_do_not_add_to_those_of_the_next(nao: RobotModel) -> None:
    """A person who stands over the left foot with both feet down: the legs come to rest and stay there."""
    imitator, legs = Imitator(nao, SETS["ours"]), build_legs(nao, LegLimits())
    imitator.calibrate(tpose())
    leaning = replace(person(com=[0.04, 0.08]), support="D")
    commands = [imitator.step(frame, 0.02) for frame in still(leaning, 8.0)]
    assert commands[-1].offset == pytest.approx(commands[-1].human_offset, abs=0.03)
    assert np.abs(commands[-1].q - commands[-200].q)[legs.joints].max() < 0.01


@pytest.mark.parametrize("parameters", SETS)
@pytest.mark.parametrize("seed", range(3))
def test_it_comes_back_from_whatever_it_was_shown(nao: RobotModel, seed: int, parameters: str) -> None:
    rng, imitator = np.random.default_rng(seed), Imitator(nao, SETS[parameters])
    imitator.calibrate(tpose())
    imitator.step(person())
    gate = build_gate(nao)
    for k in range(60):
        chaos = HumanFrame(
            0.02 * k, person().landmarks + rng.normal(scale=0.3, size=(19, 3)), support="DLRF"[k // 8 % 4]
        )
        command = imitator.step(chaos, 0.04)
        assert np.isfinite(command.q).all() and range_excess(gate, command.q) <= 0.0
    for frame in still(replace(person(), support="D"), 6.0, 0.04):
        command = imitator.step(frame, 0.04)
    assert command.support == "D" and GivenUp.HOLD not in command.given_up
    feet = imitator.mapping.targets(command.posture)[[1, 3]]
    assert np.linalg.norm(feet[0] - feet[1]) < 0.05
    assert np.abs(command.soles[:, 2]).max() < 0.005
    assert abs(command.offset - command.human_offset) < 0.05
