from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from naoimitate.core.frames import LANDMARK, LANDMARKS, HumanFrame, Motion
from naoimitate.human.support import SupportEstimator, annotate, last_mode, raw_support
from naoimitate.motion.builtin import BODY, builtin_motion, builtin_names, single_support_phases

FEET = [LANDMARK[f"{side}_{name}"] for side in "lr" for name in ("ankle", "toe")]


@cache
def blind(name: str) -> Motion:
    """A built-in motion without what is known about its support."""
    return replace(builtin_motion(name), support=None, contacts=None)


def resampled(motion: Motion, rate: float, begin: float = 0.0) -> Motion:
    """The same motion at another frame rate, its first frame at ``begin`` s on the file's clock."""
    time = np.arange(0.0, motion.duration, 1.0 / rate)
    frames = [motion.at(t) for t in time]
    return Motion(motion.name, time + begin, np.array([frame.landmarks for frame in frames]))


def live(motion: Motion, estimator: SupportEstimator | None = None) -> np.ndarray:
    estimator = estimator or SupportEstimator()
    return np.array([estimator.update(frame) for frame in motion])


def both_ways(motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Modes by the whole-clip analysis and by the causal estimate."""
    annotated = annotate(motion)
    assert annotated.support is not None
    return annotated.support, live(motion)


def sides(modes: np.ndarray) -> str:
    """The modes in order, without repetition."""
    return "".join(modes[np.r_[True, modes[1:] != modes[:-1]]])


def standing(frames: int = 200, rate: float = 100.0) -> Motion:
    motion = blind("wave")
    return Motion("standing", np.arange(frames) / rate, np.repeat(motion.landmarks[:1], frames, axis=0))


@pytest.mark.parametrize("name", builtin_names())
def test_the_stands_of_built_in_motions_are_found(name: str) -> None:
    truth = builtin_motion(name)
    assert truth.support is not None
    for modes in both_ways(blind(name)):
        assert np.mean(modes == truth.support) > 0.89
        assert sides(modes) == sides(truth.support)
        if name == "walk":
            continue
        found = single_support_phases(replace(truth, support=modes))
        for (side, begin, end), (seen, lift, land) in zip(single_support_phases(truth), found, strict=True):
            assert side == seen
            assert -0.02 <= lift - begin < 0.8, "a slow foot counts as lifted when it is 50 mm high"
            assert -0.6 < land - end <= 0.05, "and as landed when it is slow and 30 mm high"


@pytest.mark.parametrize("rate", [10.0, 24.0, 60.0, 240.0, 500.0])
def test_any_frame_rate_and_any_start_of_time_will_do(rate: float) -> None:
    truth = builtin_motion("march")
    for modes in both_ways(resampled(truth, rate, begin=7.0 / rate)):
        assert sides(modes) == "DLDRDLDRD"


@pytest.mark.parametrize("tilt", [(0.02, 0.0), (-0.012, 0.01)])
def test_a_tilted_floor_is_levelled(tilt: tuple[float, float]) -> None:
    truth = builtin_motion("walk")
    assert truth.support is not None and truth.orientations is not None and truth.tpose is not None
    turn = Rotation.from_rotvec([tilt[1], tilt[0], 0.0])
    moved = (turn.apply(truth.landmarks.reshape(-1, 3)) + np.array([1.0, -2.0, 0.4])).reshape(truth.landmarks.shape)
    level = annotate(replace(blind("walk"), landmarks=moved, orientations=None))
    for i, side in enumerate("lr"):
        assert level.contacts is not None
        planted = level.contacts[:, i] & np.isin(truth.support, ("D", side.upper()))
        ankle = level.landmarks[planted, LANDMARK[f"{side}_ankle"], 2]
        assert np.abs(ankle - BODY.ankle_height).max() < 0.010
    assert level.support is not None
    assert np.mean(level.support == truth.support) > 0.89


def test_levelling_turns_orientations_with_the_landmarks() -> None:
    truth = builtin_motion("walk")
    assert truth.orientations is not None
    turn = Rotation.from_rotvec([0.0, 0.02, 0.0])
    xyzw = (turn * Rotation.from_quat(np.roll(truth.orientations, -1, axis=-1).reshape(-1, 4))).as_quat()
    tilted = replace(
        blind("walk"),
        landmarks=turn.apply(truth.landmarks.reshape(-1, 3)).reshape(truth.landmarks.shape),
        orientations=np.roll(xyzw, 1, axis=-1).reshape(truth.orientations.shape),
    )
    back = annotate(tilted).orientations
    assert back is not None
    off = 2.0 * np.arccos(np.clip(np.abs(np.sum(back * truth.orientations, axis=-1)), 0.0, 1.0))
    assert np.degrees(off).max() < 0.3


def test_distances_are_untouched_by_levelling() -> None:
    motion = blind("side-kick")
    level = annotate(replace(motion, landmarks=motion.landmarks + np.array([0.0, 0.0, 0.7])))
    np.testing.assert_allclose(level.landmarks, motion.landmarks, atol=0.005)


def test_noise_and_gaps_do_not_make_steps() -> None:
    rng = np.random.default_rng(1)
    truth = builtin_motion("march")
    landmarks = truth.landmarks + rng.normal(0.0, 0.001, truth.landmarks.shape)
    landmarks[rng.random(landmarks.shape[:2]) < 0.05] = np.nan
    landmarks[500:530] = np.nan
    for modes in both_ways(replace(blind("march"), landmarks=landmarks)):
        assert sides(modes) == "DLDRDLDRD"


def test_a_jump_is_a_flight() -> None:
    motion = standing()
    t = motion.time - 1.0
    rise = np.where(np.abs(t) < 0.25, 0.3 - 0.5 * 9.81 * t**2, 0.0).clip(0.0)
    jump = replace(motion, landmarks=motion.landmarks + rise[:, None, None] * [0.0, 0.0, 1.0])
    for modes in both_ways(jump):
        assert sides(modes) == "DFD"
        assert (modes[np.abs(t) < 0.1] == "F").all()


def test_who_rises_to_the_tips_of_bent_toes_stands_and_does_not_fly() -> None:
    motion = standing(300)
    rise = 0.09 * np.clip(np.sin(np.pi * (motion.time - 0.5) / 2.0), 0.0, None)[:, None, None] * [0.0, 0.0, 1.0]
    balls = motion.landmarks[:, FEET].reshape(-1, 2, 2, 3)[:, :, 1]
    tips = balls * [1.0, 1.0, 0.0] + [0.05, 0.0, 0.01]
    risen = replace(motion, landmarks=motion.landmarks + rise)
    feet = np.concatenate([risen.landmarks[:, FEET].reshape(-1, 2, 2, 3), tips[:, :, None]], axis=2)
    assert set(raw_support(risen, feet).classes) == {"D"}
    feet[:, :, 2] = np.nan
    assert "F" in raw_support(risen, feet).classes, "only the tips could tell"


def test_a_sliding_foot_keeps_the_last_mode_but_is_told_apart() -> None:
    motion = standing(300)
    slide = 0.8 * np.clip(motion.time - 1.0, 0.0, 1.0)
    skate = replace(motion, landmarks=motion.landmarks + slide[:, None, None] * [1.0, 0.0, 0.0])
    raw = raw_support(skate)
    during = (motion.time > 1.1) & (motion.time < 1.9)
    assert (raw.classes[during] == "M").all()
    for modes in both_ways(skate):
        assert set(modes) == {"D"}


def test_contacts_of_the_source_are_used_and_small_gaps_in_them_closed() -> None:
    motion = standing()
    contacts = np.ones((len(motion), 2), dtype=bool)
    contacts[50:150, 1] = False
    contacts[100:104, 0] = False
    told = replace(motion, contacts=contacts)
    annotated = annotate(told)
    assert annotated.support is not None
    assert sides(annotated.support) == "DLD"
    assert sides(live(told)).replace("DLDLD", "DLD") == "DLD"


def test_a_known_support_is_left_alone() -> None:
    truth = builtin_motion("march")
    assert annotate(truth) is truth


def test_last_mode_fills_moving_feet() -> None:
    assert "".join(last_mode(np.array(list("MMLMRMM")))) == "LLLLRRR"
    assert "".join(last_mode(np.array(list("MM")))) == "DD"


def test_old_frames_change_nothing() -> None:
    estimator = SupportEstimator()
    motion = blind("march")
    modes = live(motion, estimator)
    assert estimator.update(motion[0]) == modes[-1] == estimator.update(replace(motion[0], time=float("nan")))


def test_a_teleported_person_stands_where_they_stood() -> None:
    motion = standing(400)
    away = np.where(motion.time < 1.0, 0.0, 3.0)
    sideways = replace(motion, landmarks=motion.landmarks + away[:, None, None] * [1.0, 1.0, 0.0])
    assert set(live(sideways)) == {"D"}
    up = np.where(motion.time < 1.0, 0.0, 0.8)
    lifted = live(replace(motion, landmarks=motion.landmarks + up[:, None, None] * [0.0, 0.0, 1.0]))
    assert (lifted[motion.time > 2.3] == "D").all(), "nobody flies that long: it was the floor"


def test_one_glitch_does_not_move_the_floor() -> None:
    motion = blind("march")
    landmarks = motion.landmarks.copy()
    landmarks[97::97] += [0.0, 0.0, -0.6]
    assert np.mean(live(replace(motion, landmarks=landmarks)) == live(motion)) > 0.97


def hand_stand() -> Motion:
    motion = standing()
    upside_down = motion.landmarks * [1.0, 1.0, -1.0]
    return replace(motion, landmarks=upside_down - upside_down[..., 2].min() * np.array([0.0, 0.0, 1.0]))


def lying() -> Motion:
    motion = standing()
    return replace(motion, landmarks=motion.landmarks[..., [2, 1, 0]] * [1.0, 1.0, -1.0] + [0.0, 0.0, 0.3])


def nowhere() -> Motion:
    motion = standing()
    return replace(motion, landmarks=np.full_like(motion.landmarks, np.nan))


def absurd() -> Motion:
    motion = standing()
    landmarks = np.random.default_rng(3).normal(0.0, 1e6, motion.landmarks.shape)
    landmarks[10] = np.inf
    return replace(motion, landmarks=landmarks)


@pytest.mark.parametrize("strange", [hand_stand, lying, nowhere, absurd, lambda: standing(1), lambda: standing(2)])
def test_strange_people_are_not_an_error(strange) -> None:
    motion = strange()
    for modes in both_ways(motion):
        assert len(modes) == len(motion)
        assert set(modes) <= set("DLRF")


def test_nobody_stands_on_feet_that_are_above_the_hands() -> None:
    stood = standing()
    upside_down = hand_stand()
    landmarks = np.concatenate([stood.landmarks, upside_down.landmarks])
    flip = Motion("flip", np.arange(400) / 100.0, landmarks)
    for modes in both_ways(flip):
        assert (modes[:190] == "D").all() and (modes[230:] == "F").all()


@pytest.mark.parametrize("missing", LANDMARKS)
def test_any_landmark_may_be_missing_throughout(missing: str) -> None:
    motion = resampled(builtin_motion("march"), 50.0)
    landmarks = motion.landmarks.copy()
    landmarks[:, LANDMARK[missing]] = np.nan
    for modes in both_ways(replace(motion, landmarks=landmarks)):
        if not missing.endswith("ankle"):
            assert sides(modes) == "DLDRDLDRD"


def test_the_estimate_starts_from_a_known_stand() -> None:
    truth = builtin_motion("paper")
    assert truth.tpose is not None
    hold = (truth.time > 11.0) & (truth.time < 13.0)
    started_on_one_foot = replace(blind("paper"), time=truth.time[hold], landmarks=truth.landmarks[hold])
    assert set(live(started_on_one_foot, SupportEstimator.standing(truth.tpose))) == {"L"}


def test_a_frame_without_a_person_keeps_the_mode() -> None:
    estimator = SupportEstimator()
    motion = blind("paper")
    for frame in motion:
        estimator.update(frame)
        if frame.time > 12.0:
            break
    empty = HumanFrame(time=12.5, landmarks=np.full((19, 3), np.nan))
    assert estimator.update(empty) == "L"
