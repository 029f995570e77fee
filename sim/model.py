"""The MuJoCo model of a robot, derived from the URDF text, soles, shapes and sensors of its ``RobotModel``.

Names: bodies and joints as in the URDF, actuators as the joints that they move, ``base`` the free joint, ``floor``,
geoms of body shapes as in ``RobotModel.shapes``, ``l_plate``, ``r_plate`` bodies in the sole frames, ``l_sole_0``...
the contact points of a sole, sensors ``accelerometer``, ``gyro``, ``l_sole_force``, ``l_sole_torque``...; those of the
fingers see ``sim.fingers``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from naoimitate.core.errors import RobotModelError
from naoimitate.core.frames import Array
from naoimitate.robot.model import BASE, RobotModel
from naoimitate.sim.contacts import add_shapes, add_soles
from naoimitate.sim.coupling import STOP_SOLREF, couple_joints
from naoimitate.sim.fingers import add_fingers
from naoimitate.sim.force_sensors import add_force_sensors
from naoimitate.sim.scene import add_looks, add_scene
from naoimitate.sim.sensors import add_cameras, add_imu
from naoimitate.sim.settings import SimSettings

DEFAULT = SimSettings()

Scene = Callable[[mujoco.MjSpec], None]
"""Adds the objects of a scene to the robot on its floor. Free objects meet floor, body and fingers with MuJoCo's own
``contype`` and ``conaffinity``."""


def build_model(robot: RobotModel, settings: SimSettings = DEFAULT, scene: Scene | None = None) -> mujoco.MjModel:
    """Compile the robot on its floor, with the objects of a scene; see ``build_spec``."""
    spec = build_spec(robot, settings)
    if scene is not None:
        scene(spec)
    return spec.compile()


def build_spec(robot: RobotModel, settings: SimSettings = DEFAULT) -> mujoco.MjSpec:
    """Return an editable model (for other scenes): free torso, servos, soles, shapes, fingers, sensors, floor.

    Raises RobotModelError when the URDF and the robot's data do not belong together.
    """
    spec = mujoco.MjSpec.from_string(robot.urdf)
    bodies = _bodies(spec, robot)
    spec.compiler.fusestatic = spec.compiler.discardvisual = False
    _remove_imported_geoms(spec)
    bodies[BASE].add_freejoint(name="base")
    _set_options(spec, settings)
    _add_servos(spec, robot, settings)
    _couple(spec, robot)
    add_shapes(spec, bodies, robot, settings.friction)
    add_soles(bodies, robot, settings.friction)
    add_imu(spec, bodies, robot)
    add_force_sensors(spec)
    add_cameras(spec, robot)
    add_looks(spec, bodies, robot)
    add_scene(spec, bodies[BASE], settings.friction)
    add_fingers(spec, robot)
    return spec


def torque_limits(robot: RobotModel, settings: SimSettings) -> Array:
    """Limits (J,) N m of the servos' torque, after ``settings.torque_limit``."""
    limit = settings.torque_limit
    share = {"effort": 0.0, "stall": 1.0}[limit] if isinstance(limit, str) else limit
    if share <= 0.0:
        return robot.effort * (1.0 + share)
    stall = robot.data.get("stall_torque") or {}
    if missing := [name for name in robot.joint_names if name not in stall]:
        raise RobotModelError(
            f"{robot.name} states no stall_torque for {missing[0]}; simulate it with torque_limit='effort'"
        )
    ceiling = np.array([stall[name] for name in robot.joint_names])
    return np.asarray((1.0 - share) * robot.effort + share * ceiling)


def _bodies(spec: mujoco.MjSpec, robot: RobotModel) -> dict[int, Any]:
    """Bodies by the index of the joint that moves them; ``BASE`` the torso."""
    bodies = {BASE: spec.worldbody.first_body()}
    for index, name in enumerate(robot.joint_names):
        joint = spec.joint(name)
        if joint is None:
            raise RobotModelError(f"The URDF of {robot.name} has no movable joint {name!r}")
        bodies[index] = joint.parent
    return bodies


def _remove_imported_geoms(spec: mujoco.MjSpec) -> None:
    """Shapes come from ``RobotModel`` (capsules, exclusions), couplings from ``RobotModel.coupled``."""
    for element in [*spec.geoms, *spec.equalities]:
        spec.delete(element)


def _set_options(spec: mujoco.MjSpec, settings: SimSettings) -> None:
    spec.option.timestep = settings.timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0  # friction ten times as hard as the normal direction: standing feet do not creep


def _add_servos(spec: mujoco.MjSpec, robot: RobotModel, settings: SimSettings) -> None:
    """One position servo a motor: torque = clip(k (command - q) - d dq, limits)."""
    limits = torque_limits(robot, settings)
    followers = {follower for _, follower in robot.coupled}
    for index, name in enumerate(robot.joint_names):
        joint = spec.joint(name)
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE  # the servo has the limit, the joint none of its own
        joint.solref_limit = STOP_SOLREF
        joint.armature = 0.0 if index in followers else settings.armature
        if index in followers:
            continue
        servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=settings.stiffness, kv=settings.stiffness * settings.damping_time)
        servo.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        servo.forcerange = [-limits[index], limits[index]]


def _couple(spec: mujoco.MjSpec, robot: RobotModel) -> None:
    for leader, follower in robot.coupled:
        couple_joints(spec, robot.joint_names[follower], robot.joint_names[leader])
