from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import LANDMARK, SEGMENT, Motion
from naoimitate.core.geometry import matrix_from_quat, polygon_margin
from naoimitate.human.segments import center_of_mass
from naoimitate.motion.builtin import BODY, builtin_motion, builtin_names, builtin_phases, single_support_phases

NAMES = (
    *("paper", "step-and-reach", "squat", "bow-and-reach", "wave", "side-kick", "march"),
    *("lean-and-pick", "step-and-pick", "sidestep", "turn", "stroll", "walk"),
)
SLOW = tuple(name for name in NAMES if name != "walk")
LIMBS = tuple(
    (f"{side}_{a}", f"{side}_{b}", length)
    for side in "lr"
    for a, b, length in (
        ("hip", "knee", BODY.thigh),
        ("knee", "ankle", BODY.shank),
        ("shoulder", "elbow", BODY.upper_arm),
        ("elbow", "wrist", BODY.forearm),
        ("wrist", "hand", BODY.hand),
        ("ankle", "toe", np.hypot(BODY.ball, BODY.ankle_height - BODY.ball_height)),
    )
)
BONES = (*LIMBS, ("l_hip", "r_hip", BODY.hips), ("l_shoulder", "r_shoulder", BODY.shoulders))


@cache
def motion(name: str) -> Motion:
    return builtin_motion(name)


def point(name: str, landmark: str) -> np.ndarray:
    return motion(name).landmarks[:, LANDMARK[landmark]]


def speed(name: str, landmark: str) -> float:
    m = motion(name)
    return float((np.linalg.norm(np.diff(point(name, landmark), axis=0), axis=-1) / np.diff(m.time)).max())


def axes(name: str, segment: str) -> np.ndarray:
    """(T, 3, 3), axes of a segment in the world."""
    q = motion(name).orientations
    assert q is not None
    return np.array([matrix_from_quat(row) for row in q[:, SEGMENT[segment]]])


def yaw(name: str, segment: str) -> np.ndarray:
    """(T,) rad, the heading of a segment, without jumps."""
    forward = axes(name, segment)[:, :, 0]
    return np.unwrap(np.arctan2(forward[:, 1], forward[:, 0]))


def sole(name: str, side: str) -> np.ndarray:
    """(T, 3) m, the sole point below the ankle."""
    return point(name, f"{side}_ankle") - BODY.ankle_height * axes(name, f"{side}_foot")[:, :, 2]


def flexion(name: str, side: str, joints: tuple[str, str, str]) -> np.ndarray:
    a, b, c = (point(name, f"{side}_{joint}") for joint in joints)
    u, v = b - a, c - b
    return np.arctan2(np.linalg.norm(np.cross(u, v), axis=-1), np.sum(u * v, axis=-1))


def on(name: str, side: str) -> np.ndarray:
    support = motion(name).support
    assert support is not None
    return np.isin(support, ("D", side.upper()))


def com_margin(name: str, side: str) -> np.ndarray:
    """(T,) m, how far the centre of mass is inside the outline of one sole; the foot is flat."""
    ankle, toe = point(name, f"{side}_ankle"), point(name, f"{side}_toe")
    x = (toe - ankle)[:, :2] / np.linalg.norm((toe - ankle)[:, :2], axis=-1, keepdims=True)
    away = (center_of_mass(motion(name).landmarks) - ankle)[:, :2]
    ahead, left = np.sum(away * x, axis=-1), x[:, 0] * away[:, 1] - x[:, 1] * away[:, 0]
    return np.array([polygon_margin(BODY.sole, a, b) for a, b in zip(ahead, left, strict=True)])


def test_all_names_are_there() -> None:
    assert builtin_names() == NAMES


def test_an_unknown_name_is_an_error_that_lists_the_known_ones() -> None:
    with pytest.raises(MotionFormatError, match="paper, step-and-reach"):
        builtin_motion("moonwalk")


@pytest.mark.parametrize("name", NAMES)
def test_a_motion_is_complete(name: str) -> None:
    m = motion(name)
    assert m.name == f"builtin:{name}"
    assert m.time[0] == 0.0 and (np.diff(m.time) > 0.0).all()
    assert np.isfinite(m.landmarks).all() and m.orientations is not None and m.tpose is not None
    np.testing.assert_allclose(np.linalg.norm(m.orientations, axis=-1), 1.0)
    assert m.support is not None and set(np.unique(m.support)) <= {"D", "L", "R"}
    assert m.support[0] == m.support[-1] == "D"
    assert m.contacts is not None
    np.testing.assert_array_equal(m.contacts, np.stack([on(name, "l"), on(name, "r")], axis=1))


def test_durations_and_rates_are_as_stated() -> None:
    assert len(motion("paper")) == 2500 and motion("paper").rate == pytest.approx(100.0)
    assert len(motion("step-and-reach")) == 1000 and motion("step-and-reach").rate == pytest.approx(30.0)
    assert all(motion(name).rate == pytest.approx(100.0) for name in NAMES if name != "step-and-reach")


@pytest.mark.parametrize("name", NAMES)
def test_bones_keep_their_length(name: str) -> None:
    for a, b, length in BONES:
        measured = np.linalg.norm(point(name, a) - point(name, b), axis=-1)
        assert np.abs(measured - length).max() < 1e-6, (a, b)


@pytest.mark.parametrize("name", NAMES)
def test_knees_and_elbows_stay_in_their_natural_range(name: str) -> None:
    for side in "lr":
        knee = np.degrees(flexion(name, side, ("hip", "knee", "ankle")))
        assert knee.min() > 8.0 and knee.max() < 125.0
        assert np.degrees(flexion(name, side, ("shoulder", "elbow", "wrist"))).max() < 130.0


@pytest.mark.parametrize("name", NAMES)
def test_planted_feet_are_flat_on_the_floor_and_do_not_move(name: str) -> None:
    for side in "lr":
        planted = on(name, side)
        at, toe = sole(name, side), point(name, f"{side}_toe")
        assert np.abs(at[planted, 2]).max() < 1e-9
        assert np.abs(toe[planted, 2] - BODY.ball_height).max() < 1e-9
        still = planted[1:] & planted[:-1]
        for p in (at, toe):
            assert np.linalg.norm(np.diff(p, axis=0), axis=-1)[still].max() < 1e-6


@pytest.mark.parametrize("name", NAMES)
def test_feet_in_the_air_are_above_the_floor_from_heel_to_toe_tip(name: str) -> None:
    m = motion(name)
    for side in "lr":
        lifted = ~on(name, side)
        if lifted.any():
            assert m.orientations is not None
            turns = [matrix_from_quat(q) for q in m.orientations[lifted, SEGMENT[f"{side}_foot"]]]
            outline = np.column_stack([BODY.sole, np.zeros(len(BODY.sole))])
            lowest = sole(name, side)[lifted, 2] + np.array([(outline @ turn.T)[:, 2].min() for turn in turns])
            assert lowest.min() > -0.003, "the rounded corners of a real foot"
            assert lowest.max() > 0.03


@pytest.mark.parametrize("name", SLOW)
def test_slow_swings_rise_and_come_down_vertically_and_flat(name: str) -> None:
    for side in "lr":
        at, toe = sole(name, side), point(name, f"{side}_toe")
        low = (at[:, 2] < 0.03) & ~on(name, side)
        sideways = np.linalg.norm(np.diff(at[:, :2], axis=0), axis=-1)[low[1:] & low[:-1]]
        assert sideways.max(initial=0.0) < 1e-6
        assert np.abs(toe[low, 2] - at[low, 2] - BODY.ball_height).max(initial=0.0) < 1e-6


@pytest.mark.parametrize("name", SLOW)
def test_on_one_foot_the_center_of_mass_is_well_inside_the_sole(name: str) -> None:
    for side in "lr":
        stands = on(name, side) & ~on(name, "lr".replace(side, ""))
        assert com_margin(name, side)[stands].min(initial=1.0) >= 0.020


@pytest.mark.parametrize("name", SLOW)
def test_the_weight_is_over_the_stance_foot_before_the_other_one_lifts(name: str) -> None:
    for side, begin, _ in single_support_phases(motion(name)):
        before = (motion(name).time > begin - 0.3) & (motion(name).time < begin)
        assert com_margin(name, side.lower())[before].min() >= 0.020


@pytest.mark.parametrize("name", SLOW)
def test_there_is_time_in_double_support_between_stands(name: str) -> None:
    phases = single_support_phases(motion(name))
    assert all(b[1] - a[2] >= 1.5 for a, b in pairwise(phases))
    assert all(end - begin >= 1.5 for _, begin, end in phases)


@pytest.mark.parametrize("name", SLOW)
def test_in_double_support_the_center_of_mass_is_between_the_feet(name: str) -> None:
    left, right = (0.5 * (point(name, f"{s}_ankle") + point(name, f"{s}_toe"))[:, :2] for s in "lr")
    com = center_of_mass(motion(name).landmarks)[:, :2]
    line = right - left
    offset = np.sum((com - left) * line, axis=-1) / np.sum(line**2, axis=-1)
    aside = np.linalg.norm(com - left - offset[:, None] * line, axis=-1)
    assert aside.max() < 1e-6
    assert offset.min() > -1e-6 and offset.max() < 1.0 + 1e-6


@pytest.mark.parametrize("name", SLOW)
def test_slow_motions_are_slow(name: str) -> None:
    assert max(speed(name, f"{s}_{p}") for s in "lr" for p in ("ankle", "toe")) < 0.6
    assert max(speed(name, f"{s}_hand") for s in "lr") < 1.5


@pytest.mark.parametrize("name", NAMES)
def test_motions_are_smooth(name: str) -> None:
    """Accelerations stay in what people do, and the acceleration itself does not jump between frames."""
    m = motion(name)
    step = m.time[1]
    acceleration = np.diff(m.landmarks, 2, axis=0) / step**2
    size, jump = (
        np.linalg.norm(acceleration, axis=-1).max(),
        np.linalg.norm(np.diff(acceleration, axis=0), axis=-1).max(),
    )
    assert size < (80.0 if name == "walk" else 6.0)
    assert jump / step < (4000.0 if name == "walk" else 150.0), "jerk, m/s^3"


@pytest.mark.parametrize("name", NAMES)
def test_left_is_left(name: str) -> None:
    """Seen along the hips, and in the world wherever nobody turns round."""
    ahead = axes(name, "pelvis")[:, :2, 0]
    views = [ahead / np.linalg.norm(ahead, axis=-1, keepdims=True)]
    if name != "turn":
        views.append(np.tile([1.0, 0.0], (len(ahead), 1)))
    for forward in views:
        left = np.column_stack([-forward[:, 1], forward[:, 0]])
        for part in ("shoulder", "hip"):
            across = (point(name, f"l_{part}") - point(name, f"r_{part}"))[:, :2]
            assert np.sum(across * left, axis=-1).min() > 0.1
        for side in "lr":
            along = (point(name, f"{side}_toe") - point(name, f"{side}_ankle"))[:, :2]
            assert np.sum(along * forward, axis=-1).min() > 0.05


def test_the_tpose_is_one() -> None:
    tpose = motion("paper").tpose
    assert tpose is not None and tpose.orientations is not None
    for side, sign in (("l", 1.0), ("r", -1.0)):
        arm = tpose[f"{side}_hand"] - tpose[f"{side}_shoulder"]
        np.testing.assert_allclose(arm, [0.0, sign * (BODY.upper_arm + BODY.forearm + BODY.hand), 0.0], atol=1e-9)
    for segment in ("pelvis", "chest", "head", "l_hand", "r_hand"):
        np.testing.assert_allclose(np.abs(tpose.orientations[SEGMENT[segment]]), [1.0, 0.0, 0.0, 0.0], atol=1e-9)


def test_paper_holds_the_pose_of_the_paper() -> None:
    m = motion("paper")
    tpose, first = m.tpose, m.time < 2.0
    assert tpose is not None
    assert np.abs(m.landmarks[first] - tpose.landmarks).max() < 1e-9
    hold = (m.time >= 10.4) & (m.time <= 15.4)
    assert m.support is not None and (m.support[hold] == "L").all()
    assert np.ptp(m.landmarks[hold], axis=0).max() < 1e-9, "5 s without a move"
    apart = np.linalg.norm(sole("paper", "r") - sole("paper", "l"), axis=-1)[hold]
    np.testing.assert_allclose(apart, 0.45 * BODY.leg, atol=1e-6)
    assert (sole("paper", "r") - sole("paper", "l"))[hold, 0].max() < -0.3, "stretched backwards"
    for side in "lr":
        assert (point("paper", f"{side}_hand") - point("paper", f"{side}_shoulder"))[hold, 2].min() > 0.2
    assert [side for side, _, _ in builtin_phases("paper")] == ["L"]


def test_step_and_reach_takes_two_short_steps_and_reaches_forward_and_down_with_the_right_hand() -> None:
    assert [side for side, _, _ in builtin_phases("step-and-reach")] == ["L", "R"]
    for side in "lr":
        travel = sole("step-and-reach", side)[-1] - sole("step-and-reach", side)[0]
        assert 0.15 <= travel[0] <= 0.30 and abs(travel[1]) < 1e-9
    m = motion("step-and-reach")
    hand = point("step-and-reach", "r_hand") - 0.5 * (sole("step-and-reach", "l") + sole("step-and-reach", "r"))
    reach = hand[(m.time > 19.0) & (m.time < 20.6)]
    assert reach[:, 0].min() > 0.5 and reach[:, 2].max() < 0.9


def test_march_stands_two_seconds_on_alternate_feet() -> None:
    phases = builtin_phases("march")
    assert [side for side, _, _ in phases] == ["L", "R", "L", "R"]
    assert all(end - begin == pytest.approx(2.0, abs=0.02) for _, begin, end in phases)


def test_squat_goes_deep_and_bow_goes_down() -> None:
    assert point("squat", "pelvis")[:, 2].min() < 0.62 * point("squat", "pelvis")[0, 2]
    lowest = min(point("bow-and-reach", f"{side}_hand")[:, 2].min() for side in "lr")
    assert lowest < 0.5


def test_side_kick_goes_out_to_both_sides() -> None:
    assert [side for side, _, _ in builtin_phases("side-kick")] == ["L", "R"]
    assert point("side-kick", "r_ankle")[:, 1].min() < -0.45 and point("side-kick", "l_ankle")[:, 1].max() > 0.45


def test_sidestep_goes_to_the_left_and_back_and_never_ahead() -> None:
    assert [side for side, _, _ in builtin_phases("sidestep")] == ["R", "L", "R", "L", "L", "R", "L", "R"]
    for side in "lr":
        travel = sole("sidestep", side) - sole("sidestep", side)[0]
        planted = on("sidestep", side)
        assert travel[planted, 1].max() == pytest.approx(0.16) and travel[:, 1].min() > -1e-9
        assert np.abs(travel[:, 0]).max() < 1e-9
        assert np.abs(travel[-1]).max() < 1e-9


def test_turn_goes_round_by_ninety_degrees_on_the_spot() -> None:
    assert [side for side, _, _ in builtin_phases("turn")] == ["R", "L", "R", "L", "R", "L", "R"]
    for segment in ("pelvis", "chest", "head", "l_foot", "r_foot"):
        turned = np.degrees(yaw("turn", segment) - yaw("turn", segment)[0])
        assert turned[-1] == pytest.approx(90.0)
        assert np.diff(turned).min() > -1e-9, "never back"
    between = np.degrees(yaw("turn", "l_foot") - yaw("turn", "r_foot"))
    assert between.max() < 30.0 and between.min() > -10.0
    middle = 0.25 * sum(point("turn", f"{side}_{part}") for side in "lr" for part in ("ankle", "toe"))
    assert np.linalg.norm((middle[-1] - middle[0])[:2]) < 1e-3


def test_stroll_takes_six_short_steps_straight_ahead() -> None:
    assert [side for side, _, _ in builtin_phases("stroll")] == ["L", "R"] * 3
    assert all(1.5 <= end - begin <= 2.01 for _, begin, end in builtin_phases("stroll"))
    for side in "lr":
        travel = sole("stroll", side) - sole("stroll", side)[0]
        assert travel[-1, 0] == pytest.approx(0.75)
        assert np.abs(travel[:, 1]).max() < 1e-9
    apart = (sole("stroll", "l") - sole("stroll", "r"))[on("stroll", "l") & on("stroll", "r"), 0]
    assert np.abs(apart).max() == pytest.approx(0.15)


def test_walk_goes_at_a_human_pace() -> None:
    m = motion("walk")
    middle = (m.time > 2.5) & (m.time < 5.0)
    pace = np.polyfit(m.time[middle], point("walk", "pelvis")[middle, 0], 1)[0]
    assert 0.6 < pace < 1.4
    assert [side for side, _, _ in builtin_phases("walk")] == ["L", "R"] * 4


def test_phases_end_with_the_first_frame_of_the_next_mode() -> None:
    m = motion("side-kick")
    for side, begin, end in single_support_phases(m):
        assert m.at(begin).support == side == m.at(end - 1e-6).support
        assert m.at(end).support == "D"
