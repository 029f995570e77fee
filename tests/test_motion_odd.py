"""Files of odd but legal shape: the same person comes back, whoever wrote them and however."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import motion_texts
import numpy as np
import pytest
from skeleton_writer import FLAVOURS, NAMELESS, Z_UP, Style, bvh

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import LANDMARK, Motion
from naoimitate.motion import load_motion
from naoimitate.motion.builtin import builtin_motion
from naoimitate.motion.load import recorded
from naoimitate.motion.scene import Options
from naoimitate.motion.tpose import is_tpose

pytestmark = pytest.mark.filterwarnings("ignore:Gimbal lock")

MOCAP = Path(os.environ.get("NAOIMITATE_MOCAP", Path(__file__).parents[2] / "shared" / "mocap"))
STEP = 24
RATE = 100.0 / STEP


@cache
def truth() -> Motion:
    return builtin_motion("walk")


@cache
def text() -> str:
    return bvh(truth(), Style(rate=RATE), STEP)


def read(folder: Path, content: str, name: str = "person.bvh", **wishes: object) -> Motion:
    (folder / name).write_text(content)
    return load_motion(folder / name, **wishes)


def apart(motion: Motion) -> float:
    """Largest distance of a landmark from the truth, m, after the true person was put over the origin."""
    true = truth().landmarks[::STEP]
    error = motion.landmarks - (true - true[0, LANDMARK["pelvis"]] * [1.0, 1.0, 0.0])
    return float(np.linalg.norm(error - [0.0, 0.0, error[..., 2].mean()], axis=-1).max())


def head_and_rows(content: str) -> tuple[str, list[str]]:
    """Everything up to the frame time, and the lines of numbers."""
    first = content.index("\n", content.index("Frame Time")) + 1
    return content[:first], content[first:].split("\n")[:-1]


def with_rows(content: str, change: Callable[[list[str]], list[str]]) -> str:
    head, rows = head_and_rows(content)
    return head + "\n".join(change(rows)) + "\n"


def under_a_reference(content: str, channels: str, values: str, name: str = "Reference") -> str:
    """The same skeleton below a joint that does not move, as MotionBuilder and iClone write it."""
    hierarchy, motion = content.split("MOTION")
    inner = hierarchy.removeprefix("HIERARCHY\n").replace("ROOT", "JOINT", 1)
    outer = f"HIERARCHY\nROOT {name}\n{{\n\tOFFSET 0 0 0\n\t{channels}\n{inner}}}\nMOTION"
    return with_rows(outer + motion, lambda rows: [values + row for row in rows])


def rotations_first(content: str) -> str:
    swapped = re.sub(r"(CHANNELS 6)( \w+ \w+ \w+)( \w+ \w+ \w+)", r"\1\3\2", content)
    return with_rows(swapped, lambda rows: [_moved(row.split()) for row in rows])


def _moved(words: list[str]) -> str:
    return " ".join([*words[3:6], *words[:3], *words[6:]])


def without_channels_of_the_toes(content: str) -> str:
    """The toes' joints, which never turn here, have neither channels nor numbers."""
    joints = re.findall(r"(?:ROOT|JOINT) (\w+)", content)
    columns = [c for i, name in enumerate(joints) for c in [name] * (6 if i == 0 else 3)]
    kept = [i for i, name in enumerate(columns) if "ToeBase" not in name]
    bare = re.sub(r"(JOINT \w*ToeBase\s*\{\s*OFFSET[^\n]*\n)\s*CHANNELS[^\n]*\n", r"\1", content)
    return with_rows(bare, lambda rows: [" ".join(np.array(row.split())[kept]) for row in rows])


SIX = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
END = re.compile(r"End Site\s*\{\s*OFFSET[^\n]*\s*\}\s*")
ODD: dict[str, Callable[[str], str]] = {
    "windows line ends and tabs": lambda t: t.replace(" ", "\t").replace("End\tSite", "End Site").replace("\n", "\r\n"),
    "blanks at the ends of lines and blank lines": lambda t: t.replace("\n", "  \n\n"),
    "braces behind the names": lambda t: re.sub(r"\s*\n\s*\{", " {", t),
    "offset and channels on one line": lambda t: re.sub(r"\s*\n\s*CHANNELS", "  CHANNELS", t),
    "keywords in small letters": lambda t: re.sub(
        "HIERARCHY|ROOT|JOINT|End Site|OFFSET|CHANNELS|MOTION|Frames|Frame Time", lambda m: m.group().lower(), t
    ),
    "keywords in capitals": lambda t: re.sub("End Site|Frames|Frame Time", lambda m: m.group().upper(), t),
    "blanks before colons": lambda t: t.replace("Time:", "Time :").replace("Frames:", "Frames : "),
    "channels in capitals": lambda t: t.replace("rotation", "ROTATION").replace("position", "POSITION"),
    "decimal commas": lambda t: t.replace(".", ","),
    "commas between the numbers": lambda t: with_rows(t, lambda rows: [row.replace(" ", ", ") for row in rows]),
    "powers of ten": lambda t: with_rows(
        t, lambda rows: [" ".join(f"{float(word):+.9E}" for word in row.split()) for row in rows]
    ),
    "frames over two lines": lambda t: with_rows(t, lambda rows: [row.replace(" ", "\n", 20) for row in rows]),
    "all frames on one line": lambda t: with_rows(t, lambda rows: [" ".join(rows)]),
    "zeros behind the end": lambda t: t + "\0\0\0",
    "no number of frames": lambda t: re.sub(r"Frames: \d+\n", "", t),
    "two ends of a bone": lambda t: END.sub(lambda m: m.group() * 2, t),
    "an end at the hips": lambda t: t.replace("\tJOINT", "\tEnd Site\n\t{\n\tOFFSET 0 -9 0\n\t}\n\tJOINT", 1),
    "ends with names": lambda t: t.replace("End Site", "End Site tip"),
    "rotations before positions": rotations_first,
    "joints without channels": without_channels_of_the_toes,
    "hips below a reference with channels": lambda t: under_a_reference(t, SIX, "0 0 0 0 0 0 "),
    "hips below a reference with no channels": lambda t: under_a_reference(t, "CHANNELS 0", ""),
    "hips below a reference without channels": lambda t: under_a_reference(t, "", ""),
    "hips with a name of their own": lambda t: t.replace("ROOT Hips", "ROOT Actor 7"),
    "a name twice": lambda t: t.replace("JOINT Spine1", "JOINT Spine"),
    "names in a name space": lambda t: re.sub(r"(JOINT|ROOT) ", r"\1 scene:actor:", t),
}


@pytest.mark.parametrize("change", ODD.values(), ids=ODD.keys())
def test_the_shape_of_a_file_does_not_matter(change: Callable[[str], str], tmp_path: Path) -> None:
    motion = read(tmp_path, change(text()))
    assert motion.rate == pytest.approx(RATE, rel=1e-4)
    assert apart(motion) < 0.001


@pytest.mark.parametrize("order", ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"])
def test_any_order_of_rotations_is_read(order: str, tmp_path: Path) -> None:
    assert apart(read(tmp_path, bvh(truth(), Style(order=order, rate=RATE), STEP))) < 0.001


@pytest.mark.parametrize("unit", [1.0, 0.3048, 0.1, 0.0254, 0.01, 0.001])
def test_usual_units_are_told_by_the_person(unit: float, tmp_path: Path) -> None:
    assert apart(read(tmp_path, bvh(truth(), Style(unit=unit, rate=RATE), STEP))) < 0.001


def test_hips_that_move_below_a_reference_of_iclone_travel(tmp_path: Path) -> None:
    style = Style(FLAVOURS["iclone"], six_channels=True, axes=Z_UP, rate=RATE)
    motion = read(tmp_path, under_a_reference(bvh(truth(), style, STEP), SIX, "0 0 0 0 0 0 ", "RL_BoneRoot"))
    assert apart(motion) < 0.001
    assert motion.landmarks[-1, LANDMARK["pelvis"], 0] > 1.0


@pytest.mark.skipif(not MOCAP.exists(), reason=f"no recorded clips in {MOCAP}")
@pytest.mark.parametrize("place", ["0 0 0 0 90 0 ", "500 100 -300 0 0 40 "], ids=["z up", "elsewhere"])
@pytest.mark.parametrize(
    "file",
    [
        "cmu/02_02_walk.bvh",
        "cmu/131_03_start_hop_stop.bvh",
        "cmu/88_03_motorcycle_pose_daz.bvh",
        "other/mass_balance_one_leg.bvh",
        "other/xsens_upperbody_gpl3.bvh",
    ],
)
def test_where_a_recording_stands_in_its_world_does_not_matter(file: str, place: str, tmp_path: Path) -> None:
    content = (MOCAP / file).read_text().replace("\r\n", "\n")
    here = load_motion(MOCAP / file)
    there = read(tmp_path, under_a_reference(content, SIX, place), Path(file).name)
    assert np.array_equal(here.support, there.support) and here.tpose_note == there.tpose_note
    assert np.abs(here.landmarks - there.landmarks).max() < 1e-3


def test_position_channels_that_are_relative_to_the_offset_are_told_by_their_size(tmp_path: Path) -> None:
    content = bvh(truth(), Style(six_channels=True, rate=RATE), STEP)
    joints = len(re.findall("JOINT", content))
    wobble = "0.01 0.01 0.01"

    def relative(row: str) -> str:
        words = row.split()
        rest = [words[6 + 6 * i + 3 : 6 + 6 * i + 6] for i in range(joints)]
        return " ".join([*words[:6], *(f"{wobble} {' '.join(turns)}" for turns in rest)])

    assert apart(read(tmp_path, with_rows(content, lambda rows: [relative(row) for row in rows]))) < 0.003


@pytest.mark.parametrize(
    "names", [FLAVOURS["no collar"], FLAVOURS["daz"], NAMELESS], ids=["no collar", "daz", "nameless"]
)
def test_a_skeleton_whose_bones_have_no_ends_is_read(names: dict[str, str], tmp_path: Path) -> None:
    motion = read(tmp_path, END.sub("", bvh(truth(), Style(names, rate=RATE), STEP)))
    assert np.isfinite(motion.landmarks).all()
    limbs = [LANDMARK[f"{s}_{part}"] for s in "lr" for part in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")]
    assert np.abs(motion.landmarks[:, limbs] - whole(tmp_path, names).landmarks[:, limbs]).max() < 0.02


def whole(folder: Path, names: dict[str, str]) -> Motion:
    return read(folder, bvh(truth(), Style(names, rate=RATE), STEP))


def test_a_head_that_is_missing_is_placed_above_the_neck(tmp_path: Path) -> None:
    motion = read(tmp_path, bvh(truth(), Style(without=("head",), rate=RATE), STEP))
    assert apart(motion) < 0.03


def test_frames_that_do_not_fit_the_channels_say_how(tmp_path: Path) -> None:
    for change in (
        lambda row: row + " 0",
        lambda row: row.rsplit(" ", 1)[0],
        lambda row: row.replace(" ", "\n", 1)[:-9],
    ):
        with pytest.raises(MotionFormatError, match="numbers, not one for each of the 66 channels: export"):
            read(tmp_path, with_rows(text(), lambda rows, c=change: [c(row) for row in rows]))


def test_a_header_full_of_blanks_is_read_at_once(tmp_path: Path) -> None:
    assert apart(read(tmp_path, text().replace("ROOT", " " * 300_000 + "ROOT", 1))) < 0.001


def test_the_root_of_an_acclaim_skeleton_has_its_own_order(tmp_path: Path) -> None:
    (tmp_path / "07.asf").write_text(motion_texts.asf().replace("TX TY TZ RX RY RZ", "RX RY RZ TZ TY TX"))
    swapped = re.sub(
        r"^root (\S+) (\S+) (\S+) (.*)$", r"root \4 \3 \2 \1", motion_texts.amc(truth(), STEP), flags=re.MULTILINE
    )
    assert apart(read(tmp_path, swapped, "07_01.amc", fps=RATE)) < 0.001
    (tmp_path / "07.asf").write_text(motion_texts.asf().replace("TX TY TZ RX RY RZ", "TX TY TZ"))
    with pytest.raises(MotionFormatError, match=r"skeleton 07.asf is damaged \(root\)"):
        read(tmp_path, swapped, "07_01.amc", fps=RATE)


def test_an_acclaim_motion_of_another_skeleton_is_refused(tmp_path: Path) -> None:
    content = motion_texts.amc(truth(), STEP)
    for other in (("name ltibia", "name shank"), ("dof rx ry rz", "dof rx rz")):
        (tmp_path / "07.asf").write_text(motion_texts.asf().replace(*other).replace("ltibia", "shank"))
        with pytest.raises(MotionFormatError, match=r"07.asf: name its own with --skeleton"):
            read(tmp_path, content, "07_01.amc", fps=RATE)


@pytest.mark.parametrize("copies", [1, 2, 30])
def test_an_added_tpose_may_be_there_more_than_once(copies: int, tmp_path: Path) -> None:
    content = bvh(truth(), Style(rate=RATE), STEP, added=True)
    motion = read(tmp_path, with_rows(content, lambda rows: rows[:1] * copies + rows[1:]))
    assert motion.time[0] == pytest.approx(copies / RATE) and "added first frame" in motion.tpose_note
    assert apart(motion) < 0.03  # the floor under a walk may be found a little tilted


def test_a_held_tpose_that_nobody_added_is_motion(tmp_path: Path) -> None:
    for step in (1, STEP, 2 * STEP):
        held = bvh(builtin_motion("paper"), Style(rate=100.0 / step), step)
        motion = read(tmp_path, with_rows(held, lambda rows: rows[:1] * 10 + rows))
        assert motion.time[0] == 0.0 and "held at" in motion.tpose_note


def test_what_hangs_far_beyond_the_toes_is_no_toe(tmp_path: Path) -> None:
    ski = text().replace("OFFSET 0.000000 0.000000 5.000000", "OFFSET 0.000000 0.000000 90.000000")
    assert ski != text()
    (tmp_path / "ski.bvh").write_text(ski)
    assert np.isnan(recorded(tmp_path / "ski.bvh", Options())[1][:, :, 2]).all()


def test_a_frame_that_xsens_lost_or_damaged_leaves_a_gap_in_time(tmp_path: Path) -> None:
    content = motion_texts.mvnx(truth(), STEP, RATE)
    lost = re.sub(r'<frame time="\d+" index="5".*?</frame>\n', "", content, flags=re.DOTALL)
    damaged = re.sub(r'(index="5" type="normal">\n)<orientation>\S+ ', r"\1<orientation>", content)
    for broken in (lost, damaged):
        assert broken != content
        steps = np.diff(read(tmp_path, broken, "person.mvnx").time) * RATE
        assert steps[4] == pytest.approx(2.0, rel=1e-3) and np.delete(steps, 4) == pytest.approx(1.0, rel=1e-3)


def test_contacts_of_xsens_without_numbers_count_in_their_order(tmp_path: Path) -> None:
    content = motion_texts.mvnx(truth(), STEP, RATE)
    for index in ("", ' index="first"'):
        odd = re.sub(r'(<contactDefinition label="\w+") index="\d"', rf"\1{index}", content)
        assert odd != content
        motion = read(tmp_path, odd, "person.mvnx")
        assert np.array_equal(motion.contacts[:, 0], np.isin(truth().support[::STEP], ["D", "L"]))


@pytest.mark.parametrize("tag", ["<a:contact/>", "<x:y:z>1</x:y:z>", '<x xmlns="of/}a">1</x>'])
def test_tags_that_no_program_writes_are_passed_over(tag: str, tmp_path: Path) -> None:
    content = motion_texts.mvnx(truth(), STEP, RATE)
    assert apart(read(tmp_path, content.replace("<frames>", f"{tag}<frames>"), "person.mvnx")) < 0.001


@pytest.mark.parametrize("rest", ["t", "x"])
@pytest.mark.parametrize("wish", [{}, {"tpose_at": 3.0}], ids=["found", "asked"])
def test_somebody_who_lies_on_a_side_has_a_tpose(rest: str, wish: dict[str, float], tmp_path: Path) -> None:
    content = bvh(truth(), Style(rest=rest, rate=RATE), STEP)
    motion = read(tmp_path, under_a_reference(content, SIX, "0 0 0 90 0 0 "), up="y", **wish)
    assert np.isfinite(motion.landmarks).all() and is_tpose(motion.tpose.landmarks[None])[0] == (not wish)
    for part in ("knee", "ankle", "elbow", "wrist"):
        above = {"knee": "hip", "ankle": "knee", "elbow": "shoulder", "wrist": "elbow"}[part]
        bones = [np.linalg.norm(m.tpose[f"l_{part}"] - m.tpose[f"l_{above}"]) for m in (motion, truth())]
        assert bones[0] == pytest.approx(bones[1], abs=1e-3)


def test_a_calibration_posture_that_does_not_stand_in_the_world_asked_for_is_not_used(tmp_path: Path) -> None:
    motion = read(tmp_path, motion_texts.mvnx(truth(), STEP, RATE), "person.mvnx", up="y")
    assert np.isfinite(motion.landmarks).all() and "segment lengths" in motion.tpose_note


def test_an_acclaim_motion_says_the_unit_of_its_own_angles(tmp_path: Path) -> None:
    skeleton = motion_texts.asf().replace("angle deg", "angle rad")
    turned = " ".join(f"{np.radians(angle):.9f}" for angle in motion_texts.AXIS)
    skeleton = re.sub(r"axis \S+ \S+ \S+ XYZ", f"axis {turned} XYZ", skeleton)
    (tmp_path / "07.asf").write_text(skeleton)
    assert apart(read(tmp_path, motion_texts.amc(truth(), STEP), "07_01.amc", fps=RATE)) < 0.001
