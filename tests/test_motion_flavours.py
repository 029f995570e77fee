"""A known person, written in the ways of many programs, comes back with every landmark where it was."""

from __future__ import annotations

from functools import cache
from itertools import cycle
from pathlib import Path

import motion_texts
import numpy as np
import pytest
from skeleton_writer import FLAVOURS, NAMELESS, Y_UP, Z_UP, Style, bvh

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import LANDMARK, LANDMARKS, SEGMENTS, Motion
from naoimitate.motion import load_motion
from naoimitate.motion.builtin import builtin_motion
from naoimitate.motion.load import recorded
from naoimitate.motion.scene import Options
from naoimitate.motion.tpose import is_tpose

pytestmark = pytest.mark.filterwarnings("ignore:Gimbal lock")

STEP = 12
RATE = 100.0 / STEP
UNITS = {"metres": 1.0, "centimetres": 0.01, "millimetres": 0.001, "inches": 0.0254, "CMU's units": 0.0254 / 0.45}
RESTS = ("t", "a", "hanging", "spread", "x")
_ORDERS, _UNITS = cycle(("ZXY", "ZYX", "XYZ", "YXZ")), cycle(UNITS.values())
_AXES, _SIX = cycle((Y_UP, Z_UP)), cycle((False, False, True))
STYLES = {
    f"{name}, {rest}": Style(names, rest, next(_UNITS), next(_AXES), next(_ORDERS), next(_SIX), rate=RATE)
    for name, names in {**FLAVOURS, "nameless": NAMELESS}.items()
    for rest in RESTS
}
"""Every naming in every rest pose; units, axes, Euler orders and position channels take turns."""


@cache
def truth(name: str = "paper") -> Motion:
    return builtin_motion(name)


def apart(motion: Motion, name: str = "paper", frames: slice = slice(None, None, STEP)) -> np.ndarray:
    """Distance of every landmark from the truth, (T, 19) m, after the true person was put over the origin."""
    true = truth(name).landmarks[frames]
    true = true - true[0, LANDMARK["pelvis"]] * [1.0, 1.0, 0.0]
    error = motion.landmarks - true
    return np.linalg.norm(error - [0.0, 0.0, error[..., 2].mean()], axis=-1)


def turned(motion: Motion, name: str = "paper", frames: slice = slice(None, None, STEP)) -> np.ndarray:
    """Angle of every segment from the truth, (T, 7) deg."""
    cosine = np.abs(np.sum(motion.orientations * truth(name).orientations[frames], axis=-1))
    return np.degrees(2 * np.arccos(np.clip(cosine, 0, 1)))


def read(folder: Path, text: str, name: str = "person.bvh", **wishes: object) -> Motion:
    (folder / name).write_text(text)
    return load_motion(folder / name, **wishes)


@pytest.mark.parametrize("style", STYLES.values(), ids=STYLES.keys())
def test_every_landmark_and_segment_of_every_flavour_comes_back(style: Style, tmp_path: Path) -> None:
    motion = read(tmp_path, bvh(truth(), style, STEP))
    off = apart(motion).max(axis=0)
    assert off.max() < 0.001, f"{LANDMARKS[int(off.argmax())]}: {motion.notes}"
    assert motion.landmarks[0, LANDMARK["l_ankle"], 2] == pytest.approx(
        truth().landmarks[0, LANDMARK["l_ankle"], 2], abs=0.005
    )
    off = turned(motion).max(axis=0)
    assert off.max() < 0.5, f"{SEGMENTS[int(off.argmax())]}: {motion.notes}"


@pytest.mark.parametrize("style", list(STYLES.values())[::7], ids=list(STYLES)[::7])
def test_an_added_tpose_calibrates_and_is_no_motion(style: Style, tmp_path: Path) -> None:
    motion = read(tmp_path, bvh(truth("walk"), style, STEP, added=True))
    assert motion.time[0] == pytest.approx(1.0 / RATE)
    assert "added first frame" in motion.tpose_note
    assert apart(motion, "walk").max() < 0.03  # the floor under a walk may be found a little tilted


@pytest.mark.parametrize("rest", RESTS)
def test_a_clip_without_a_tpose_gets_one_of_its_segment_lengths(rest: str, tmp_path: Path) -> None:
    motion = read(tmp_path, bvh(truth("walk"), Style(rest=rest, rate=RATE), STEP))
    assert motion.tpose is not None and is_tpose(motion.tpose.landmarks[None])[0]
    assert "segment lengths" in motion.tpose_note
    for a, b in (("l_shoulder", "l_elbow"), ("r_elbow", "r_wrist"), ("l_hip", "l_knee"), ("r_knee", "r_ankle")):
        length = np.linalg.norm(truth().landmarks[0, LANDMARK[a]] - truth().landmarks[0, LANDMARK[b]])
        assert np.linalg.norm(motion.tpose[a] - motion.tpose[b]) == pytest.approx(length, abs=1e-4)
    assert turned(motion, "walk").max() < (25.0 if rest == "x" else 1.5)


def test_a_tpose_can_be_chosen_made_or_is_refused(tmp_path: Path) -> None:
    text = bvh(truth(), Style(rate=RATE), STEP)
    assert "held at" in read(tmp_path, text).tpose_note
    assert "as asked." in read(tmp_path, text, tpose_at=0.24).tpose_note
    assert "the posture there is none" in read(tmp_path, text, tpose_at=10.0).tpose_note
    assert "segment lengths" in read(tmp_path, text, tpose_at="none").tpose_note
    for wish in (1000.0, -1.0, float("nan"), "soon"):
        with pytest.raises(MotionFormatError, match="T-pose"):
            read(tmp_path, text, tpose_at=wish)


@pytest.mark.parametrize("name", UNITS)
def test_units_are_found_by_the_person_and_can_be_overridden(name: str, tmp_path: Path) -> None:
    text = bvh(truth("squat"), Style(unit=UNITS[name], rate=RATE), STEP)
    motion = read(tmp_path, text)
    assert any(name in note for note in motion.notes)
    assert apart(motion, "squat").max() < 0.001
    half = read(tmp_path, text, unit=0.5 * UNITS[name])
    assert np.allclose(np.ptp(half.landmarks[0], axis=0), 0.5 * np.ptp(motion.landmarks[0], axis=0), atol=1e-3)


@pytest.mark.parametrize(("axes", "up"), [(Y_UP, "y"), (Z_UP, "z")])
def test_the_up_axis_is_found_and_can_be_overridden(axes: np.ndarray, up: str, tmp_path: Path) -> None:
    text = bvh(truth("squat"), Style(axes=axes, rate=RATE), STEP)
    motion = read(tmp_path, text)
    assert any(f"Up is the file's {up} axis" in note for note in motion.notes)
    other = read(tmp_path, text, up="z" if up == "y" else "y")
    assert np.ptp(other.landmarks[0, :, 2]) < 0.8  # lies down now


def test_a_skeleton_built_for_y_up_that_stands_in_a_z_up_world_stands(tmp_path: Path) -> None:
    style = Style(names=FLAVOURS["lafan1"], rest="x", axes=Z_UP, rate=RATE)
    motion = read(tmp_path, bvh(truth("walk"), style, STEP))
    assert apart(motion, "walk").max() < 0.03


def test_left_handed_axes_are_mirrored_back(tmp_path: Path) -> None:
    motion = read(tmp_path, bvh(truth(), Style(axes=np.diag([-1.0, 1.0, 1.0]) @ Y_UP, rate=RATE), STEP))
    assert apart(motion).max() < 0.001 and turned(motion).max() < 0.5
    assert any("left-handed" in note for note in motion.notes)


def test_the_offset_of_the_root_is_not_added_to_absolute_channels(tmp_path: Path) -> None:
    there = tuple(truth().landmarks[0, LANDMARK["pelvis"]] @ Y_UP.T / 0.01)
    motion = read(tmp_path, bvh(truth(), Style(root_offset=there, rate=RATE), STEP))
    assert apart(motion).max() < 0.001
    assert any("OFFSET was not added" in note for note in motion.notes)


def test_missing_hands_feet_and_heads_are_placed_and_said(tmp_path: Path) -> None:
    style = Style(names=FLAVOURS["mixamo"], without=("head", "neck", "l_wrist", "r_wrist", "l_toe", "r_toe"), rate=RATE)
    motion = read(tmp_path, bvh(truth("squat"), style, STEP))
    assert np.isfinite(motion.landmarks).all()
    assert any("the knuckles" in note and "the head's centre" in note for note in motion.notes)
    assert apart(motion, "squat").max() < 0.05  # a head that is not in the file cannot be seen to bow


@pytest.mark.parametrize("joint", ["l_hip", "r_knee", "r_elbow"])
def test_a_skeleton_without_a_needed_joint_says_which(joint: str, tmp_path: Path) -> None:
    says = {"l": "left", "r": "right"}[joint[0]] + " " + joint[2:]
    with pytest.raises(MotionFormatError, match=says):
        read(tmp_path, bvh(truth("squat"), Style(without=(joint,)), STEP))


@pytest.mark.parametrize(
    ("names", "without", "known"),
    [
        ("plain", (), (True, True, True)),
        ("xsens", (), (True, True, True)),
        ("daz", (), (True, True, False)),
        ("plain", ("l_toe", "r_toe"), (True, True, False)),
    ],
)
def test_the_points_of_the_feet_are_those_of_the_skeleton(
    names: str, without: tuple[str, ...], known: tuple[bool, ...], tmp_path: Path
) -> None:
    style = Style(FLAVOURS[names], without=without, axes=Z_UP, unit=0.0254, rate=RATE)
    (tmp_path / "person.bvh").write_text(bvh(truth("squat"), style, STEP))
    motion, feet = recorded(tmp_path / "person.bvh", Options())
    assert np.isfinite(feet).all(axis=(0, 1, 3)).tolist() == list(known)
    assert np.isfinite(feet).any(axis=(0, 1, 3)).tolist() == list(known)
    for i, side in enumerate("lr"):
        ankle, toe = (motion.landmarks[:, LANDMARK[f"{side}_{part}"]] for part in ("ankle", "toe"))
        assert np.allclose(feet[:, i, :2], np.stack([ankle, toe], axis=1), atol=1e-9)
        if known[2]:
            assert np.allclose(np.linalg.norm(feet[:, i, 2] - toe, axis=-1), 0.05, atol=1e-4)
            assert np.allclose(feet[:, i, 2, 2], toe[:, 2], atol=1e-3), "the toes of a squat lie flat"


def test_a_skeleton_that_ends_at_the_ankles_has_no_points_of_the_toes(tmp_path: Path) -> None:
    (tmp_path / "swing.txt").write_text(motion_texts.deepmimic())
    motion, feet = recorded(tmp_path / "swing.txt", Options())
    assert np.isfinite(motion.landmarks).all() and np.isfinite(feet[:, :, 0]).all()
    assert np.isnan(feet[:, :, 1:]).all()


def test_an_acclaim_pair_comes_back_with_its_skeleton_beside_it_or_named(tmp_path: Path) -> None:
    (tmp_path / "07.asf").write_text(motion_texts.asf())
    motion = read(tmp_path, motion_texts.amc(truth(), STEP), "07_01.amc", fps=RATE)
    assert apart(motion).max() < 0.001 and turned(motion).max() < 0.5
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    with pytest.raises(MotionFormatError, match="--skeleton"):
        read(elsewhere, motion_texts.amc(truth(), STEP), "07_01.amc")
    named = read(elsewhere, motion_texts.amc(truth(), STEP), "07_01.amc", fps=RATE, skeleton=tmp_path / "07.asf")
    assert np.array_equal(named.landmarks, motion.landmarks)
    assert load_motion(elsewhere / "07_01.amc", skeleton=tmp_path / "07.asf").rate == pytest.approx(120.0)


def test_an_mvnx_file_comes_back_with_tpose_contacts_and_centre_of_mass(tmp_path: Path) -> None:
    motion = read(tmp_path, motion_texts.mvnx(truth(), STEP, RATE), "person.mvnx")
    assert apart(motion).max() < 0.001 and turned(motion).max() < 0.5
    assert "calibration posture" in motion.tpose_note
    assert motion.contacts is not None and np.array_equal(
        motion.contacts[:, 0], np.isin(truth().support[::STEP], ["D", "L"])
    )
    assert motion.com is not None and np.allclose(motion.com, motion.landmarks[:, LANDMARK["pelvis"]], atol=1e-6)


def test_deepmimic_frames_have_their_own_durations_and_a_standard_skeleton(tmp_path: Path) -> None:
    motion = read(tmp_path, motion_texts.deepmimic(), "swing.txt")
    assert motion.rate == pytest.approx(50.0)
    assert np.linalg.norm(motion.tpose["l_hip"] - motion.tpose["l_knee"]) == pytest.approx(0.421546, abs=1e-6)
    assert motion.landmarks[-1, LANDMARK["pelvis"], 0] == pytest.approx(0.39, abs=1e-3)
    assert (motion.landmarks[:, LANDMARK["l_hip"], 1] > motion.landmarks[:, LANDMARK["r_hip"], 1]).all()
