"""The paper's evaluation: noise as stated, every case measured, our figures beside the paper's."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from naoimitate.core.frames import Motion
from naoimitate.motion.builtin import builtin_motion
from naoimitate.robot import RobotModel, load_robot
from naoimitate.run.evaluation import Evaluation, write_evaluation
from naoimitate.run.file import Run
from naoimitate.run.recorded import imitate
from naoimitate.run.replay import frames
from naoimitate.run.reproduce import CAMERA_RATE, NOISE, PARAMETER_SETS, direct_baseline, noisy, repeat, unsupported
from naoimitate.run.table import PAPER_TABLE, measure_steps


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return load_robot("nao")


@pytest.fixture(scope="module")
def motion() -> Motion:
    """The first four seconds of the paper's sequence."""
    whole = builtin_motion("paper")
    keep = whole.time < 4.0
    cut = {name: getattr(whole, name)[keep] for name in ("time", "landmarks", "orientations", "contacts", "support")}
    return dataclasses.replace(whole, **cut)


def test_noise_has_the_stated_size_and_follows_its_seed(motion: Motion) -> None:
    error = noisy(motion, 3).landmarks - motion.landmarks
    assert error.std() == pytest.approx(NOISE, rel=0.02)
    assert abs(error.mean()) < 0.02 * NOISE
    np.testing.assert_array_equal(noisy(motion, 3).landmarks, noisy(motion, 3).landmarks)
    assert np.abs(noisy(motion, 4).landmarks - noisy(motion, 3).landmarks).max() > NOISE


def test_the_evaluation_measures_every_case_and_puts_it_beside_the_paper(
    robot: RobotModel, motion: Motion, tmp_path: Path
) -> None:
    def falls(run: Run) -> Run:
        return dataclasses.replace(run, sim_fell=True)

    cases = tuple(repeat(motion, robot, parameters, 2, falls, lambda share: None) for parameters in PARAMETER_SETS)
    tables = {
        (motion.name, name): measure_steps(motion, robot, PARAMETER_SETS[name], CAMERA_RATE) for name in PARAMETER_SETS
    }
    baseline = direct_baseline(motion, robot, None)
    for case in cases:
        assert len(case.runs) == 2
        assert not np.array_equal(case.runs[0].q, case.runs[1].q)
        assert case.fell == (True, True)
        assert np.all(case.hand_errors > 0.0)
    ours = cases[list(PARAMETER_SETS).index("ours")]
    assert ours.hand_errors.max() < 3.0
    assert baseline.fell is None
    written = write_evaluation(Evaluation(cases, tables, (baseline,)), robot, tmp_path)
    assert len(written) == 1 + 2 * 3
    page = (tmp_path / "summary.md").read_text()
    for name, mean, largest in PAPER_TABLE:
        assert f"| {name} | {mean}, max {largest} |" in page
    assert "2 of 2 fell" in page


def test_table_one_counts_the_iterations_of_the_stabilisation_alone(robot: RobotModel, motion: Motion) -> None:
    """Two arms of 30 iterations and two legs of 5 are fixed; a person who stands still needs hardly any more."""
    table = measure_steps(motion, robot, PARAMETER_SETS["theirs"], CAMERA_RATE)
    assert 0 <= table.iterations.min() < 10
    assert np.all(table.mapping > 0.0)
    np.testing.assert_allclose(table.mapping + table.stabilisation, table.total)


def test_without_stabilisation_the_centre_of_mass_is_not_over_what_touches_the_floor(
    robot: RobotModel, motion: Motion
) -> None:
    assert direct_baseline(motion, robot, None).outside > 0.5
    stable = imitate(motion, robot, PARAMETER_SETS["ours"], sample=CAMERA_RATE)
    assert unsupported(frames(stable, robot)) == 0.0
