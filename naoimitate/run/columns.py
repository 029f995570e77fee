"""Commands of the imitator as columns of the run file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from naoimitate.core.frames import RobotCommand
from naoimitate.mapping import Mapping
from naoimitate.robot.model import RobotModel


def columns(commands: Sequence[RobotCommand]) -> dict[str, Any]:
    """What T commands say, by key of the run file; the soles are all that is ever planted."""
    support = np.array([c.support for c in commands])
    contacts = np.stack([support != "R", support != "L"], axis=1)
    soles = np.array([c.soles for c in commands])
    return {
        "time": np.array([c.time for c in commands]),
        "q": np.array([c.q for c in commands]),
        "base_pos": np.array([c.base_pos for c in commands]),
        "base_quat": np.array([c.base_quat for c in commands]),
        "support": support,
        "human_support": np.array([c.human_support for c in commands]),
        "contacts": contacts,
        "contact_points": np.where(contacts[:, :, None], soles, np.nan),
        "offset": np.array([c.offset for c in commands]),
        "human_offset": np.array([c.human_offset for c in commands]),
        "com": np.array([c.com for c in commands]),
        "human_posture": np.array([c.posture for c in commands]),
        "hand_opening": np.array([c.hand_opening for c in commands]),
        "given_up": np.array([int(c.given_up) for c in commands], dtype=np.uint8),
        "ik_iterations": np.array([c.ik_iterations for c in commands]),
    }


def constants(robot: RobotModel, mapping: Mapping, retarget: str, source: str, provenance: str) -> dict[str, Any]:
    """What does not change in a run, by key of the run file."""
    return {
        "robot": robot.name,
        "robot_version": robot.version,
        "method": "static",
        "retarget": retarget,
        "source": source,
        "provenance": provenance,
        "joint_names": np.array(robot.joint_names),
        "contact_names": np.array(["l_sole", "r_sole"]),
        "ref_human": mapping.ref_human,
        "ref_robot": mapping.ref_robot,
        "scale": mapping.scale,
    }
