"""From frames to what imitation needs: bad landmarks are bridged, the best knowledge of support and CoM is used."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from people import bare, person, tpose, turned, without

from naoimitate.core.frames import LANDMARKS, SEGMENT, HumanFrame
from naoimitate.human.body import measure
from naoimitate.human.observer import MAX_COORDINATE, Observer
from naoimitate.human.segments import center_of_mass

BODY = measure(tpose())


def observer() -> Observer:
    return Observer(BODY, tpose(), hands=True)


def test_a_whole_frame_is_complete_and_left_as_it_is() -> None:
    frame = person()
    seen = observer().see(frame, "D")
    assert seen.complete
    assert seen.com == pytest.approx(center_of_mass(frame.landmarks))
    assert seen.body.soles[:, 2] == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 2.0 * MAX_COORDINATE, -1e300])
def test_bad_landmarks_keep_their_last_place_relative_to_the_others(value: float) -> None:
    watch = observer()
    watch.see(person(), "D")
    shifted = turned(person(0.01), 0.0, x=0.3, y=-0.2)
    seen = watch.see(without(shifted, "l_wrist", "r_knee", value=value), "D")
    assert not seen.complete
    assert seen.body.posture == pytest.approx(watch.see(shifted, "D").body.posture, abs=1e-9)


def test_a_frame_without_any_landmark_repeats_the_last_one() -> None:
    watch = observer()
    before = watch.see(person(), "D")
    seen = watch.see(without(person(0.01), *LANDMARKS), "D")
    assert not seen.complete
    assert seen.body.posture == pytest.approx(before.body.posture)


def test_the_first_frame_takes_missing_landmarks_from_the_t_pose() -> None:
    seen = observer().see(without(tpose(), "l_hand", "head", "r_elbow"), "D")
    assert seen.body.posture == pytest.approx(observer().see(tpose(), "D").body.posture, abs=1e-9)


def test_the_frame_given_is_not_changed() -> None:
    frame = without(person(), "l_wrist")
    watch = observer()
    watch.see(frame, "D")
    assert np.isnan(frame["l_wrist"]).all()


@given(st.lists(st.sampled_from(LANDMARKS), unique=True), st.sampled_from([np.nan, np.inf, 1e200, -1e5]))
@settings(max_examples=60, deadline=None)
def test_whatever_is_missing_everything_seen_is_finite(names: list[str], value: float) -> None:
    watch = observer()
    watch.see(person(), "D")
    seen = watch.see(without(person(0.02), *names, value=value))
    assert seen.complete == (not names)
    for array in (*vars(seen.body).values(), seen.com, seen.head):
        assert np.isfinite(array).all()


def test_support_is_what_the_caller_knows_then_the_frame_then_the_estimate() -> None:
    watch, frame = observer(), replace(person(), support="R")
    assert watch.see(frame, "L").support == "L"
    assert watch.see(frame).support == "R"
    assert watch.see(replace(frame, support=None)).support == "D"


def test_support_is_estimated_from_the_feet() -> None:
    watch = observer()
    lifted = {"feet": [[0.0, 0.1, 0.25, 0.0, 0.0, 0.0], [0.0, -0.1, 0.0, 0.0, 0.0, 0.0]], "com": [0.04, -0.09]}
    modes = [watch.see(person(0.01 * k)).support for k in range(50)]
    modes += [watch.see(person(0.5 + 0.01 * k, **lifted)).support for k in range(100)]
    assert set(modes[:50]) == {"D"}
    assert modes[-1] == "R"


def test_com_of_the_source_goes_before_the_segment_table() -> None:
    given_com = np.array([0.1, 0.2, 0.9])
    assert np.array_equal(observer().see(replace(person(), com=given_com), "D").com, given_com)
    lost = replace(person(), com=np.array([0.1, np.nan, 0.9]))
    assert observer().see(lost, "D").com == pytest.approx(center_of_mass(person().landmarks))


@given(st.floats(-1.2, 1.2), st.floats(-0.6, 0.6), st.floats(-3.0, 3.0))
@settings(max_examples=60, deadline=None)
def test_head_turns_against_the_torso(yaw: float, pitch: float, facing: float) -> None:
    seen = observer().see(turned(person(head=[yaw, pitch]), facing), "D")
    assert seen.head == pytest.approx((yaw, pitch), abs=1e-6)


def test_a_head_that_leans_in_the_t_pose_looks_straight_ahead() -> None:
    watch = Observer(BODY, person(head=[0.1, 0.2]))
    assert watch.see(person(head=[0.1, 0.2]), "D").head == pytest.approx((0.0, 0.0), abs=1e-9)
    assert watch.see(person(head=[0.4, 0.2]), "D").head == pytest.approx((0.3, 0.0), abs=1e-9)


def test_without_orientations_the_head_looks_straight_ahead_and_hands_are_unknown() -> None:
    seen = observer().see(bare(person(head=[0.5, 0.3])), "D")
    assert seen.head == (0.0, 0.0)
    assert seen.hands is None


def test_hands_of_the_t_pose_are_in_line_with_the_torso() -> None:
    seen = observer().see(turned(tpose(), 1.3), "D")
    assert seen.hands is not None
    assert seen.hands == pytest.approx(np.stack([np.eye(3), np.eye(3)]), abs=1e-6)


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf, 1e-200, 1e200])
def test_impossible_orientations_count_as_missing(bad: float) -> None:
    frame = person()
    orientations = np.full_like(frame.orientations, bad)
    seen = observer().see(replace(frame, orientations=orientations), "D")
    for array in (*vars(seen.body).values(), seen.head):
        assert np.isfinite(array).all()
    assert seen.hands is None


def test_orientations_of_any_length_are_directions() -> None:
    frame = person(head=[0.3, 0.1])
    doubled = replace(frame, orientations=-2.0 * frame.orientations)
    assert observer().see(doubled, "D").head == pytest.approx((0.3, 0.1), abs=1e-6)


def test_hands_are_left_alone_where_nobody_asks_for_them() -> None:
    assert Observer(BODY, tpose()).see(tpose(), "D").hands is None


def test_hand_opening_is_nan_where_the_source_has_none() -> None:
    assert np.isnan(observer().see(person(), "D").opening).all()
    opened = replace(person(), hand_opening=np.array([0.2, 0.9]))
    assert np.array_equal(observer().see(opened, "D").opening, [0.2, 0.9])


def test_missing_hand_orientation_alone_leaves_the_head() -> None:
    frame = person(head=[0.3, 0.1])
    assert frame.orientations is not None
    frame.orientations[SEGMENT["l_hand"]] = np.nan
    seen = observer().see(frame, "D")
    assert seen.hands is None
    assert seen.head == pytest.approx((0.3, 0.1), abs=1e-6)


def test_a_person_may_stand_anywhere_on_the_floor() -> None:
    seen = observer().see(turned(HumanFrame(0.0, person().landmarks), 2.0, x=80.0, y=-60.0), "D")
    assert seen.complete
    assert seen.body.posture == pytest.approx(observer().see(bare(person()), "D").body.posture, abs=1e-9)
