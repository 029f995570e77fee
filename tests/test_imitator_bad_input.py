"""The pipeline and input that no person gives: it holds, goes on, and stays balanced."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from judge import LEFT_LIFTED, imitate, still, stream
from people import bare, moved, person, turned, without

from naoimitate.core.frames import LANDMARKS, GivenUp, HumanFrame
from naoimitate.core.geometry import matrix_from_rotation_vector
from naoimitate.robot.model import RobotModel


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_landmarks_that_come_and_go(robot: RobotModel, value: float) -> None:
    rng, frames = np.random.default_rng(0), stream("march", 50.0, 2.0, 8.0)
    for i, frame in enumerate(frames):
        lost = [n for n in LANDMARKS if rng.random() < 0.2]
        frames[i] = without(frame, *lost, value=value)
    judge = imitate(robot, frames)
    assert GivenUp.INPUT in judge.given_up


def test_a_stream_that_loses_everything_for_a_second_holds_and_goes_on(nao: RobotModel) -> None:
    frames = stream("march", 50.0, 2.0, 9.0)
    frames[100:150] = [without(f, *LANDMARKS) for f in frames[100:150]]
    judge = imitate(nao, frames)
    lost = [c.given_up for c in judge.commands[100:150]]
    assert all(GivenUp.INPUT in bits for bits in lost)
    assert GivenUp.INPUT not in judge.commands[-1].given_up


def test_missing_feet_and_missing_arms(nao: RobotModel) -> None:
    feet = ("l_ankle", "r_ankle", "l_toe", "r_toe", "l_knee", "r_knee")
    arms = ("l_elbow", "r_elbow", "l_wrist", "r_wrist", "l_hand", "r_hand")
    for names in (feet, arms):
        judge = imitate(nao, [without(bare(f), *names) for f in stream("march", 50.0, 2.0, 6.0)])
        assert all(GivenUp.INPUT in c.given_up for c in judge.commands)


def test_teleports_of_two_metres(robot: RobotModel) -> None:
    rng, frames = np.random.default_rng(1), stream("march", 50.0, 2.0, 9.0)
    place = np.zeros(3)
    for i, frame in enumerate(frames):
        if rng.random() < 0.1:
            place = rng.uniform(-2.0, 2.0, 3)
        frames[i] = moved(frame, np.eye(3), place)
    imitate(robot, frames)


def test_a_person_who_turns_round_between_two_frames(nao: RobotModel) -> None:
    rng, frames = np.random.default_rng(2), stream("march", 50.0, 2.0, 8.0)
    yaw = 0.0
    for i, frame in enumerate(frames):
        yaw = rng.uniform(-3.1, 3.1) if rng.random() < 0.1 else yaw
        frames[i] = turned(frame, yaw)
    imitate(nao, frames)


@pytest.mark.parametrize("axis", [(0.0, 1.57, 0.0), (1.57, 0.0, 0.0), (3.14, 0.0, 0.0), (0.0, -1.57, 0.0)])
@pytest.mark.parametrize("whole", [True, False])
def test_a_person_who_lies_down_or_stands_on_the_hands(
    robot: RobotModel, axis: tuple[float, float, float], whole: bool
) -> None:
    """Over a second, or all at once; with and without orientations."""
    frames = still(25)
    for k in range(150):
        part = min(k / 50.0, 1.0) if whole else 1.0
        frame = moved(person(), matrix_from_rotation_vector(part * np.array(axis)), np.array([0.0, 0.0, 0.3 * part]))
        frames.append(replace(frame if whole else bare(frame), time=0.5 + 0.02 * k))
    imitate(robot, frames)


def test_frames_at_once_and_frames_late(robot: RobotModel) -> None:
    """dt of 0, back in time, 10 s late."""
    frames, time = stream("march", 50.0, 2.0, 9.0), 0.0
    steps = [0.02, 0.0, 0.0, -1.0, 10.0, 0.02, 1e-9, 0.3, -0.02]
    for i, frame in enumerate(frames):
        time += steps[i % len(steps)]
        frames[i] = replace(frame, time=time)
    judge = imitate(robot, frames)
    elapsed = np.diff([c.time for c in judge.commands])
    assert elapsed.min() > 0.0 and elapsed.max() <= 0.05 + 1e-12


@pytest.mark.parametrize("dt", [0.0, -1.0, 10.0, np.nan, np.inf])
def test_any_dt_that_the_caller_gives(nao: RobotModel, dt: float) -> None:
    imitate(nao, still(5) + stream("march", 50.0, 3.0, 4.0), dt=dt)


def test_times_that_are_no_times(nao: RobotModel) -> None:
    frames = [
        replace(f, time=(np.nan, np.inf, -np.inf, 1e300)[i % 4]) for i, f in enumerate(stream("wave", 50.0, 3, 5))
    ]
    imitate(nao, frames)


@pytest.mark.parametrize("quaternion", [0.0, np.nan, np.inf, 1e-12, 1e12])
def test_orientations_that_are_no_rotations(nao: RobotModel, quaternion: float) -> None:
    frames = stream("march", 50.0, 3.0, 5.0)
    imitate(nao, [replace(f, orientations=np.full_like(f.orientations, quaternion)) for f in frames])


@pytest.mark.parametrize("com", [np.nan, np.inf, 1e9, -1e300])
def test_a_com_that_is_none(nao: RobotModel, com: float) -> None:
    frames = stream("march", 50.0, 3.0, 5.0)
    imitate(nao, [replace(f, com=np.array([com, 0.0, com])) for f in frames])


GARBAGE = st.floats(allow_nan=True, allow_infinity=True, width=64)

COORDINATE = st.one_of(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), GARBAGE)


@given(
    seed=st.integers(0, 2**32 - 1),
    spread=st.sampled_from([0.02, 0.3, 3.0, 1e3, 1e8]),
    modes=st.lists(st.sampled_from(["D", "L", "R", "F", None]), min_size=1, max_size=6),
    odd=st.lists(COORDINATE, min_size=3, max_size=3),
)
@settings(max_examples=12, deadline=None)
def test_random_garbage_never_unbalances_the_robot(
    robot: RobotModel, seed: int, spread: float, modes: list[str | None], odd: list[float]
) -> None:
    """Noise of millimetres to light years on every landmark, any support mode, impossible numbers anywhere."""
    rng, frames = np.random.default_rng(seed), []
    for k in range(60):
        frame = person() if k % 20 < 10 else person(**LEFT_LIFTED)
        landmarks = frame.landmarks + rng.normal(0.0, spread, frame.landmarks.shape)
        landmarks[rng.integers(len(landmarks))] = odd
        quaternions = frame.orientations + rng.normal(0.0, min(spread, 10.0), frame.orientations.shape)
        support = modes[(k // 12) % len(modes)]
        frames.append(HumanFrame(0.02 * k, landmarks, quaternions, support=support))
    imitate(robot, frames)
