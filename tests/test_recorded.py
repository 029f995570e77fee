"""A recorded motion from its first to its last frame: the run."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from people import person, tpose

from naoimitate.calib.subject import calibrate
from naoimitate.core.errors import CalibrationError, MotionFormatError
from naoimitate.core.frames import Motion
from naoimitate.motion.builtin import builtin_motion
from naoimitate.robot.model import RobotModel
from naoimitate.run.file import Run, load_run, save
from naoimitate.run.recorded import imitate, resample
from naoimitate.run.scores import score_run


def clip(*support: str, rate: float = 30.0) -> Motion:
    """A person who stands, frame by frame."""
    frame = person()
    count = len(support)
    return Motion(
        "clip",
        np.arange(count) / rate,
        np.tile(frame.landmarks, (count, 1, 1)),
        np.tile(frame.orientations, (count, 1, 1)),
        support=np.array(support),
        tpose=tpose(),
    )


@pytest.fixture(scope="module")
def wave(nao: RobotModel) -> Run:
    return imitate(builtin_motion("wave"), nao, rate=50.0, seed=7)


def test_a_run_covers_the_clip_at_the_persons_pace(wave: Run) -> None:
    motion = builtin_motion("wave")
    assert wave.human_time[0] == 0.0 and motion.duration - 0.02 < wave.human_time[-1] <= motion.duration
    assert np.diff(wave.time) == pytest.approx(0.02)
    assert wave.human_time - wave.time == pytest.approx(0.0, abs=1e-9)


def test_a_run_can_be_written_and_read(wave: Run, tmp_path: Path) -> None:
    save(wave, tmp_path / "run.npz")
    again = load_run(tmp_path / "run.npz")
    assert np.array_equal(again.q, wave.q) and again.retarget == "planted" and again.method == "static"


def test_a_run_says_how_it_came_about(wave: Run) -> None:
    told = json.loads(wave.provenance)
    assert told["seed"] == 7
    assert told["source_sha256"] == builtin_motion("wave").sha256
    assert wave.source == "builtin:wave"


def test_targets_are_those_of_the_scorer(wave: Run) -> None:
    """Equation (1) of the person in every frame, its references and scales."""
    assert wave.human_posture.shape == (len(wave), 4, 3)
    assert wave.ref_robot == pytest.approx(wave.scale[:, None] * wave.ref_human)
    np.testing.assert_allclose(wave.human_posture[0], wave.human_posture[5], atol=0.01)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_speed_factor_stretches_the_run(nao: RobotModel, factor: float) -> None:
    run = imitate(builtin_motion("wave"), nao, rate=50.0, speed=factor, start=3.0, end=6.0)
    assert run.duration == pytest.approx(3.0 / factor, abs=0.05)
    assert np.diff(run.human_time)[:-1] == pytest.approx(0.02 * factor)


def test_a_stretch_of_the_clip_keeps_the_files_time(nao: RobotModel) -> None:
    run = imitate(builtin_motion("wave"), nao, rate=50.0, start=2.0, end=4.0)
    assert run.human_time[0] == pytest.approx(2.0) and run.human_time[-1] == pytest.approx(4.0)
    assert run.time[0] == 0.0


def test_a_stretch_without_frames_says_so(nao: RobotModel) -> None:
    with pytest.raises(MotionFormatError, match="--start and --end"):
        imitate(builtin_motion("wave"), nao, start=90.0)
    with pytest.raises(MotionFormatError, match="--start and --end"):
        imitate(builtin_motion("wave"), nao, start=5.0, end=4.0)


def test_a_motion_without_a_t_pose_needs_a_subject(nao: RobotModel) -> None:
    motion = replace(clip(*"DDD"), tpose=None)
    with pytest.raises(MotionFormatError, match="--subject"):
        imitate(motion, nao)
    assert len(imitate(motion, nao, subject=calibrate(tpose()))) > 1


def test_a_t_pose_that_is_none_is_refused(nao: RobotModel) -> None:
    broken = tpose()
    broken.landmarks[:] = np.nan
    with pytest.raises(CalibrationError):
        imitate(replace(clip(*"DDD"), tpose=broken), nao)


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("speed", [1.0, "auto"])
def test_a_clip_of_one_or_two_frames_runs(nao: RobotModel, count: int, speed: float | str, tmp_path: Path) -> None:
    run = imitate(clip(*"D" * count), nao, speed=speed)
    assert len(run) >= 1 and np.isfinite(run.q).all()
    save(run, tmp_path / "run.npz")
    assert all(measure.passed is not False for measure in score_run(run, nao))


@pytest.mark.parametrize("rate", [10.0, 500.0])
def test_any_frame_rate_of_the_file_runs(nao: RobotModel, rate: float) -> None:
    motion = resample(builtin_motion("march"), rate)
    run = imitate(motion, nao, rate=50.0, start=2.0, end=6.0)
    assert all(measure.passed is not False for measure in score_run(run, nao))
    assert "L" in run.support


def test_a_camera_of_30_frames_sees_30_frames() -> None:
    seen = resample(builtin_motion("wave"), 30.0)
    assert np.diff(seen.time[:-1]) == pytest.approx(1.0 / 30.0)
    assert seen.time[-1] == builtin_motion("wave").duration
    assert seen.support is not None and len(seen.support) == len(seen.time)


def test_missing_landmarks_in_a_clip_are_bridged(nao: RobotModel) -> None:
    motion = builtin_motion("march")
    landmarks = motion.landmarks.copy()
    rng = np.random.default_rng(0)
    landmarks[rng.random(landmarks.shape[:2]) < 0.3] = np.nan
    run = imitate(replace(motion, landmarks=landmarks, com=None), nao, rate=50.0, start=2.0, end=7.0)
    assert all(measure.passed is not False for measure in score_run(run, nao) if "error" not in measure.key)
    assert np.isfinite(run.human_posture).all()


@pytest.mark.parametrize("speed", [1.0, "auto"])
def test_support_that_nobody_told_is_found(nao: RobotModel, speed: float | str) -> None:
    motion = replace(builtin_motion("march"), support=None, contacts=None)
    run = imitate(motion, nao, rate=50.0, speed=speed, start=2.0, end=7.0)
    assert "L" in run.human_support and "L" in run.support


def test_progress_goes_from_nothing_to_one(nao: RobotModel) -> None:
    shares: list[float] = []
    imitate(builtin_motion("wave"), nao, rate=50.0, start=1.0, end=2.0, progress=shares.append)
    assert np.all(np.diff(shares) >= 0.0) and shares[-1] == pytest.approx(1.0)
    assert 0.0 < shares[0] < 0.1
