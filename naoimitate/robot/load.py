"""Loading a robot: a folder with robot.urdf and robot.yaml, or the name of a built-in one, becomes a RobotModel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from naoimitate.core.errors import RobotModelError
from naoimitate.robot.assemble import build_model, require
from naoimitate.robot.mirror import Mirror, both_sides
from naoimitate.robot.model import RobotModel
from naoimitate.robot.urdf import read_mechanism
from naoimitate.robot.versions import apply_changes, changes_of

BUILT_IN = Path(__file__).parent.parent / "robots"
SECTIONS = ("name", "default_version", "versions", "chains", "points", "soles", "postures")
"""What every robot.yaml must have."""


def robot_names() -> tuple[str, ...]:
    """Names of the built-in robots."""
    return tuple(sorted(path.parent.name for path in BUILT_IN.glob("*/robot.yaml")))


def robot_versions(name_or_path: str | Path) -> tuple[str, ...]:
    """Versions of a robot, in the order of its robot.yaml."""
    return tuple(_read_data(_folder(name_or_path))["versions"])


def load_robot(name_or_path: str | Path, version: str | None = None) -> RobotModel:
    """Load a robot by built-in name or from a folder with robot.urdf and robot.yaml.

    version: one of its versions, None = its default one. Every other YAML file of the folder appears in the model's
    ``data`` under its stem, and the folder's own path under ``folder``, for the files that robot.yaml names.
    Raises RobotModelError with what is wrong and what to do.
    """
    folder = _folder(name_or_path)
    data = _read_data(folder)
    try:
        urdf = _read_urdf(folder / "robot.urdf")
        version, changes = changes_of(data, version)
        mirror = Mirror(read_mechanism(urdf), data.get("mirror", {}))
        model = build_model(version, apply_changes(urdf, changes, mirror), both_sides(data, mirror))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise RobotModelError(
            f"{folder} holds a value of the wrong form ({error!r}): compare it with a built-in robot"
        ) from error
    return replace(model, data={**model.data, "folder": str(folder.resolve())})


def _folder(name_or_path: str | Path) -> Path:
    """Folder of a robot; a built-in name goes before a folder of the working directory that is called the same."""
    folder = BUILT_IN / name_or_path if str(name_or_path) in robot_names() else Path(name_or_path)
    for file in ("robot.urdf", "robot.yaml"):
        if not (folder / file).is_file():
            raise RobotModelError(
                f"unknown robot {str(name_or_path)!r}: give one of {', '.join(robot_names())}, "
                "or a folder with robot.urdf and robot.yaml"
            )
    return folder


def _read_data(folder: Path) -> dict[str, Any]:
    data = _read_yaml(folder / "robot.yaml")
    require(data, SECTIONS, "robot.yaml")
    others = {path.stem: _read_yaml(path) for path in sorted(folder.glob("*.yaml")) if path.stem != "robot"}
    return others | data


def _read_urdf(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise RobotModelError(f"{path} is no text (byte {error.start} is not UTF-8): correct it") from error


def _read_yaml(path: Path) -> dict[str, Any]:
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise RobotModelError(f"{path} is not valid YAML ({' '.join(str(error).split())}): correct it") from error
    if not isinstance(data, dict):
        raise RobotModelError(f"{path} must be a mapping of sections: compare it with a built-in robot")
    return data
