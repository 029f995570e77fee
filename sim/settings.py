"""Settings of the simulated robot, each with its unit and the reason for its value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class SimSettings:
    """How the simulated servos, feet and clock behave. Nobody has published such figures for small humanoids' gear
    motors: the values are parameters, and a plan that needs one of them to be exact is not a safe plan.
    """

    stiffness: float = 300.0
    """Of every position servo, N m/rad. 150 is a soft small servo, 300 a firm one."""

    damping_time: float = 0.02
    """Servo damping / stiffness, s: 6 N m s/rad at 300 N m/rad. One value for all joints, so that all lag behind a
    moving command by the same time and the posture stays coordinated. Limbs are overdamped with it, and the whole
    robot swaying on one foot has about a fifth of critical damping."""

    torque_limit: Literal["effort", "stall"] | float = "effort"
    """``effort``: the robot's planning limit (URDF). ``stall``: the motors' physical ceiling, where its data say it.
    A number: from 0, effort, to 1, stall; below 0 the share of the effort that is missing."""

    armature: float = 0.008
    """Inertia of rotor and gears seen at the joint, kg m^2. A coreless 22 mm motor has a rotor of about 4e-7 kg m^2;
    times the square of the gear ratio (131 to 201 in NAO's legs) 0.007 to 0.016, and 0.002 in head and arms."""

    friction: float = 0.8
    """Coefficient between soles and floor, and between body parts."""

    timestep: float = 0.002
    """Of the integrator, s."""

    period: float = 0.01
    """Time between two uses of the newest command, s; the servos move to it in a straight line meanwhile."""
