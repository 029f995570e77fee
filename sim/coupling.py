"""Joints that one motor moves together."""

from __future__ import annotations

import mujoco

STOP_SOLREF = (0.005, 1.0)
"""Time constant (s) and damping ratio of joint stops and of the coupling of joints that share a motor: gears, rigid
next to the servos."""


def couple_joints(spec: mujoco.MjSpec, follower: str, leader: str) -> None:
    """One motor, two joints: follower = leader."""
    coupling = spec.add_equality(
        name=f"{follower}_as_{leader}", type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT
    )
    coupling.name1, coupling.name2 = follower, leader
    coupling.data[:5] = [0.0, 1.0, 0.0, 0.0, 0.0]
    coupling.solref = STOP_SOLREF
