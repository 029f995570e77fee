"""The real clips of ``shared/mocap``: what is read is what was measured of them by other means (INDEX.yaml)."""

from __future__ import annotations

import os
import shutil
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from naoimitate.core.frames import LANDMARK, LANDMARKS, SEGMENT, Motion
from naoimitate.motion import load_motion
from naoimitate.motion.describe import segment_lengths
from naoimitate.motion.tpose import is_tpose

MOCAP = Path(os.environ.get("NAOIMITATE_MOCAP", Path(__file__).parents[2] / "shared" / "mocap"))
INDEX = MOCAP / "INDEX.yaml"
CLIPS: list[dict[str, Any]] = yaml.safe_load(INDEX.read_text())["clips"] if INDEX.exists() else []
MEASURED_TPOSES = ("file's own", "added first frame")

pytestmark = pytest.mark.skipif(not CLIPS, reason=f"no recorded clips at {MOCAP}")


@cache
def load(file: str) -> Motion:
    return load_motion(MOCAP / file)


@pytest.fixture(params=CLIPS, ids=[Path(c["file"]).stem for c in CLIPS])
def clip(request: pytest.FixtureRequest) -> dict[str, Any]:
    """The facts of each clip in turn."""
    return dict(request.param)


def test_every_clip_has_all_landmarks_orientations_and_support(clip: dict[str, Any]) -> None:
    motion = load(clip["file"])
    assert np.isfinite(motion.landmarks).all()
    assert motion.orientations is not None and np.isfinite(motion.orientations).all()
    assert motion.support is not None


def test_the_rate_is_the_true_one_and_the_clip_has_its_length(clip: dict[str, Any]) -> None:
    motion = load(clip["file"])
    assert motion.rate == pytest.approx(clip["fps_true"], rel=1e-3)
    file_frames = len(motion) + clip["frames_skipped_at_start"]
    added = 1 if clip["file"].endswith(".mvnx") or "xsens" in clip["file"] else 0
    assert file_frames == clip["frames"] or file_frames == clip["frames"] + added


def test_frames_that_are_no_motion_are_left_out_and_time_counts_from_the_first_of_the_file(
    clip: dict[str, Any],
) -> None:
    motion = load(clip["file"])
    assert motion.time[0] == pytest.approx(clip["frames_skipped_at_start"] / clip["fps_true"], abs=1e-4)


def test_legs_and_arms_have_their_lengths(clip: dict[str, Any]) -> None:
    lengths = segment_lengths(load(clip["file"]))
    leg = 0.5 * sum(lengths[f"{s}_{bone}"] for s in "lr" for bone in ("thigh", "shank"))
    arm = 0.5 * sum(lengths[f"{s}_{bone}"] for s in "lr" for bone in ("upper_arm", "forearm"))
    assert leg == pytest.approx(clip["leg_hip_to_ankle_m"], abs=0.002)
    assert arm == pytest.approx(clip["arm_shoulder_to_wrist_m"], abs=0.002)


def test_the_root_travels_as_far_as_it_did(clip: dict[str, Any]) -> None:
    pelvis = load(clip["file"]).landmarks[:, LANDMARK["pelvis"], :2]
    assert np.linalg.norm(pelvis[-1] - pelvis[0]) == pytest.approx(clip["root_net_travel_m"], abs=0.13)
    far = np.linalg.norm(pelvis[:, None, :] - pelvis[None, ::5, :], axis=-1).max()
    assert far == pytest.approx(clip["root_horizontal_span_m"], rel=0.1, abs=0.08)


def test_the_person_faces_x_over_the_origin_at_the_start(clip: dict[str, Any]) -> None:
    first = load(clip["file"]).landmarks[0]
    left = sum(first[LANDMARK[f"l_{part}"]] - first[LANDMARK[f"r_{part}"]] for part in ("hip", "shoulder"))
    assert np.degrees(np.arctan2(-left[0], left[1])) == pytest.approx(0.0, abs=12.0)
    assert np.linalg.norm(first[LANDMARK["pelvis"], :2]) < 0.03


def test_feet_turn_with_the_person_and_point_away_from_the_heels(clip: dict[str, Any]) -> None:
    motion = load(clip["file"])
    for side in "lr":
        along = motion.landmarks[:, LANDMARK[f"{side}_toe"]] - motion.landmarks[:, LANDMARK[f"{side}_ankle"]]
        w, x, y, z = motion.orientations[:, SEGMENT[f"{side}_foot"]].T
        forward = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1)
        assert (np.sum(forward * along, axis=1) > 0.7 * np.linalg.norm(along, axis=1)).all()


def test_every_clip_has_a_tpose_to_calibrate_on(clip: dict[str, Any]) -> None:
    motion = load(clip["file"])
    assert motion.tpose is not None and is_tpose(motion.tpose.landmarks[None])[0]
    measured = any(words in motion.tpose_note for words in MEASURED_TPOSES)
    assert measured == (clip["tpose_first_frame"] or clip["file"].endswith(".mvnx"))


def test_a_bvh_file_and_the_amc_file_of_the_same_trial_give_the_same_person() -> None:
    bvh, amc = load("cmu/02_02_walk.bvh"), load("cmu/02_02_walk.amc")
    apart = np.linalg.norm(bvh.landmarks - amc.landmarks, axis=-1).max(axis=0)
    lower = [LANDMARK[f"{s}_{part}"] for s in "lr" for part in ("hip", "knee", "ankle", "toe")]
    assert apart[lower].max() < 0.0005
    assert apart.max() < 0.005, f"worst: {LANDMARKS[int(apart.argmax())]}"


def test_a_bvh_file_and_the_mvnx_file_of_the_same_take_give_the_same_person() -> None:
    bvh, mvnx = load("other/xsens_upperbody_gpl3.bvh"), load("other/xsens_upperbody_gpl3.mvnx")
    a, b = (m.landmarks[-111:] - m.landmarks[-111:, :1] for m in (bvh, mvnx))
    assert np.linalg.norm(a - b, axis=-1).max() < 0.003  # one file starts a frame earlier, so faces x a little earlier
    turned = np.abs(np.sum(bvh.orientations[-111:] * mvnx.orientations[-111:], axis=-1))
    assert np.degrees(2 * np.arccos(np.clip(turned.min(), 0, 1))) < 0.1


def test_a_backflip_shows_its_true_rate_by_its_fall_when_its_name_does_not(tmp_path: Path) -> None:
    copy = shutil.copy(MOCAP / "cmu" / "88_01_backflip_daz.bvh", tmp_path / "flip.bvh")
    motion = load_motion(copy)
    assert motion.rate == pytest.approx(60.0)
    assert any("Free flight" in note for note in motion.notes)


def test_the_labelled_rate_stands_when_people_fall_with_g() -> None:
    for file in (
        "cmu/131_03_start_hop_stop.bvh",
        "cmu/05_20_dance_arabesque_leap.bvh",
        "other/deepmimic_humanoid3d_jump.txt",
    ):
        assert not any("Free flight" in note for note in load(file).notes)


def test_contacts_and_centre_of_mass_of_xsens_are_used() -> None:
    motion = load("other/xsens_upperbody_gpl3.mvnx")
    assert motion.contacts is not None and motion.contacts.all()
    assert motion.com is not None
    assert np.linalg.norm(motion.com - motion.landmarks[:, LANDMARK["pelvis"]], axis=1).max() < 0.25


def test_walks_look_ahead_and_stand_upright() -> None:
    for file in ("cmu/02_02_walk.bvh", "cmu/07_05_slow_walk.amc", "cmu/12_01_walk.bvh"):
        w, x, y, z = np.median(load(file).orientations, axis=0).T
        pitch = np.degrees(np.arcsin(np.clip(2 * (w * y - x * z), -1, 1)))
        assert np.abs(pitch[[SEGMENT[s] for s in ("pelvis", "chest", "head")]]).max() < 15.0


def test_hands_and_toes_are_near_wrists_and_ankles(clip: dict[str, Any]) -> None:
    p = load(clip["file"]).landmarks
    for side in "lr":
        for near, far in (("wrist", "hand"), ("ankle", "toe")):
            way = p[:, LANDMARK[f"{side}_{far}"]] - p[:, LANDMARK[f"{side}_{near}"]]
            assert np.linalg.norm(way, axis=1).max() < 0.3
