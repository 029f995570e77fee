"""Both robots load without code about either; wrong data are refused with one line that says what to do."""

from __future__ import annotations

import copy
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import second_robot as second
import yaml

from naoimitate.core.errors import RobotModelError
from naoimitate.robot import RobotModel, load_robot, robot_names, robot_versions
from naoimitate.robot.kernel import forward

Data = dict[str, Any]


def frames(robot: RobotModel, q: Any) -> tuple[Any, Any]:
    count = len(robot.joint_names) + 1
    pos, rot = np.empty((count, 3)), np.empty((count, 3, 3))
    forward(robot.tree, q, pos, rot)
    return pos, rot


def place(robot: RobotModel, pos: Any, rot: Any, name: str) -> Any:
    point = robot.points[name]
    return pos[point.joint + 1] + rot[point.joint + 1] @ point.offset


def test_built_in_robots_and_their_versions_are_listed() -> None:
    assert robot_names() == ("nao",)
    assert robot_versions("nao") == ("v4", "v5", "v6")
    assert load_robot("nao").version == "v4"


def test_every_robot_has_what_the_program_asks_for(robot: RobotModel) -> None:
    sides = ("shoulder", "elbow", "wrist", "hand", "hip", "knee", "ankle", "sole")
    assert {"head"} | {f"{s}_{p}" for s in "lr" for p in sides} <= set(robot.points)
    assert set(robot.chains) == {"head", "l_arm", "r_arm", "l_leg", "r_leg"}
    assert {"zero", "stand", "calibration"} <= set(robot.postures)
    assert set(robot.limb_length) == {"l_arm", "r_arm", "l_leg", "r_leg"}
    for q in robot.postures.values():
        assert q.shape == robot.lower.shape == (len(robot.joint_names),)


def test_joints_come_parents_first_and_ancestors_are_the_path_to_the_base(robot: RobotModel) -> None:
    for j, parent in enumerate(robot.tree.parent):
        assert parent < j
        path, k = {j}, int(parent)
        while k >= 0:
            path.add(k)
            k = int(robot.tree.parent[k])
        assert set(np.flatnonzero(robot.tree.ancestor[j]).tolist()) == path


def test_a_symmetric_posture_puts_the_right_limbs_where_the_left_ones_are_mirrored(robot: RobotModel) -> None:
    names = [name for name in ("stand", "calibration", "StandInit", "Crouch") if name in robot.postures]
    for name in names:
        pos, rot = frames(robot, robot.postures[name])
        for point in (p for p in robot.points if p.startswith("l_")):
            left, right = place(robot, pos, rot, point), place(robot, pos, rot, "r_" + point[2:])
            np.testing.assert_allclose(right, left * [1.0, -1.0, 1.0], atol=1e-9, err_msg=f"{name} {point}")


def test_limb_lengths_do_not_depend_on_the_side_and_are_what_the_links_measure(nao: RobotModel) -> None:
    assert nao.limb_length["l_leg"] == pytest.approx(0.100 + 0.1029 + 0.04519)
    assert nao.limb_length["l_arm"] == pytest.approx(np.hypot(0.105, 0.015) + np.hypot(0.05595 + 0.05775, 0.01231))
    assert nao.limb_length["r_arm"] == pytest.approx(nao.limb_length["l_arm"])


def test_second_robot_has_its_own_joints_and_no_coupling(second_robot: RobotModel) -> None:
    assert len(second_robot.joint_names) == 20 and len(second_robot.chains["l_arm"]) == 3
    assert second_robot.coupled == () and second_robot.tables == ()
    assert second_robot.mass == pytest.approx(3.15)


def test_opposed_axes_get_opposed_angles_on_the_right_side(second_robot: RobotModel) -> None:
    stand = second_robot.postures["stand"]
    assert stand[second_robot.joint("r_knee")] == -stand[second_robot.joint("l_knee")]
    assert stand[second_robot.joint("r_sho_roll")] == -stand[second_robot.joint("l_sho_roll")]


def test_mass_of_welded_links_counts(second_robot: RobotModel) -> None:
    elbow = second_robot.joint("l_el")
    assert second_robot.tree.mass[elbow + 1] == pytest.approx(0.11 + second.HAND_MASS)


def test_a_version_changes_both_sides_and_the_urdf(second_robot_folder: Path, second_robot: RobotModel) -> None:
    heavy = load_robot(second_robot_folder, "heavy")
    left, right = heavy.joint("l_knee"), heavy.joint("r_knee")
    assert heavy.tree.mass[left + 1] == heavy.tree.mass[right + 1] == 0.2
    np.testing.assert_allclose(heavy.tree.com[left + 1], [0.001, -0.017, -0.05])
    np.testing.assert_allclose(heavy.tree.com[right + 1], [0.001, 0.017, -0.05])
    assert heavy.speed[left] == heavy.speed[right] == 4.0
    assert heavy.mass == pytest.approx(second_robot.mass + 0.24)
    assert heavy.urdf.count('mass value="0.2"') == 2 and second_robot.urdf.count('mass value="0.2"') == 0


def test_coupling_table_of_the_right_ankle_mirrors_the_left(nao: RobotModel) -> None:
    tables = {(nao.joint_names[t.x], nao.joint_names[t.y]): t for t in nao.tables}
    assert set(tables) == {("HeadYaw", "HeadPitch"), ("LAnklePitch", "LAnkleRoll"), ("RAnklePitch", "RAnkleRoll")}
    left, right = tables[("LAnklePitch", "LAnkleRoll")], tables[("RAnklePitch", "RAnkleRoll")]
    for x in np.linspace(-1.5, 1.5, 61):
        low, high = left.bounds(x)
        assert right.bounds(x) == pytest.approx((-high, -low))
    assert left.bounds(-9.0) == (-0.049916, 0.075049)
    assert left.bounds(0.5 * (0.100007 + 0.349938)) == pytest.approx((-0.397935, 0.5 * (0.768992 + 0.550477)))


def test_pairs_leave_out_neighbours_and_groups_and_keep_the_rest(nao: RobotModel) -> None:
    names = {frozenset((nao.shapes[i].name, nao.shapes[j].name)) for i, j in nao.pairs}
    kept = [("l_foot", "r_foot"), ("l_tibia", "r_tibia"), ("l_thigh", "r_thigh"), ("l_hand", "belly")]
    kept += [("l_forearm", "l_thigh"), ("r_hand", "head"), ("l_hand", "r_forearm"), ("r_foot", "l_tibia")]
    left_out = [("chest", "belly"), ("chest", "l_bicep"), ("belly", "r_thigh"), ("l_thigh", "l_tibia")]
    left_out += [("l_tibia", "l_foot"), ("r_bicep", "r_hand"), ("head", "chest"), ("r_bicep", "r_shoulder_ball")]
    assert all(frozenset(pair) in names for pair in kept)
    assert not any(frozenset(pair) in names for pair in left_out)


def test_shapes_have_the_same_size_left_and_right(robot: RobotModel) -> None:
    shapes = {shape.name: shape for shape in robot.shapes}
    for name in (n for n in shapes if n.startswith("l_")):
        left, right = shapes[name], shapes["r_" + name[2:]]
        assert left.kind == right.kind and left.radius == right.radius
        np.testing.assert_allclose(left.half, right.half)
        assert np.linalg.norm(left.p1 - left.p0) == pytest.approx(np.linalg.norm(right.p1 - right.p0))


def test_other_yaml_files_of_the_folder_are_data(tmp_path: Path) -> None:
    folder = second.write_second_robot(tmp_path)
    (folder / "drivers.yaml").write_text("ports: [3, 4]\n")
    assert load_robot(folder).data["drivers"] == {"ports": [3, 4]}


def test_a_joint_that_does_not_exist_is_named(nao: RobotModel) -> None:
    with pytest.raises(RobotModelError, match="nao has no joint 'LToe'"):
        nao.joint("LToe")


def set_at(*keys: Any, to: Any) -> Callable[[Data], None]:
    """A change of robot.yaml: write a value, or remove the key where ``to`` is None."""

    def change(data: Data) -> None:
        for key in keys[:-1]:
            data = data[key]
        if to is None:
            del data[keys[-1]]
        else:
            data[keys[-1]] = to

    return change


WRONG_DATA = {
    "points missing": (set_at("points", to=None), "points missing"),
    "a point missing": (set_at("points", "l_knee", to=None), "points: l_knee, r_knee missing"),
    "a chain missing": (set_at("chains", "l_arm", to=None), "chains: l_arm, r_arm missing"),
    "stand missing": (set_at("postures", "stand", to=None), "'stand' missing"),
    "unknown link": (set_at("points", "l_knee", "link", to="l_shin"), "'l_shin'.*does not have"),
    "unknown joint": (set_at("chains", "head", to=["head_pan", "nod"]), "'nod'.*does not have"),
    "unknown joint in a posture": (set_at("postures", "zero", to={"nod": 1.0}), "'nod'.*does not have"),
    "gap in a chain": (set_at("chains", "l_arm", to=["l_sho_pitch", "l_el"]), "chain 'l_arm'.*'l_el'"),
    "sole on another link": (set_at("points", "l_sole", "link", to="l_knee_link"), "l_sole is not on the last link"),
    "clockwise sole": (set_at("soles", "l", to=[[0, 0], [0, 1], [1, 0]]), "sole 'l'.*clockwise"),
    "hollow sole": (set_at("soles", "l", to=[[0, 0], [4, 0], [1, 1], [0, 4]]), "sole 'l'.*not convex"),
    "sole wound twice": (set_at("soles", "l", to=[[0, 2], [-1, -2], [2, 1], [-2, 1], [1, -2]]), "'l'.*not convex"),
    "sole of two points": (set_at("soles", "l", to=[[0, 0], [1, 0]]), "at least 3 points"),
    "posture beyond its limits": (set_at("postures", "stand", "l_knee", to=2.3), "'stand': 'l_knee' is outside"),
    "unknown excluded link": (set_at("collision", "exclude", to=[["body_link", "tail"]]), "'tail'"),
    "unknown version": (set_at("default_version", to="v9"), "no version 'v9'.*standard, heavy"),
    "version of an unknown link": (set_at("versions", "standard", to={"links": {"tail": {"mass": 1}}}), "'tail'"),
    "version based on itself": (
        set_at("versions", "standard", to={"base": "standard"}),
        "'standard'.*one of those before it",
    ),
    "version of an unknown kind": (set_at("versions", "standard", to={"length": {}}), "'length'.*links, speed"),
    "coupling table out of order": (
        set_at("tables", to=[{"x": "head_pan", "y": "head_tilt", "rows": [[1, -1, 1], [0, -1, 1]]}]),
        "increasing x",
    ),
    "coupling table upside down": (
        set_at("tables", to=[{"x": "head_pan", "y": "head_tilt", "rows": [[0, 1, -1], [1, -1, 1]]}]),
        "y_min above y_max",
    ),
    "posture beyond a coupling table": (
        set_at("tables", to=[{"x": "head_pan", "y": "head_tilt", "rows": [[0, 0.1, 0.2], [1, 0.1, 0.2]]}]),
        "outside its coupling table",
    ),
    "text for numbers": (set_at("soles", "l", to="square"), "wrong form"),
}


@pytest.mark.parametrize("case", WRONG_DATA)
def test_wrong_data_are_refused(tmp_path: Path, case: str) -> None:
    change, message = WRONG_DATA[case]
    data = copy.deepcopy(second.DATA)
    change(data)
    folder = second.write_second_robot(tmp_path)
    (folder / "robot.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
    refused(folder, message)


WRONG_URDF = {
    "no XML": ("</robot>", "", "not valid XML"),
    "no robot": ("robot>", "model>", "not valid XML"),
    "limits reversed": ('lower="-0.05" upper="2.2"', 'lower="2.2" upper="-0.05"', "'l_knee'.*swap"),
    "no speed limit": ('velocity="5.0"', 'velocity="0"', "'head_pan'.*velocity"),
    "limit no number": ('upper="2.2"', 'upper="wide"', "joint 'l_knee': <limit upper='wide'> is no number"),
    "mass not finite": ('<mass value="0.95"/>', '<mass value="nan"/>', "is no number"),
    "no mass": ('<mass value="0.95"/>', '<mass value="0"/>', "the base link has no mass"),
    "impossible inertia": ('ixx="0.0028', 'ixx="0.28', "inertia that no body can have"),
    "sliding joint": (
        '"head_pan" type="revolute"',
        '"head_pan" type="prismatic"',
        "'head_pan' .prismatic.: only fixed",
    ),
    "one name twice": ('"head_pan"', '"body_link"', "the name 'body_link' twice"),
    "no limit": ('<limit lower="-0.05" upper="2.2" velocity="5.0" effort="5.0"/>', "", "'l_knee' .*with a <limit>"),
    "unknown parent": (
        '<parent link="l_knee_link"/>',
        '<parent link="shin"/>',
        "'l_ank_pitch': its parent link 'shin'",
    ),
    "two base links": ("</robot>", '<link name="tail"/></robot>', "no tree with one base link"),
    "two parents": ('<child link="r_knee_link"/>', '<child link="l_knee_link"/>', "no tree with one base link"),
    "a mesh": ('<sphere radius="0.05"/>', '<mesh filename="head.stl"/>', "'head_tilt_link_shape'.*use a sphere"),
    "no size": ('<sphere radius="0.05"/>', "<sphere/>", "'head_tilt_link_shape' has no size"),
    "radius is text": ('<sphere radius="0.05"/>', '<sphere radius="big"/>', "'big' are not numbers"),
    "shape name twice": ('"r_knee_link_shape"', '"l_knee_link_shape"', "two shapes are called 'l_knee_link_shape'"),
    "not mirrored": ('xyz="-0.001 -0.06 0.111"', 'xyz="-0.001 -0.07 0.111"', "'r_sho_pitch' are not mirror images"),
}


@pytest.mark.parametrize("case", WRONG_URDF)
def test_wrong_urdf_is_refused(tmp_path: Path, case: str, capfd: pytest.CaptureFixture[str]) -> None:
    old, new, message = WRONG_URDF[case]
    folder = second.write_second_robot(tmp_path)
    text = (folder / "robot.urdf").read_text()
    assert old in text
    (folder / "robot.urdf").write_text(text.replace(old, new, 1))
    refused(folder, message)
    assert capfd.readouterr().err == ""


def test_a_joint_can_only_follow_another_one_exactly(tmp_path: Path) -> None:
    folder = second.write_second_robot(tmp_path)
    text = (folder / "robot.urdf").read_text()
    joint = re.search(r'<joint name="r_hip_yaw".*?</joint>', text)
    assert joint is not None
    mimic = '<mimic joint="l_hip_yaw" multiplier="{}"/></joint>'
    for factor in ("-1", "1"):
        mimicked = joint.group().replace("</joint>", mimic.format(factor))
        (folder / "robot.urdf").write_text(text.replace(joint.group(), mimicked))
        if factor == "-1":
            refused(folder, "'r_hip_yaw' mimics 'l_hip_yaw'.*multiplier 1")
    model = load_robot(folder)
    assert model.coupled == ((model.joint("l_hip_yaw"), model.joint("r_hip_yaw")),)


def test_coupled_joints_differ_in_no_posture(tmp_path: Path) -> None:
    folder = second.write_second_robot(tmp_path)
    text = (folder / "robot.urdf").read_text()
    joint = re.search(r'<joint name="r_knee".*?</joint>', text)
    assert joint is not None
    mimic = joint.group().replace("</joint>", '<mimic joint="l_knee"/></joint>')
    (folder / "robot.urdf").write_text(text.replace(joint.group(), mimic))
    refused(folder, "posture '.*': 'r_knee' must equal its leader")


def test_unknown_robots_and_versions_are_named_with_what_there_is(second_robot_folder: Path) -> None:
    with pytest.raises(RobotModelError, match="unknown robot 'hal': give one of nao"):
        load_robot("hal")
    with pytest.raises(RobotModelError, match="nao has no version 'v7': choose one of v4, v5, v6"):
        load_robot("nao", "v7")
    with pytest.raises(RobotModelError, match="second has no version 'v4'"):
        load_robot(second_robot_folder, "v4")


def test_yaml_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    folder = second.write_second_robot(tmp_path)
    for text, message in (("a: [", "not valid YAML"), ("- a\n", "must be a mapping")):
        (folder / "robot.yaml").write_text(text)
        refused(folder, message)


def refused(folder: Path, message: str) -> None:
    with pytest.raises(RobotModelError) as caught:
        load_robot(folder)
    assert re.search(message, str(caught.value)), caught.value
    assert "\n" not in str(caught.value)


def test_loading_prints_nothing(second_robot_folder: Path) -> None:
    code = f"from naoimitate.robot import load_robot; load_robot('nao'); load_robot({str(second_robot_folder)!r})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ, check=True)
    assert done.stdout == "" and done.stderr == ""
