from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate.core.errors import UnreachablePose
from naoimitate.core.frames import LANDMARK, SEGMENT
from naoimitate.core.geometry import matrix_from_quat
from naoimitate.human.anthropometry import Anthropometry
from naoimitate.human.procedural import Parameters, arm_towards, pose
from naoimitate.human.segments import center_of_mass
from naoimitate.human.tracks import Spline, Track

BODY = Anthropometry()
ANGLE = st.floats(-0.5, 0.5)


@st.composite
def stands(draw: st.DrawFn) -> Parameters:
    """One moment of somebody on both feet, knees bent, arms anywhere in front and beside."""
    arms = [
        [draw(st.floats(-0.4, 2.6)), draw(st.floats(-0.2, 1.5)), draw(st.floats(0.0, 2.2)), draw(ANGLE)] for _ in "lr"
    ]
    feet = [[draw(st.floats(-0.1, 0.1)), y, 0.0, draw(ANGLE), 0.0, 0.0] for y in (0.12, -0.12)]
    return Parameters(
        feet=np.array([feet]),
        com=np.array([[draw(st.floats(0.0, 0.1)), draw(st.floats(-0.08, 0.08))]]),
        height=np.array([draw(st.floats(0.6, 0.82))]),
        trunk=np.array([[draw(ANGLE), draw(ANGLE), draw(st.floats(-0.2, 0.2))]]),
        arms=np.array([arms]),
        head=np.array([[draw(ANGLE), draw(ANGLE)]]),
    )


def distance(landmarks: np.ndarray, a: str, b: str) -> np.ndarray:
    return np.linalg.norm(landmarks[..., LANDMARK[a], :] - landmarks[..., LANDMARK[b], :], axis=-1)


@settings(max_examples=100, deadline=None)
@given(stands())
def test_bones_keep_their_length_and_the_center_of_mass_is_where_it_should_be(parameters: Parameters) -> None:
    landmarks, _ = pose(BODY, parameters)
    for side in "lr":
        assert distance(landmarks, f"{side}_hip", f"{side}_knee") == pytest.approx(BODY.thigh, abs=1e-9)
        assert distance(landmarks, f"{side}_knee", f"{side}_ankle") == pytest.approx(BODY.shank, abs=1e-9)
        assert distance(landmarks, f"{side}_shoulder", f"{side}_elbow") == pytest.approx(BODY.upper_arm, abs=1e-9)
        assert distance(landmarks, f"{side}_elbow", f"{side}_wrist") == pytest.approx(BODY.forearm, abs=1e-9)
        assert distance(landmarks, f"{side}_wrist", f"{side}_hand") == pytest.approx(BODY.hand, abs=1e-9)
    np.testing.assert_allclose(center_of_mass(landmarks)[:, :2], parameters.com, atol=1e-8)
    np.testing.assert_allclose(landmarks[:, LANDMARK["pelvis"], 2], parameters.height)


@settings(max_examples=50, deadline=None)
@given(stands())
def test_knees_bend_forwards(parameters: Parameters) -> None:
    landmarks, orientations = pose(BODY, parameters)
    forward = matrix_from_quat(orientations[0, SEGMENT["pelvis"]])[:, 0]
    for side in "lr":
        hip, knee, ankle = (landmarks[0, LANDMARK[f"{side}_{name}"]] for name in ("hip", "knee", "ankle"))
        assert (knee - 0.5 * (hip + ankle)) @ forward > 0.0


@settings(max_examples=50, deadline=None)
@given(stands())
def test_the_mirrored_script_gives_the_mirrored_person(parameters: Parameters) -> None:
    mirror = np.array([1.0, -1.0, 1.0])
    flip = replace(
        parameters,
        feet=parameters.feet[:, ::-1] * [1, -1, 1, -1, 1, -1],
        com=parameters.com * [1, -1],
        trunk=parameters.trunk * [-1, 1, -1],
        arms=parameters.arms[:, ::-1],
        head=parameters.head * [-1, 1],
    )
    landmarks, _ = pose(BODY, parameters)
    other, _ = pose(BODY, flip)
    for name in LANDMARK:
        twin = {"l_": "r_", "r_": "l_"}.get(name[:2], name[:2]) + name[2:]
        np.testing.assert_allclose(other[:, LANDMARK[twin]], landmarks[:, LANDMARK[name]] * mirror, atol=1e-7)


@settings(max_examples=50, deadline=None)
@given(stands(), st.floats(-4.0, 4.0))
def test_a_person_who_has_turned_is_the_same_person_turned(parameters: Parameters, heading: float) -> None:
    c, s = np.cos(heading), np.sin(heading)
    turn = np.array([[c, -s], [s, c]])
    feet = parameters.feet + heading * np.array([0, 0, 0, 1, 0, 0])
    feet[..., :2] = feet[..., :2] @ turn.T
    turned = replace(parameters, feet=feet, com=parameters.com @ turn.T, heading=np.array([heading]))
    landmarks, orientations = pose(BODY, parameters)
    other, others = pose(BODY, turned)
    np.testing.assert_allclose(other[..., :2], landmarks[..., :2] @ turn.T, atol=1e-7)
    np.testing.assert_allclose(other[..., 2], landmarks[..., 2], atol=1e-7)
    for before, after in zip(orientations[0], others[0], strict=True):
        axes = matrix_from_quat(before)
        np.testing.assert_allclose(matrix_from_quat(after)[:2], turn @ axes[:2], atol=1e-7)


@settings(max_examples=50, deadline=None)
@given(st.sampled_from("lr"), st.floats(0.25, 0.55), st.floats(-1.2, 1.2), st.floats(-1.2, 1.2))
def test_the_wrist_goes_where_it_is_asked_to(side: str, reach: float, azimuth: float, elevation: float) -> None:
    wanted = reach * np.array(
        [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
    )
    arms = np.zeros((1, 2, 4))
    arms[0, "lr".index(side)] = arm_towards(BODY, side, wanted)
    feet = np.array([[[0, 0.1, 0, 0, 0, 0], [0, -0.1, 0, 0, 0, 0]]], dtype=float)
    upright = Parameters(feet, np.zeros((1, 2)), np.array([0.85]), np.zeros((1, 3)), arms, np.zeros((1, 2)))
    landmarks, _ = pose(BODY, upright)
    np.testing.assert_allclose(
        landmarks[0, LANDMARK[f"{side}_wrist"]] - landmarks[0, LANDMARK[f"{side}_shoulder"]], wanted, atol=1e-9
    )


def test_a_swivelled_elbow_goes_up_and_out() -> None:
    feet = np.array([[[0, 0.1, 0, 0, 0, 0], [0, -0.1, 0, 0, 0, 0]]], dtype=float)
    elbows = []
    for swivel in (0.0, 0.4):
        arms = np.tile([1.5, 0.1, 0.8, swivel], (1, 2, 1))
        landmarks, _ = pose(
            BODY, Parameters(feet, np.zeros((1, 2)), np.array([0.85]), np.zeros((1, 3)), arms, np.zeros((1, 2)))
        )
        elbows.append(landmarks[0, [LANDMARK["l_elbow"], LANDMARK["r_elbow"]]])
    (left, right), (left_up, right_up) = elbows
    assert left_up[1] > left[1] and right_up[1] < right[1]
    assert left_up[2] > left[2] and right_up[2] > right[2]


def test_a_foot_out_of_reach_is_an_error_that_says_so() -> None:
    feet = np.array([[[0, 0.1, 0, 0, 0, 0], [0, -0.9, 0, 0, 0, 0]]], dtype=float)
    far = Parameters(feet, np.zeros((1, 2)), np.array([0.9]), np.zeros((1, 3)), np.zeros((1, 2, 4)), np.zeros((1, 2)))
    with pytest.raises(UnreachablePose, match="r leg"):
        pose(BODY, far)
    with pytest.raises(UnreachablePose, match="l wrist"):
        arm_towards(BODY, "l", np.array([0.9, 0.0, 0.0]))


@pytest.mark.parametrize(
    "curve",
    [
        Track(0.0, ((1.0, 2.0, 1.0), (2.0, 4.0, -0.5))),
        Track((0.0, 1.0), ((0.5, 2.5, (1.0, 0.0)),)),
        Spline(1.0, 0.5, (0.0, 1.0, -1.0, 2.0, 2.0)),
    ],
)
def test_tracks_are_twice_continuously_differentiable(curve: Track | Spline) -> None:
    """Halving the sampling interval halves the largest jump of the second derivative (jumps are of the jerk only)."""

    def jump(step: float) -> float:
        value = curve(np.arange(0.0, 6.0, step))
        return float(np.abs(np.diff(value, 3, axis=0)).max() / step**2)

    assert jump(0.005) < 0.6 * jump(0.01)


def test_a_track_arrives_and_rests() -> None:
    track = Track(2.0, ((1.0, 2.0, 5.0),))
    np.testing.assert_allclose(track(np.array([0.0, 1.0, 1.5, 2.0, 9.0])), [2.0, 2.0, 3.5, 5.0, 5.0])


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-5, 5), min_size=2, max_size=9))
def test_a_spline_never_overshoots_its_controls(controls: list[float]) -> None:
    value = Spline(0.0, 0.4, tuple(controls))(np.linspace(-2.0, 8.0, 300))
    assert value.min() >= min(controls) - 1e-9 and value.max() <= max(controls) + 1e-9
    assert value[0] == pytest.approx(controls[0]) and value[-1] == pytest.approx(controls[-1])


@pytest.mark.parametrize("stature", [1.5, 1.75, 2.0])
def test_lengths_are_those_of_a_person(stature: float) -> None:
    body = Anthropometry(stature)
    height = body.leg + body.waist + body.trunk
    assert height == pytest.approx(0.818 * stature)
    assert 0.095 < body.hips / stature < 0.105
    assert 0.20 < body.shoulders / stature < 0.23
    sole = body.sole
    assert np.ptp(sole[:, 0]) == pytest.approx(0.152 * stature)
    assert np.ptp(sole[:, 1]) == pytest.approx(0.055 * stature)
    edges = np.roll(sole, -1, axis=0) - sole
    turns = edges[:, 0] * np.roll(edges, -1, axis=0)[:, 1] - edges[:, 1] * np.roll(edges, -1, axis=0)[:, 0]
    assert (turns > 0).all(), "the outline is convex and counter-clockwise"
