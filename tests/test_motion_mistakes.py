"""Damaged, odd and hopeless files: they run as far as they can, or end in one line that says what to do."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path

import motion_texts
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from skeleton_writer import FLAVOURS, Style, bvh

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import LANDMARK, LANDMARKS, Motion
from naoimitate.motion import load_motion, readers
from naoimitate.motion.builtin import builtin_motion
from naoimitate.motion.describe import describe
from naoimitate.motion.mvnx import read_mvnx

pytestmark = pytest.mark.filterwarnings("ignore:Gimbal lock")

STEP = 50
DAMAGE = (b"", b"nan ", b"1e308", b"\xff", b"\0", b" ", b"\n", b"7", b"}")
"""What takes the place of a byte of a damaged file."""


@cache
def text(name: str = "paper") -> str:
    return bvh(builtin_motion(name), Style(rate=2.0), STEP)


def read(folder: Path, content: str | bytes, name: str = "person.bvh", **wishes: object) -> Motion:
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return load_motion(folder / name, **wishes)


def refused(folder: Path, content: str | bytes, says: str, name: str = "person.bvh", **wishes: object) -> None:
    with pytest.raises(MotionFormatError, match=says) as caught:
        read(folder, content, name, **wishes)
    assert "\n" not in str(caught.value) and name in str(caught.value)


def lines_of(content: str, change: Callable[[list[str]], list[str]]) -> str:
    """The text with its lines of motion changed."""
    head, _, body = content.partition("Frame Time: ")
    step, *rows = body.strip().split("\n")
    return f"{head}Frame Time: {step}\n" + "\n".join(change(rows)) + "\n"


def test_a_file_cut_within_its_motion_runs_with_its_complete_frames(tmp_path: Path) -> None:
    whole = read(tmp_path, text())
    half = read(tmp_path, text()[: int(0.7 * len(text()))])
    assert 0.4 * len(whole) < len(half) < 0.8 * len(whole)
    assert any("cut off" in note for note in half.notes) and any("declares 50 frames" in note for note in half.notes)
    assert np.abs(half.landmarks - whole.landmarks[: len(half)]).max() < 0.005


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.999])
def test_a_file_cut_within_its_hierarchy_is_refused(share: float, tmp_path: Path) -> None:
    refused(tmp_path, text()[: int(share * text().index("MOTION"))], "ends before its motion")


def test_a_file_without_a_complete_frame_is_refused(tmp_path: Path) -> None:
    head = text()[: text().index("Frame Time")]
    refused(tmp_path, head.replace("Frames: 50", "Frames: 0") + "Frame Time: 0.5\n", "no complete frame")
    refused(tmp_path, head + "Frame Time: 0.5\n1 2 3\n", "no complete frame")


def test_a_single_frame_runs(tmp_path: Path) -> None:
    motion = read(tmp_path, lines_of(text(), lambda rows: rows[:1]))
    assert len(motion) == 1 and motion.time[0] == 0.0 and motion.tpose is not None


@pytest.mark.parametrize("rate", [10.0, 500.0])
def test_slow_and_fast_recordings_keep_their_rate(rate: float, tmp_path: Path) -> None:
    motion = read(tmp_path, bvh(builtin_motion("wave"), Style(rate=rate), max(1, int(100 / rate))))
    assert motion.rate == pytest.approx(rate, rel=1e-3)


def test_a_file_without_a_rate_needs_one(tmp_path: Path) -> None:
    for step in ("0", "0.0", "-0.01", "soon", "nan", "33333"):
        refused(tmp_path, text().replace("Frame Time: 0.5000000", f"Frame Time: {step}"), "--fps")
    motion = read(tmp_path, text().replace("Frame Time: 0.5000000", "Frame Time: 0"), fps=2.0)
    assert motion.rate == pytest.approx(2.0)
    refused(tmp_path, text(), "--fps", fps=0.0)


def test_short_gaps_are_bridged_and_said(tmp_path: Path) -> None:
    def damaged(rows: list[str]) -> list[str]:
        return [" ".join(["nan"] * len(row.split())) if i in (7, 8) else row for i, row in enumerate(rows)]

    fine = bvh(builtin_motion("squat"), Style(rate=50.0), 2)
    whole, motion = read(tmp_path, fine), read(tmp_path, lines_of(fine, damaged))
    assert np.isfinite(motion.landmarks).all() and np.isfinite(motion.orientations).all()
    assert any("interpolated" in note for note in motion.notes)
    assert np.abs(motion.landmarks - whole.landmarks).max() < 0.01


def test_long_gaps_stay_open(tmp_path: Path) -> None:
    def damaged(rows: list[str]) -> list[str]:
        return [" ".join(["nan"] * len(row.split())) if 20 <= i < 60 else row for i, row in enumerate(rows)]

    motion = read(tmp_path, lines_of(bvh(builtin_motion("squat"), Style(rate=50.0), 2), damaged))
    assert np.isnan(motion.landmarks[30]).all() and np.isfinite(motion.landmarks[70]).all()
    assert any("40 frames keep missing" in note for note in motion.notes)
    missing = describe(motion)["missing"]
    assert list(missing) == list(LANDMARKS) and missing["l_knee"] == pytest.approx(40 / len(motion))


def test_a_damaged_frame_is_a_gap_and_many_are_refused(tmp_path: Path) -> None:
    motion = read(tmp_path, lines_of(text(), lambda rows: [*rows[:5], "1 2 x", *rows[6:]]))
    assert len(motion) == 50 and any("1 damaged frames" in note for note in motion.notes)
    refused(tmp_path, lines_of(text(), lambda rows: ["1 2 x" if i % 3 else r for i, r in enumerate(rows)]), "damaged")


def test_a_joint_that_is_never_there_is_refused_by_name(tmp_path: Path) -> None:
    def damaged(rows: list[str]) -> list[str]:
        return ["nan " + row.split(" ", 1)[1] for row in rows]

    refused(tmp_path, lines_of(text(), damaged), "left hip is in no frame")


def test_teleports_are_kept_and_said(tmp_path: Path) -> None:
    def jump(rows: list[str]) -> list[str]:
        parts = [row.split() for row in rows]
        return [" ".join([str(float(p[0]) + 200.0 * (i >= 30)), *p[1:]]) for i, p in enumerate(parts)]

    fine = bvh(builtin_motion("wave"), Style(rate=50.0), 2)
    motion = read(tmp_path, lines_of(fine, jump))
    step = np.linalg.norm(motion.landmarks[30, 0] - motion.landmarks[29, 0])
    assert step == pytest.approx(2.0, abs=0.01)
    assert any("jumps up to 2.0" in note and "0.60 s" in note for note in motion.notes)


@pytest.mark.parametrize(("turn", "upright"), [("lying", 0.0), ("handstand", -1.0)])
def test_people_who_lie_or_stand_on_their_hands_are_read(turn: str, upright: float, tmp_path: Path) -> None:
    def tipped(rows: list[str]) -> list[str]:
        angles = {"lying": "0 -90 0", "handstand": "180 0 0"}[turn]
        return [" ".join([row.split()[0], "20", row.split()[2], angles, *row.split()[6:]]) for row in rows]

    motion = read(tmp_path, lines_of(text("wave"), tipped))
    body = motion.landmarks[:, LANDMARK["chest"]] - motion.landmarks[:, LANDMARK["pelvis"]]
    assert np.allclose(body[:, 2] / np.linalg.norm(body, axis=1), upright, atol=0.2)
    assert np.isfinite(motion.landmarks).all() and motion.tpose is not None
    assert motion.tpose["head"][2] > motion.tpose["pelvis"][2] > motion.tpose["l_knee"][2]


def test_what_is_no_motion_file_is_refused_with_a_hint(tmp_path: Path) -> None:
    refused(tmp_path, b"", "empty")
    refused(tmp_path, b"   \n", "empty")
    refused(tmp_path, bytes(range(256)) * 40, "ends before its motion")
    refused(tmp_path, bytes(range(256)) * 40, "export it as BVH", "person.fbx")
    refused(tmp_path, motion_texts.asf(), "is a skeleton", "person.asf")
    refused(tmp_path, "{}", "no complete frame", "person.json")
    with pytest.raises(MotionFormatError, match="folder"):
        load_motion(tmp_path)
    with pytest.raises(MotionFormatError, match="cannot be read"):
        load_motion(tmp_path / "nowhere.bvh")
    with pytest.raises(MotionFormatError):
        load_motion("\0.bvh")
    with pytest.raises(MotionFormatError, match="no built-in motion"):
        load_motion("builtin:nothing")


def test_a_file_too_large_to_hold_and_one_of_two_people_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused(tmp_path, text().replace("JOINT Spine\n", "ROOT Spine\n"), "more than one skeleton")
    monkeypatch.setattr(readers, "LARGEST", 100)
    refused(tmp_path, text(), "cut it into parts")


def test_a_unit_that_makes_nobody_is_replaced_by_a_usual_stature_and_said(tmp_path: Path) -> None:
    motion = read(tmp_path, bvh(builtin_motion("wave"), Style(unit=3e-5, rate=2.0), STEP))
    assert describe(motion)["person"]["stature"] == pytest.approx(1.70, abs=0.01)
    assert any("--unit" in note for note in motion.notes)


def test_the_content_tells_the_format_not_the_name(tmp_path: Path) -> None:
    assert len(read(tmp_path, text(), "person.TXT")) == 50
    assert len(read(tmp_path, motion_texts.mvnx(builtin_motion("wave"), STEP, 2.0), "person.xml")) == 28


def test_line_ends_encodings_and_marks_do_not_matter(tmp_path: Path) -> None:
    plain = read(tmp_path, text())
    odd = text().replace("Hips", "H\u00fcfte").replace("Spine1", "R\u00fccken").encode("latin-1")
    dos, old_mac, mixed = text().replace("\n", "\r\n"), text().replace("\n", "\r"), text().replace("\n", "\r\n", 40)
    for content in (dos, old_mac, mixed, text() + "\n\n", "\ufeff" + text(), odd, text().encode("utf-16")):
        assert np.allclose(read(tmp_path, content).landmarks, plain.landmarks, atol=1e-6)


def test_wishes_that_do_not_fit_the_file_are_refused(tmp_path: Path) -> None:
    refused(tmp_path, text(), "own skeleton", skeleton=tmp_path / "x.asf")
    refused(tmp_path, text(), "--unit", unit=0.0)
    refused(tmp_path, text(), "--up", up="sideways")
    with pytest.raises(MotionFormatError, match="no frame lies between"):
        read(tmp_path, text(), start=100.0)
    for wish, says in (({"fps": 100.0}, "--fps"), ({"tpose_at": 1.0}, "--tpose-at")):
        with pytest.raises(MotionFormatError, match=f"{says} is for files"):
            load_motion("builtin:wave", **wish)


def test_a_stretch_of_a_clip_keeps_the_times_of_the_file(tmp_path: Path) -> None:
    whole, part = read(tmp_path, text()), read(tmp_path, text(), start=5.0, end=10.0)
    assert part.time[0] == pytest.approx(5.0) and part.time[-1] == pytest.approx(10.0)
    assert np.array_equal(part.landmarks, whole.landmarks[10:21]) and part.tpose is not None
    assert np.array_equal(part.support, whole.support[10:21])


def test_an_external_entity_is_not_resolved(tmp_path: Path) -> None:
    (tmp_path / "secret.txt").write_text("2.5")
    declared = f'<!DOCTYPE mvnx [<!ENTITY x SYSTEM "{(tmp_path / "secret.txt").as_uri()}">]>'
    evil = motion_texts.mvnx(builtin_motion("wave"), STEP, 2.0).replace("?>\n", f"?>\n{declared}\n", 1)
    clip = read_mvnx(evil.replace("<centerOfMass>", "<centerOfMass>&x; ").encode())
    assert len(clip) == 28 and clip.com is None


def test_a_bomb_of_entities_is_refused(tmp_path: Path) -> None:
    entities = ['<!ENTITY a "ha">']
    entities += [f'<!ENTITY {b} "{f"&{a};" * 20}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True)]
    evil = motion_texts.mvnx(builtin_motion("wave"), STEP, 2.0).replace("<footContacts>", "<footContacts>&i; ")
    refused(tmp_path, evil.replace("?>\n", f"?>\n<!DOCTYPE mvnx [{''.join(entities)}]>\n", 1), "damaged", "bomb.mvnx")


def test_facts_about_a_motion_are_plain_values(tmp_path: Path) -> None:
    facts = describe(read(tmp_path, text()))
    assert facts["person"]["stature"] == pytest.approx(1.75, abs=0.01) and facts["rate"] == pytest.approx(2.0)
    assert facts["segment_lengths"]["l_thigh"] == pytest.approx(0.245 * 1.75, abs=1e-3)
    assert facts["missing"] == {} and facts["frames"] == 50
    assert sum(facts["support"].values()) == pytest.approx(1.0) and abs(facts["lowest_foot"]) < 0.05


@cache
def samples() -> dict[str, bytes]:
    """A small file of each format."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        motion = builtin_motion("paper")
        daz = Style(FLAVOURS["daz"], rest="a", six_channels=True, rate=2.0)
        files = {
            "person.bvh": bvh(motion, Style(rate=2.0), 100),
            "daz.bvh": bvh(motion, daz, 100, added=True),
            "person_01.amc": motion_texts.amc(motion, 100),
            "person.mvnx": motion_texts.mvnx(motion, 100, 2.0),
            "person.json": motion_texts.deepmimic(8),
        }
    return {name: content.encode() for name, content in files.items()}


@pytest.mark.parametrize("name", ["person.bvh", "daz.bvh", "person_01.amc", "person.mvnx", "person.json"])
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damage_gives_a_motion_or_one_line_never_anything_else(name: str, data: st.DataObject, tmp_path: Path) -> None:
    (tmp_path / "person.asf").write_text(motion_texts.asf())
    content = bytearray(samples()[name])
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content)))]
    for _ in range(data.draw(st.integers(0, 6))):
        place = data.draw(st.integers(0, max(0, len(content) - 1)))
        content[place : place + 1] = data.draw(st.sampled_from(DAMAGE))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            motion = read(tmp_path, bytes(content), name)
    except MotionFormatError as error:
        assert "\n" not in str(error)
    else:
        assert motion.landmarks.shape[1:] == (len(LANDMARKS), 3)
        assert motion.tpose is not None and np.isfinite(motion.tpose.landmarks).all()
        assert (np.diff(motion.time) > 0.0).all()
