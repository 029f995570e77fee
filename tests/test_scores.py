"""Every score reacts to the fault that it is there for, and to nothing in a run without faults."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from second_robot import write_second_robot
from synthetic import of_poses, planted_base, standing, tilted

from naoimitate.core.errors import RunFileError
from naoimitate.robot import RobotModel, load_robot
from naoimitate.run.clips import is_auto, is_quasi_static, is_speed_one
from naoimitate.run.contact import CLEAR
from naoimitate.run.file import Run
from naoimitate.run.measure import Measure
from naoimitate.run.overlap import ALLOWED_OVERLAP, nearest_pairs
from naoimitate.run.reach import reachable_errors
from naoimitate.run.replay import frames, replay, targets
from naoimitate.run.scores import score_run
from naoimitate.run.sheet import as_dict, as_lines

CONTRACT = (
    *("margin_min_mm", "outside_frames", "slip_max_mm", "sole_height_max_mm", "sole_tilt_max_deg", "drag_frames"),
    *("floor_penetration_max_mm", "limit_excess_rad", "speed_over_limit", "self_collision_frames"),
    *("hand_error_cm_mean", "foot_error_cm_mean", "hand_excess_cm_mean", "single_support_recall"),
    *("support_agreement", "time_factor", "fell"),
)


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return load_robot("nao")


def measures(run: Run, robot: RobotModel) -> dict[str, Measure]:
    return {measure.key: measure for measure in score_run(run, robot)}


def missed(run: Run, robot: RobotModel) -> set[str]:
    return set(as_dict(score_run(run, robot))["missed"])


def changed(run: Run, **values: Any) -> Run:
    return dataclasses.replace(run, **values)


def speed_setting(speed: object) -> str:
    return json.dumps({"settings": {"speed": speed}})


def one_foot(robot: RobotModel, n: int = 200, lift: float = 0.05) -> Run:
    """The left leg stands, the right one is bent up by about ``lift`` m; the torso is set over the left sole."""
    run = standing(robot, n)
    q = run.q.copy()
    bend = 2.0 * np.sqrt(lift / (robot.limb_length["r_leg"]))
    for name, share in (("RHipPitch", -0.5), ("RKneePitch", 1.0), ("RAnklePitch", -0.5)):
        q[:, robot.joint(name)] += share * bend
    return changed(of_poses(robot, q, run.base_pos, run.base_quat), support=np.full(n, "L"))


def test_a_robot_that_stands_and_copies_its_person_misses_no_bar(robot: RobotModel) -> None:
    sheet = measures(standing(robot), robot)
    assert not missed(standing(robot), robot)
    assert sheet["margin_min_mm"].value > 40.0
    for key in CONTRACT[1:10]:
        assert sheet[key].value == pytest.approx(0.0, abs=1e-9), key
    assert sheet["hand_error_cm_mean"].value == pytest.approx(0.0, abs=1e-9)
    assert sheet["support_agreement"].value == 1.0
    assert sheet["time_factor"].value == pytest.approx(1.0)


def test_every_key_of_the_contract_is_in_the_json_sheet(robot: RobotModel) -> None:
    values = as_dict(score_run(standing(robot, 20), robot))
    assert set(CONTRACT) <= set(values)
    assert json.loads(json.dumps(values)) == values
    assert len(as_lines(score_run(standing(robot, 20), robot))) == len(values) - 2


def test_another_robot_is_measured_the_same_way(tmp_path: Path) -> None:
    """Three-joint arms without a wrist, uncoupled hips: nothing in the scores knows the first robot."""
    other = load_robot(write_second_robot(tmp_path))
    run = standing(other, 60)
    sheet = measures(run, other)
    assert not missed(run, other)
    assert sheet["margin_min_mm"].value > 10.0
    slid = changed(run, base_pos=run.base_pos + np.linspace(0.0, 1.0, 60)[:, None] * [0.003, 0.0, 0.0])
    assert missed(slid, other) == {"slip_max_mm"}
    far = run.human_posture.copy()
    far[:, 0] *= 2.0
    reaching = measures(changed(run, human_posture=far), other)
    assert 0.0 <= reaching["hand_excess_cm_mean"].value < reaching["hand_error_cm_mean"].value


def test_the_programs_own_com_is_not_believed(robot: RobotModel) -> None:
    run = standing(robot, 20)
    assert measures(changed(run, com=run.com + 1.0), robot)["margin_min_mm"].value > 40.0


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_com_beside_the_feet_is_outside(robot: RobotModel, side: float) -> None:
    run = standing(robot, 50)
    quat = run.base_quat.copy()
    quat[20:30] = tilted(quat[20:30], side * 0.6)
    sheet = measures(changed(run, base_quat=quat), robot)
    assert sheet["margin_min_mm"].value < -20.0
    assert sheet["outside_frames"].value >= 10


def test_a_robot_on_one_foot_with_the_com_between_the_feet_is_outside(robot: RobotModel) -> None:
    run = changed(standing(robot, 50), support=np.array(["D"] * 25 + ["L"] * 25))
    sheet = measures(run, robot)
    assert sheet["outside_frames"].value == 25 + 25
    assert sheet["margin_single_min_mm"].value == pytest.approx(sheet["margin_min_mm"].value)
    assert sheet["margin_min_mm"].value == pytest.approx(-1e3 * (0.05 + robot.soles["l"][:, 1].min()), abs=3.0)


def test_margin_is_checked_between_frames_too(robot: RobotModel) -> None:
    """Stable on the left foot, then stable on the right: half-way the centre of mass is over neither."""
    quat = standing(robot, 2).base_quat
    leaning = np.array([tilted(quat, -0.18)[0], tilted(quat, 0.18)[1]])
    run = changed(standing(robot, 2, base_quat=leaning), support=np.array(["L", "R"]))
    sheet = measures(run, robot)
    assert sheet["margin_single_min_mm"].value > 5.0
    assert sheet["margin_min_mm"].value < 0.0
    assert sheet["outside_frames"].value == 1


@pytest.mark.parametrize("drag", [0.002, 0.0006])
def test_a_planted_foot_that_slides_is_a_slip(robot: RobotModel, drag: float) -> None:
    run = standing(robot)
    moving = changed(run, base_pos=run.base_pos + np.linspace(0.0, 1.0, 200)[:, None] * [drag, 0.0, 0.0])
    assert measures(moving, robot)["slip_max_mm"].value == pytest.approx(1e3 * drag, rel=0.01)
    assert missed(moving, robot) == {"slip_max_mm"}


def test_a_planted_foot_that_turns_is_a_slip(robot: RobotModel) -> None:
    run = standing(robot)
    angle = np.linspace(0.0, 0.02, 200)
    turn = np.column_stack([np.cos(angle / 2), np.zeros(200), np.zeros(200), np.sin(angle / 2)])
    w, z = turn[:, 0], turn[:, 3]
    a, b, c, d = run.base_quat.T
    quat = np.column_stack([w * a - z * d, w * b - z * c, w * c + z * b, w * d + z * a])
    assert measures(changed(run, base_quat=quat), robot)["slip_max_mm"].value > 0.5


def test_a_flickering_support_flag_does_not_hide_a_slip(robot: RobotModel) -> None:
    run = standing(robot)
    moving = run.base_pos + np.linspace(0.0, 1.0, 200)[:, None] * [0.002, 0.0, 0.0]
    flicker = np.where(np.arange(200) % 10 == 0, "L", "D")
    sheet = measures(changed(run, base_pos=moving, support=flicker), robot)
    assert sheet["slip_max_mm"].value == pytest.approx(2.0, rel=0.01)


def test_a_foot_that_was_clear_of_the_floor_may_land_elsewhere(robot: RobotModel) -> None:
    run = standing(robot, 90)
    up = np.concatenate([np.zeros(30), np.full(30, 2.0 * CLEAR), np.zeros(30)])
    base = run.base_pos + np.outer(up, [0.0, 0.0, 1.0])
    base[60:, 0] += 0.05
    support = np.array(["R"] * 30 + ["L"] * 30 + ["R"] * 30)
    assert measures(changed(run, base_pos=base, support=support), robot)["slip_max_mm"].value < 1e-6
    low = base * [1.0, 1.0, 0.0] + run.base_pos * [0.0, 0.0, 1.0]
    sheet = measures(changed(run, base_pos=low, support=support), robot)
    assert sheet["slip_max_mm"].value == pytest.approx(50.0, rel=0.01)


def test_slip_and_flatness_bind_only_planted_feet(robot: RobotModel) -> None:
    run = standing(robot, retarget="paper")
    lifted = changed(run, base_pos=run.base_pos + np.array([0.0, 0.0, 0.002]))
    assert not missed(lifted, robot)
    sheet = measures(lifted, robot)
    assert sheet["sole_height_max_mm"].passed is None
    assert "planted" in sheet["sole_height_max_mm"].note


def test_a_stance_sole_off_the_floor_or_tilted_is_not_flat(robot: RobotModel) -> None:
    run = standing(robot, 30)
    lifted = changed(run, base_pos=run.base_pos + np.array([0.0, 0.0, 0.001]))
    assert measures(lifted, robot)["sole_height_max_mm"].value == pytest.approx(1.0)
    rolled = measures(changed(run, base_quat=tilted(run.base_quat, np.radians(1.0))), robot)
    assert rolled["sole_tilt_max_deg"].value == pytest.approx(1.0, abs=1e-6)


def test_a_sole_under_the_floor_is_penetration_and_no_drag(robot: RobotModel) -> None:
    run = standing(robot, 30)
    sunk = measures(changed(run, base_pos=run.base_pos - [0.0, 0.0, 0.003]), robot)
    assert sunk["floor_penetration_max_mm"].value == pytest.approx(3.0)
    assert sunk["drag_frames"].value == 0


def test_a_body_part_under_the_floor_is_penetration(robot: RobotModel) -> None:
    run = standing(robot, 5)
    lying = changed(run, base_quat=tilted(run.base_quat, np.pi / 2), base_pos=run.base_pos * [1, 1, 0] + [0, 0, 0.02])
    assert measures(lying, robot)["floor_penetration_max_mm"].value > 10.0


def test_a_swing_foot_near_the_floor_drags_but_in_the_first_and_last_of_its_swing(robot: RobotModel) -> None:
    run = changed(standing(robot, 100), support=np.array(["D"] * 20 + ["L"] * 60 + ["D"] * 20))
    assert measures(run, robot)["drag_frames"].value == 60 - 2 * 15
    assert measures(one_foot(robot), robot)["drag_frames"].value == 0


def test_a_joint_beyond_its_range_is_an_excess(robot: RobotModel) -> None:
    run = standing(robot, 30)
    for j in range(len(robot.joint_names)):
        q = run.q.copy()
        q[7, j] = robot.upper[j] + 0.01
        assert measures(changed(run, q=q), robot)["limit_excess_rad"].value >= 0.01 - 1e-9, robot.joint_names[j]


def test_a_coupling_table_and_a_shared_motor_are_limits(robot: RobotModel) -> None:
    run = standing(robot, 30)
    for table in robot.tables:
        q = run.q.copy()
        x = float(table.rows[0, 0])
        q[3, table.x] = np.clip(x, robot.lower[table.x], robot.upper[table.x])
        q[3, table.y] = min(table.bounds(x)[1] + 0.02, robot.upper[table.y])
        assert measures(changed(run, q=q), robot)["limit_excess_rad"].value > 1e-3
    leader, follower = robot.coupled[0]
    q = run.q.copy()
    q[:, follower] = q[:, leader] + 5e-7
    assert measures(changed(run, q=q), robot)["limit_excess_rad"].value == 0.0
    q[4, follower] = q[4, leader] + 2e-6
    assert measures(changed(run, q=q), robot)["limit_excess_rad"].value == pytest.approx(2e-6, rel=0.01)


def test_speed_is_measured_per_wall_clock_frame(robot: RobotModel) -> None:
    run = standing(robot, 30)
    j = robot.joint("LElbowYaw")
    q = run.q.copy()
    q[10:, j] += 0.01 * robot.speed[j]
    assert measures(changed(run, q=q), robot)["speed_over_limit"].value == pytest.approx(1.0)
    assert missed(changed(run, q=q), robot) >= {"speed_over_limit"}
    halved = changed(run, q=q, time=run.time * 2.0, human_time=run.time * 2.0)
    assert measures(halved, robot)["speed_over_limit"].value == pytest.approx(0.5)


def test_a_joint_that_swings_to_and_fro_between_frames_rattles(robot: RobotModel) -> None:
    run = standing(robot, 30)
    q = run.q.copy()
    q[10:20:2, robot.joint("LWristYaw")] += 0.02
    assert measures(changed(run, q=q), robot)["rattle_frames"].value == 9
    slow = run.q + 0.3 * np.sin(np.arange(30) * 0.2)[:, None]
    assert measures(changed(run, q=slow), robot)["rattle_frames"].value == 0


def test_an_arm_through_the_body_is_a_self_collision(robot: RobotModel) -> None:
    run = standing(robot, 30)
    q = run.q.copy()
    q[5:9, list(robot.chains["l_arm"])] = [1.45, -0.3142, 0.0, -0.0349, 0.0]
    assert measures(changed(run, q=q), robot)["self_collision_frames"].value == 4


def test_errors_are_distances_to_equation_5(robot: RobotModel) -> None:
    run = standing(robot, 30, source="builtin:paper")
    scaled = changed(
        run, scale=np.full(4, 0.5), human_posture=run.ref_human + 2.0 * (run.human_posture - run.ref_human)
    )
    np.testing.assert_allclose(targets(scaled), frames(run, robot).posture, atol=1e-12)
    human = run.human_posture.copy()
    human[:, 0] += [0.0, 0.0, 0.03]
    human[:, 3] += [0.0, 0.04, 0.0]
    sheet = measures(changed(run, human_posture=human), robot)
    assert sheet["hand_error_cm_mean"].value == pytest.approx(1.5)
    assert sheet["foot_error_cm_mean"].value == pytest.approx(2.0)
    assert sheet["hand_error_cm_mean"].passed is False
    assert (
        measures(changed(run, human_posture=human, source="builtin:wave"), robot)["hand_error_cm_mean"].passed is None
    )


def test_hand_excess_counts_only_what_the_arm_could_have_reached(robot: RobotModel) -> None:
    run = standing(robot, 50)
    reach = run.human_posture.copy()
    reach[:, 0] *= 3.0
    far = measures(changed(run, human_posture=reach), robot)
    assert far["hand_error_cm_mean"].value > 5.0
    assert 0.0 <= far["hand_excess_cm_mean"].value < far["hand_error_cm_mean"].value
    near = run.human_posture.copy()
    near[:, 0] += [0.02, 0.0, 0.01]
    sheet = measures(changed(run, human_posture=near), robot)
    assert sheet["hand_excess_cm_mean"].value == pytest.approx(sheet["hand_error_cm_mean"].value, abs=0.02)


def test_the_reachable_bound_is_zero_for_reachable_and_positive_for_other_targets(robot: RobotModel) -> None:
    rng = np.random.default_rng(3)
    q = np.tile(robot.postures["stand"], (40, 1))
    arms = [*robot.chains["l_arm"], *robot.chains["r_arm"]]
    other = q.copy()
    other[:, arms] = robot.lower[arms] + (0.3 + 0.4 * rng.random((40, len(arms)))) * (robot.upper - robot.lower)[arms]
    poses = replay(robot, other, np.zeros((40, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (40, 1)))
    free = nearest_pairs(robot, poses) > -ALLOWED_OVERLAP
    hands = poses.posture[:, (0, 2)]
    assert free.sum() > 20
    assert reachable_errors(robot, q, hands)[free].max() < 2e-4
    beyond = hands * (robot.limb_length["l_arm"] + 0.05) / np.linalg.norm(hands, axis=2, keepdims=True)
    assert reachable_errors(robot, q, beyond).min() > 0.04


def walk_of_supports(robot: RobotModel, human: str, stands: str) -> Run:
    """One letter is half a second; robot and person take the supports given."""
    n = 50 * len(human)
    return changed(
        standing(robot, n, provenance=speed_setting("auto")),
        human_support=np.repeat(list(human), 50),
        support=np.repeat(list(stands), 50),
    )


@pytest.mark.parametrize(
    ("human", "stands", "recall", "agreement"),
    [
        ("DDLLLLDD", "DDLLLLDD", 1.0, 1.0),
        ("DDLLLLDD", "DDDDLLDD", 1.0, 0.75),
        ("DDLLLLDD", "DDDDDLDD", 0.0, 0.625),
        ("DLLDRRDD", "DLLDLLDD", 0.5, 0.75),
        ("DDLLLLDD", "DDDDDDDD", 0.0, 0.5),
        ("DDFFDDDD", "DDDDDDDD", None, 1.0),
    ],
)
def test_recall_and_agreement(robot: RobotModel, human: str, stands: str, recall: float, agreement: float) -> None:
    sheet = measures(walk_of_supports(robot, human, stands), robot)
    assert sheet["single_support_recall"].value == recall
    assert sheet["support_agreement"].value == pytest.approx(agreement, abs=0.01)


def test_standing_still_is_not_imitation(robot: RobotModel) -> None:
    run = changed(walk_of_supports(robot, "DDLLLLDD", "DDDDDDDD"), source="builtin:paper")
    assert {"single_support_recall", "support_agreement"} <= missed(run, robot)


def test_a_wait_takes_no_human_time(robot: RobotModel) -> None:
    """The robot waits half a second in double support at the moment before the person's foot lifts."""
    run = walk_of_supports(robot, "DDLLDD", "DDLLDD")
    steps = np.full(len(run), 0.01)
    steps[60:100] = 0.0
    waiting = changed(run, human_time=np.cumsum(steps) - steps[0])
    sheet = measures(waiting, robot)
    assert sheet["single_support_recall"].value == 1.0
    assert sheet["time_factor"].value == pytest.approx(299 / 259, rel=1e-6)
    assert is_auto(changed(waiting, provenance="{}"))
    assert not is_speed_one(changed(waiting, provenance="{}"))


def test_the_lift_off_delay_is_the_median_on_the_robots_clock(robot: RobotModel) -> None:
    run = walk_of_supports(robot, "DLLLDRRRDLLL", "DDLLDDRRDLLL")
    assert measures(run, robot)["lift_off_delay_median_s"].value == pytest.approx(0.5)


@pytest.mark.parametrize("long_enough", [True, False])
def test_short_stands_do_not_count_for_recall(robot: RobotModel, long_enough: bool) -> None:
    run = standing(robot, 200)
    human = np.full(200, "D")
    human[50 : 100 if long_enough else 90] = "R"
    sheet = measures(changed(run, human_support=human), robot)
    assert sheet["single_support_recall"].value == (0.0 if long_enough else None)
    assert sheet["single_support_recall_long"].value is None


def test_which_bars_hold_follows_from_clip_and_speed(robot: RobotModel) -> None:
    run = standing(robot, 20)
    for source, expected in {
        "builtin:paper": True,
        "builtin:walk": False,
        "clips/13_29_jacks_twists.bvh": True,
        "13_26_direct_traffic.bvh": False,
        "mass_balance_one_leg.bvh": True,
        "mass_kick.bvh": False,
    }.items():
        assert is_quasi_static(changed(run, source=source)) is expected, source
    auto = changed(run, source="builtin:paper", provenance=speed_setting("auto"))
    assert measures(auto, robot)["support_agreement"].passed is True
    assert measures(auto, robot)["hand_error_cm_mean"].passed is None
    assert is_speed_one(run)


def test_a_simulated_fall_is_seen_in_the_flag_and_in_the_torso(robot: RobotModel) -> None:
    run = standing(robot, 20)
    assert measures(run, robot)["fell"].value is None
    fine = changed(run, sim_fell=False, sim_base_pos=run.base_pos, sim_base_quat=run.base_quat, sim_q=run.q)
    assert measures(fine, robot)["fell"].passed is True
    assert measures(changed(fine, sim_fell=True), robot)["fell"].passed is False
    low, tipped = run.base_pos.copy(), run.base_quat.copy()
    low[9, 2] *= 0.55
    tipped[9] = tilted(run.base_quat[:1], 0.9)[0]
    assert measures(changed(fine, sim_base_pos=low), robot)["fell"].value is True
    assert measures(changed(fine, sim_base_quat=tipped), robot)["fell"].value is True


def test_step_times_are_reported_in_ms(robot: RobotModel) -> None:
    step = np.full(200, 1e-3)
    step[5] = 0.05
    sheet = measures(changed(standing(robot), step_time=step), robot)
    assert sheet["step_time_mean_ms"].value == pytest.approx(1.245)
    assert sheet["step_time_max_ms"].value == pytest.approx(50.0)


def test_untracked_frames_of_a_live_run_are_not_judged_for_similarity(robot: RobotModel) -> None:
    run = standing(robot, 40)
    human_time, human = run.human_time.copy(), run.human_posture.copy()
    human_time[:10], human[:10] = np.nan, np.nan
    sheet = measures(changed(run, human_time=human_time, human_posture=human), robot)
    assert sheet["hand_error_cm_mean"].value == pytest.approx(0.0, abs=1e-9)
    assert sheet["support_agreement"].value == 1.0


def test_a_run_of_one_frame_has_a_sheet(robot: RobotModel) -> None:
    assert not missed(standing(robot, 1), robot)


def test_a_run_of_another_robot_is_refused(robot: RobotModel) -> None:
    run = standing(robot, 5)
    with pytest.raises(RunFileError, match="joints"):
        score_run(changed(run, joint_names=run.joint_names[::-1]), robot)


def test_the_planted_base_of_the_synthetic_runs_is_flat(robot: RobotModel) -> None:
    pos, quat = planted_base(robot, robot.postures["stand"])
    pose = replay(robot, robot.postures["stand"][None], pos[None], quat[None])
    assert abs(pose.soles[0][0, :, 2]).max() < 1e-9
    assert abs(pose.soles[1][0, :, 2]).max() < 1e-9
