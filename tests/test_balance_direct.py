"""Direct imitation, the baseline: it falls, and nothing that it is shown makes it fail."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from naoimitate.core.frames import Motion
from naoimitate.gate import build_gate, range_excess
from naoimitate.motion.builtin import builtin_motion
from naoimitate.robot.model import RobotModel
from naoimitate.run.file import Run, load_run, save
from naoimitate.run.recorded import imitate
from naoimitate.run.replay import frames
from naoimitate.settings import PAPER, Settings
from naoimitate.sim.simulate import simulate

DIRECT = Settings(retarget="direct")


def fell(robot: RobotModel, run: Run) -> bool:
    return bool(simulate(robot, run.time, run.q, run.base_pos, run.base_quat, run.support).fell.any())


@pytest.mark.parametrize("name", ["paper", "step-and-reach"])
def test_direct_imitation_falls_where_the_stabilised_one_stands(nao: RobotModel, name: str) -> None:
    motion = builtin_motion(name)
    ways = {
        way: imitate(motion, nao, replace(PAPER, retarget=way), rate=50.0, sample=30.0, end=12.0)
        for way in ("direct", "paper")
    }
    assert fell(nao, ways["direct"])
    assert not fell(nao, ways["paper"])


CHANGES: dict[str, Callable[[np.ndarray, np.random.Generator], np.ndarray]] = {
    "hand-stand": lambda marks, _: marks * [1.0, -1.0, -1.0] + [0.0, 0.0, 1.9],
    "lying": lambda marks, _: marks[:, :, [2, 1, 0]] * [1.0, 1.0, -1.0] + [0.0, 0.0, 0.3],
    "random": lambda marks, rng: rng.normal(size=marks.shape),
    "missing": lambda marks, rng: np.where(rng.random(marks.shape[:2])[:, :, None] < 0.5, np.nan, marks),
    "all missing": lambda marks, _: np.full_like(marks, np.nan),
    "far away": lambda marks, _: 40.0 * marks,
}


def changed(name: str) -> Motion:
    """Two seconds of the walk as landmarks alone, changed."""
    whole = builtin_motion("walk")
    keep = slice(200, 400, 3)
    marks = CHANGES[name](whole.landmarks[keep], np.random.default_rng(0))
    time = whole.time[keep] - whole.time[keep][0]
    return replace(whole, time=time, landmarks=marks, orientations=None, contacts=None, support=whole.support[keep])


@pytest.mark.parametrize("parameters", [DIRECT, replace(PAPER, retarget="direct")], ids=["ours", "theirs"])
@pytest.mark.parametrize("name", CHANGES)
def test_nothing_it_is_shown_makes_it_fail(nao: RobotModel, tmp_path: Path, name: str, parameters: Settings) -> None:
    run = imitate(changed(name), nao, parameters, rate=50.0)
    save(run, tmp_path / "run.npz")
    loaded = load_run(tmp_path / "run.npz")
    np.testing.assert_array_equal(loaded.q, run.q)
    assert loaded.retarget == "direct"
    assert np.isfinite(run.base_pos).all()
    assert max(range_excess(build_gate(nao), q) for q in run.q) <= 1e-9


def test_the_lower_sole_touches_the_floor(nao: RobotModel) -> None:
    run = imitate(builtin_motion("bow-and-reach"), nao, DIRECT, rate=50.0, sample=30.0, end=8.0)
    poses = frames(run, nao)
    lowest = np.minimum(poses.low(0), poses.low(1))
    np.testing.assert_allclose(lowest[1:], 0.0, atol=1e-9)
