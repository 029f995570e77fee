"""Loading a robot: a folder with robot.urdf and robot.yaml, or the name of a built-in one, becomes a RobotModel."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from naoimitate.core.errors import RobotModelError
from naoimitate.robot.checks import check_model
from naoimitate.robot.mirror import Mirror, sided
from naoimitate.robot.model import BASE, Array, CouplingTable, Point, RobotModel, Shape
from naoimitate.robot.urdf import Mechanism, read_mechanism, zero_frames
from naoimitate.robot.versions import apply_changes, changes_of

BUILT_IN = Path(__file__).parent.parent / "robots"
SECTIONS = ("name", "default_version", "versions", "chains", "points", "soles", "postures")
"""What every robot.yaml must have."""
LIMBS = {
    "arm": ("shoulder", "elbow", "hand"),
    "leg": ("hip", "knee", "ankle", "sole"),
}
"""Points along a limb between which its length is measured."""


def robot_names() -> tuple[str, ...]:
    """Names of the built-in robots."""
    return tuple(sorted(path.parent.name for path in BUILT_IN.glob("*/robot.yaml")))


def robot_versions(name_or_path: str | Path) -> tuple[str, ...]:
    """Versions of a robot, in the order of its robot.yaml."""
    return tuple(_read_data(_folder(name_or_path))["versions"])


def load_robot(name_or_path: str | Path, version: str | None = None) -> RobotModel:
    """Load a robot by built-in name or from a folder with robot.urdf and robot.yaml.

    version: one of its versions, None = its default one. Every other YAML file of the folder appears in the model's
    ``data`` under its stem. Raises RobotModelError with what is wrong and what to do.
    """
    folder = _folder(name_or_path)
    data = _read_data(folder)
    urdf = (folder / "robot.urdf").read_text(encoding="utf-8")
    version, changes = changes_of(data, version)
    mirror = Mirror(read_mechanism(urdf), data.get("mirror", {}))
    urdf = apply_changes(urdf, changes, mirror)
    return build_model(version, urdf, _complete(data, mirror))


def build_model(version: str, urdf: str, data: dict[str, Any]) -> RobotModel:
    """RobotModel from the URDF of one version and data that are written out for both sides; checked."""
    mechanism = read_mechanism(urdf)
    points = {name: _point(mechanism, name, value) for name, value in data["points"].items()}
    _require(
        points, ["head", *(f"{s}_{p}" for s in "lr" for limb in LIMBS.values() for p in (*limb, "wrist"))], "points"
    )
    _require(data["chains"], ["head", *(f"{s}_{limb}" for s in "lr" for limb in LIMBS)], "chains")
    model = RobotModel(
        name=data["name"],
        version=version,
        urdf=urdf,
        joint_names=mechanism.joint_names,
        tree=mechanism.tree,
        lower=mechanism.lower,
        upper=mechanism.upper,
        speed=mechanism.speed,
        effort=mechanism.effort,
        coupled=mechanism.coupled,
        tables=tuple(_table(mechanism, table) for table in data["tables"]),
        points=points,
        chains={name: tuple(_joint(mechanism, j) for j in joints) for name, joints in data["chains"].items()},
        soles={side: np.array(outline, dtype=float) for side, outline in data["soles"].items()},
        shapes=mechanism.shapes,
        pairs=_pairs(mechanism, data["collision"]["exclude"]),
        postures={name: _posture(mechanism, values) for name, values in data["postures"].items()},
        limb_length=_limb_lengths(mechanism, points),
        data=data,
    )
    check_model(model)
    return model


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
    _require(data, SECTIONS, "robot.yaml")
    others = {path.stem: _read_yaml(path) for path in sorted(folder.glob("*.yaml")) if path.stem != "robot"}
    return others | data


def _read_yaml(path: Path) -> dict[str, Any]:
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise RobotModelError(f"{path} is not valid YAML ({' '.join(str(error).split())}): correct it") from error
    if not isinstance(data, dict):
        raise RobotModelError(f"{path} must be a mapping of sections: see robots/nao/robot.yaml")
    return data


def _require(section: Mapping[str, Any], keys: Any, where: str) -> None:
    missing = [key for key in keys if key not in section]
    if missing:
        raise RobotModelError(f"{where}: {', '.join(missing)} missing, add to robot.yaml")


def _complete(data: dict[str, Any], mirror: Mirror) -> dict[str, Any]:
    """The data with the right side written out."""
    full = dict(data)
    full["chains"] = sided(data["chains"], mirror.names)
    full["points"] = sided(data["points"], lambda point: _mirrored_point(point, mirror))
    full["soles"] = sided(data["soles"], lambda outline: [[x, -y] for x, y in reversed(outline)])
    full["postures"] = {name: mirror.posture(values or {}) for name, values in data["postures"].items()}
    full["stall_torque"] = mirror.magnitudes(data.get("stall_torque", {}))
    full["tables"] = _both_sides_tables(data.get("tables", []), mirror)
    groups = [list(group) for group in data.get("collision", {}).get("exclude", [])]
    full["collision"] = {"exclude": [*groups, *(twin for g in groups if (twin := mirror.names(g)) not in groups)]}
    return full


def _mirrored_point(point: Mapping[str, Any], mirror: Mirror) -> dict[str, Any]:
    x, y, z = point.get("at", (0.0, 0.0, 0.0))
    return {"link": mirror.name(point["link"]), "at": [x, -y, z]}


def _both_sides_tables(tables: list[dict[str, Any]], mirror: Mirror) -> list[dict[str, Any]]:
    written = {(table["x"], table["y"]) for table in tables}
    out = list(tables)
    for table in tables:
        x, y = mirror.name(table["x"]), mirror.name(table["y"])
        if (x, y) not in written:
            rows = mirror.rows(table["x"], table["y"], np.array(table["rows"], dtype=float))
            out.append({"x": x, "y": y, "rows": rows.tolist()})
    return out


def _joint(mechanism: Mechanism, name: str) -> int:
    if name not in mechanism.joint_names:
        raise RobotModelError(f"robot.yaml names the joint {name!r}, which robot.urdf does not have: correct the name")
    return mechanism.joint_names.index(name)


def _point(mechanism: Mechanism, name: str, value: Mapping[str, Any]) -> Point:
    if value.get("link") not in mechanism.frames:
        raise RobotModelError(f"point {name!r} is on link {value.get('link')!r}, which robot.urdf does not have")
    frame = mechanism.frames[value["link"]]
    return Point(frame.joint, frame.pos + frame.rot @ np.array(value.get("at", (0.0, 0.0, 0.0)), dtype=float))


def _posture(mechanism: Mechanism, values: Mapping[str, float]) -> Array:
    q = np.zeros(len(mechanism.joint_names))
    for name, value in values.items():
        q[_joint(mechanism, name)] = value
    return q


def _table(mechanism: Mechanism, table: Mapping[str, Any]) -> CouplingTable:
    rows = np.array(table["rows"], dtype=float)
    return CouplingTable(_joint(mechanism, table["x"]), _joint(mechanism, table["y"]), rows)


def _pairs(mechanism: Mechanism, exclude: list[list[str]]) -> npt.NDArray[np.int64]:
    """(P, 2) pairs of shapes on different links, but for those of parent and child or of one excluded group."""
    groups = [_group(mechanism, group) for group in exclude]
    parent = mechanism.tree.parent

    def apart(a: Shape, b: Shape) -> bool:
        related = a.joint == b.joint or any(
            j != BASE and parent[j] == i for i, j in ((a.joint, b.joint), (b.joint, a.joint))
        )
        return not related and not any(a.joint in group and b.joint in group for group in groups)

    indexed = combinations(enumerate(mechanism.shapes), 2)
    pairs = [(i, j) for (i, a), (j, b) in indexed if apart(a, b)]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _group(mechanism: Mechanism, links: list[str]) -> set[int]:
    for link in links:
        if link not in mechanism.frames:
            raise RobotModelError(f"collision: exclude names link {link!r}, which robot.urdf does not have")
    return {mechanism.frames[link].joint for link in links}


def _limb_lengths(mechanism: Mechanism, points: Mapping[str, Point]) -> dict[str, float]:
    """Sum of the distances between a limb's points at the zero posture, m."""
    pos, rot = zero_frames(mechanism.tree)
    place = {name: pos[point.joint + 1] + rot[point.joint + 1] @ point.offset for name, point in points.items()}
    return {
        f"{side}_{limb}": sum(
            float(np.linalg.norm(place[f"{side}_{b}"] - place[f"{side}_{a}"]))
            for a, b in pairwise(names)
        )
        for side in "lr"
        for limb, names in LIMBS.items()
    }
