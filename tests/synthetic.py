"""Runs made by hand for the tests of run file, scores and report: a robot that stands, and one thing gone wrong."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import numpy as np

from naoimitate.core.geometry import matrix_from_quat, quat_from_matrix
from naoimitate.robot.model import RobotModel
from naoimitate.run.file import Run
from naoimitate.run.replay import EFFECTORS, replay

RATE = 100.0
"""Frames a second of a synthetic run, Hz."""


def standing(robot: RobotModel, frames: int = 200, **changes: Any) -> Run:
    """A run in which the robot stands still on both planted feet and copies its person exactly."""
    q = np.tile(robot.postures["stand"], (frames, 1))
    base_pos, base_quat = planted_base(robot, robot.postures["stand"])
    run = of_poses(robot, q, np.tile(base_pos, (frames, 1)), np.tile(base_quat, (frames, 1)))
    return dataclasses.replace(run, **changes)


def planted_base(robot: RobotModel, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pose of the torso that puts the left sole flat on the floor at the origin."""
    pose = replay(robot, q[None], np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]]))
    point = robot.points["l_sole"]
    rot, pos = pose.links_rot[0, point.joint + 1], pose.links_pos[0, point.joint + 1]
    sole = pos + rot @ point.offset
    return -rot.T @ sole, quat_from_matrix(rot.T.copy())


def of_poses(robot: RobotModel, q: np.ndarray, base_pos: np.ndarray, base_quat: np.ndarray) -> Run:
    """A run of given poses in double support, whose person has the robot's own posture."""
    n = len(q)
    poses = replay(robot, q, base_pos, base_quat)
    time = np.arange(n) / RATE
    return Run(
        robot=robot.name,
        robot_version=robot.version,
        method="static",
        retarget="planted",
        source="builtin:synthetic",
        provenance=json.dumps({"settings": {"speed": 1.0}}),
        time=time,
        human_time=time + 0.5,
        joint_names=np.array(robot.joint_names),
        q=q,
        base_pos=base_pos,
        base_quat=base_quat,
        support=np.full(n, "D"),
        human_support=np.full(n, "D"),
        contact_names=np.array(["l_sole", "r_sole"]),
        contacts=np.ones((n, 2), dtype=np.bool_),
        contact_points=np.zeros((n, 2, 3)),
        offset=np.full(n, 0.5),
        human_offset=np.full(n, 0.5),
        com=poses.com,
        human_posture=poses.posture,
        ref_human=poses.posture[0],
        ref_robot=poses.posture[0],
        scale=np.ones(len(EFFECTORS)),
        hand_opening=np.full((n, 2), np.nan),
        given_up=np.zeros(n, dtype=np.uint8),
        step_time=np.full(n, 3e-4),
        ik_iterations=np.full(n, 12),
    )


def tilted(base_quat: np.ndarray, angle: float) -> np.ndarray:
    """Quaternions (N, 4) with a rotation about the world's x axis put in front, angle in rad."""
    c, s = np.cos(angle), np.sin(angle)
    roll = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return np.array([quat_from_matrix(roll @ matrix_from_quat(quat)) for quat in base_quat])
