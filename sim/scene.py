"""How it looks: floor, sky, light, colours. Left limbs end in blue, right limbs in orange, so that sides can be told
apart in a picture; the cameras are drawn as dark lenses, so that front and back can.
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from naoimitate.core.frames import SIDES
from naoimitate.robot.model import BASE, RobotModel
from naoimitate.sim.contacts import FLOOR, OBJECTS

SHELL, JOINT, LENS = "shell", "joint", "lens"
SIDE_COLOUR = {"l": "left", "r": "right"}
MATERIALS = {
    SHELL: (0.93, 0.93, 0.95, 1.0),
    JOINT: (0.30, 0.32, 0.36, 1.0),
    LENS: (0.05, 0.05, 0.07, 1.0),
    "left": (0.20, 0.45, 0.85, 1.0),
    "right": (0.95, 0.50, 0.15, 1.0),
}

LOOKS_GROUP, FLOOR_GROUP = 1, 2
"""MuJoCo's geom groups of what is drawn but touches nothing, and of the floor."""

FLOOR_TILE = 0.1
"""Side of a floor tile, m: a scale in every picture."""

FIELD_OF_VIEW = 30.0
"""Vertical, deg: a long lens, so that two figures side by side keep their proportions."""

PICTURE_SIZE = (1920, 1080)
"""Largest off-screen picture, pixels."""


def add_scene(spec: mujoco.MjSpec, torso: Any, friction: float) -> None:
    """Add floor, sky and lights; the floor is the geom ``floor`` at z = 0, the lights go with the torso."""
    _add_textures(spec)
    floor = spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05])
    floor.material, floor.group = "floor", FLOOR_GROUP
    floor.contype, floor.conaffinity = FLOOR, OBJECTS
    floor.friction[0] = friction
    for position, direction, strength, shadow in (
        ([0.3, 0.6, 2.0], [-0.15, -0.3, -1.0], 0.55, True),
        ([2.0, -1.0, 1.5], [-1.0, 0.5, -0.8], 0.25, False),
    ):
        light = torso.add_light(pos=position, dir=direction, castshadow=shadow)
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        light.mode = mujoco.mjtCamLight.mjCAMLIGHT_TRACK
        light.diffuse = [strength] * 3
        light.specular = [0.1] * 3
    spec.visual.headlight.ambient = [0.35] * 3
    spec.visual.headlight.diffuse = [0.2] * 3
    spec.visual.headlight.specular = [0.05] * 3
    spec.visual.quality.shadowsize = 2048
    spec.visual.quality.numslices, spec.visual.quality.numstacks = 20, 10
    spec.visual.global_.fovy = FIELD_OF_VIEW
    spec.visual.global_.offwidth, spec.visual.global_.offheight = PICTURE_SIZE
    spec.stat.extent = 2.0  # m around the robot that shadows cover


def _add_textures(spec: mujoco.MjSpec) -> None:
    spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.90, 0.93, 0.96], rgb2=[0.62, 0.70, 0.80], width=64, height=384,
    )  # fmt: skip
    spec.add_texture(
        name="tiles", type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.62, 0.65, 0.68], rgb2=[0.70, 0.73, 0.76], width=256, height=256,
    )  # fmt: skip
    floor = spec.add_material(name="floor", texuniform=True, texrepeat=[0.5 / FLOOR_TILE] * 2)
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "tiles"


def add_looks(spec: mujoco.MjSpec, bodies: dict[int, Any], robot: RobotModel) -> None:
    """Colour the body's shapes, fill the gaps between them at the joints, draw the lenses of its cameras."""
    for name, colour in MATERIALS.items():
        spec.add_material(name=name, rgba=colour, specular=0.3, shininess=0.4)
    for shape in robot.shapes:
        spec.geom(shape.name).material = SHELL
    for side in SIDES:
        ends = {robot.points[f"{side}_{end}"].joint for end in ("hand", "sole")}
        for shape in robot.shapes:
            if shape.joint in ends:
                spec.geom(shape.name).material = SIDE_COLOUR[side]
    size = 0.9 * float(np.median([shape.radius for shape in robot.shapes if shape.kind != "box"]))
    _fill_joints(spec, bodies, robot, size)
    for name in robot.data.get("cameras", {}):
        _draw_lens(spec, name, 0.25 * size)


def _fill_joints(spec: mujoco.MjSpec, bodies: dict[int, Any], robot: RobotModel, size: float) -> None:
    """Draw a ball at each joint, and a bone to the next joint of its chain: nothing hangs in the air."""
    for chain in robot.chains.values():
        for before, joint in zip((BASE, *chain), chain, strict=False):
            _decorate(bodies[joint], mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.75 * size, 0.0, 0.0])
            start, end = np.zeros(3), np.asarray(robot.tree.pos[joint])
            if before == BASE:
                start = end * np.array([1.0, 0.0, 1.0])
            if math.dist(start, end) > 1e-3:
                bone = {"fromto": np.concatenate([start, end]), "size": [0.6 * size, 0.0, 0.0]}
                _decorate(bodies[before], mujoco.mjtGeom.mjGEOM_CAPSULE, **bone)


def _draw_lens(spec: mujoco.MjSpec, camera: str, radius: float) -> None:
    lens = spec.camera(camera)
    geom = _decorate(lens.parent, mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0.0, 0.0])
    geom.pos, geom.material = lens.pos, LENS


def _decorate(body: Any, kind: mujoco.mjtGeom, **size: Any) -> Any:
    """Add a geom that is only drawn."""
    geom = body.add_geom(type=kind, group=LOOKS_GROUP, contype=0, conaffinity=0, mass=0.0, material=JOINT, **size)
    return geom
