"""The zero-moment point of a run: where the floor would have to push if the motion were carried out exactly.

All links count, with the rates of their linear and angular momentum (Vukobratovic and Borovac 2004). With mass m,
centre r, its acceleration a, inertia I in the world's axes, angular velocity w and acceleration u of each link:

    F = sum m (a + g z),    M = sum r x m (a + g z) + I u + w x I w,    x = -M_y / F_z,    y = M_x / F_z    at z = 0

Derivatives are those of a parabola fitted at each frame to its neighbours within ``WINDOW``, with Gaussian weights of
``SMOOTHING``; on an even grid they are those of the Gaussian-smoothed motion. Commands come at some 100 Hz, limits
switch from one to the next, and their plain second differences are noise. So what is much faster than ``BANDWIDTH`` is
not seen; servos do not follow it either.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.sparse import csr_array

from naoimitate.core.physics import GRAVITY
from naoimitate.robot.model import RobotModel
from naoimitate.run.file import Run
from naoimitate.run.measure import Measure
from naoimitate.run.replay import Array, Replay

SMOOTHING = 0.02
"""s, standard deviation of the weights; the time by which position servos of small robots lag behind a command."""
WINDOW = 4.0 * SMOOTHING
"""s before and after a frame that count. Where they are not recorded, at both ends of a run, nothing is measured."""
BANDWIDTH = math.sqrt(math.log(2.0)) / (2.0 * math.pi * SMOOTHING)
"""Hz at which an acceleration keeps 1 / sqrt(2) of its amplitude, 6.6; at any other exp(-(2 pi f s)^2 / 2)."""
CLOCK = 1e-9
"""Rounding of the run's clock, s."""
FEWEST = 5
"""Frames in a window from which a parabola can be told."""
AIRBORNE = 0.1
"""Share of the weight: when the floor carries less, there is no zero-moment point to speak of."""
PERCENTILE = 1.0
MM = 1000.0


def derivatives(time: Array) -> tuple[csr_array, csr_array, npt.NDArray[np.bool_]]:
    """Operators (T, T) that make first and second derivatives of what is sampled at time (T,) s, and where they can."""
    begin, end = (np.searchsorted(time, time + side * (WINDOW + CLOCK)) for side in (-1.0, 1.0))
    index = begin[:, None] + np.arange(int((end - begin).max()))
    inside = index < end[:, None]
    index = np.minimum(index, len(time) - 1)
    u = (time[index] - time[:, None]) / SMOOTHING
    weight = np.where(inside, np.exp(-0.5 * u**2), 0.0)
    powers = np.stack([np.ones_like(u), u, 0.5 * u**2], axis=1)
    middle = np.minimum(time - time[0], time[-1] - time) > WINDOW - CLOCK
    whole = middle & (inside.sum(axis=1) >= FEWEST)
    normal = np.einsum("tk,tak,tbk->tab", weight, powers, powers)
    normal[~whole] = np.eye(3)
    fit = np.linalg.solve(normal, weight[:, None] * powers)
    rows = np.broadcast_to(np.arange(len(time))[:, None], index.shape)
    once, twice = (
        csr_array((fit[:, order].ravel() / SMOOTHING**order, (rows.ravel(), index.ravel())), shape=(len(time),) * 2)
        for order in (1, 2)
    )
    return once, twice, whole


def zero_moment_point(time: Array, mass: Array, inertia: Array, centres: Array, rotations: Array) -> Array:
    """Zero-moment point (T, 2) m of L rigid bodies; NaN at both ends, in gaps, and where they hardly press down.

    time (T,) s. mass (L,) kg. inertia (L, 3, 3) kg m^2 about the centre, body axes. centres (T, L, 3) m, rotations
    (T, L, 3, 3): of the bodies in the world.
    """
    once, twice, whole = derivatives(time)
    force, moment = np.zeros(len(time)), np.zeros((len(time), 2))
    for m, body, r, rot in zip(mass, inertia, centres.swapaxes(0, 1), rotations.swapaxes(0, 1), strict=True):
        push = m * (twice @ r + [0.0, 0.0, GRAVITY])
        about = rot @ body @ rot.swapaxes(1, 2)
        w, u = (_turning(operator, rot) for operator in (once, twice))
        spin = np.einsum("tij,tj->ti", about, u) + np.cross(w, np.einsum("tij,tj->ti", about, w))
        force += push[:, 2]
        moment += (np.cross(r, push) + spin)[:, :2]
    known = whole & (force > AIRBORNE * mass.sum() * GRAVITY)
    result = np.full((len(time), 2), np.nan)
    result[known] = np.column_stack([-moment[known, 1], moment[known, 0]]) / force[known, None]
    return result


def _turning(operator: csr_array, rot: Array) -> Array:
    """Angular velocity, or acceleration, (T, 3) of rotations (T, 3, 3): [w] = R' R^T, and [u] = R'' R^T less its
    symmetric part [w]^2."""
    slope = (operator @ rot.reshape(-1, 9)).reshape(-1, 3, 3) @ rot.swapaxes(1, 2)
    skew = 0.5 * (slope - slope.swapaxes(1, 2))
    return np.column_stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]])


def link_inertias(robot: RobotModel) -> Array:
    """Inertias (J + 1, 3, 3) kg m^2 of the links about their centres of mass, rows and axes as in ``Tree``."""
    model = pin.buildModelFromXML(robot.urdf, pin.JointModelFreeFlyer())
    return np.array([model.inertias[i].inertia for i in (1, *map(model.getJointId, robot.joint_names))])


def zmp_of(robot: RobotModel, time: Array, poses: Replay) -> Array:
    """Zero-moment point (T, 2) m of a robot that goes through these poses at time (T,) s, NaN as above."""
    local = poses.links_pos + np.einsum("tlij,lj->tli", poses.links_rot, robot.tree.com)
    centres = poses.base_pos[:, None] + np.einsum("tij,tlj->tli", poses.base_rot, local)
    rotations = poses.base_rot[:, None] @ poses.links_rot
    return zero_moment_point(time, robot.tree.mass, link_inertias(robot), centres, rotations)


def zmp_margins(robot: RobotModel, run: Run, poses: Replay) -> Array:
    """Distance (T,) m of the zero-moment point to the edge of the stance soles as planned, negative outside; or NaN."""
    return poses.margins(run.support, zmp_of(robot, run.time, poses))


def zmp(run: Run, robot: RobotModel, poses: Replay, moved: Replay | None) -> list[Measure]:
    """The measures of the zero-moment point: of the command, and of what the simulated robot made of it (``moved``)."""
    margin = zmp_margins(robot, run, poses)
    known = MM * margin[np.isfinite(margin)]
    there = len(known) > 0
    return [
        Measure(
            "zmp_margin_min_mm",
            "zero-moment point, least margin",
            float(known.min()) if there else None,
            "mm",
            note=f"accelerations up to {BANDWIDTH:.1f} Hz",
        ),
        Measure(
            "zmp_margin_p01_mm",
            "zero-moment point, margin, 1st percentile",
            float(np.percentile(known, PERCENTILE)) if there else None,
            "mm",
        ),
        Measure("zmp_outside_frames", "frames with the ZMP outside", int((known < 0.0).sum()) if there else None),
        Measure(
            "sim_zmp_margin_min_mm", "ZMP of the simulated motion, least margin", _simulated(run, robot, moved), "mm"
        ),
    ]


def _simulated(run: Run, robot: RobotModel, moved: Replay | None) -> float | None:
    if moved is None:
        return None
    margin = zmp_margins(robot, run, moved)
    return MM * float(np.nanmin(margin)) if np.isfinite(margin).any() else None
