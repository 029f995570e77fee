"""The table of codecs. Adding one is one file and one entry."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from naoimitate.core.errors import DriverError
from naoimitate.hw.can.codec import Codec
from naoimitate.hw.can.dbc import DbcCodec
from naoimitate.hw.can.joints import JointMap
from naoimitate.robot.model import RobotModel


def make_codec(name: str, robot: RobotModel, joint_map: JointMap, database: Path | None = None) -> Codec:
    """The codec of that name for a robot's motors; database: a file instead of the one that robot.yaml names."""
    if name not in CODECS:
        raise DriverError(f"unknown CAN codec {name!r}: give one of {', '.join(CODECS)}")
    return CODECS[name](robot, joint_map, database)


def database_path(robot: RobotModel) -> Path:
    """The robot's CAN database: the path that robot.yaml has, seen from robot.yaml."""
    name = robot.data.get("can", {}).get("database")
    if name is None:
        raise DriverError(f"{robot.name} has no CAN database: name a DBC file as `database` in the section can")
    return Path(robot.data.get("folder", "."), name)


def _dbc(robot: RobotModel, joint_map: JointMap, database: Path | None) -> Codec:
    codec = DbcCodec(database or database_path(robot), joint_map.nodes)
    ends = np.sort([joint_map.to_motor(joint_map.lower), joint_map.to_motor(joint_map.upper)], axis=0)
    low, high = codec.position_range
    for motor in np.flatnonzero((ends[0] < low) | (ends[1] > high)):
        raise DriverError(
            f"{joint_map.title(int(motor))} turns from {ends[0][motor]:.2f} to {ends[1][motor]:.2f} rad, more than its "
            "command can carry: change its scale in the CAN database, or gear and limits in robot.yaml"
        )
    return codec


CODECS: dict[str, Callable[[RobotModel, JointMap, Path | None], Codec]] = {"dbc": _dbc}
"""By the name that --can-codec takes."""
