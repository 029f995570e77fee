"""The compact human model: measures, torso frame, feet, and the posture of equation (1)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from people import BODY, NEEDED, bare, moved, person, tpose, turned, without

from naoimitate.core.errors import CalibrationError
from naoimitate.core.frames import LANDMARKS, HumanFrame
from naoimitate.core.geometry import matrix_from_rotation_vector, rotation_vector, yaw_matrix
from naoimitate.human.body import EFFECTORS, measure, observe

PERSON = measure(tpose())
L_HAND, L_FOOT, R_HAND, R_FOOT = range(4)
ANGLE = st.floats(-0.5, 0.5)
VECTOR = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


def test_measures_of_a_known_person() -> None:
    assert PERSON.arm == pytest.approx((BODY.upper_arm + BODY.forearm,) * 2)
    assert PERSON.leg == pytest.approx((BODY.leg,) * 2)
    assert PERSON.stature == pytest.approx(BODY.stature)
    assert PERSON.ankle_height == pytest.approx(BODY.ankle_height)
    assert PERSON.limb_lengths == pytest.approx([PERSON.arm[0], PERSON.leg[0], PERSON.arm[1], PERSON.leg[1]])


@pytest.mark.parametrize("name", NEEDED)
def test_a_t_pose_without_a_needed_landmark_is_refused_by_name(name: str) -> None:
    with pytest.raises(CalibrationError, match=name):
        measure(without(tpose(), name))


@pytest.mark.parametrize("name", sorted(set(LANDMARKS) - set(NEEDED)))
def test_a_t_pose_does_not_need_head_hands_and_spine(name: str) -> None:
    assert measure(without(tpose(), name)) == PERSON


@pytest.mark.parametrize("scale", [0.0, 0.01])
def test_a_person_in_the_wrong_unit_is_refused(scale: float) -> None:
    with pytest.raises(CalibrationError, match="unit"):
        measure(HumanFrame(0.0, tpose().landmarks * scale))


def test_posture_of_the_t_pose_by_hand() -> None:
    """Arms straight to the sides; soles below the hips, but for the stance that is wider than the hips."""
    posture = observe(PERSON, tpose()).posture
    arm = BODY.upper_arm + BODY.forearm
    assert posture[L_HAND] == pytest.approx([0.0, arm, 0.0], abs=1e-6)
    assert posture[R_HAND] == pytest.approx([0.0, -arm, 0.0], abs=1e-6)
    hip = tpose()["l_hip"]
    assert posture[L_FOOT] == pytest.approx([-hip[0], 0.10 - hip[1], -hip[2]], abs=1e-6)
    assert posture[R_FOOT] == pytest.approx(posture[L_FOOT] * [1.0, -1.0, 1.0], abs=1e-6)
    assert EFFECTORS == ("l_hand", "l_foot", "r_hand", "r_foot")


@given(st.floats(-3.0, 3.0), VECTOR, ANGLE, ANGLE, ANGLE)
@settings(max_examples=60, deadline=None)
def test_posture_is_the_same_wherever_the_person_is(
    yaw: float, place: tuple[float, float, float], a: float, b: float, c: float
) -> None:
    frame = person(trunk=[a, b, 0.4 * c], arms=[[1.0 + a, 0.5, 0.4, c], [0.3, 0.6 + b, 1.0, 0.0]])
    here = observe(PERSON, frame)
    R = yaw_matrix(yaw) @ matrix_from_rotation_vector(np.array([a, b, c]))
    there = observe(PERSON, moved(frame, R, np.array(place)))
    assert there.posture == pytest.approx(here.posture, abs=1e-9)
    assert there.elbows == pytest.approx(here.elbows, abs=1e-9)
    assert there.torso == pytest.approx(R @ here.torso, abs=1e-9)
    assert there.soles == pytest.approx(here.soles @ R.T + place, abs=1e-9)
    assert there.foot_centres == pytest.approx(here.foot_centres @ R.T + place, abs=1e-9)


def test_torso_frame_stands_upright_and_turns_with_the_person() -> None:
    assert observe(PERSON, tpose()).torso == pytest.approx(np.eye(3), abs=1e-9)
    for yaw in (-2.0, 0.7, 3.0):
        assert observe(PERSON, turned(tpose(), yaw)).torso == pytest.approx(yaw_matrix(yaw), abs=1e-9)


def test_bending_at_the_waist_tilts_the_torso_frame_forwards() -> None:
    """The feet come to the front of the torso: bending at the robot's hips."""
    upright, bent = (observe(PERSON, person(trunk=[0.0, pitch, 0.0])) for pitch in (0.0, 0.8))
    assert 0.3 < np.arctan2(bent.torso[0, 2], bent.torso[2, 2]) < 0.8
    assert bent.posture[L_FOOT, 0] > upright.posture[L_FOOT, 0] + 0.2


@given(ANGLE, ANGLE, ANGLE)
@settings(max_examples=60, deadline=None)
def test_torso_frame_is_a_rotation_with_z_from_hips_to_shoulders(a: float, b: float, c: float) -> None:
    frame = person(trunk=[a, b, 0.4 * c])
    R = observe(PERSON, frame).torso
    assert pytest.approx(np.eye(3), abs=1e-9) == R.T @ R
    assert np.linalg.det(R) == pytest.approx(1.0)
    up = frame["l_shoulder"] + frame["r_shoulder"] - frame["l_hip"] - frame["r_hip"]
    assert R[:, 2] == pytest.approx(up / np.linalg.norm(up), abs=1e-9)


def test_twist_of_the_shoulders_is_shared_by_shoulders_and_hips() -> None:
    """Chest 0.5 rad, pelvis 0.3 rad: y is the mean of both lines."""
    R = observe(PERSON, person(trunk=[0.5, 0.0, 0.0])).torso
    assert np.arctan2(R[1, 0], R[0, 0]) == pytest.approx(0.4, abs=0.01)


def test_foot_is_the_point_of_the_sole_below_the_ankle_and_turns_with_the_foot() -> None:
    """A foot 0.25 m up and tilted by 0.4 rad about the ankle."""
    tilted = person(feet=[[0.1, 0.1, 0.25, 0.0, 0.4, 0.0], [0.0, -0.1, 0.0, 0.0, 0.0, 0.0]], com=[0.04, -0.08])
    state = observe(PERSON, tilted)
    assert state.soles[0] == pytest.approx([0.1, 0.1, 0.25], abs=1e-6)
    assert state.soles[1] == pytest.approx([0.0, -0.1, 0.0], abs=1e-6)
    assert rotation_vector(state.feet[0]) == pytest.approx([0.0, 0.4, 0.0], abs=1e-6)
    assert np.linalg.norm(state.soles[0] - tilted["l_ankle"]) == pytest.approx(BODY.ankle_height)


@given(st.floats(-0.6, 0.6), st.floats(-0.3, 0.4), st.floats(0.0, 0.2))
@settings(max_examples=60, deadline=None)
def test_feet_without_orientations_are_seen_in_their_landmarks(yaw: float, pitch: float, height: float) -> None:
    """The roll is told by the shank alone: the whole turn within 0.4 rad, and the posture within 25 mm."""
    frame = person(feet=[[0.0, 0.12, height, yaw, pitch, 0.0], [0.0, -0.12, 0.0, 0.0, 0.0, 0.0]], com=[0.04, -0.06])
    seen, known = observe(PERSON, bare(frame)), observe(PERSON, frame)
    assert np.linalg.norm(rotation_vector(seen.feet[0].T @ known.feet[0])) < 0.4
    assert seen.posture == pytest.approx(known.posture, abs=0.025)
    assert seen.feet[1] == pytest.approx(np.eye(3), abs=0.1)


def test_missing_foot_orientations_alone_are_replaced() -> None:
    frame = tpose()
    assert frame.orientations is not None
    frame.orientations[-1] = np.nan
    assert np.isfinite(observe(PERSON, frame).posture).all()


def test_a_person_shrunk_to_a_point_gives_numbers() -> None:
    state = observe(PERSON, HumanFrame(0.0, np.zeros((len(LANDMARKS), 3))))
    for value in vars(state).values():
        assert np.isfinite(value).all()
