"""A person's calibration, and its file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from people import BODY, bare, person, tpose, turned, without

from naoimitate.calib.subject import FORMAT, calibrate, load_subject, save_subject
from naoimitate.core.errors import CalibrationError
from naoimitate.core.frames import HumanFrame

DAMAGES = {
    "empty": "",
    "not YAML": "format: [",
    "binary": "\x00\x01\x02",
    "a list": "- 1\n- 2\n",
    "a number": "3",
    "another format": "format: something-else/1\n",
    "no T-pose": f"format: {FORMAT}\n",
    "no landmarks": f"format: {FORMAT}\ntpose: {{}}\n",
    "landmarks as text": f"format: {FORMAT}\ntpose: {{landmarks_m: hello, orientations_wxyz: null}}\n",
}


def test_a_t_pose_becomes_a_subject_with_its_reference_posture() -> None:
    subject = calibrate(tpose())
    arm = BODY.upper_arm + BODY.forearm
    assert subject.reference[0] == pytest.approx([0.0, arm, 0.0], abs=1e-6)
    assert subject.body.limb_lengths == pytest.approx([arm, BODY.leg, arm, BODY.leg])


@pytest.mark.parametrize("make", [tpose, lambda: bare(tpose()), lambda: turned(tpose(), 2.0, 3.0, -1.0)])
def test_round_trip(tmp_path: Path, make: object) -> None:
    subject = calibrate(make())
    save_subject(subject, tmp_path / "subject.yaml")
    again = load_subject(tmp_path / "subject.yaml")
    assert again.reference == pytest.approx(subject.reference, abs=1e-5)
    assert again.body.limb_lengths == pytest.approx(subject.body.limb_lengths, abs=1e-5)
    assert again.tpose.landmarks == pytest.approx(subject.tpose.landmarks, abs=1e-6)
    assert (again.tpose.orientations is None) == (subject.tpose.orientations is None)


def test_round_trip_keeps_what_the_source_does_not_have(tmp_path: Path) -> None:
    frame = without(tpose(), "head", "l_hand", "r_hand")
    assert frame.orientations is not None
    frame.orientations[0] = np.nan
    save_subject(calibrate(frame), tmp_path / "subject.yaml")
    again = load_subject(tmp_path / "subject.yaml").tpose
    assert np.array_equal(np.isnan(again.landmarks), np.isnan(frame.landmarks))
    assert np.array_equal(np.isnan(again.orientations), np.isnan(frame.orientations))


def test_the_file_can_be_read_by_people(tmp_path: Path) -> None:
    save_subject(calibrate(tpose()), tmp_path / "subject.yaml")
    document = yaml.safe_load((tmp_path / "subject.yaml").read_text())
    assert document["format"] == FORMAT
    assert document["measures_m"]["stature"] == pytest.approx(BODY.stature, abs=1e-3)
    assert set(document["reference_m"]) == {"l_hand", "l_foot", "r_hand", "r_foot"}


@pytest.mark.parametrize("name", DAMAGES)
def test_a_damaged_file_gives_one_clear_line(tmp_path: Path, name: str) -> None:
    path = tmp_path / "subject.yaml"
    path.write_text(DAMAGES[name])
    with pytest.raises(CalibrationError) as error:
        load_subject(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_a_missing_file_and_a_folder_give_one_clear_line(tmp_path: Path) -> None:
    for path in (tmp_path / "nowhere.yaml", tmp_path):
        with pytest.raises(CalibrationError, match="naoimitate calibrate"):
            load_subject(path)


def test_bytes_that_are_no_text_give_one_clear_line(tmp_path: Path) -> None:
    path = tmp_path / "subject.yaml"
    path.write_bytes(b"\xff\xfe\x00\x9f" * 50)
    with pytest.raises(CalibrationError, match="calibrate"):
        load_subject(path)


@pytest.mark.parametrize(
    ("part", "name", "value"),
    [
        ("landmarks_m", "l_knee", None),
        ("landmarks_m", "l_knee", [1.0, 2.0]),
        ("landmarks_m", "l_knee", [1.0, 2.0, "x"]),
        ("landmarks_m", "l_knee", [1.0, 2.0, float("nan")]),
        ("landmarks_m", "l_knee", [1.0, 2.0, float("inf")]),
        ("orientations_wxyz", "head", [1.0, 0.0, 0.0]),
        ("orientations_wxyz", "head", "straight"),
    ],
)
def test_a_damaged_value_is_refused(tmp_path: Path, part: str, name: str, value: object) -> None:
    path = tmp_path / "subject.yaml"
    save_subject(calibrate(tpose()), path)
    document = yaml.safe_load(path.read_text())
    document["tpose"][part][name] = value
    path.write_text(yaml.safe_dump(document))
    with pytest.raises(CalibrationError):
        load_subject(path)


@pytest.mark.parametrize("part", ["landmarks_m", "orientations_wxyz"])
def test_a_missing_row_is_refused(tmp_path: Path, part: str) -> None:
    path = tmp_path / "subject.yaml"
    save_subject(calibrate(tpose()), path)
    document = yaml.safe_load(path.read_text())
    document["tpose"][part].popitem()
    path.write_text(yaml.safe_dump(document))
    with pytest.raises(CalibrationError):
        load_subject(path)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_file_cut_short_is_refused(tmp_path: Path, share: float) -> None:
    path = tmp_path / "subject.yaml"
    save_subject(calibrate(tpose()), path)
    text = path.read_text()
    path.write_text(text[: int(share * len(text))])
    with pytest.raises(CalibrationError):
        load_subject(path)


def test_a_subject_must_have_limbs() -> None:
    with pytest.raises(CalibrationError, match="l_knee"):
        calibrate(without(tpose(), "l_knee"))
    with pytest.raises(CalibrationError, match="unit"):
        calibrate(HumanFrame(0.0, person().landmarks * 1e-3))
    with pytest.raises(CalibrationError):
        calibrate(replace(tpose(), landmarks=np.full((19, 3), np.nan)))


def test_impossible_orientations_of_a_t_pose_do_not_spoil_the_reference() -> None:
    frame = tpose()
    broken = replace(frame, orientations=np.zeros_like(frame.orientations))
    assert calibrate(broken).reference == pytest.approx(calibrate(frame).reference, abs=0.01)
